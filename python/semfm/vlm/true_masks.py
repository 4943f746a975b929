"""Answers with the truth instead of asking a model: the ceiling of everything but the model.

The region that is known is drawn into the target's views and handed over in the form that a model
would use, so that it goes through every step: JSON, polygons or marks, lifting and vote. What is
lost there, no model can win back.
"""

from __future__ import annotations

import json
import time
from typing import Any

import numpy as np

from .endpoint import SIMULATED, Reply
from .lifting import region_mask
from .marking import UNITS
from .polygon import trace
from .question import Question


class TrueMasks:
    """Knows the region of one target: an :class:`.endpoint.Endpoint`."""

    def __init__(self, weights: np.ndarray) -> None:
        """``weights`` (n): of the target's vertices."""
        self._weights = weights

    @staticmethod
    def described() -> dict[str, Any]:
        """That no model was asked."""
        return {"model": f"{SIMULATED}true-masks"}

    def describe(self) -> dict[str, Any]:
        """That no model was asked."""
        return self.described()

    def ask(self, question: Question) -> Reply:
        """The true masks as polygons, or the patches that lie in them by more than half."""
        start = time.perf_counter()
        text = true_answer(question, self._weights)
        took = 1000 * (time.perf_counter() - start)
        return Reply(text, None, "stop", f"{SIMULATED}true-masks", 0, 0, took, 0.0, 1)


def true_answer(question: Question, weights: np.ndarray) -> str:
    """The right answer to a question about a target whose region has these weights (n)."""
    views = []
    for i, (name, view) in enumerate(zip(question.names, question.views)):
        mask = region_mask(view, weights)
        if question.segments is None:
            scale = UNITS / np.array(mask.shape[::-1])
            # Two decimals are a hundredth of a pixel in pictures of 4000.
            given = [(polygon * scale).round(2).tolist() for polygon in trace(mask)]
        else:
            given = _mostly_inside(question.segments[i], mask)
        views.append({"view": name, question.mode: given})
    return json.dumps({"views": views})


def _mostly_inside(segments: np.ndarray, mask: np.ndarray) -> list[int]:
    total = np.bincount(segments.ravel())
    inside = np.bincount(segments[mask], minlength=len(total))
    return [int(n) for n in np.flatnonzero(2 * inside > total) if n > 0]
