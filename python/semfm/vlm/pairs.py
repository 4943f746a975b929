"""Which pairs to ask about, and where their files are."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .._files import read_json
from ..sidecar.errors import expected


@dataclass(frozen=True)
class Pair:
    """One ordered pair.

    Attributes
    ----------
    group, source, target
        Names.
    source_views, target_views
        Their views files.
    region
        File with the source's region.
    truth
        File with the target's, where one is named; only the true masks look at it.
    """

    group: str
    source: str
    target: str
    source_views: Path
    target_views: Path
    region: Path
    truth: Path | None


def read_pairs(path: str | os.PathLike[str], views_folder: str | None = None) -> list[Pair]:
    """Pairs from a file, in its order.

    Two forms are read. That of an evaluation folder, ``{group: [[source, target], …]}``: labels
    are ``<category>/<name>.json`` beside the file, views ``<name>.views.mcap`` in
    ``views_folder`` or beside the label. And a list of objects ``{group, source, target,
    source_views, target_views, region[, truth]}``, paths relative to the file.

    Raises
    ------
    SidecarError
        If the file has another form, or files that it leads to are missing.
    """
    name, value = os.fspath(path), read_json(path)
    here = Path(path).parent
    if isinstance(value, dict):
        pairs = _by_group(name, value, here, Path(views_folder) if views_folder else None)
    elif isinstance(value, list):
        pairs = [_explicit(name, at, entry, here) for at, entry in enumerate(value)]
    else:
        raise expected(name, "content", "groups of pairs or a list of pairs", type(value).__name__)
    if not pairs:
        raise expected(name, "pairs", "at least one", "none")
    seen = set()
    for pair in pairs:
        if (names := (pair.group, pair.source, pair.target)) in seen:
            raise expected(name, " ".join(names), "each pair once", "it twice")
        seen.add(names)
        for file in (pair.source_views, pair.target_views, pair.region, pair.truth):
            if file is not None and not file.is_file():
                raise expected(name, " ".join(names), f"the file {file}", "none")
    return pairs


def _by_group(path: str, groups: dict, here: Path, views_folder: Path | None) -> list[Pair]:
    pairs = []
    for group, listed in groups.items():
        if not isinstance(listed, list):
            raise expected(path, group, "a list of pairs", type(listed).__name__)
        for at, pair in enumerate(listed):
            if not (isinstance(pair, list) and len(pair) == 2 and all(map(_is_name, pair))):
                raise expected(path, f"{group}[{at}]", "two names", repr(pair)[:80])
            labels = [_label(path, here, name) for name in pair]
            views = [
                (views_folder or label.parent) / f"{name}.views.mcap"
                for name, label in zip(pair, labels)
            ]
            pairs.append(Pair(group, *pair, *views, *labels))
    return pairs


def _is_name(value: object) -> bool:
    """A name that leads to no other folder."""
    return (
        isinstance(value, str) and value not in ("", ".", "..") and not set(value) & set("/\\*?[")
    )


def _label(path: str, here: Path, name: str) -> Path:
    found = sorted(here.glob(f"*/{name}.json"))
    if len(found) != 1:
        raise expected(path, name, f"one label {here}/*/{name}.json", len(found))
    return found[0]


def _explicit(path: str, at: int, entry: Any, here: Path) -> Pair:
    keys = ("group", "source", "target", "source_views", "target_views", "region")
    if not isinstance(entry, dict) or not all(isinstance(entry.get(key), str) for key in keys):
        raise expected(path, f"pair {at}", f"texts under {', '.join(keys)}", repr(entry)[:80])
    truth = entry.get("truth")
    return Pair(
        entry["group"],
        entry["source"],
        entry["target"],
        here / entry["source_views"],
        here / entry["target_views"],
        here / entry["region"],
        here / truth if isinstance(truth, str) else None,
    )
