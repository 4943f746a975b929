"""Where the tokens of a vision transformer lie in the picture before its processor touched it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .encoder import Grid
from .errors import expected


def processed_grid(name: str, processor: Any, patch: int, height: int, width: int) -> Grid:
    """The grid behind a processor that resizes, then may crop the centre.

    Parameters
    ----------
    name
        The encoder, for errors.
    processor
        A transformers image processor with ``size`` and, if it crops, ``crop_size``.
    patch
        Side of a patch in pixels of the processed picture. A remainder at the right and bottom
        gets no token (patches are cut by a convolution without padding).
    height, width
        Of the picture given to the processor.

    Returns
    -------
    Grid
        With its rectangle in pixels of the given picture. An odd number of cropped pixels is
        halved exactly, though the processor rounds: rolls by 180° see the other rounding.
    """
    resized = _resized(name, processor, height, width)
    seen = resized
    if getattr(processor, "do_center_crop", None):
        seen = _pair(name, processor.crop_size)
    scale_y, scale_x = height / resized[0], width / resized[1]
    rows, cols = seen[0] // patch, seen[1] // patch
    if not rows or not cols:
        raise expected(name, "image size", f"at least one patch of {patch} pixels", seen)
    top, left = (resized[0] - seen[0]) / 2, (resized[1] - seen[1]) / 2
    bottom, right = top + rows * patch, left + cols * patch
    return Grid(rows, cols, (left * scale_x, top * scale_y, right * scale_x, bottom * scale_y))


def _resized(name: str, processor: Any, height: int, width: int) -> tuple[int, int]:
    if not getattr(processor, "do_resize", True):
        return height, width
    size = _mapping(name, processor.size)
    if size.get("shortest_edge") and not size.get("longest_edge"):
        # The longer edge is cut to a whole number, as transformers does.
        edge, short = int(size["shortest_edge"]), min(height, width)
        return int(edge * height / short), int(edge * width / short)
    return _pair(name, size)


def _pair(name: str, size: Any) -> tuple[int, int]:
    size = _mapping(name, size)
    if not size.get("height") or not size.get("width"):
        raise expected(name, "image processor", "a size by height and width or shortest_edge", size)
    return int(size["height"]), int(size["width"])


def _mapping(name: str, size: Any) -> Mapping[str, Any]:
    """Processors hold sizes as dictionaries or, in newer versions, as records like them."""
    try:
        return {key: value for key, value in dict(size).items() if value is not None}
    except (TypeError, ValueError) as error:
        raise expected(name, "image processor", "a size", size) from error
