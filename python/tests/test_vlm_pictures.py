"""What the model is shown: patches that mean the same everywhere, and marks that can be seen."""

from __future__ import annotations

import numpy as np
import pytest
from mesh_views_builder import box, write_mesh_views
from semfm.vlm import read_object, read_region
from semfm.vlm.lifting import Lifted, lift, region_mask, seen_in
from semfm.vlm.marking import RED, UNITS, marks_picture, source_picture, target_picture
from semfm.vlm.segments import components, depth_inside, segment


@pytest.fixture(scope="module")
def two_posts(tmp_path_factory):
    """Two posts side by side, nearer to each other than a patch is wide."""
    a, triangles = box((0, 0, 0), (0.3, 0.3, 3), 0.1)
    b, more = box((0.6, 0, 0), (0.9, 0.3, 3), 0.1)
    path = tmp_path_factory.mktemp("posts") / "posts.mcap"
    vertices = np.concatenate([a, b])
    return read_object(
        write_mesh_views(path, vertices, np.concatenate([triangles, more + len(a)]), 6, 96)
    )


def test_patches_cover_the_object_and_stop_where_surfaces_part(two_posts):
    views = two_posts.views
    segments = segment(two_posts, views, 8)
    n_left = len(two_posts.vertices) // 2
    left, right = set(), set()
    for view, image in zip(views, segments):
        np.testing.assert_array_equal(image > 0, view.on_object)
        numbers = image[view.surface.rows, view.surface.cols]
        is_left = view.surface.corners[:, 0] < n_left
        left |= set(numbers[is_left].tolist())
        right |= set(numbers[~is_left].tolist())
    # Where one post hides behind the other, a sliver too small for a number joins its neighbour.
    assert len(left & right) <= 0.2 * len(left | right)
    assert left | right == set(range(1, len(left | right) + 1)), "numbered without gaps"


def test_a_patch_is_the_same_surface_in_every_view(tmp_path):
    """On a cube, away from its edges, where a vertex lies on one side and its pixel on the next."""
    vertices, triangles = box((0, 0, 0), (1, 1, 1), 0.1)
    cube = read_object(write_mesh_views(tmp_path / "c.mcap", vertices, triangles, 6, 96))
    views = cube.views
    segments = segment(cube, views, 12)
    inner = np.sort(np.abs(vertices - 0.5), 1)[:, 1] < 0.45
    seen = [np.where(inner, seen_in(cube, view), -1) for view in views]
    numbers = [
        np.where(s >= 0, image[view.surface.rows, view.surface.cols][s], -1)
        for s, view, image in zip(seen, views, segments)
    ]
    same = total = 0
    for i in range(len(views)):
        for j in range(i):
            both = (numbers[i] > 0) & (numbers[j] > 0)
            same += (numbers[i][both] == numbers[j][both]).sum()
            total += both.sum()
    assert total > 500 and same / total > 0.9
    chosen = [np.isin(image, [1, 2, 3]) for image in segments]
    lifted = lift(cube, views, chosen)
    assert Lifted(lifted.seen[:, inner], lifted.marked[:, inner]).inconsistency < 0.15


def test_parts_and_depths_of_an_image():
    labels = np.array([[1, 1, 0, 1], [1, 1, 2, 2], [1, 1, 2, 2], [0, 1, 2, 2]])
    parts = components(labels)
    assert parts.max() + 1 == 5  # two zeros apart, a large 1, a lone 1, the 2
    assert parts[0, 0] == parts[3, 1] != parts[0, 3]
    depth = depth_inside(np.pad(np.ones((5, 7), int), 1))
    assert depth.max() == 3 and depth[3, 4] == 3 and depth[0, 0] == 0 and depth[1, 1] == 1


def test_the_region_is_red_and_the_rest_as_it_was(mallets):
    views = read_object(mallets["short"].views)
    weights = read_region(mallets["short"].region, views)
    view = max(views.views, key=lambda v: region_mask(v, weights).sum())
    mask = region_mask(view, weights)
    plain = np.asarray(target_picture(view, 432, ruler=False)).astype(int)
    marked = np.asarray(source_picture(view, mask, 432)).astype(int)
    assert marked.shape == plain.shape == (432, 432, 3)
    large = np.kron(mask, np.ones((6, 6), bool))
    redness = marked[..., 0] - marked[..., 1:].max(-1)
    assert (redness[large] > 40).mean() > 0.9 and RED[0] > 200
    near = np.kron(mask, np.ones((6, 6))) > 0
    for _ in range(12):
        near[1:] |= near[:-1]
        near[:-1] |= near[1:]
        near[:, 1:] |= near[:, :-1]
        near[:, :-1] |= near[:, 1:]
    np.testing.assert_array_equal(marked[~near], plain[~near])


def test_the_ruler_stands_where_answers_count(mallets):
    view = read_object(mallets["short"].views).views[0]
    plain = np.asarray(target_picture(view, 720, ruler=False)).astype(int)
    ruled = np.asarray(target_picture(view, 720, ruler=True)).astype(int)
    changed = (ruled != plain).any(-1)
    side = len(plain)
    for units in range(100, UNITS, 100):
        at = round(units / UNITS * side)
        beside = slice(at - 1, at + 1)  # a line has one pixel, the corner at ``at`` has none
        assert changed[:, beside].any(1).mean() > 0.95 and changed[beside].any(0).mean() > 0.95
    assert not changed[side // 20 * 19 :, side // 20 * 19 :].any()


def test_numbers_are_drawn_apart(mallets):
    """Boxes are black, and nothing else in the picture is."""
    views = read_object(mallets["long"].views)
    (image,) = segment(views, views.views[:1], 10)
    picture = np.asarray(marks_picture(views.views[0], image, 720)).astype(int)
    boxes = components((picture.max(-1) == 0).astype(int))
    sizes = [s for s in np.bincount(boxes[picture.max(-1) == 0]) if s > 60]
    assert 1 <= len(sizes) and len(sizes) >= 0.7 * len(np.unique(image[image > 0]))
