"""``python -m semfm.reconstruct`` is ``semfm-reconstruct``."""

import sys

from .cli import main

sys.exit(main())
