"""Regions as the project's files hold them: ``semfm.region/1``."""

from __future__ import annotations

import os

import numpy as np

from .. import Region
from .object_views import ObjectViews

REGION_FORMAT = "semfm.region/1"
#: A vertex belongs to a region where its weight is this or more.
COUNTS = 0.5


def read_region(path: str | os.PathLike[str], of: ObjectViews) -> np.ndarray:
    """Weights (n) in [0, 1] of a region file, one per vertex of the object.

    ``{"vertices": […], "weights": […]}``, bare or under ``region``; weights default to 1. Where
    the file names its mesh, it must be the object's.

    Raises
    ------
    FormatError
        If the file is broken, of another mesh, or the region is empty.
    FileError
        If it cannot be read.
    """
    return Region.read(path, of.mesh).weights


def region_entries(weights: np.ndarray) -> dict[str, list]:
    """``vertices`` (ascending, those that count) and their ``weights``, ready for JSON."""
    ids = np.flatnonzero(weights >= COUNTS)
    return {"vertices": ids.tolist(), "weights": [round(float(w), 6) for w in weights[ids]]}
