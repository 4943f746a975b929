"""Progress on stderr: a bar for people, lines of JSON for a program that draws its own."""

from __future__ import annotations

import argparse
import json
import sys
from typing import Protocol

from .. import __version__

#: Values of ``--progress``. ``auto`` draws a bar when stderr is a terminal.
MODES = ("auto", "json", "none")


def add_message_options(p: argparse.ArgumentParser, json_help: str | None = None) -> None:
    """Adds ``--json`` where a command has a result to print, then progress, silence and version."""
    messages = p.add_argument_group("messages")
    if json_help is not None:
        messages.add_argument("--json", action="store_true", help=json_help)
    messages.add_argument(
        "--progress", choices=MODES, default="auto", help="on stderr (%(default)s)"
    )
    messages.add_argument("--quiet", action="store_true", help="nothing but errors")
    p.add_argument("--version", action="version", version=f"%(prog)s {__version__}")


class Progress(Protocol):
    """Takes how far the work has come; call :meth:`close` at the end."""

    def __call__(self, done: int, total: int) -> None: ...

    def close(self) -> None: ...


def open_progress(mode: str, unit: str = "images") -> Progress:
    """The progress display of one of :data:`MODES`, counting in ``unit``."""
    if mode == "json":
        return _JsonLines(unit)
    if mode == "none" or not sys.stderr.isatty():
        return _Silent(unit)
    try:
        return _TqdmBar(unit)
    except ImportError:
        return _PlainBar(unit)


class _Silent:
    def __init__(self, unit: str) -> None:
        self.unit = unit

    def __call__(self, done: int, total: int) -> None:
        pass

    def close(self) -> None:
        pass


class _JsonLines(_Silent):
    """One object a line: {"event": "progress", "done": 28, "total": 56, "unit": "images"}."""

    def __call__(self, done: int, total: int) -> None:
        line = {"event": "progress", "done": done, "total": total, "unit": self.unit}
        print(json.dumps(line), file=sys.stderr, flush=True)


class _PlainBar(_Silent):
    def __call__(self, done: int, total: int) -> None:
        filled = 30 * done // max(total, 1)
        bar = "#" * filled + "." * (30 - filled)
        print(f"\r[{bar}] {done}/{total} {self.unit}", end="", file=sys.stderr, flush=True)

    def close(self) -> None:
        print(file=sys.stderr)


class _TqdmBar(_Silent):
    def __init__(self, unit: str) -> None:
        from tqdm import tqdm

        super().__init__(unit)
        self.bar = tqdm(unit=f" {unit}", file=sys.stderr, leave=False)

    def __call__(self, done: int, total: int) -> None:
        self.bar.total = total
        self.bar.update(done - self.bar.n)

    def close(self) -> None:
        self.bar.close()
