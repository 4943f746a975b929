"""``python -m semfm.sidecar`` is ``semfm-embed``."""

import sys

from .cli import main

sys.exit(main())
