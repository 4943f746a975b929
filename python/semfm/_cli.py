"""Calls `semfm-cli` from Python where the library has no call of its own: as a user would."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Union

from .errors import SemfmError

_Word = Union[str, "os.PathLike[str]"]


@dataclass(frozen=True)
class CliAnswer:
    """What a command printed: data (stdout) and the lines of its messages (stderr)."""

    data: str
    messages: list[str]


def run_semfm_cli(words: Sequence[_Word]) -> CliAnswer:
    """Runs ``semfm-cli WORDS`` of this installation in a process of its own.

    Parameters
    ----------
    words : sequence of str or path
        The command and its arguments.

    Returns
    -------
    CliAnswer

    Raises
    ------
    SemfmError
        Where it ends with another code than 0; the message is its last line, without "error:".
    """
    command = [sys.executable, "-m", "semfm", *(os.fspath(word) for word in words)]
    done = subprocess.run(
        command, stdin=subprocess.DEVNULL, capture_output=True, encoding="utf-8", errors="replace"
    )
    lines = [line.strip() for line in done.stderr.splitlines() if line.strip()]
    if done.returncode != 0:
        raise SemfmError(_reason(lines) or f"semfm-cli {words[0]}: exit code {done.returncode}")
    return CliAnswer(done.stdout, lines)


def _reason(lines: Sequence[str]) -> str:
    """What stands after "error:" in messages; all of them where nothing does."""
    for i, line in enumerate(lines):
        if line.startswith("error: "):
            return " ".join([line[len("error: ") :], *lines[i + 1 :]])
    return " ".join(lines)
