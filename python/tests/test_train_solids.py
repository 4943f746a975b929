"""The training code's solids: signed distances of primitives and families."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # `train` is no part of the package

from train import curves, sdf  # noqa: E402
from train.families import FAMILIES  # noqa: E402


@pytest.mark.parametrize(
    "solid, inside, outside",
    [
        (sdf.box((0.5, 0.2, 0.1)), (0, 0, 0), (0.6, 0, 0)),
        (sdf.ellipsoid((0.5, 0.2, 0.1)), (0.4, 0, 0), (0, 0.3, 0)),
        (sdf.tube([[0, 0, 0], [1, 0, 0]], 0.1), (0.5, 0.05, 0), (0.5, 0.15, 0)),
        (sdf.torus(0.5, 0.1), (0.5, 0, 0), (0, 0, 0)),
        (sdf.shell(sdf.box((0.5, 0.5, 0.5)), 0.1), (0.45, 0, 0), (0, 0, 0)),
        (sdf.revolved(curves.vessel_profile([0.3] * 9, 1, 0.05)), (0.28, 0, 0.5), (0, 0, 0.5)),
        (sdf.sheet(0.4, 0.4, 0.05, (0.5, 0, 0)), (0.3, 0, 0.045), (0.3, 0, -0.05)),
    ],
)
def test_solids_know_inside_from_outside(solid, inside, outside):
    d = solid.distance(np.float32([inside, outside]))
    assert d[0] < 0 < d[1]


@pytest.mark.parametrize("family", FAMILIES)
def test_distances_are_never_steep(family):
    """Else a far point would be skipped that is near."""
    rng = np.random.default_rng(11)
    solid = FAMILIES[family](rng)
    p = rng.uniform(solid.low, solid.high, (2000, 3)).astype(np.float32)
    step = rng.normal(0, 0.01, p.shape).astype(np.float32)
    change = np.abs(solid.distance(p + step) - solid.distance(p))
    # flattened tubes and blends may be a little steeper; coarse cells leave room for that
    assert np.quantile(change / np.linalg.norm(step, axis=1), 0.99) < 1.7
