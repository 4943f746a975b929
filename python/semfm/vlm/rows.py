"""The file of results, ``semfm.vlm/1``: one row per pair and number of views.

::

    {"format": "semfm.vlm/1",
     "settings": {"endpoint": {"base_url": …, "model": …, …},
                  "baseline": {"mode": "polygons", "threshold": 0.5, …, "prompts": "…"}},
     "rows": [{"group": "1 tools", "source": "bm_axe", "target": "bm_hammer", "n_views": 6,
               "mode": "polygons", "model": "gpt-4o-2024-11-20", "real_model": true,
               "mesh": {"n_vertices": 9243, "n_triangles": 18464, "hash": "blake3:…"},
               "views": {"source": ["003", …], "target": ["001", …]},
               "region": {"vertices": [12, 40], "weights": [1.0, 0.666667]},
               "inconsistency": 0.21,
               "failure": null,
               "stages_ms": {"choose": 8.1, "draw": 410.0, "model": 31200.0, "wait": 0.2,
                             "lift": 30.5},
               "tokens": {"prompt": 9211, "completion": 420},
               "attempts": 1, "cached": false}]}

``region`` and ``failure`` exclude each other. ``failure`` is ``{kind, text, reason, of_endpoint}``.
``vertices`` ascend and hold those that count; ``mesh`` is the target. Rows stand in the order of
the pairs. A run that was stopped leaves the rows that were done.
"""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from .._files import read_json
from .._semfm import write_file
from ..sidecar.errors import SidecarError, expected

ROWS_FORMAT = "semfm.vlm/1"

#: What names a row: group, source, target, n_views.
RowName = tuple[str, str, str, int]
_NAME = ("group", "source", "target", "n_views")


class RowsFile:
    """The rows of a run, written whole after every row, and taken up again where it stopped."""

    def __init__(
        self, path: str | os.PathLike[str], settings: dict[str, Any], order: Sequence[RowName]
    ) -> None:
        """Open a file to be written, with the rows it has already.

        Rows for which there was no reply are left out, to be asked for again; so are rows that
        ``order``, all that the run asks for, does not name.

        Raises
        ------
        SidecarError
            If the file is another's, or was made with other settings.
        """
        self.path, self.settings, self._order = Path(path), settings, list(order)
        self._rows = {name: row for name, row in self._read().items() if name in set(order)}

    @property
    def rows(self) -> list[dict[str, Any]]:
        """The rows there are, in order."""
        return [self._rows[name] for name in self._order if name in self._rows]

    @property
    def missing(self) -> list[RowName]:
        """What is still to be asked."""
        return [name for name in self._order if name not in self._rows]

    def add(self, name: RowName, row: dict[str, Any]) -> None:
        """Add a row and write the file."""
        self._rows[name] = {**dict(zip(_NAME, name)), **row}
        self.write()

    def write(self) -> None:
        """Write the file, whole or not at all."""
        head = {"format": ROWS_FORMAT, "settings": self.settings}
        lines = ",\n".join(json.dumps(row, allow_nan=False) for row in self.rows)
        text = json.dumps(head)[:-1] + f', "rows": [\n{lines}\n]}}\n'
        write_file(self.path, text.encode())

    def _read(self) -> dict[RowName, dict[str, Any]]:
        if not self.path.exists():
            return {}
        value = read_json(self.path)
        if not isinstance(value, dict) or value.get("format") != ROWS_FORMAT:
            raise expected(self.path, "format", f"{ROWS_FORMAT}, to go on with", "another file")
        if value.get("settings") != json.loads(json.dumps(self.settings)):
            wanted = "the same as in this run, to go on with (or choose another -o)"
            raise expected(self.path, "settings", wanted, json.dumps(value.get("settings")))
        try:
            rows = {tuple(row[key] for key in _NAME): row for row in value["rows"]}
            done = {k: r for k, r in rows.items() if not (r["failure"] or {}).get("of_endpoint")}
        except (KeyError, TypeError, AttributeError) as error:
            raise expected(self.path, "rows", "rows as this program writes them", error) from error
        return done  # type: ignore[return-value]
