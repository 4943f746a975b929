"""Polygons in pixel coordinates: filled into masks, checked, and traced back from masks."""

from __future__ import annotations

import numpy as np

#: More corners than any answer needs; keeps the check for crossings quick.
MAX_CORNERS = 4096


def fill(polygon: np.ndarray, height: int, width: int) -> np.ndarray:
    """The pixels (height × width) bool whose centres lie inside a polygon (n × 2), as (x, y)."""
    mask = np.zeros((height, width), bool)
    x0, y0 = polygon, np.roll(polygon, -1, 0)
    lines = np.arange(height) + 0.5
    crossings: list[list[float]] = [[] for _ in range(height)]
    for (ax, ay), (bx, by) in zip(x0.tolist(), y0.tolist()):
        if ay == by:
            continue
        # Half-open, so that a corner on a line counts once.
        first, last = np.searchsorted(lines, [min(ay, by), max(ay, by)])
        for row in range(first, last):
            crossings[row].append(ax + (lines[row] - ay) / (by - ay) * (bx - ax))
    for row, xs in enumerate(crossings):
        xs.sort()
        for left, right in zip(xs[::2], xs[1::2]):
            start, stop = np.ceil(np.clip([left - 0.5, right - 0.5], 0, width)).astype(int)
            mask[row, start:stop] = True
    return mask


def crosses_itself(polygon: np.ndarray) -> bool:
    """Whether two edges of a polygon (n × 2) cross; edges that merely touch do not."""
    a, b = polygon, np.roll(polygon, -1, 0)
    for i in range(len(polygon) - 2):
        others = slice(i + 2, len(polygon))
        c, d = a[others], b[others]
        splits_other = _side(a[i], b[i], c) * _side(a[i], b[i], d) < 0
        is_split = _side(c, d, a[i]) * _side(c, d, b[i]) < 0
        if (splits_other & is_split).any():
            return True
    return False


def _side(a: np.ndarray, b: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Sign of the turn from a to b to p."""
    turn = (b[..., 0] - a[..., 0]) * (p[..., 1] - a[..., 1])
    return np.sign(turn - (b[..., 1] - a[..., 1]) * (p[..., 0] - a[..., 0]))


def trace(mask: np.ndarray) -> list[np.ndarray]:
    """Polygons along pixel edges whose union, filled, is the mask (height × width) bool.

    None has a hole: a part with holes is cut in two through one of them, and again.
    """
    loops = _loops(mask)
    hole = next((loop for loop in loops if _area(loop) < 0), None)
    if hole is None:
        return loops
    cut = int(hole[:, 0].min() + hole[:, 0].max()) // 2
    left, right = mask.copy(), mask.copy()
    left[:, cut:] = False
    right[:, :cut] = False
    return trace(left) + trace(right)


def _area(loop: np.ndarray) -> float:
    """Twice the signed area, positive for a loop clockwise on the screen."""
    x, y = loop.T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


def _loops(mask: np.ndarray) -> list[np.ndarray]:
    """The borders between pixels inside and outside, the inside on the right hand."""
    padded = np.pad(mask, 1)
    inside = padded[1:-1, 1:-1]
    # Where a pixel's border lies, by which neighbour is outside, and the edge's ends from its
    # upper left corner.
    sides = [
        (padded[:-2, 1:-1], (0, 0), (1, 0)),
        (padded[1:-1, 2:], (1, 0), (1, 1)),
        (padded[2:, 1:-1], (1, 1), (0, 1)),
        (padded[1:-1, :-2], (0, 1), (0, 0)),
    ]
    following: dict[tuple[int, int], list[tuple[int, int]]] = {}
    for neighbour, start, end in sides:
        for row, col in np.argwhere(inside & ~neighbour).tolist():
            at = (col + start[0], row + start[1])
            following.setdefault(at, []).append((col + end[0], row + end[1]))
    loops = []
    while following:
        start_at = next(iter(following))
        loop, at, before = [], start_at, None
        while True:
            step = _turn_right(following, before, at)
            direction = (step[0] - at[0], step[1] - at[1])
            if before != direction:
                loop.append(at)
            at, before = step, direction
            if at == start_at and (at not in following or not _goes_on(following, before, at)):
                break
        loops.append(np.array(loop, float))
    return loops


def _turn_right(
    following: dict[tuple[int, int], list[tuple[int, int]]],
    before: tuple[int, int] | None,
    at: tuple[int, int],
) -> tuple[int, int]:
    """Take the next edge from a corner; where two pixels touch there, stay with the same one."""
    ends = following[at]
    best = 0
    if before is not None and len(ends) > 1:
        right = (at[0] - before[1], at[1] + before[0])
        best = ends.index(right)
    step = ends.pop(best)
    if not ends:
        del following[at]
    return step


def _goes_on(
    following: dict[tuple[int, int], list[tuple[int, int]]],
    before: tuple[int, int],
    at: tuple[int, int],
) -> bool:
    """Whether a loop that is back at its first corner passes through it once more.

    It began there with one of two edges; it is closed when the edge to the right is that one.
    """
    return (at[0] - before[1], at[1] + before[0]) in following[at]
