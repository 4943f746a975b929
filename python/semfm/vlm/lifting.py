"""From masks in views to weights on vertices, by visibility and vote.

A view sees a vertex where a pixel around its projection shows the surface at the vertex: one of
the vertex's own triangles, or a point within 1.5 pixels of it. Triangle images alone would not do:
on a fine mesh most triangles are smaller than a pixel and are named by none.

Each view that sees a vertex has one vote: marked or not. The vertex's weight is the share of those
views that mark it; a vertex that no view sees has weight 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .object_views import ObjectView, ObjectViews
from .region import COUNTS

#: A vertex is seen where the surface in a pixel beside its projection is this near, in widths of
#: a pixel at its depth. Neighbouring pixels on a surface tilted by 60° are two widths apart, so a
#: vertex between them has one within a width and a half. Below 1, slanted faces fall out of sight;
#: above 2, the far sides of blades count as seen.
REACH_PIXELS = 1.5
#: Lead of a vertex's own triangles, in reaches; beyond any distance between neighbouring pixels.
_OWN = 1e6


@dataclass(frozen=True)
class Lifted:
    """What the views say of each vertex.

    Attributes
    ----------
    seen, marked
        (views × n) bool; marked only where seen.
    """

    seen: np.ndarray
    marked: np.ndarray

    @property
    def votes(self) -> np.ndarray:
        """Share (n) of the views that see a vertex which mark it; 0 where none sees it."""
        seen = self.seen.sum(0)
        return np.divide(self.marked.sum(0), seen, out=np.zeros(len(seen)), where=seen > 0)

    @property
    def inconsistency(self) -> float | None:
        """How much the views contradict each other, from 0 to 1.

        Over all pairs of views, and the vertices that both of a pair see: one less the ratio of
        the vertices that both mark to those that at least one marks. 0 where every two views agree
        wherever they look at the same surface; 1 where no vertex is marked by two views. None
        where no vertex that two views see is marked at all, as with a single view.
        """
        seen, marked = self.seen.astype(int), self.marked.astype(int)
        s, m = seen.sum(0), marked.sum(0)
        both = m * (m - 1) // 2  # pairs of views, per vertex
        either = both + m * (s - m)
        return float(1 - both.sum() / either.sum()) if either.any() else None


def lift(of: ObjectViews, views: Sequence[ObjectView], masks: Sequence[np.ndarray]) -> Lifted:
    """Lift one mask per view.

    Parameters
    ----------
    of
        The object.
    views
        Some of its views.
    masks
        (height × width) bool each.
    """
    seen, marked = [], []
    for view, mask in zip(views, masks):
        pixels = seen_in(of, view)
        in_view = pixels >= 0
        under = mask[view.surface.rows, view.surface.cols]
        seen.append(in_view)
        marked.append(in_view & under[pixels] if len(under) else in_view)
    return Lifted(np.array(seen), np.array(marked))


def seen_in(of: ObjectViews, view: ObjectView) -> np.ndarray:
    """The pixel in which a view sees each vertex.

    Returns
    -------
    numpy.ndarray
        (n) int, an index into the view's surface; −1 where the view does not see the vertex. Of
        several such pixels one that shows a triangle of the vertex, and of those the one whose
        surface point is nearest.
    """
    surface, n = view.surface, len(of.vertices)
    height, width = view.on_object.shape
    pixel_at = view.image(np.arange(len(surface.rows)), -1)
    projected = view.camera.project(of.vertices)
    ahead = np.flatnonzero(projected[:, 2] > 0)
    at = np.floor(projected[ahead, :2]).clip(-9, 1 << 20).astype(int)
    reach = np.full(n, np.inf)
    reach[ahead] = REACH_PIXELS * projected[ahead, 2] / min(view.camera.fx, view.camera.fy)
    best, nearest = np.full(n, -1), np.full(n, np.inf)
    for dv in (-1, 0, 1):
        for du in (-1, 0, 1):
            u, v = at[:, 0] + du, at[:, 1] + dv
            inside = (u >= 0) & (u < width) & (v >= 0) & (v < height)
            ids, pixels = ahead[inside], pixel_at[v[inside], u[inside]]
            ids, pixels = ids[pixels >= 0], pixels[pixels >= 0]
            distance = np.linalg.norm(surface.points[pixels] - of.vertices[ids], axis=1)
            own = (surface.corners[pixels] == ids[:, None]).any(1)
            # At an edge the next side may be nearer: a triangle of the vertex itself goes first.
            rank = distance / reach[ids] - np.where(own, _OWN, 0.0)
            better = ((distance <= reach[ids]) | own) & (rank < nearest[ids])
            best[ids[better]], nearest[ids[better]] = pixels[better], rank[better]
    return best


def region_mask(view: ObjectView, weights: np.ndarray) -> np.ndarray:
    """Where a view shows a region, (height × width) bool.

    The weights (n) are interpolated over the triangles; a pixel counts from one half.
    """
    surface = view.surface
    shown = (weights[surface.corners] * surface.barycentric).sum(1) >= COUNTS
    return view.image(shown, False)


def counted(votes: np.ndarray, threshold: float) -> np.ndarray:
    """Votes as a region's weights, in which one half or more counts.

    The vote at the threshold becomes one half and the rest is stretched in two straight pieces, so
    order is kept; with a threshold of one half, weights are the votes.
    """
    below = votes * (COUNTS / threshold)
    if threshold == 1:
        return np.where(votes >= 1, 1.0, below)
    above = COUNTS + (votes - threshold) * ((1 - COUNTS) / (1 - threshold))
    return np.where(votes >= threshold, above, below)
