"""The painted meshes of a transfer in other people's readers: as many vertices, in the order of the
file, each in the colour that its weight demands."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest
from browser import semfm_cli

#: Colours without and with full weight, sRGB bytes.
PLAIN, MARKED = np.array([0.78] * 3) * 255, np.array([0.86, 0.16, 0.16]) * 255

FILES = ("source.ply", "target.ply", "target.glb")


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("colours")
    done = subprocess.run([semfm_cli(), "demo", "-q", "-o", out], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return out


def wanted(folder: Path, name: str):
    """Positions and triangles of the mesh that went in, its weights and the colours they demand."""
    side = name.split(".")[0]
    mesh = folder / f"containers_{('source', 'target').index(side)}_s0.obj"
    rows = [line.split() for line in mesh.read_text().splitlines()]
    points = np.array([row[1:4] for row in rows if row and row[0] == "v"], float)
    faces = [[int(word.split("/")[0]) - 1 for word in row[1:]] for row in rows if row[:1] == ["f"]]
    weights = json.loads((folder / "transfer" / "point_map.json").read_text())[f"{side}_weight"]
    weights = np.array(weights)
    colors = PLAIN + weights[:, None] * (MARKED - PLAIN)
    return points, np.array(faces), weights, colors


def only_geometry(loaded):
    """The mesh of a file, which may hold it in a scene, in coordinates as stored."""
    if not hasattr(loaded, "geometry"):
        return loaded
    (mesh,) = loaded.geometry.values()
    return mesh


def upright_from_target(folder: Path) -> np.ndarray:
    """The matrix (4 × 4) of the node that turns the target."""
    trimesh = pytest.importorskip("trimesh")
    scene = trimesh.load(folder / "transfer" / "target.glb", process=False)
    matrix, geometry = scene.graph.get("upright_from_target")
    assert geometry in scene.geometry
    return matrix


@pytest.mark.parametrize("name", FILES)
def test_trimesh_sees_every_vertex_in_its_colour(folder, name):
    trimesh = pytest.importorskip("trimesh")
    points, faces, weights, colors = wanted(folder, name)
    mesh = only_geometry(trimesh.load(folder / "transfer" / name, process=False))
    np.testing.assert_allclose(mesh.vertices, points, atol=1e-6)
    np.testing.assert_array_equal(mesh.faces, faces)
    assert mesh.visual.kind == "vertex"
    # Weights in point_map.json have four digits: a byte may round the other way.
    np.testing.assert_allclose(mesh.visual.vertex_colors[:, :3], colors, atol=0.6)
    assert (mesh.visual.vertex_colors[:, 3] == 255).all()
    if name.endswith("ply"):
        found = mesh.metadata["_ply_raw"]["vertex"]["data"]["weight"]
    else:
        found = mesh.vertex_attributes["_WEIGHT"]
    np.testing.assert_allclose(np.ravel(found), weights, atol=1e-4)


def test_a_node_of_the_glb_stands_the_target_upright(folder):
    trimesh = pytest.importorskip("trimesh")
    points, faces, _, _ = wanted(folder, "target.glb")
    matrix = upright_from_target(folder)
    turn, shift = matrix[:3, :3], matrix[:3, 3]
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-6)
    assert np.linalg.det(turn) > 0 and (shift == 0).all()
    # Seen as a scene, vertices keep their order.
    seen = trimesh.load(folder / "transfer" / "target.glb", process=False).to_geometry()
    np.testing.assert_allclose(seen.vertices, points @ turn.T, atol=1e-6)
    np.testing.assert_array_equal(seen.faces, faces)


def test_the_region_is_where_the_colour_is_nearer_to_red(folder):
    trimesh = pytest.importorskip("trimesh")
    region = json.loads((folder / "transfer" / "region.json").read_text())
    mesh = trimesh.load(folder / "transfer" / "target.ply", process=False)
    colors = mesh.visual.vertex_colors[:, :3].astype(float)
    nearer = np.linalg.norm(colors - MARKED, axis=1) < np.linalg.norm(colors - PLAIN, axis=1)
    inside = np.zeros(len(colors), bool)
    inside[region["vertices"]] = True
    assert (nearer == inside).mean() > 0.999


@pytest.mark.full
@pytest.mark.parametrize("name", FILES)
def test_open3d_shows_the_colours(folder, name):
    # A missing system library (libusb, libGL) is an ImportError, too.
    o3d = pytest.importorskip("open3d", exc_type=ImportError)
    points, faces, _, colors = wanted(folder, name)
    mesh = o3d.io.read_triangle_mesh(str(folder / "transfer" / name))
    assert mesh.has_vertex_colors()
    found, seen = np.asarray(mesh.vertices), 255 * np.asarray(mesh.vertex_colors)
    assert len(found) == len(points) and len(mesh.triangles) == len(faces)
    if name.endswith("glb"):
        # Open3D reads glTF through assimp, which applies the node and puts vertices in the order of
        # the triangles.
        points = points @ upright_from_target(folder)[:3, :3].T
        order = np.array([np.abs(points - p).sum(1).argmin() for p in found])
        assert len(np.unique(order)) == len(points)
        points, colors = points[order], colors[order]
    np.testing.assert_allclose(found, points, atol=1e-6)
    np.testing.assert_allclose(seen, colors, atol=0.6)
