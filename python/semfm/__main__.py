"""``semfm-cli`` out of the wheel, also as ``python -m semfm``: the code of the binary itself."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Sequence
from typing import Optional

from ._semfm import run_cli


def main(arguments: Optional[Sequence[str]] = None) -> int:
    """Runs one command line and returns its exit code.

    Parameters
    ----------
    arguments : sequence of str, optional
        Without the program's name; those of the process where none are given.

    Returns
    -------
    int
        0 success, 1 a sound run without an answer, 2 bad input or failure.
    """
    return run_cli(list(sys.argv[1:] if arguments is None else arguments))


def script() -> None:
    """The console script: Ctrl-C ends it as it ends the binary."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    # Mesa's choice of a device would complain on stderr where there is no display.
    os.environ.setdefault("NODEVICE_SELECT", "1")
    sys.exit(main())


if __name__ == "__main__":
    script()
