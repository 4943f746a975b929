"""Figures say what they show: painted pixels are looked for, not just files."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

import semfm
import semfm.zoo

pytest.importorskip("matplotlib").use("Agg")

import matplotlib.pyplot as plt  # noqa: E402

import semfm.plot  # noqa: E402
from semfm.plot.outcome import nearest  # noqa: E402


@pytest.fixture(scope="module")
def pair():
    return [semfm.demo_object("containers", instance=i, n_vertices=600) for i in (0, 1)]


@pytest.fixture(scope="module")
def result(pair):
    source, target = pair
    return semfm.transfer(
        source.mesh,
        target.mesh,
        source.region,
        source_features=source.shared_features(),
        target_features=target.shared_features(),
    )


@pytest.fixture(autouse=True)
def closed():
    yield
    plt.close("all")


def pixels(axes):
    return np.asarray(axes.images[0].get_array()).reshape(-1, 3).astype(int)


def red(axes):
    r, g, b = pixels(axes).T
    return int(((r > 2 * g) & (r > 2 * b)).sum())


def test_a_region_is_red_and_nothing_else_is(pair):
    mug = pair[0]
    shown = red(semfm.plot.region(mug.mesh, mug.region))
    fewer = semfm.Region.from_vertices(mug.mesh.n_vertices, mug.region.vertices[::4])
    assert shown > 2000 > red(semfm.plot.mesh(mug.mesh)) == 0
    assert 0 < red(semfm.plot.region(mug.mesh, fewer)) < shown


def test_the_camera_finds_a_region_that_can_be_seen_from_one_side_only():
    plate = semfm.zoo.icosphere(4)
    for direction in np.vstack([np.eye(3), -np.eye(3)]):
        cap = semfm.Region.near(plate, direction, radius=0.3)
        camera = semfm.plot.best_camera(plate, cap)
        assert camera.eye @ direction > 0
        assert camera.width == camera.height == semfm.plot.surface.SIDE


def test_values_go_through_the_colour_map_and_missing_ones_stay_grey():
    sphere = semfm.zoo.icosphere(3)
    camera = semfm.camera_towards(sphere, [0, 0, 1], [0, 1, 0], size=200)
    height = np.array(sphere.vertices[:, 0])
    axes = semfm.plot.mesh(sphere, height, cmap="coolwarm", camera=camera, title="x")
    assert axes.get_title() == "x" and len(axes.figure.axes) == 2
    picture = np.asarray(axes.images[0].get_array()).astype(int)
    middle, third = picture.shape[0] // 2, picture.shape[1] // 4
    left, right = picture[middle, third], picture[middle, -third]
    assert left[2] > left[0] and right[0] > right[2]
    height[height > 0] = np.nan
    picture = np.asarray(semfm.plot.mesh(sphere, height, camera=camera).images[0].get_array())
    assert np.ptp(picture[middle, -third].astype(int)) < 3
    plain = semfm.plot.mesh(sphere, height, camera=camera, colorbar=False)
    assert len(plain.figure.axes) == 1


def test_axes_that_are_given_are_drawn_into(pair):
    figure, axes = plt.subplots(1, 2)
    assert semfm.plot.mesh(pair[0].mesh, ax=axes[1]) is axes[1]
    assert not axes[0].images and axes[1].images and plt.get_fignums() == [figure.number]


def test_a_transfer_shows_both_regions_and_the_verdict(result):
    figure = semfm.plot.transfer(result)
    above, below = figure.axes[:2], figure.axes[2:]
    assert all(red(axes) > 500 for axes in above) and all(axes.images for axes in below)
    assert result.verdict in figure.get_suptitle()
    confidence = semfm.plot.confidence(result)
    bars = [bar.get_width() for bar in confidence.axes[2].patches]
    assert bars[0] == result.confidence
    assert bars[1:] == [each.probability for each in result.hypotheses]


def test_the_parts_shown_are_those_that_were_paired(pair):
    source, target = pair
    result = semfm.transfer(
        source.mesh,
        target.mesh,
        source.region,
        source_embeddings=source.embeddings("easy"),
        target_embeddings=target.embeddings("easy"),
    )
    figure = semfm.plot.anchors(result)
    told = [text.get_text() for text in figure.legends[0].get_texts()]
    used = result.report["anchors"]
    assert told == [f"{a['source']} ~ {a['target']}: cosine {a['cosine']:.2f}" for a in used]
    assert len(told) == result.settings.n_anchors


def test_an_identity_carries_every_colour_to_its_place(pair):
    mesh = pair[0].mesh
    figure = semfm.plot.point_map(mesh, mesh, np.arange(mesh.n_vertices))
    source, target = (pixels(axes) for axes in figure.axes)
    assert np.array_equal(source, target)
    figure = semfm.plot.point_map(mesh, mesh, np.zeros(mesh.n_vertices, dtype=int))
    assert not np.array_equal(source, pixels(figure.axes[1]))


def test_matrix_and_spectra(pair):
    shapes = {each.kind: semfm.Shape(each.mesh, k=12) for each in pair}
    axes = semfm.plot.functional_map(semfm.FunctionalMap(np.eye(5, 4)))
    assert np.array_equal(np.asarray(axes.images[0].get_array()), np.eye(5, 4))
    assert axes.get_xlabel().startswith("source") and axes.get_ylabel().startswith("target")
    axes = semfm.plot.spectra(shapes)
    for line, shape in zip(axes.lines, shapes.values()):
        assert np.array_equal(line.get_ydata(), shape.basis.values)


def test_what_does_not_fit_is_refused_by_name(pair):
    mesh = pair[0].mesh
    with pytest.raises(semfm.InvalidInput, match=r"values: expected shape .* found \(3,\)"):
        semfm.plot.mesh(mesh, [1, 2, 3])
    with pytest.raises(semfm.InvalidInput, match="region: expected shape"):
        semfm.plot.region(mesh, semfm.Region.from_vertices(3, [1]))
    with pytest.raises(semfm.InvalidInput, match="colors: expected shape"):
        semfm.plot.mesh(mesh, colors=np.zeros((3, 3)))
    with pytest.raises(semfm.InvalidInput, match="from 0 to 1"):
        semfm.plot.mesh(mesh, colors=np.full((mesh.n_vertices, 3), 2.0))
    with pytest.raises(semfm.InvalidInput, match="found both"):
        semfm.plot.mesh(mesh, mesh.vertices[:, 0], colors=mesh.vertices)
    with pytest.raises(semfm.InvalidInput, match="a finite number"):
        semfm.plot.mesh(mesh, np.full(mesh.n_vertices, np.nan))
    with pytest.raises(semfm.InvalidInput, match="map: expected"):
        semfm.plot.point_map(mesh, pair[1].mesh, semfm.PointMap([0, 1], 2))


def test_the_nearest_point_is_the_nearest():
    rng = np.random.default_rng(0)
    queries, points = rng.normal(size=(5000, 3)), rng.normal(size=(40, 3))
    expected = np.linalg.norm(queries[:, None] - points, axis=2).argmin(axis=1)
    assert np.array_equal(nearest(queries, points), expected)


def test_without_matplotlib_the_error_names_the_extra():
    code = "import sys; sys.modules['matplotlib'] = None\nimport semfm\nimport semfm.plot"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert run.returncode == 1 and "pip install matplotlib" in run.stderr
