"""Polygons: filled by pixel centres, traced back exactly, crossings found."""

from __future__ import annotations

import numpy as np
import pytest
from semfm.vlm.polygon import crosses_itself, fill, trace


def union(polygons, height, width) -> np.ndarray:
    mask = np.zeros((height, width), bool)
    for polygon in polygons:
        mask |= fill(polygon, height, width)
    return mask


def masks():
    rng = np.random.default_rng(3)
    y, x = np.mgrid[:23, :31]
    ring = abs(np.hypot(x - 15, y - 11) - 7) < 3
    yield from (np.zeros((5, 7), bool), np.ones((5, 7), bool), ring, ~ring, (x + y) % 2 == 0)
    yield np.pad([[True, False, True], [False, True, False], [True, True, True]], 1)
    for share in (0.1, 0.5, 0.9):
        for _ in range(20):
            yield rng.random((13, 17)) < share


def test_a_traced_mask_fills_back_to_itself():
    for mask in masks():
        polygons = trace(mask)
        np.testing.assert_array_equal(union(polygons, *mask.shape), mask)
        assert not any(crosses_itself(polygon) for polygon in polygons)


def test_a_filled_polygon_has_the_pixels_whose_centres_it_holds():
    triangle = np.array([(0.6, 0.2), (9.7, 3.1), (2.2, 8.9)])
    y, x = np.mgrid[:10, :11] + 0.5
    turns = []
    for (ax, ay), (bx, by) in zip(triangle, np.roll(triangle, -1, 0)):
        turns.append((bx - ax) * (y - ay) - (by - ay) * (x - ax))
    np.testing.assert_array_equal(fill(triangle, 10, 11), np.minimum.reduce(turns) > 0)
    np.testing.assert_array_equal(fill(triangle[::-1], 10, 11), fill(triangle, 10, 11))


def test_two_polygons_that_share_an_edge_share_no_pixel():
    left = np.array([(0, 0), (4.5, 0), (2.5, 6), (0, 6)])
    right = np.array([(4.5, 0), (8, 0), (8, 6), (2.5, 6)])
    assert not (fill(left, 6, 8) & fill(right, 6, 8)).any()
    assert (fill(left, 6, 8) | fill(right, 6, 8)).all()


@pytest.mark.parametrize(
    "polygon, crosses",
    [
        ([(0, 0), (4, 4), (4, 0), (0, 4)], True),
        ([(0, 0), (4, 0), (4, 4), (0, 4)], False),
        ([(0, 0), (4, 0), (2, 0), (2, 3)], False),  # goes back along itself: no area, no crossing
        ([(0, 0), (2, 2), (4, 0), (4, 4), (2, 2), (0, 4)], False),  # touches itself in a corner
        ([(0, 0), (6, 0), (6, 6), (3, -1), (0, 6)], True),
    ],
)
def test_crossings(polygon, crosses):
    assert crosses_itself(np.array(polygon, float)) == crosses
