"""Which views a model is shown: few, and spread well apart."""

from __future__ import annotations

import numpy as np

from ..sidecar.errors import expected
from .object_views import ObjectViews


def choose_views(of: ObjectViews, n_views: int, interest: np.ndarray) -> list[int]:
    """Choose views by farthest-point sampling of the directions from which they look.

    Parameters
    ----------
    of
        The object.
    n_views
        How many.
    interest
        (views) float; the first view is the one with the most. Ties go to the lower number, so
        the choice is the same each time, and a larger one begins with the smaller.

    Returns
    -------
    list of int
        Indices into the object's views, in the order of choice.

    Raises
    ------
    SidecarError
        If the file has fewer views.
    """
    if not 1 <= n_views <= len(of.views):
        raise expected(of.path, "views", f"1 to {len(of.views)} to be chosen", n_views)
    middle = (of.vertices.min(0) + of.vertices.max(0)) / 2
    directions = np.array([view.camera.eye - middle for view in of.views])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    chosen = [int(np.argmax(interest))]
    # 1 − cosine rises with the angle; rounded, so that equal angles tie on every machine.
    apart = np.round(1 - directions @ directions.T, 9)
    while len(chosen) < n_views:
        nearest = apart[chosen].min(0)
        nearest[chosen] = -1
        chosen.append(int(np.argmax(nearest)))
    return chosen
