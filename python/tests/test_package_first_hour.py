"""What one meets in the first hour: pixels and depth, folders read back, paths, pictures, messages."""

from __future__ import annotations

import json
import pickle
import subprocess
import sys
import types

import numpy as np
import pytest
import semfm
import semfm.zoo
from semfm._progress import Bar

K = np.array([[70.0, 0, 31.5], [0, 71.0, 23.5], [0, 0, 1]])


def turned() -> np.ndarray:
    pose = np.eye(4)
    pose[:3, :3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    pose[:3, 3] = [0.1, -0.2, 0.7]
    return pose


@pytest.fixture(scope="module")
def pair():
    return [semfm.demo_object("containers", instance=i, n_vertices=400) for i in (0, 1)]


@pytest.fixture(scope="module")
def result(pair):
    source, target = pair
    return semfm.transfer(
        source.mesh,
        target.mesh,
        source.region,
        source_features=source.shared_features(),
        target_features=target.shared_features(),
        k=20,
    )


@pytest.fixture(scope="module")
def grasps():
    ball = semfm.zoo.icosphere(3)
    return semfm.find_grasps(
        ball,
        semfm.Region(np.ones(ball.n_vertices)),
        "franka",
        scale=0.03,
        n_samples=100,
        top=4,
        camera_from_object=turned(),
    )


# ---- pixels, rays, depth


@pytest.mark.parametrize("pose", [None, turned()])
def test_pixels_rays_and_points_are_one(pose):
    camera = semfm.Pinhole.from_matrix(K, 64, 48, camera_from_world=pose)
    assert (camera.fx, camera.fy, camera.cx, camera.cy) == (70, 71, 32, 24)
    points = np.random.default_rng(0).uniform([-1, -1, 1], [1, 1, 3], (20, 3))
    if pose is not None:
        points = (points - pose[:3, 3]) @ pose[:3, :3]
    seen = camera.project(points)
    np.testing.assert_allclose(camera.unproject(seen), points, atol=1e-12)
    along = camera.eye + seen[:, 2:] * camera.rays(seen[:, :2])
    np.testing.assert_allclose(along, points, atol=1e-12)


def test_a_depth_image_is_a_cloud_as_opencv_counts_pixels():
    depth = np.zeros((48, 64), np.float32)
    depth[10, 20], depth[11, 30], depth[0, 0] = 2.0, 0.5, np.nan
    camera = semfm.Pinhole.from_matrix(K, 64, 48)
    by_hand = [[(20 - 31.5) / 70 * 2, (10 - 23.5) / 71 * 2, 2], [(30 - 31.5) / 140, (11 - 23.5) / 142, 0.5]]
    np.testing.assert_allclose(camera.cloud(depth), by_hand, rtol=1e-6)
    mask = np.zeros((48, 64), bool)
    mask[11] = True
    np.testing.assert_allclose(camera.cloud(depth, mask=mask), by_hand[1:], rtol=1e-6)
    posed = semfm.Pinhole.from_matrix(K, 64, 48, camera_from_world=turned())
    in_camera = posed.cloud(depth) @ turned()[:3, :3].T + turned()[:3, 3]
    np.testing.assert_allclose(in_camera, by_hand, rtol=1e-6)
    with pytest.raises(semfm.InvalidInput, match=r"depth: expected .*\(48, 64\)"):
        camera.cloud(depth.T)


def test_a_rendered_depth_comes_back_onto_the_surface():
    mesh = semfm.zoo.torus(40, 20)
    (camera,) = semfm.rig(mesh, count=1, size=64)
    (view,) = semfm.render(mesh, [camera])
    points = camera.cloud(view.depth)
    assert len(points) == (view.triangles >= 0).sum()
    assert semfm.SurfaceIndex(mesh).closest(points)[1].max() < 1e-5


def test_a_refused_matrix_is_printed_by_rows():
    pose = np.eye(4)
    pose[0, 2] = 7
    with pytest.raises(semfm.InvalidInput, match=r"\[\[1\.0, 0\.0, 7\.0\], \[0\.0, 1\.0, 0\.0\]"):
        semfm.Pinhole.from_matrix(K, 64, 48, camera_from_world=pose)
    ball = semfm.zoo.icosphere(1)
    with pytest.raises(semfm.InvalidInput, match=r"\[1\.0, 0\.0, 7\.0\], \[0\.0, 1\.0, 0\.0\]"):
        everywhere = semfm.Region(np.ones(ball.n_vertices))
        semfm.find_grasps(ball, everywhere, "franka", scale=0.03, camera_from_object=pose)
    with pytest.raises(semfm.InvalidInput, match=r"no skew.*\[70\.0, 2\.0, 31\.5\]"):
        semfm.Pinhole.from_matrix(K + np.array([[0, 2, 0], [0, 0, 0], [0, 0, 0]]), 64, 48)


# ---- what was written is read


def test_a_transfers_folder_and_point_map_are_read_back(result, tmp_path):
    result.write(tmp_path)
    again = semfm.read_transfer(tmp_path)
    assert np.array_equal(again.region.mask, result.region.mask)
    counted = result.region.vertices  # the file holds no others
    assert np.array_equal(again.region.weights[counted], result.region.weights[counted])
    assert again.point_map == result.point_map
    assert (again.source, again.target) == (result.source.mesh, result.target.mesh)
    assert again.verdict == result.verdict and again.confidence == result.confidence
    assert np.array_equal(again.source_region.mask, result.source_region.mask)
    assert len(again.hypotheses) == len(result.hypotheses)
    assert again.hypotheses[0].probability == result.hypotheses[0].probability
    assert again.report == json.loads((tmp_path / "report.json").read_text())
    assert semfm.PointMap.read(tmp_path / "point_map.json") == result.point_map
    assert pickle.loads(pickle.dumps(again)).region == again.region
    semfm.zoo.icosphere(1).write(tmp_path / "target.ply")
    with pytest.raises(semfm.FormatError, match="target.ply"):
        semfm.read_transfer(tmp_path)


def test_an_alignment_is_written_as_the_shell_writes_it(tmp_path):
    torus = semfm.zoo.torus(30, 15)
    points = semfm.sample_uniform(torus, 400)[0] * 0.1 + np.array([0, 0, 1.0])
    found = semfm.align(torus, points, viewpoint=None, n_starts=20)
    found.write(tmp_path / "aligned.json")
    file = json.loads((tmp_path / "aligned.json").read_text())
    assert file == found.to_dict() and file["format"] == "semfm.aligned/1"
    np.testing.assert_array_equal(file["camera_from_object"], found.camera_from_object)
    again = pickle.loads(pickle.dumps(found))
    assert np.array_equal(again.camera_from_object, found.camera_from_object)


# ---- grasps


def test_a_grasp_says_where_it_is(grasps):
    for grasp in grasps:
        np.testing.assert_array_equal(grasp.position, grasp.object_from_tcp[:3, 3])
        np.testing.assert_allclose(grasp.approach, grasp.object_from_tcp[:3, 2], atol=1e-12)
        np.testing.assert_allclose(grasp.camera_from_tcp, turned() @ grasp.object_from_tcp, atol=1e-12)
        again = pickle.loads(pickle.dumps(grasp))
        np.testing.assert_allclose(again.camera_from_tcp, grasp.camera_from_tcp, atol=1e-12)
        assert again.terms == grasp.terms
    assert pickle.loads(pickle.dumps(grasps)).region == grasps.region


def test_a_gripper_is_a_mesh_that_closes_on_the_object(grasps):
    grasp = grasps[0]
    hand = grasps.gripper.mesh_at(grasp.width)
    pose = grasp.object_from_tcp
    vertices = hand.vertices @ pose[:3, :3].T + pose[:3, 3]
    ball = semfm.Mesh(grasps.mesh.vertices * grasps.scale, grasps.mesh.faces)
    assert -1e-3 < np.linalg.norm(vertices, axis=1).min() - 0.03 < 0.02
    for contact in grasp.contacts:
        assert semfm.SurfaceIndex(ball).closest(contact[None])[1][0] < 1e-6


def test_grasps_go_to_trimesh(grasps):
    pytest.importorskip("trimesh")
    from semfm.adapters import to_trimesh

    scene = to_trimesh(grasps)
    names = set(scene.graph.nodes_geometry)
    assert names == {"object", *(f"grasp {rank}" for rank in range(len(grasps)))}
    np.testing.assert_allclose(scene.geometry["object"].bounds, [[-0.03] * 3, [0.03] * 3], atol=1e-9)


# ---- paths wherever a mesh or a region is


def test_paths_are_meshes_and_regions_everywhere(tmp_path):
    ball = semfm.zoo.icosphere(2)
    mesh, region = tmp_path / "ball.ply", tmp_path / "region.json"
    ball.write(mesh)
    everywhere = semfm.Region(np.ones(ball.n_vertices))
    everywhere.write(region, mesh)
    found = semfm.find_grasps(mesh, region, "franka", scale=0.03, n_samples=50)
    assert found.region == everywhere and found.mesh == ball
    assert ball.picture(region=region)[:4] == b"\x89PNG"
    assert semfm.Region.near(mesh, [0, 0, 2], 0.3) == semfm.Region.near(semfm.read_mesh(mesh), [0, 0, 2], 0.3)
    pytest.importorskip("trimesh")
    from semfm.adapters import to_trimesh

    assert len(to_trimesh(str(mesh), region=region).vertices) == ball.n_vertices


# ---- scenes and other people's objects


def test_a_scene_of_trimesh_is_one_mesh_where_its_nodes_stand(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    scene = trimesh.Scene()
    box = trimesh.creation.box((1, 1, 1))
    move = np.eye(4)
    move[:3, 3] = [5, 0, 0]
    mirror = np.diag([-1.0, 1, 1, 1])
    scene.add_geometry(box, geom_name="box", node_name="first")
    scene.add_geometry(box, geom_name="box", node_name="second", transform=move @ mirror)
    scene.add_geometry(trimesh.PointCloud(np.zeros((3, 3))), node_name="points")
    mesh = semfm.Mesh.from_trimesh(scene)
    assert (mesh.n_vertices, mesh.n_faces) == (16, 24)
    np.testing.assert_allclose(mesh.bounds, [[-0.5] * 3, [5.5, 0.5, 0.5]])
    assert mesh.report()["watertight"]
    corners = mesh.vertices[mesh.faces]
    volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6
    assert volume == pytest.approx(2.0)  # neither box is inside out
    scene.export(tmp_path / "scene.glb")
    loaded = trimesh.load(tmp_path / "scene.glb")
    assert semfm.SurfaceIndex(loaded).mesh.area == pytest.approx(12.0)
    with pytest.raises(semfm.InvalidInput, match="scene with a mesh"):
        semfm.Mesh.from_trimesh(trimesh.Scene())


@pytest.mark.parametrize("make", [semfm.Mesh.from_trimesh, semfm.Mesh.from_open3d])
@pytest.mark.parametrize("thing", [5, "text", None, [1, 2], types.SimpleNamespace(vertices=[[0, 0, 0]])])
def test_what_is_no_mesh_is_named(make, thing):
    with pytest.raises(semfm.InvalidType, match="mesh: expected .* found"):
        make(thing)


# ---- index spaces


def test_a_function_on_the_other_vertices_is_told_what_to_do():
    ball = semfm.zoo.icosphere(3)
    lonely = semfm.Mesh(np.vstack([ball.vertices, [[9.0, 9, 9]]]), ball.faces)
    shape = semfm.Shape(lonely, k=10)
    n, n_working = lonely.n_vertices, shape.working.n_vertices
    assert n_working == n - 1
    for use in (
        lambda f: shape.smooth(f, 0.01),
        shape.onto_original,
        shape.basis.project,
        lambda f: shape.basis.diffuse(f, 0.1),
        lambda f: shape.basis.truncated(5).project(f),
    ):
        with pytest.raises(semfm.InvalidInput, match=rf"\({n_working},\).*working.*\({n},\).*onto_working"):
            use(np.ones(n))
        use(shape.onto_working(np.ones(n)))
    with pytest.raises(semfm.InvalidInput, match=rf"\({n},\).*as given.*\({n_working},\).*onto_original"):
        shape.onto_working(np.ones(n_working))


# ---- notebooks


def test_notebooks_show_pictures(result, grasps, pair):
    for thing in (pair[0].mesh, result, grasps):
        assert thing._repr_png_()[:4] == b"\x89PNG"
    assert result.picture() == result._repr_png_()
    text = pair[0].region._repr_html_()
    assert f"{len(pair[0].region.vertices)} of {pair[0].mesh.n_vertices} vertices" in text


# ---- wks without features


def test_wks_needs_no_features(pair, tmp_path):
    source, target = pair
    bare = semfm.transfer(source.mesh, target.mesh, source.region, method="wks", k=20)
    features = dict(source_features=source.shared_features(), target_features=target.shared_features())
    full = semfm.transfer(source.mesh, target.mesh, source.region, method="wks", k=20, **features)
    assert bare.region == full.region and bare.point_map == full.point_map
    assert bare.verdict in ("check", "refuse")
    prepared = semfm.prepare(source.mesh, method="wks", k=20)
    again = pickle.loads(pickle.dumps(prepared))
    assert semfm.Matching(again, again, method="wks").transfer(source.region).region.n_vertices
    with pytest.raises(semfm.InvalidInput, match="wks"):
        semfm.Matching(prepared, prepared)
    bare.write(tmp_path)
    assert np.array_equal(semfm.read_transfer(tmp_path).region.mask, bare.region.mask)


def test_wks_needs_no_features_at_the_shell(pair, tmp_path):
    files = [each.write(tmp_path, "easy") for each in pair]
    pair[0].region.write(tmp_path / "grip.json", pair[0].mesh)
    words = ["transfer", files[0]["mesh"], files[1]["mesh"], "--region", tmp_path / "grip.json"]
    command = [sys.executable, "-m", "semfm", *map(str, words), "--no-cache", "-k", "20"]
    shell = [*command, "--method", "wks", "-o", str(tmp_path / "out")]
    run = subprocess.run(shell, capture_output=True, text=True, timeout=120)
    assert run.returncode in (0, 1), run.stderr
    meshes = [semfm.Mesh.read(each["mesh"]) for each in files]
    expected = semfm.transfer(*meshes, tmp_path / "grip.json", method="wks", k=20)
    assert np.array_equal(semfm.read_transfer(tmp_path / "out").region.mask, expected.region.mask)


# ---- progress


def test_progress_counts_forwards(pair):
    told: dict[str, list[float]] = {}
    source, target = pair
    semfm.transfer(
        source.mesh,
        target.mesh,
        source.region,
        source_features=source.shared_features(),
        target_features=target.shared_features(),
        progress=lambda stage, done, total: told.setdefault(stage, []).append(done / max(total, 1)),
    )
    assert len(told) > 2
    for stage, shares in told.items():
        assert shares == sorted(set(shares)), stage


def test_progress_shows_in_a_log(capsys, monkeypatch):
    bar = Bar()
    for done in range(101):
        bar("eigenbasis", done, 100)
    bar("vote", 1, 3)
    bar.close()
    lines = capsys.readouterr().err.splitlines()
    assert lines == ["semfm: eigenbasis 0/100", "semfm: eigenbasis 100/100", "semfm: vote 1/3"]
    monkeypatch.setattr(sys, "stderr", None)  # pythonw
    Bar()("stage", 1, 2)
