"""How the commands that are written in Python end: with 0, 1 or 2, or 130 after Ctrl-C."""

from __future__ import annotations

import os
import sys
from typing import Callable

from ._semfm import printable
from .errors import SemfmError

#: Exit code of bad input, a failure, or an answer that could not be printed.
FAILED = 2
#: Exit code after Ctrl-C, as shells have it.
INTERRUPTED = 130


def complain(program: str, message: object) -> None:
    """Prints a message on stderr; parts of it may be other people's text."""
    print(f"{program}: {printable(str(message))}", file=sys.stderr)


def finish(program: str, work: Callable[[], int], interrupted: str) -> int:
    """Runs a command and returns its exit code.

    Parameters
    ----------
    program : str
        Its name, in messages.
    work : callable
        The command; returns its exit code.
    interrupted : str
        What is said after Ctrl-C.

    Returns
    -------
    int
        That of `work`; 2 after an error or where stdout could not be written, 130 after Ctrl-C. A
        reader of stdout that has gone away is no failure.
    """
    try:
        try:
            code = work()
        except SystemExit as end:  # argparse has said what is wrong, or printed help
            code = end.code if isinstance(end.code, int) else FAILED if end.code else 0
        sys.stdout.flush()
    except BrokenPipeError:
        _abandon_stdout()
        code = 0
    except SemfmError as error:
        complain(program, error)
        code = FAILED
    except KeyboardInterrupt:
        complain(program, interrupted)
        code = INTERRUPTED
    except (ImportError, MemoryError, OSError) as error:
        complain(program, _words(error))
        code = FAILED
    except Exception as error:
        complain(program, f"a bug in semfm, please report it: {type(error).__name__}: {error}")
        code = FAILED
    return _close(program, code)


def _words(error: BaseException) -> str:
    if isinstance(error, MemoryError):
        return "out of memory"
    if isinstance(error, OSError) and error.filename is None:
        return f"stdout: {error.strerror or error}"
    return str(error)


def _close(program: str, code: int) -> int:
    """What is still to be printed must get through, too."""
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        _abandon_stdout()
    except OSError as error:
        complain(program, _words(error))
        _abandon_stdout()
        return FAILED
    return code


def _abandon_stdout() -> None:
    """Lets the interpreter flush into nothing when it ends: the failure was told already."""
    try:
        nothing = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nothing, sys.stdout.fileno())
        os.close(nothing)
    except (OSError, ValueError):
        pass
