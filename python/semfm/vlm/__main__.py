"""``python -m semfm.vlm`` is ``semfm-vlm``."""

import sys

from .cli import main

sys.exit(main())
