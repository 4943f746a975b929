"""What a model is asked: words, pictures, and the form of its answer."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources
from string import Template
from typing import Any

import numpy as np
from PIL import Image

from .._identity import picture_identity
from . import marking
from .object_views import ObjectView

#: Ways of answering: outlines in coordinates, or the numbers of patches.
MODES = ("polygons", "marks")


@dataclass(frozen=True)
class Question:
    """One question about one pair of objects.

    Attributes
    ----------
    mode
        One of :data:`MODES`.
    system
        The instructions.
    parts
        Text and pictures, in order.
    names
        Of the target pictures, ``T1`` first.
    views
        Of the target, one per picture.
    segments
        With ``marks``, the patches of each picture (height × width); else None.
    """

    mode: str
    system: str
    parts: list[str | Image.Image]
    names: list[str]
    views: list[ObjectView]
    segments: list[np.ndarray] | None

    def content(self) -> dict[str, Any]:
        """All that the model is given, pictures by the hash of their pixels."""
        parts = [part if isinstance(part, str) else picture_identity(part) for part in self.parts]
        return {"system": self.system, "parts": parts, "schema": self.schema()}

    def schema(self) -> dict[str, Any]:
        """The answer's JSON schema, within what strict structured outputs allow."""
        if self.mode == "polygons":
            corner = {"type": "array", "items": {"type": "number"}}
            given = {"type": "array", "items": {"type": "array", "items": corner}}
        else:
            given = {"type": "array", "items": {"type": "integer"}}
        properties = {"view": {"type": "string", "enum": self.names}, self.mode: given}
        view = {
            "type": "object",
            "properties": properties,
            "required": list(properties),
            "additionalProperties": False,
        }
        return {
            "type": "object",
            "properties": {"views": {"type": "array", "items": view}},
            "required": ["views"],
            "additionalProperties": False,
        }


@dataclass(frozen=True)
class Drawing:
    """How pictures are made: their side in pixels, and whether the target's have a ruler."""

    side: int = 768
    ruler: bool = True


def ask_for_region(
    source: Sequence[ObjectView],
    region: Sequence[np.ndarray],
    target: Sequence[ObjectView],
    segments: Sequence[np.ndarray] | None,
    drawing: Drawing,
    hint: str = "",
) -> Question:
    """The question for one pair.

    Parameters
    ----------
    source, target
        The views to be shown.
    region
        (height × width) bool per source view: where it shows the region.
    segments
        Patches per target view to ask for marks; None to ask for polygons.
    drawing
        Of the pictures.
    hint
        What the region is for, in words; may be empty.
    """
    mode = "polygons" if segments is None else "marks"
    parts: list[str | Image.Image] = [_prompt("source", n_views=len(source))]
    if hint:
        parts.append(_prompt("hint", hint=hint))
    for i, (view, mask) in enumerate(zip(source, region), 1):
        parts += [f"S{i}:", marking.source_picture(view, mask, drawing.side)]
    grid = _prompt("grid") if drawing.ruler else ""
    parts.append(_prompt(mode, n_views=len(target), grid=grid))
    names = [f"T{i}" for i in range(1, len(target) + 1)]
    for i, (name, view) in enumerate(zip(names, target)):
        if segments is None:
            picture = marking.target_picture(view, drawing.side, drawing.ruler)
        else:
            picture = marking.marks_picture(view, segments[i], drawing.side)
        parts += [f"{name}:", picture]
    parts.append(f"Answer for {', '.join(names)}.")
    cut = None if segments is None else list(segments)
    return Question(mode, _prompt("system"), parts, names, list(target), cut)


def prompts_hash() -> str:
    """A hash over all prompt files: what was asked is part of how a result was made."""
    names = ("system", "source", "hint", "polygons", "marks", "grid")
    return hashlib.sha256(json.dumps([_file(name) for name in names]).encode()).hexdigest()[:16]


def _prompt(name: str, **values: object) -> str:
    return Template(_file(name)).substitute(values).strip()


@cache
def _file(name: str) -> str:
    return (resources.files(__package__) / "prompts" / f"{name}.md").read_text("utf-8")
