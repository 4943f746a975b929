"""Reads a model's answer, strictly: one JSON object in the form that the prompt gives.

A model may write anything. What is not the form asked for makes the pair a failure that keeps
the reply, and never stops the program. One liberty is taken: a code fence around the whole object,
which many models add whatever they are told, is taken off.
"""

from __future__ import annotations

import json
import math
import re
from typing import Any

import numpy as np

from ..errors import SemfmError
from .endpoint import Reply
from .marking import UNITS
from .polygon import MAX_CORNERS, crosses_itself, fill
from .question import Question

#: Kinds of failure that are the model's: the reply came, and holds no usable region.
KINDS = ("refusal", "truncated", "prose", "json", "schema", "polygon", "marks", "empty")
_FENCE = re.compile(r"```(?:json)?\s*\n(.*)\n\s*```", re.DOTALL)


class UnusableAnswer(SemfmError):
    """A reply without a usable region.

    Attributes
    ----------
    kind
        One of :data:`KINDS`.
    reason
        What was expected and what was found, in words.
    """

    def __init__(self, kind: str, reason: str) -> None:
        super().__init__(f"{kind}: {reason}", f"answer-{kind}")
        self.kind, self.reason = kind, reason

    def __reduce__(self) -> tuple[object, ...]:
        return (type(self), (self.kind, self.reason))


def read_answer(reply: Reply, question: Question) -> list[np.ndarray]:
    """The region that a reply marks in each target view.

    Returns
    -------
    list of numpy.ndarray
        (height × width) bool per view of the question.

    Raises
    ------
    UnusableAnswer
        If the reply is a refusal, cut short, prose, broken JSON or of another form; if a polygon
        leaves its picture or crosses itself, or a number is not in its picture; or if nothing is
        marked anywhere.
    """
    if reply.refusal:
        raise UnusableAnswer("refusal", "the model declined")
    if reply.finish_reason == "content_filter":
        raise UnusableAnswer("refusal", "the endpoint's content filter stopped the reply")
    if reply.finish_reason == "length":
        raise UnusableAnswer("truncated", "the reply ends at the limit of tokens")
    given = _per_view(_json(reply.text), question)
    masks = []
    for i, (name, view) in enumerate(zip(question.names, question.views)):
        height, width = view.on_object.shape
        if question.segments is None:
            masks.append(_polygons(given[name], name, height, width))
        else:
            masks.append(_marks(given[name], name, question.segments[i]))
    if not any((mask & view.on_object).any() for mask, view in zip(masks, question.views)):
        raise UnusableAnswer("empty", "nothing of the object is marked in any view")
    return masks


def _json(text: str) -> Any:
    text = text.strip()
    if fenced := _FENCE.fullmatch(text):
        text = fenced[1].strip()
    if not text.startswith(("{", "[")):
        raise UnusableAnswer("prose", "expected one JSON object, found other text")
    try:
        return json.loads(text, parse_constant=_no_constant)
    except (ValueError, RecursionError) as error:
        raise UnusableAnswer("json", f"expected one JSON object: {error}") from None


def _no_constant(name: str) -> None:
    raise ValueError(f"{name} is no JSON")


def _per_view(value: Any, question: Question) -> dict[str, list]:
    """The lists by view; every target view exactly once."""
    if not isinstance(value, dict) or not isinstance(value.get("views"), list):
        raise UnusableAnswer("schema", 'expected {"views": […]}')
    given: dict[str, list] = {}
    for entry in value["views"]:
        if not isinstance(entry, dict) or not isinstance(entry.get(question.mode), list):
            raise UnusableAnswer("schema", f'expected {{"view": …, "{question.mode}": […]}}')
        name = entry.get("view")
        if not isinstance(name, str) or name not in question.names:
            raise UnusableAnswer("schema", f"expected a view of {question.names}, found {name!r}")
        if name in given:
            raise UnusableAnswer("schema", f"view {name} is answered twice")
        given[name] = entry[question.mode]
    if missing := [name for name in question.names if name not in given]:
        raise UnusableAnswer("schema", f"no answer for {', '.join(missing)}")
    return given


def _polygons(polygons: list, name: str, height: int, width: int) -> np.ndarray:
    mask = np.zeros((height, width), bool)
    for polygon in polygons:
        if not isinstance(polygon, list) or not 3 <= len(polygon) <= MAX_CORNERS:
            raise UnusableAnswer("schema", f"{name}: expected polygons of at least 3 corners")
        for corner in polygon:
            if not isinstance(corner, list) or len(corner) != 2 or not all(map(_finite, corner)):
                raise UnusableAnswer("schema", f"{name}: expected a corner [x, y]: {corner!r:.80}")
            if not all(0 <= number <= UNITS for number in corner):
                reason = f"{name}: corner {corner} is outside the picture (0 to {UNITS})"
                raise UnusableAnswer("polygon", reason)
        corners = np.array(polygon, float)
        if crosses_itself(corners):
            raise UnusableAnswer("polygon", f"{name}: a polygon crosses itself")
        mask |= fill(corners * (width / UNITS, height / UNITS), height, width)
    return mask


def _finite(number: object) -> bool:
    return type(number) in (int, float) and math.isfinite(number)  # type: ignore[arg-type]


def _marks(marks: list, name: str, segments: np.ndarray) -> np.ndarray:
    there = set(np.unique(segments[segments > 0]).tolist())
    for mark in marks:
        if type(mark) is not int:
            raise UnusableAnswer("schema", f"{name}: expected whole numbers, found {mark!r:.80}")
        if mark not in there:
            raise UnusableAnswer("marks", f"{name}: there is no patch {mark} in the picture")
    return np.isin(segments, marks)
