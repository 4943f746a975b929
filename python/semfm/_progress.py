"""The bar behind ``progress=True``."""

from __future__ import annotations

import sys
from typing import Any, Optional


class Bar:
    """One tqdm bar per stage; without tqdm a line on a terminal, and nothing elsewhere."""

    def __init__(self) -> None:
        self._stage = ""
        self._bar: Optional[Any] = None
        try:
            from tqdm.auto import tqdm
        except ImportError:
            self._tqdm = None
        else:
            self._tqdm = tqdm

    def __call__(self, stage: str, done: int, total: int) -> None:
        """Shows ``done`` of ``total`` steps of a stage."""
        if self._tqdm is None:
            if sys.stderr.isatty():
                sys.stderr.write(f"\r{stage:>16} {done}/{total} ")
                sys.stderr.flush()
                self._stage = stage
            return
        if self._bar is None or stage != self._stage:
            self.close()
            self._bar = self._tqdm(total=total or None, desc=stage, leave=False)
            self._stage = stage
        self._bar.total = total or None
        self._bar.n = done
        self._bar.refresh()

    def close(self) -> None:
        """Removes what is shown."""
        if self._bar is not None:
            self._bar.close()
            self._bar = None
        elif self._tqdm is None and self._stage:
            sys.stderr.write("\r" + " " * 40 + "\r")
