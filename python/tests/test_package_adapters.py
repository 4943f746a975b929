"""Objects in other libraries: vertex by vertex, painted, and back; without them a clear error."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

import semfm
import semfm.zoo
from semfm.adapters import to_open3d, to_polyscope, to_rerun, to_trimesh
from semfm.adapters._parts import color_bytes, parts_of


def required(name):
    """The library, or a skipped test: it may be missing, or lack a library of the system."""
    try:
        return __import__(name)
    except (ImportError, OSError) as error:
        pytest.skip(f"{name} cannot be imported: {error}")


@pytest.fixture(scope="module")
def result():
    source, target = (semfm.demo_object("tools", instance=i, n_vertices=400) for i in (0, 1))
    return semfm.transfer(
        source.mesh,
        target.mesh,
        source.region,
        source_features=source.shared_features(),
        target_features=target.shared_features(),
    )


@pytest.fixture(scope="module")
def sphere():
    return semfm.zoo.icosphere(2)


@pytest.fixture(scope="module")
def cap(sphere):
    return semfm.Region.near(sphere, [0, 0, 1], radius=0.6)


# Red and grey, as bytes, of the two ends of a region's weights.
RED, GREY = [219, 41, 41, 255], [199, 199, 199, 255]


def test_a_transfer_has_two_sides_that_do_not_touch(result):
    source, target = parts_of(result)
    assert (source.name, target.name) == ("source", "target")
    assert source.vertices[:, 0].max() < (target.vertices + target.offset)[:, 0].min()
    assert np.array_equal(target.scalars["region"], result.weights)
    looked_up = source.layers["places"][result.point_map.source_of]
    assert np.array_equal(target.layers["places"], looked_up)
    bytes_ = color_bytes(source.colors)
    assert bytes_[result.source_region.mask].tolist()[0] == RED
    assert bytes_[~result.source_region.mask].tolist()[0] == GREY


def test_what_does_not_fit_is_refused(sphere, cap, result):
    with pytest.raises(semfm.InvalidInput, match="found both"):
        parts_of(sphere, cap, sphere.vertices)
    with pytest.raises(semfm.InvalidInput, match="has its own"):
        parts_of(result, cap)
    with pytest.raises(semfm.InvalidInput, match="SemanticCloud"):
        parts_of(result.source.cloud, cap)
    with pytest.raises(semfm.InvalidInput, match="region: expected shape"):
        parts_of(sphere, [1.0])
    with pytest.raises(semfm.FileError, match="mug.obj"):
        parts_of("mug.obj")


def test_trimesh_and_back(sphere, cap, result):
    trimesh = required("trimesh")
    there = to_trimesh(sphere, region=cap)
    assert semfm.Mesh.from_trimesh(there) == sphere
    assert np.array_equal(there.vertex_attributes["region"], cap.weights)
    assert there.visual.vertex_colors[cap.mask].tolist() == [RED] * int(cap.mask.sum())
    double = semfm.Mesh(np.vstack([sphere.vertices] * 2), sphere.faces)
    assert len(to_trimesh(double).vertices) == 2 * sphere.n_vertices
    cloud = to_trimesh(result.source.cloud)
    assert isinstance(cloud, trimesh.PointCloud) and len(cloud.vertices) == len(
        result.source.cloud
    )
    scene = to_trimesh(result)
    transform, name = scene.graph["target"]
    assert sorted(scene.geometry) == ["source", "target"] and transform[0, 3] != 0
    assert np.array_equal(scene.geometry[name].vertices, result.target.mesh.vertices)


def test_open3d_and_back(sphere, cap, result):
    required("open3d")
    there = to_open3d(sphere, region=cap)
    assert semfm.Mesh.from_open3d(there) == sphere and there.has_vertex_normals()
    colors = np.asarray(there.vertex_colors)
    assert np.allclose(colors[cap.mask], [0.86, 0.16, 0.16])
    source, target = to_open3d(result)
    assert semfm.Mesh.from_open3d(target) == result.target.mesh
    cloud = to_open3d(result.source.cloud)
    assert np.array_equal(np.asarray(cloud.points), result.source.cloud.points)


def test_polyscope_has_structures_and_quantities(tmp_path):
    required("polyscope")
    # In a process and a folder of its own: polyscope keeps one global state and leaves files.
    code = """
import numpy as np, polyscope, semfm, semfm.zoo
from semfm.adapters import to_polyscope
try:
    polyscope.init("openGL_mock")
except Exception as error:
    print("no backend:", error); raise SystemExit(77)
sphere = semfm.zoo.icosphere(2)
cap = semfm.Region.near(sphere, [0, 0, 1], radius=0.6)
mesh = to_polyscope(sphere, "ball", region=cap)
assert polyscope.has_surface_mesh("ball") and mesh.n_vertices() == sphere.n_vertices
objects = [semfm.demo_object("tools", instance=i, n_vertices=300) for i in (0, 1)]
features = dict(zip(("source_features", "target_features"), (o.shared_features() for o in objects)))
result = semfm.transfer(objects[0].mesh, objects[1].mesh, objects[0].region, **features)
source, target = to_polyscope(result, "pair")
assert polyscope.has_surface_mesh("pair source") and polyscope.has_surface_mesh("pair target")
assert target.get_transform()[0, 3] != 0 and np.array_equal(source.get_transform(), np.eye(4))
cloud = to_polyscope(result.source.cloud)
assert polyscope.has_point_cloud("cloud") and cloud.n_points() == len(result.source.cloud)
"""
    command = [sys.executable, "-c", code]
    run = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
    if run.returncode == 77:
        pytest.skip(run.stdout.strip())
    assert run.returncode == 0, run.stderr


def test_rerun_is_told_everything(sphere, cap, result, tmp_path):
    rerun = required("rerun")
    recording = rerun.RecordingStream("semfm_test")
    file = tmp_path / "all.rrd"
    recording.save(str(file))
    assert to_rerun(sphere, region=cap, recording=recording) == ["mesh"]
    assert to_rerun(result, "pair", recording=recording) == ["pair/source", "pair/target"]
    assert to_rerun(result.source.cloud, recording=recording) == ["cloud"]
    views = semfm.render(sphere, semfm.rig(sphere, count=2, size=32))
    assert to_rerun(views, recording=recording) == ["views/0", "views/1"]
    assert to_rerun(views[0].camera, "eye", recording=recording) == ["eye"]
    recording.flush()
    content = file.read_bytes()
    for entity in (b"/mesh", b"/pair/source", b"/pair/target", b"/cloud", b"/views/1/rgb", b"/eye"):
        assert entity in content, entity


@pytest.mark.parametrize(
    ("name", "install", "adapter"),
    [
        ("trimesh", "trimesh", to_trimesh),
        ("open3d", "open3d", to_open3d),
        ("polyscope", "polyscope", to_polyscope),
        ("rerun", "rerun-sdk", to_rerun),
    ],
)
def test_a_missing_library_is_named(name, install, adapter, sphere, monkeypatch):
    monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(ImportError, match=f"needs {name}.*pip install {install}$"):
        adapter(sphere)
