"""What ``progress=True`` shows: a bar where one can be drawn, lines in a log elsewhere."""

from __future__ import annotations

import sys
import time
from typing import Any, Optional

# Between two lines of one stage in a log, in seconds.
INTERVAL = 5.0


class Bar:
    """A bar of tqdm for each stage on a terminal or in a notebook, or a plain line without tqdm.

    In a log it is a line when a stage begins, every few seconds, and when it ends.
    """

    def __init__(self) -> None:
        self._bars: dict[str, Any] = {}
        self._last: dict[str, float] = {}
        self._line = ""
        self._is_terminal = sys.stderr is not None and sys.stderr.isatty()
        self._tqdm: Optional[Any] = None
        if self._is_terminal or "ipykernel" in sys.modules:
            try:
                from tqdm.auto import tqdm
            except ImportError:
                pass
            else:
                self._tqdm = tqdm

    def __call__(self, stage: str, done: int, total: int) -> None:
        """Shows ``done`` of ``total`` steps of a stage."""
        if self._tqdm is not None:
            bar = self._bars.get(stage)
            if bar is None:
                bar = self._bars[stage] = self._tqdm(total=total or None, desc=stage, leave=False)
            bar.total = total or None
            bar.n = done
            bar.refresh()
        elif self._is_terminal:
            text = f"{stage:>16} {done}/{total}"
            sys.stderr.write("\r" + text.ljust(len(self._line)))
            sys.stderr.flush()
            self._line = text
        elif sys.stderr is not None:
            self._log(stage, done, total)

    def _log(self, stage: str, done: int, total: int) -> None:
        now = time.monotonic()
        is_due = stage not in self._last or done >= total or now - self._last[stage] >= INTERVAL
        if is_due:
            self._last[stage] = now
            sys.stderr.write(f"semfm: {stage} {done}/{total}\n")
            sys.stderr.flush()

    def close(self) -> None:
        """Removes what is shown on a terminal."""
        for bar in self._bars.values():
            bar.close()
        self._bars = {}
        if self._line:
            sys.stderr.write("\r" + " " * len(self._line) + "\r")
            sys.stderr.flush()
            self._line = ""
