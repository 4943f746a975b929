"""Masks onto vertices: who sees what, the vote, and how far the views agree."""

from __future__ import annotations

import re

import numpy as np
import pytest
from mesh_views_builder import box, iou, mallet, write_mesh_views
from semfm import FormatError, SemfmError
from semfm.sidecar.errors import SidecarError
from semfm.vlm import read_object, read_region
from semfm.vlm.choose_views import choose_views
from semfm.vlm.lifting import Lifted, counted, lift, region_mask, seen_in


@pytest.fixture(scope="module")
def cube(tmp_path_factory):
    """A closed cube of 1 unit around (3, −2, 5); how finely it is cut does not matter."""

    def build(step):
        vertices, triangles = box((2.5, -2.5, 4.5), (3.5, -1.5, 5.5), step)
        folder = tmp_path_factory.mktemp("cube")
        return read_object(write_mesh_views(folder / "c.mcap", vertices, triangles, 5, 40))

    return build


@pytest.mark.parametrize("step", [0.5, 0.25, 0.04])
def test_a_view_sees_the_sides_that_face_it(cube, step):
    """At a step of .04 most triangles are smaller than a pixel."""
    views = cube(step)
    middle = np.array([3, -2, 5])
    for view in views.views:
        seen = seen_in(views, view) >= 0
        outward = np.sign(np.round((views.vertices - middle) * 2, 6).astype(int))
        inner = np.abs((views.vertices - middle) * 2) < 0.6
        for axis in range(3):
            for side in (-1, 1):
                # Vertices of one side, away from its edges, which the next side shares.
                face = (outward[:, axis] == side) & ~inner[:, axis]
                face &= np.delete(inner, axis, 1).all(1)
                normal = np.eye(3)[axis] * side
                to_eye = view.camera.eye - (middle + normal / 2)
                slant = to_eye @ normal / np.linalg.norm(to_eye)
                if slant > 0.4:
                    assert seen[face].all()
                elif slant < 0:
                    assert not seen[face].any()


def test_true_masks_come_back_as_the_region(mallets):
    views = read_object(mallets["long"].views)
    weights = read_region(mallets["long"].region, views)
    masks = [region_mask(view, weights) for view in views.views]
    lifted = lift(views, views.views, masks)
    seen = lifted.seen.any(0)
    assert seen.mean() > 0.95
    assert iou(lifted.votes[seen] >= 0.5, mallets["long"].inside[seen]) > 0.95
    assert lifted.inconsistency < 0.05
    np.testing.assert_array_equal(lifted.marked & ~lifted.seen, False)


def test_rigid_motion_and_scale_change_nothing(tmp_path, mallets):
    """Reach is in pixels, so units do not matter."""
    vertices, triangles, inside = mallet(2.4)
    moved = read_object(write_mesh_views(tmp_path / "m.mcap", 1e-3 * vertices + 7, triangles))
    plain = read_object(mallets["long"].views)
    for a, b in zip(plain.views, moved.views):
        same = (seen_in(plain, a) >= 0) == (seen_in(moved, b) >= 0)
        assert same.mean() > 0.995


def test_votes_are_shares_of_the_views_that_see():
    seen = np.array([[1, 1, 1, 0], [1, 1, 0, 0], [1, 1, 1, 0]], bool)
    marked = np.array([[1, 1, 0, 0], [1, 0, 0, 0], [0, 0, 0, 0]], bool)
    lifted = Lifted(seen, marked)
    np.testing.assert_allclose(lifted.votes, [2 / 3, 1 / 3, 0, 0])
    # Pairs of views that see: vertex 0 three, one of them both; vertex 1 three, of which two have
    # one mark; vertex 2 one, unmarked. Either: 3 + 2; both: 1.
    assert lifted.inconsistency == pytest.approx(1 - 1 / 5)


def test_inconsistency_at_its_ends():
    seen = np.ones((3, 4), bool)
    same = np.tile([True, False, True, False], (3, 1))
    assert Lifted(seen, same).inconsistency == 0
    apart = np.eye(3, 4, dtype=bool)
    assert Lifted(seen, apart).inconsistency == 1
    assert Lifted(seen[:1], same[:1]).inconsistency is None
    assert Lifted(seen, np.zeros((3, 4), bool)).inconsistency is None


@pytest.mark.parametrize("threshold", [0.2, 0.5, 0.7, 1.0])
def test_weights_count_from_the_threshold_and_keep_order(threshold):
    votes = np.linspace(0, 1, 21)
    weights = counted(votes, threshold)
    np.testing.assert_array_equal(weights >= 0.5, votes >= threshold - 1e-12)
    assert (np.diff(weights) > 0).all() and weights[0] == 0 and weights[-1] == 1
    np.testing.assert_allclose(counted(votes, 0.5), votes)


def test_chosen_views_are_spread_and_begin_alike(mallets):
    views = read_object(mallets["long"].views)
    interest = np.array([view.on_object.sum() for view in views.views])
    assert choose_views(views, 1, interest) == [int(np.argmax(interest))]
    eight = choose_views(views, 8, interest)
    assert sorted(eight) == list(range(8))
    for n in (2, 3, 6):
        assert choose_views(views, n, interest) == eight[:n]
    middle = (views.vertices.min(0) + views.vertices.max(0)) / 2
    directions = np.array([view.camera.eye - middle for view in views.views])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    cosine = directions @ directions.T
    assert cosine[eight[0], eight[1]] == cosine[eight[0]].min()
    with pytest.raises(SidecarError, match="1 to 8 to be chosen, found 9"):
        choose_views(views, 9, interest)


def drop_mesh(messages):
    return [(topic, m) for topic, m in messages if topic != "/mesh"]


def shift_mesh(messages):
    for topic, message in messages:
        if topic == "/mesh":
            for point in message.entities[0].triangles[0].points:
                point.x += 0.5
    return messages


def shift_cameras(messages):
    for topic, message in messages:
        if topic == "/tf":
            message.translation.x += 0.5
    return messages


def fewer_points(messages):
    del messages[0][1].entities[0].triangles[0].points[-1]
    return messages


def tilted(messages):
    for topic, message in messages:
        if topic == "/tf":
            message.rotation.w *= 2
    return messages


@pytest.mark.parametrize(
    "change, reason",
    [
        (drop_mesh, "/mesh: expected the object's mesh"),
        (shift_mesh, "used with the mesh"),
        (shift_cameras, "the triangles of /mesh behind their pixels"),
        (fewer_points, "/mesh"),
        (tilted, "a rigid transform"),
    ],
)
def test_files_without_a_sound_mesh_are_refused(tmp_path, change, reason):
    vertices, triangles, _ = mallet(1.0, 0.25)
    path = write_mesh_views(tmp_path / "v.mcap", vertices, triangles, 2, 48, change)
    with pytest.raises(SemfmError, match=re.escape(reason)) as error:
        read_object(path)
    assert str(path) in str(error.value)


@pytest.mark.parametrize(
    "region, reason",
    [
        ('{"vertices": [1, 99999]}', "vertices[1]"),
        ('{"vertices": [true]}', "`vertices`, a list of vertex ids"),
        ('{"vertices": [0], "weights": [1, 1]}', "one per vertex"),
        ('{"vertices": [0], "weights": [1.5]}', "weights[0]"),
        ('{"vertices": [0], "weights": [0.4]}', "an empty region"),
        ('{"vertices": [0], "mesh": {"n_vertices": 3}}', "mesh.n_vertices"),
        ('{"format": "semfm.region/2", "vertices": [0]}', "format"),
        ("[1, 2]", "`vertices`"),
        ("{", "JSON"),
    ],
)
def test_regions_of_other_meshes_are_refused(tmp_path, mallets, region, reason):
    path = tmp_path / "r.json"
    path.write_text(region)
    with pytest.raises(FormatError, match=re.escape(reason)):
        read_region(path, read_object(mallets["short"].views))
