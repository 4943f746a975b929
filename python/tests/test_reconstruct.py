"""From a picture to meshes in the camera's frame: conventions, files, the road on, and what is
refused.
"""

from __future__ import annotations

import json
import os
import shlex
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import semfm
import semfm.zoo
from PIL import Image
from sam3d_stand_in import Scene, make_scene
from semfm.reconstruct.cli import main
from semfm.reconstruct.fit import metres_per_unit
from semfm.reconstruct.observation import RETURNS_AT_LEAST, Seen, read_seen
from semfm.reconstruct.poses import of_sam3d, read_pose

pytest.importorskip("scipy")
pytest.importorskip("trimesh")

#: Of positions: 32 bits hold a few centimetres to 4 nm; what is written has 9 digits.
NEAR = 1e-6


@pytest.fixture(scope="module")
def scene(tmp_path_factory) -> Scene:
    return make_scene(tmp_path_factory.mktemp("scene"))


@pytest.fixture
def own_scene(tmp_path) -> Scene:
    """For tests that change it."""
    return make_scene(tmp_path / "scene")


def run(
    *words: object, module: str = "semfm.reconstruct", **more
) -> subprocess.CompletedProcess[str]:
    """A command in a process of its own, without what the shell may say of a checkout."""
    environment = {
        k: v for k, v in os.environ.items() if k not in ("SAM3D_OBJECTS", "CONDA_PREFIX")
    }
    command = [sys.executable, "-m", module, *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, env=environment, **more)


def with_sam3d(scene: Scene, out: Path, *words: object) -> subprocess.CompletedProcess[str]:
    return run(scene.picture, "--sam3d", scene.checkout, "-o", out, *words)


def read(folder: Path, name: str = "report.json") -> dict:
    return json.loads((folder / name).read_text())


def placed(folder: Path) -> np.ndarray:
    """The object's vertices in the camera's frame, by its two files."""
    pose = np.array(read(folder, "camera_from_object.json")["camera_from_object"])
    return semfm.Mesh.read(folder / "mesh.ply").vertices @ pose[:3, :3].T + pose[:3, 3]


@pytest.fixture(scope="module")
def with_depth(scene, tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("with-depth") / "out"
    done = with_sam3d(scene, out, *scene.words("mask", "hand-mask", "depth", "intrinsics"))
    assert done.returncode == 0, done.stderr
    assert done.stdout == f"{out}\n", "what the tool prints is no data"
    assert "said on stdout" in done.stderr and "next: semfm-cli align" in done.stderr
    return out


def test_what_is_known_in_the_cameras_frame_comes_back(scene, with_depth):
    np.testing.assert_allclose(placed(with_depth), scene.mug.vertices, atol=NEAR)
    hand = semfm.Mesh.read(with_depth / "hand.ply")
    np.testing.assert_allclose(hand.vertices, scene.hand.vertices, atol=NEAR)
    np.testing.assert_array_equal(hand.faces, scene.hand.faces)
    mesh = semfm.Mesh.read(with_depth / "mesh.ply")
    off = np.abs(mesh.vertices - scene.mug.vertices).max()
    assert off > 0.1, "the mesh stands in a frame of its own"


def test_the_report_says_what_it_is_worth(scene, with_depth):
    report = read(with_depth)
    assert report["format"] == "semfm.reconstruction/1" and report["unit"] == "metre"
    assert report["tool"]["name"] == "SAM 3D Objects"
    assert report["tool"]["config"]["hash"].startswith("sha256:")
    assert set(report["inputs"]) == {"picture", "mask", "hand_mask", "depth", "intrinsics"}
    assert report["verdict"] == "check" and "start value" in report["reasons"][0]
    low, high = semfm.Mesh.read(with_depth / "mesh.ply").bounds
    sides = report["object"]["scale"] * (high - low)
    np.testing.assert_allclose(report["object"]["size"], sides)
    for name in ("object", "hand"):
        fit = report[name]["fit"]
        assert fit["silhouette_iou"] > 0.97, name
        # The depth is written in tenths of a millimetre.
        assert abs(fit["depth_error_m"]) < 1e-4 and fit["depth_spread_m"] < 1e-4


def test_both_files_of_the_mesh_are_one_mesh(with_depth):
    ply, glb = (semfm.read_mesh(with_depth / f"mesh.{kind}") for kind in ("ply", "glb"))
    assert ply.mesh.hash == glb.mesh.hash == read(with_depth)["object"]["mesh"]["hash"]
    np.testing.assert_array_equal(ply.vertex_colors, glb.vertex_colors)
    assert len(np.unique(ply.vertex_colors[:, :3])) > 100, "the tool's colours"


def test_the_centred_copy_has_metres_and_a_rigid_pose(scene, with_depth):
    centred = semfm.read_mesh(with_depth / "centred.ply")
    np.testing.assert_allclose(centred.mesh.bounds.sum(axis=0), 0, atol=NEAR)
    pose = np.array(read(with_depth)["object"]["camera_from_centred"])
    np.testing.assert_allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3), atol=1e-12)
    back = centred.mesh.vertices @ pose[:3, :3].T + pose[:3, 3]
    np.testing.assert_allclose(back, scene.mug.vertices, atol=NEAR)
    assert centred.has_colors


def test_the_overlay_is_drawn_where_the_masks_are(scene, with_depth):
    drawn, given = (
        np.asarray(Image.open(path).convert("RGB")).astype(int)
        for path in (with_depth / "overlay.png", scene.picture)
    )
    changed = (drawn != given).any(axis=2)
    masks = [np.asarray(Image.open(scene.folder / name)) > 0 for name in ("mask.png", "hand.png")]
    assert (changed & ~(masks[0] | masks[1])).sum() <= 3
    blue, red = (drawn[mask].mean(axis=0) for mask in masks)
    assert blue[2] > blue[0] + 20 and red[0] > red[2] + 20


def test_the_commands_that_it_prints_lead_to_the_region(scene, with_depth):
    align, region = read(with_depth)["next"]
    for command in (align, region):
        program, *words = shlex.split(command)
        assert program == "semfm-cli"
        done = run(*words, module="semfm")
        assert done.returncode == 0, done.stderr
    aligned = read(with_depth, "aligned.json")
    pose = np.array(aligned["camera_from_object"])
    mesh = semfm.Mesh.read(with_depth / "mesh.ply")
    there = mesh.vertices @ pose[:3, :3].T + pose[:3, 3]
    assert np.abs(there - scene.mug.vertices).max() < 2e-3, "the start was right, and stays so"
    touched = semfm.Region.read(with_depth / "grip.json", mesh).mask
    distance = np.linalg.norm(
        scene.mug.vertices[:, None] - scene.hand.vertices[None, ::8], axis=2
    ).min(axis=1)
    assert touched.any()
    assert distance[touched].max() < 0.03 and distance[~touched].max() > 0.06


def test_the_pose_is_read_as_that_of_align(with_depth, tmp_path):
    mesh = semfm.Mesh.read(with_depth / "mesh.ply")
    everywhere = semfm.Region.from_vertices(mesh.n_vertices, range(mesh.n_vertices))
    pose = with_depth / "camera_from_object.json"
    few = {"n_samples": 20, "top": 1}
    grasps = semfm.find_grasps(mesh, everywhere, "franka", alignment=pose, **few)
    assert grasps.scale == pytest.approx(read(with_depth)["object"]["scale"])
    with pytest.raises(semfm.FormatError, match="mesh"):
        ball = semfm.zoo.icosphere(2)
        semfm.find_grasps(
            ball, semfm.Region([1.0] * ball.n_vertices), "franka", alignment=pose, **few
        )
    value = {**json.loads(pose.read_text()), "verdict": "refuse"}
    (tmp_path / "refused.json").write_text(json.dumps(value))
    with pytest.raises(semfm.SemfmError, match="refuse"):
        semfm.find_grasps(mesh, everywhere, "franka", alignment=tmp_path / "refused.json", **few)


def test_without_depth_there_are_no_metres(scene, tmp_path):
    done = with_sam3d(scene, tmp_path / "out", *scene.words("mask", "hand-mask"))
    assert done.returncode == 0, done.stderr
    report = read(tmp_path / "out")
    assert report["unit"] == "point map" and report["next"] == []
    assert report["verdict"] == "refuse" and "--longest" in done.stderr
    assert report["object"]["fit"] is None and not (tmp_path / "out/overlay.png").exists()
    np.testing.assert_allclose(placed(tmp_path / "out"), 3.7 * scene.mug.vertices, atol=10 * NEAR)


def test_the_longest_side_makes_metres(scene, with_depth, tmp_path):
    longest = max(read(with_depth)["object"]["size"])
    words = scene.words("mask", "hand-mask")
    done = with_sam3d(scene, tmp_path / "out", *words, "--longest", longest)
    assert done.returncode == 0, done.stderr
    # The frames of the two runs differ, and so do the boxes along their axes: compare up to that.
    found = placed(tmp_path / "out")
    factor = np.linalg.norm(found, axis=1) / np.linalg.norm(scene.mug.vertices, axis=1)
    np.testing.assert_allclose(factor, factor[0], rtol=1e-5)
    hand = semfm.Mesh.read(tmp_path / "out/hand.ply").vertices
    np.testing.assert_allclose(hand, factor[0] * scene.hand.vertices, atol=10 * NEAR)
    report = read(tmp_path / "out")
    assert max(report["object"]["size"]) == pytest.approx(longest)
    assert report["unit"] == "metre" and report["verdict"] == "check"
    assert [shlex.split(command)[1] for command in report["next"]] == ["region"]


def save_as_documented(scene: Scene, folder: Path) -> list[str]:
    """What docs/observations.md tells users to save where SAM 3D Objects runs."""
    script = f"""
import sys, json, numpy as np
sys.path[:0] = [{str(scene.checkout)!r}, {str(scene.checkout / "notebook")!r}]
from inference import Inference
from PIL import Image
inference = Inference({str(scene.checkout / "checkpoints/hf/pipeline.yaml")!r}, compile=False)
image = np.asarray(Image.open({scene.picture!r}))
for name, file in (("object", "mask.png"), ("hand", "hand.png")):
    mask = np.asarray(Image.open({str(scene.folder)!r} + "/" + file)) > 0
    output = inference(image, mask, seed=42)
    output["glb"].export({str(folder)!r} + f"/{{name}}.glb")
    pose = {{key: output[key].numpy().tolist() for key in ("rotation", "translation", "scale")}}
    json.dump(pose, open({str(folder)!r} + f"/{{name}}.json", "w"))
"""
    environment = {**os.environ, "CONDA_PREFIX": sys.prefix}
    subprocess.run([sys.executable, "-c", script], check=True, env=environment, capture_output=True)
    words = []
    for option, name in (("", "object"), ("hand-", "hand")):
        words += [f"--{option}mesh", str(folder / f"{name}.glb")]
        words += [f"--{option}pose", str(folder / f"{name}.json")]
    return words


def test_what_another_machine_made_is_brought_in(scene, tmp_path):
    words = save_as_documented(scene, tmp_path)
    done = run(*words, "--metric", "-o", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    # Made without a point map: 3.7 units to the metre, which --metric takes at its word.
    np.testing.assert_allclose(placed(tmp_path / "out"), 3.7 * scene.mug.vertices, atol=10 * NEAR)
    hand = semfm.Mesh.read(tmp_path / "out/hand.ply").vertices
    np.testing.assert_allclose(hand, 3.7 * scene.hand.vertices, atol=10 * NEAR)
    assert semfm.read_mesh(tmp_path / "out/mesh.ply").has_colors
    report = read(tmp_path / "out")
    assert report["unit"] == "metre" and report["metres_from"] == "pose"
    # Depth that it was not made with tells the unit: what was drawn 3.7 times too far away is not.
    seen = [scene.picture, *scene.words("mask", "hand-mask", "depth", "intrinsics")]
    done = run(*words, *seen, "-o", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    np.testing.assert_allclose(placed(tmp_path / "out"), scene.mug.vertices, rtol=1e-4, atol=NEAR)
    hand = semfm.Mesh.read(tmp_path / "out/hand.ply").vertices
    np.testing.assert_allclose(hand, scene.hand.vertices, rtol=1e-4, atol=NEAR)
    assert read(tmp_path / "out")["metres_from"] == "depth"


def test_a_mesh_with_our_pose_needs_no_tool(scene, tmp_path):
    scene.mug.write(tmp_path / "mug.obj")
    pose = {
        "camera_from_object": np.diag([2.0, 2, 2, 1]).tolist(),
        "mesh": {"hash": scene.mug.hash},
    }
    (tmp_path / "pose.json").write_text(json.dumps(pose))
    words = ["--mesh", tmp_path / "mug.obj", "--pose", tmp_path / "pose.json", "--json", "--quiet"]
    seen = [scene.picture, *scene.words("mask", "hand-mask", "depth", "intrinsics")]
    done = run(*words, *seen, "-o", tmp_path / "out")
    assert done.returncode == 0 and done.stderr == ""
    report = json.loads(done.stdout)
    assert report == read(tmp_path / "out")
    np.testing.assert_allclose(placed(tmp_path / "out"), 2 * scene.mug.vertices, atol=NEAR)
    # Twice as large and twice as far away: the same silhouette, another depth.
    assert report["object"]["fit"]["silhouette_iou"] > 0.9
    assert 0.4 < report["object"]["fit"]["depth_error_m"] < 0.7
    bare = tmp_path / "bare.json"
    bare.write_text(json.dumps(pose["camera_from_object"]))
    assert read_pose(bare).is_metric
    pose["mesh"]["hash"] = semfm.zoo.icosphere(1).hash
    (tmp_path / "pose.json").write_text(json.dumps(pose))
    done = run(*words, "-o", tmp_path / "out")
    assert done.returncode == 2 and "mesh.hash" in done.stderr


OWN_TOOL = """
import numpy as np, semfm.zoo
from semfm.reconstruct import place_mesh

class Balls:
    name = "balls"
    def describe(self):
        return {"name": self.name, "version": "1"}
    def reconstruct(self, picture, mask, point_map, seed):
        middle = np.nanmean(point_map[mask], axis=0)
        pose = np.diag([0.05, 0.05, 0.05, 1])
        pose[:3, 3] = middle
        return place_mesh(semfm.zoo.icosphere(2), pose)

class Wordless(Balls):
    def reconstruct(self, *given):
        return None

"""


def test_a_class_of_ones_own_is_a_tool(scene, tmp_path):
    (tmp_path / "own.py").write_text(OWN_TOOL)
    words = [scene.picture, *scene.words("mask", "hand-mask", "depth", "intrinsics"), "-o", "out"]
    done = run("--tool", "own:Balls", *words, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    report = read(tmp_path / "out")
    assert report["tool"] == {"name": "balls", "version": "1"}
    seen = read_seen(scene.picture, [str(scene.folder / "mask.png")], *files_of(scene))
    middle = np.nanmean(seen.point_map()[seen.masks[0]], axis=0)
    np.testing.assert_allclose(placed(tmp_path / "out").mean(axis=0), middle, atol=1e-5)
    assert (tmp_path / "out/hand.ply").exists()
    done = run("--tool", "own:Wordless", *words, cwd=tmp_path)
    assert done.returncode == 2 and "a PlacedMesh, found NoneType" in done.stderr
    assert not (tmp_path / "out/report.json").exists() or read(tmp_path / "out") == report


def files_of(scene: Scene) -> tuple[str, str]:
    return str(scene.folder / "K.json"), str(scene.folder / "depth.npy")


def test_a_run_without_a_hand_leaves_none_behind(scene, tmp_path):
    out = tmp_path / "out"
    for names in (("mask", "hand-mask"), ("mask",)):
        assert with_sam3d(scene, out, *scene.words(*names, "depth", "intrinsics")).returncode == 0
    assert read(out)["hand"] is None and not (out / "hand.ply").exists()


def test_pixels_of_the_point_map_are_where_the_camera_sees_them(scene):
    seen = read_seen(scene.picture, [str(scene.folder / "mask.png")], *files_of(scene))
    point_map = seen.point_map()
    height, width = seen.depth.shape
    assert point_map.shape == (height, width, 3) and point_map.dtype == np.float32
    rows, columns = np.nonzero(np.isfinite(seen.depth))
    x, y, z = point_map[rows, columns].astype(float).T
    K = json.loads((scene.folder / "K.json").read_text())
    np.testing.assert_allclose(K["fx"] * x / z + K["cx"], columns, atol=1e-3)
    np.testing.assert_allclose(K["fy"] * y / z + K["cy"], rows, atol=1e-3)
    assert np.isnan(point_map[~np.isfinite(seen.depth)]).all()


def test_the_pose_is_that_of_pytorch3d():
    """Rows from the left, the inverse of what the quaternion seems to name, and both axes of the
    picture turned.
    """
    # A quarter turn about z, as columns: x to y. As rows: y to x.
    half = np.sqrt(0.5)
    pose = of_sam3d([half, 0, 0, half], [[0.1, 0.2, 3.0]], [[2.0, 2.0, 2.0]])
    # A GLB's y is the pose's z; its z is the pose's −y.
    glb_y, glb_z = [0, 1, 0], [0, 0, 1]
    up = pose[:3, :3] @ glb_y + pose[:3, 3]
    np.testing.assert_allclose(up, [-0.1, -0.2, 5.0], atol=1e-12)
    # (0, −1, 0) of the pose's frame goes to (−1, 0, 0) of PyTorch3D's, which is to the right of a
    # camera of ours.
    right = pose[:3, :3] @ glb_z + pose[:3, 3]
    np.testing.assert_allclose(right, [2.0 - 0.1, -0.2, 3.0], atol=1e-12)
    assert np.linalg.det(pose[:3, :3]) == pytest.approx(8.0)
    same = of_sam3d(-3 * np.array([half, 0, 0, half]), [0.1, 0.2, 3.0], 2.0)
    np.testing.assert_allclose(same, pose, atol=1e-12)


def test_without_the_tool_it_says_what_to_install(scene, tmp_path):
    words = [scene.picture, *scene.words("mask"), "-o", tmp_path / "out"]
    done = run(*words)
    assert done.returncode == 2 and done.stdout == ""
    for text in ("sam3d_objects: not installed", "doc/setup.md", "--sam3d", "--pose"):
        assert text in done.stderr
    for option, text in (
        (["--sam3d", tmp_path], "notebook/inference.py"),
        (["--sam3d", scene.checkout, "--sam3d-config", tmp_path / "no.yaml"], "pipeline.yaml"),
        (["--tool", "sam4d"], "sam3d or package.module:Class, found 'sam4d'"),
        (["--tool", "no_such:Tool"], "no_such"),
    ):
        done = run(*words, *option)
        assert done.returncode == 2 and text in done.stderr, done.stderr
    (tmp_path / "half/notebook").mkdir(parents=True)
    (tmp_path / "half/checkpoints/hf").mkdir(parents=True)
    (tmp_path / "half/checkpoints/hf/pipeline.yaml").write_text("")
    (tmp_path / "half/notebook/inference.py").write_text("import pytorch3d_that_is_not_here")
    done = run(*words, "--sam3d", tmp_path / "half")
    assert done.returncode == 2 and "pytorch3d_that_is_not_here" in done.stderr
    assert "doc/setup.md" in done.stderr


def test_failures_of_the_tool_are_told_as_its_own(own_scene, tmp_path):
    words = own_scene.words("mask", "depth", "intrinsics")
    for change, text in (
        ({"fails": "CUDA out of memory"}, "SAM 3D Objects: RuntimeError: CUDA out of memory"),
        ({"fails": "", "stretch": [1, 1, 1.2]}, "scale: expected one positive number"),
        ({"stretch": [float("nan")] * 3}, "scale: expected 1 or 3 finite numbers"),
        ({"stretch": [1, 1, 1], "no_mesh": True}, "a mesh under `glb`"),
    ):
        own_scene.change(**change)
        done = with_sam3d(own_scene, tmp_path / "out", *words)
        assert done.returncode == 2 and text in done.stderr, done.stderr
        assert "a bug in semfm" not in done.stderr
        assert not (tmp_path / "out/report.json").exists()


def pose_file(folder: Path, value: object) -> str:
    path = folder / "pose.json"
    path.write_text(json.dumps(value))
    return str(path)


@pytest.mark.parametrize(
    "pose, text",
    [
        ({"rotation": [0, 0, 0, 0], "translation": [0, 0, 1], "scale": 1}, "a quaternion, w first"),
        ({"rotation": [1, 0, 0], "translation": [0, 0, 1], "scale": 1}, "4 finite numbers"),
        ({"rotation": [1, 0, 0, 0], "translation": [0, 0, 1]}, "scale: expected a field"),
        ({"rotation": [1, 0, 0, 0], "translation": [0, 0, 1], "scale": [1, 2, 1]}, "equal"),
        ({"rotation": [1, 0, 0, 0], "translation": "here", "scale": 1}, "found 'here'"),
        ({"rotation": [1, 0, 0, 0], "translation": [0, 0, -9], "scale": 1}, "before the camera"),
        ({"pose": 1}, "the fields ['pose']"),
        ([[1, 0], [0, 1]], "a 4 × 4 matrix"),
        (np.diag([-1.0, 1, 1, 1]).tolist(), "right-handed"),
        (np.diag([1.0, 1, 1.1, 1]).tolist(), "a rotation times a scale"),
        (np.diag([1.0, 1, 1, 2]).tolist(), "0, 0, 0, 1 in the last row"),
        (np.diag([0.0, 0, 0, 1]).tolist(), "a rotation times a scale"),
        ("pose", "a 4 × 4 matrix"),
    ],
)
def test_what_is_no_pose_is_refused(tmp_path, capsys, pose, text):
    semfm.zoo.icosphere(2).write(tmp_path / "ball.ply")
    path = pose_file(tmp_path, pose)
    words = ["--mesh", str(tmp_path / "ball.ply"), "--pose", path, "-o", str(tmp_path / "out")]
    assert main(words) == 2
    said = capsys.readouterr()
    assert said.out == "" and text in said.err and "pose.json" in said.err


def test_few_pixels_tell_no_metres():
    depth, mask = np.full(SHAPE, 2.0), np.zeros(SHAPE, dtype=bool)
    seen = Seen(np.zeros((*SHAPE, 3), np.uint8), [mask], depth, None, [])
    view = SimpleNamespace(depth=np.full(SHAPE, 4.0))
    mask[0, : RETURNS_AT_LEAST - 1] = True
    assert metres_per_unit(view, mask, seen) is None
    mask[1, 0] = True
    assert metres_per_unit(view, mask, seen) == 0.5


def test_a_refused_pose_is_not_in_metres(tmp_path):
    value = {"camera_from_object": np.eye(4).tolist()}
    for verdict in ("check", "refuse"):
        path = pose_file(tmp_path, {**value, "verdict": verdict})
        assert read_pose(path).is_metric == (verdict == "check")


def test_bad_input_is_refused_by_name(scene, tmp_path, capsys):
    everything = tmp_path / "everything.png"
    Image.fromarray(np.full(SHAPE, 255, np.uint8)).save(everything)
    small = tmp_path / "small.png"
    Image.fromarray(np.eye(9, dtype=np.uint8) * 255).save(small)
    pointer = tmp_path / "pointer.png"
    pointer.write_text("version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 1\n")
    empty = tmp_path / "empty.npy"
    np.save(empty, np.where(np.arange(SHAPE[1]) < 2, 0.5, 0) * np.ones(SHAPE))
    depth = scene.words("depth", "intrinsics")
    for words, text in (
        ([scene.picture], "IMAGE with --mask"),
        ([scene.picture, "--mask", everything], "everything.png"),
        ([scene.picture, "--mask", small], "240 × 180"),
        ([scene.picture, "--mask", pointer], "git lfs pull"),
        ([tmp_path / "none.png", *scene.words("mask")], "none.png"),
        ([scene.picture, *scene.words("mask", "depth")], "--intrinsics beside it"),
        (
            [scene.picture, *scene.words("mask", "intrinsics"), "--depth", empty],
            "at least 30 pixels under it with a depth, found 0 of",
        ),
        ([scene.picture, *scene.words("mask"), *depth, "--longest", 0.1], "--longest"),
        ([scene.picture, *scene.words("mask"), "--longest", -1], "0 to 100 metres"),
        ([scene.picture, *scene.words("mask"), "--pose", "p.json"], "--mesh"),
        (["--mesh", "m.ply"], "--pose beside it"),
    ):
        assert main([*map(str, words), "-o", str(tmp_path / "out")]) == 2, words
        said = capsys.readouterr()
        assert said.out == "" and text in said.err and "a bug in semfm" not in said.err, said.err
        assert not (tmp_path / "out/report.json").exists()


SHAPE = (180, 240)


def test_no_input_is_overwritten(scene, tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    scene.mug.write(out / "mesh.ply")
    before = (out / "mesh.ply").read_bytes()
    path = pose_file(tmp_path, np.eye(4).tolist())
    done = run("--mesh", out / "mesh.ply", "--pose", path, "-o", out)
    assert done.returncode == 2 and (out / "mesh.ply").read_bytes() == before


def shared_file(shared: Path, *parts: str) -> Path:
    path = shared.joinpath(*parts)
    if not path.exists():
        pytest.skip(f"no shared data at {path}")
    return path


def test_a_real_glb_of_sam3d_keeps_vertices_and_colours(shared, tmp_path):
    glb = shared_file(shared, "data", "sam3d", "sam3d_sample.glb")
    pose = {
        "rotation": [[0.5, -0.5, 0.5, 0.5]],
        "translation": [[0.1, -0.05, 0.7]],
        "scale": [[0.2] * 3],
    }
    path = pose_file(tmp_path, pose)
    done = run("--mesh", glb, "--pose", path, "--longest", 0.3, "-o", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    given = semfm.read_mesh(glb)
    for name in ("mesh.ply", "mesh.glb"):
        found = semfm.read_mesh(tmp_path / "out" / name)
        assert found.mesh.hash == given.mesh.hash
        np.testing.assert_array_equal(found.vertex_colors, given.vertex_colors)
    centred = semfm.Mesh.read(tmp_path / "out/centred.ply")
    low, high = centred.bounds
    np.testing.assert_allclose(low, -high, atol=NEAR)
    assert (high - low).max() == pytest.approx(0.3, abs=NEAR)


def test_a_real_depth_becomes_a_point_map_of_the_labelled_place(shared, tmp_path):
    """DexYCB: the bottle's points lie where its label says that it stands."""
    folder = shared_file(shared, "data", "rgbd", "dexycb_frame")
    labels = np.load(folder / "labels.npz")
    calibration = (folder / "836212060125_640x480.yml").read_text()
    lines = calibration[calibration.index("color:") :].splitlines()[1:]
    camera = {}
    for line in lines:
        name, _, value = line.strip().partition(":")
        if name in ("fx", "fy", "ppx", "ppy") and name not in camera:
            camera[name] = float(value)
    (tmp_path / "K.json").write_text(json.dumps(camera))
    np.save(tmp_path / "labels.npy", labels["seg"])
    ids = [i for i in np.unique(labels["seg"]) if i not in (0, 255)]
    masks = [f"{tmp_path / 'labels.npy'}#{i}" for i in ids]
    seen = read_seen(folder / "color.png", masks, tmp_path / "K.json", folder / "depth.png")
    point_map = seen.point_map()
    nearest = []
    for mask in seen.masks:
        middle = np.nanmedian(point_map[mask], axis=0)
        nearest.append(np.linalg.norm(labels["pose_y"][..., 3] - middle, axis=-1).min())
    # A label is the origin of a model, in the middle of it; what is seen of the largest, a bowl of
    # 16 cm, is at most its radius away. An axis turned round would be 20 cm off and more.
    assert max(nearest) < 0.08, nearest
