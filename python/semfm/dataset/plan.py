"""The plan of a dataset, ``semfm.dataset-plan/1``: which objects, and which region of each.

::

    {"format": "semfm.dataset-plan/1",
     "objects": [
       {"category": "containers", "name": "blue_mug", "object": "a blue mug",
        "region": "the handle", "longest_m": 0.12, "reference": "pictures/blue_mug.png"},
       {"category": "containers", "name": "kettle", "object": "a kettle", "region": "the handle",
        "longest_m": 0.26, "picture": "photos/kettle.jpg",
        "mask": "photos/kettle_mask.png", "hand_mask": "photos/kettle_hand.png"}]}

``reference`` shows the object alone, on a plain background; ``picture``, in its place, shows a hand
on it already. Masks may be given with either. ``longest_m`` is the longest side of the object's
box in metres: contact is told in millimetres, and a picture has none. Paths are relative to the
plan's folder. ``prompt`` takes the place of the words that are sent for this object; ``attempt``,
from 1, is raised to ask for another picture in the same words.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .._files import read_json
from ..sidecar.errors import expected

PLAN_FORMAT = "semfm.dataset-plan/1"

_TEXTS = ("category", "name", "object", "region")
_FILES = ("reference", "picture", "mask", "hand_mask")
_KEYS = {*_TEXTS, *_FILES, "longest_m", "prompt", "attempt"}


@dataclass(frozen=True)
class PlannedObject:
    """One object of a plan.

    Attributes
    ----------
    category, name
        Of its files; the name is unique in the category.
    object, region
        In words: what it is, and where it is gripped.
    longest_m
        Longest side of its box, metres.
    reference
        Its picture, without a hand; None where ``picture`` is given.
    picture
        With a hand; None where it is to be made.
    mask, hand_mask
        Of the picture with the hand; None where they are to be made.
    prompt
        In place of our words, or None.
    attempt
        Which picture in these words, from 1.
    """

    category: str
    name: str
    object: str
    region: str
    longest_m: float
    reference: Path | None
    picture: Path | None
    mask: Path | None
    hand_mask: Path | None
    prompt: str | None
    attempt: int

    @property
    def title(self) -> str:
        """CATEGORY/NAME."""
        return f"{self.category}/{self.name}"

    @property
    def files(self) -> list[Path]:
        """The files that it names."""
        found = (self.reference, self.picture, self.mask, self.hand_mask)
        return [path for path in found if path is not None]


def read_plan(path: str | os.PathLike[str]) -> list[PlannedObject]:
    """Reads a plan.

    Raises
    ------
    FileError, FormatError
        If it cannot be read or is not JSON.
    SidecarError
        With the object and the field at fault; also for a file that is not there.
    """
    value = read_json(path)
    if not isinstance(value, dict) or value.get("format") != PLAN_FORMAT:
        found = value.get("format") if isinstance(value, dict) else type(value).__name__
        raise expected(path, "format", PLAN_FORMAT, found)
    entries = value.get("objects")
    if not isinstance(entries, list) or not entries:
        raise expected(path, "objects", "a list of at least one object", repr(entries)[:80])
    folder = Path(path).parent
    objects = [_object(path, f"objects[{i}]", entry, folder) for i, entry in enumerate(entries)]
    titles = [item.title for item in objects]
    for title in titles:
        if titles.count(title) > 1:
            raise expected(path, "name", "another name for each object of a category", title)
    return objects


def _object(path: str | os.PathLike[str], place: str, entry: Any, folder: Path) -> PlannedObject:
    if not isinstance(entry, dict):
        raise expected(path, place, "an object", repr(entry)[:80])
    if unknown := sorted(set(entry) - _KEYS):
        raise expected(path, f"{place}.{unknown[0]}", f"one of {', '.join(sorted(_KEYS))}", "it")
    texts = {key: _text(path, place, key, entry.get(key)) for key in _TEXTS}
    for key in ("category", "name"):
        text = texts[key]
        if text != text.strip() or text.startswith(".") or any(c in '/\\:*?"<>|\0' for c in text):
            raise expected(path, f"{place}.{key}", "a name that a file can have", repr(text))
    longest: Any = entry.get("longest_m")
    if type(longest) not in (int, float) or not 0.005 < longest < 5:
        wanted = "the longest side in metres, .005 to 5"
        raise expected(path, f"{place}.longest_m", wanted, repr(longest))
    files: dict[str, Path | None] = dict.fromkeys(_FILES)
    for key in _FILES:
        if key in entry:
            files[key] = file = folder / _text(path, place, key, entry[key])
            if not file.is_file():
                raise expected(path, f"{place}.{key}", "a file", f"none at {file}")
    if (files["reference"] is None) == (files["picture"] is None):
        wanted = "`reference` (without a hand) or `picture` (with one)"
        raise expected(path, place, wanted, "both" if files["reference"] else "neither")
    if (files["mask"] is None) != (files["hand_mask"] is None):
        raise expected(path, place, "`mask` and `hand_mask`, or neither", "one of the two")
    if files["mask"] and not files["picture"]:
        raise expected(path, f"{place}.mask", "`picture`, which it is a mask of", "`reference`")
    prompt = None if "prompt" not in entry else _text(path, place, "prompt", entry["prompt"])
    attempt = entry.get("attempt", 1)
    if type(attempt) is not int or attempt < 1:
        raise expected(path, f"{place}.attempt", "a number from 1", repr(attempt))
    fields: dict[str, Any] = {**texts, **files}
    return PlannedObject(longest_m=float(longest), prompt=prompt, attempt=attempt, **fields)


def _text(path: object, place: str, key: str, value: Any) -> str:
    if not isinstance(value, str) or not value.strip():
        raise expected(path, f"{place}.{key}", "text", repr(value)[:80])
    return value
