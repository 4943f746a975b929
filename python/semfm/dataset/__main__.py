"""``python -m semfm.dataset`` is ``semfm-dataset``."""

import sys

from .cli import main

sys.exit(main())
