"""`semfm.Observation`: pictures and depth as arrays, with the shell's answers to the last byte."""

from __future__ import annotations

import copy
import json
import os
import pickle
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import semfm
from observed_frames import (
    CAMERA,
    HEIGHT,
    WALL,
    WIDTH,
    K,
    in_metres,
    seen,
    shell,
    turned,
    write_files,
)


@pytest.fixture(scope="module")
def pair():
    """A mug with its true grip, and a kettle in metres."""
    mug, kettle = (semfm.demo_object("containers", instance=i, n_vertices=2000) for i in (0, 1))
    return mug, in_metres(kettle.mesh)


@pytest.fixture(scope="module")
def kettle(pair):
    return seen(turned(pair[1], [0.02, 0.0, 0.6], 60.0))


def same_bytes(folder, name):
    """Whether the shell and Python wrote the same file."""
    return (folder / "shell" / name).read_bytes() == (folder / "python" / name).read_bytes()


def test_arrays_come_out_as_they_went_in(kettle):
    assert (kettle.color.shape, kettle.color.dtype) == ((HEIGHT, WIDTH, 3), np.uint8)
    assert (kettle.depth.shape, kettle.depth.dtype) == ((HEIGHT, WIDTH), np.float32)
    mask = kettle.masks["object"]
    assert mask.dtype == bool and list(kettle.masks) == ["object"]
    assert np.all(kettle.depth[~mask] == np.float32(WALL)) and np.all(kettle.depth[mask] < 0.8)
    assert kettle.camera == CAMERA and kettle.time_nanos is None and kettle.objects == []
    for view in (kettle.color, kettle.depth, mask):
        with pytest.raises(ValueError, match="read-only"):
            view[0, 0] = 0
    metres = semfm.Observation(CAMERA, depth=kettle.depth, color=kettle.color, masks=[mask])
    assert list(metres.masks) == ["0"] and np.array_equal(metres.depth, kettle.depth)
    feet = semfm.Observation(K, depth=kettle.depth / 0.3048, depth_scale=1 / 0.3048)
    np.testing.assert_allclose(feet.depth, kettle.depth, rtol=1e-6)
    assert repr(kettle) == "Observation(320 × 240, colour, depth, 1 mask)"
    assert kettle.picture().startswith(b"\x89PNG") and kettle._repr_png_().startswith(b"\x89PNG")
    for again in (pickle.loads(pickle.dumps(kettle)), copy.deepcopy(kettle)):
        assert again == kettle
    assert metres != kettle


def test_points_lie_where_the_camera_sees_them(kettle):
    points = kettle.cloud("object")
    u, v, z = kettle.camera.project(points).T
    mask = kettle.masks["object"]
    assert len(points) == mask.sum()
    assert mask[v.astype(int), u.astype(int)].all()
    np.testing.assert_allclose(z, kettle.depth[mask], rtol=1e-6)
    assert np.array_equal(kettle.cloud(mask), points)
    assert len(kettle.cloud()) == WIDTH * HEIGHT
    beside = kettle.surroundings()
    assert len(beside) > 500 and np.allclose(beside[:, 2], WALL)
    # A sensor that gives points is asked in the same way.
    sensor = semfm.Observation(CAMERA, cloud=kettle.cloud(), masks=kettle.masks)
    assert np.array_equal(sensor.cloud("object"), points) and sensor.depth is None
    assert pickle.loads(pickle.dumps(sensor)) == sensor


def test_a_lens_and_a_pose_are_taken_into_account(kettle):
    lens = {"distortion": [0.3, 0, 0, 0, 0]}
    bent = semfm.Observation(K, depth=kettle.depth, **lens)
    assert bent.depth[0, 0] == 0 and bent.depth[120, 160] == kettle.depth[120, 160]
    # A fisheye lens bends rays with coefficients of 0, too: off the middle it shows what lies farther out.
    fisheye = semfm.Observation(
        K, color=kettle.color, distortion=[0] * 4, distortion_model="equidistant"
    )
    straight = semfm.Observation(K, color=kettle.color, distortion=[0] * 4)
    assert np.array_equal(straight.color, kettle.color) and not np.array_equal(
        fisheye.color, kettle.color
    )
    pose = np.eye(4)
    pose[:3, 3] = [0.1, 0.2, 0.3]
    posed = semfm.Observation(K, depth=kettle.depth, camera_from_world=pose, time_nanos=5)
    assert np.array_equal(posed.camera.camera_from_world, pose) and posed.time_nanos == 5


def test_files_are_read_as_the_shell_reads_them(kettle, tmp_path):
    files = write_files(tmp_path, kettle)
    read = semfm.Observation.read(**files)
    assert read == kettle
    named = semfm.Observation.read(
        **{**files, "mask": {"kettle": files["mask"]}}, hand_mask=files["mask"]
    )
    assert list(named.masks) == ["kettle", "hand"]
    written = shell(
        "frames", "--color", files["color"], "--depth", files["depth"], "--intrinsics", files["intrinsics"],
        "--mask", files["mask"], "-o", tmp_path / "shell",
    )  # fmt: skip
    assert written.returncode == 0, written.stderr
    assert semfm.write_observations(tmp_path / "python", [read]) == str(tmp_path / "python")
    names = sorted(
        path.relative_to(tmp_path / "shell") for path in (tmp_path / "shell").rglob("*.*")
    )
    assert names == sorted(
        p.relative_to(tmp_path / "python") for p in (tmp_path / "python").rglob("*.*")
    )
    for name in names:
        assert same_bytes(tmp_path, name), name


def test_a_source_hands_out_one_frame_after_the_other(pair, tmp_path):
    frames = [
        seen(turned(pair[1], [0.01 * i, 0, 0.6], 10.0 * i), time_nanos=10**9 + 10**8 * i)
        for i in range(5)
    ]
    for name in ("seen.mcap", "scene"):
        semfm.write_observations(tmp_path / name, frames)
    bag = semfm.read_observations(tmp_path / "seen.mcap")
    first = next(bag)
    assert np.array_equal(first.color, frames[0].color)
    assert np.array_equal(first.depth, frames[0].depth)
    assert first.time_nanos == frames[0].time_nanos and first.masks == {}
    assert bag.notes == [] and len(list(bag)) == 4
    assert any("camera from" in note for note in bag.notes)
    assert list(bag) == []
    scene = list(semfm.read_observations(tmp_path / "scene", every=2, most=2))
    assert [each.time_nanos for each in scene] == [frames[0].time_nanos, frames[2].time_nanos]
    assert np.array_equal(scene[1].masks["obj0"], frames[2].masks["object"])
    known = scene[1].objects[0]
    assert known["mask"] == "obj0" and known["camera_from_object"].shape == (4, 4)
    with pytest.raises(semfm.FileError):
        next(semfm.read_observations(tmp_path / "nothing.mcap"))
    with pytest.raises(semfm.InvalidInput, match="max gap"):
        semfm.read_observations(tmp_path / "seen.mcap", max_gap=-1.0)


def readers():
    """The threads of this process that read observations."""
    names = Path("/proc/self/task").glob("*/comm")
    return sum(path.read_text().strip() == "semfm-reader" for path in names if path.exists())


@pytest.mark.skipif(sys.platform != "linux", reason="threads as Linux lists them")
def test_frames_that_nobody_wants_any_more_are_not_read(kettle, tmp_path):
    semfm.write_observations(tmp_path / "seen.mcap", [kettle] * 6)
    frames = semfm.read_observations(tmp_path / "seen.mcap")
    next(frames)
    # It waits for the frame that it has read ahead to be asked for.
    assert readers() == 1
    del frames
    for _ in range(600):
        if readers() == 0:
            break
        time.sleep(0.1)
    assert readers() == 0


FORKED = """
import os, sys
import semfm

frames = semfm.read_observations(sys.argv[1])
next(frames)
child = os.fork()
if child == 0:
    try:
        next(frames)
    except semfm.InvalidInput as error:
        print(error, flush=True)
        os._exit(3)
    os._exit(1)
print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), len(list(frames)))
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_a_forked_process_is_told_to_open_the_source_itself(kettle, tmp_path):
    semfm.write_observations(tmp_path / "seen.mcap", [kettle] * 4)
    command = [sys.executable, "-W", "ignore", "-c", FORKED, tmp_path / "seen.mcap"]
    run = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert run.returncode == 0, run.stderr
    error, answers = run.stdout.splitlines()
    assert "open the source in each process" in error and answers == "3 3"


@pytest.mark.parametrize("views", [None, "both"])
def test_a_surface_is_the_same_at_the_shell(kettle, tmp_path, views):
    files = write_files(tmp_path, kettle)
    more = ["--views", views] if views else []
    made = shell(
        "surface", "--color", files["color"], "--depth", files["depth"], "--intrinsics", files["intrinsics"],
        "--mask", files["mask"], "-o", tmp_path / "shell", *more,
    )  # fmt: skip
    assert made.returncode == 0, made.stderr
    surface = semfm.Observation.read(**files).surface()
    embeddings = surface.embed(views=views)
    written = surface.write(tmp_path / "python", embeddings=embeddings)
    assert len(written) == 5
    assert sorted(path.name for path in (tmp_path / "shell").iterdir()) == sorted(
        Path(path).name for path in written
    )
    for name in (Path(path).name for path in written):
        assert same_bytes(tmp_path, name), name
    assert surface.report["views"] is None and surface.report["object"] == "object"
    assert surface.mesh == semfm.Mesh.read(tmp_path / "shell/surface.ply")
    assert surface.colors.shape == (surface.mesh.n_vertices, 3) and surface.colors.dtype == np.uint8
    assert surface.around.shape[1] == 3 and surface.cameras == [CAMERA]


def test_a_region_on_what_was_seen_is_the_same_at_the_shell(pair, kettle, tmp_path):
    mug = pair[0]
    mug.mesh.write(tmp_path / "mug.obj")
    mug.region.write(tmp_path / "grip.json", mug.mesh)
    surface = kettle.surface("object")
    embeddings = surface.embed()
    surface.write(tmp_path / "seen", embeddings=embeddings)
    run = shell(
        "transfer", tmp_path / "mug.obj", tmp_path / "seen/surface.ply", "--region", tmp_path / "grip.json",
        "--target-embeddings", tmp_path / "seen/surface.emb.mcap", "--no-cache", "-o", tmp_path / "shell",
    )  # fmt: skip
    assert run.returncode in (0, 1), run.stderr
    result = semfm.transfer(
        tmp_path / "mug.obj", surface.mesh, tmp_path / "grip.json", target_embeddings=embeddings
    )
    result.write(tmp_path / "python")
    for name in ("region.json", "point_map.json", "target.ply"):
        assert same_bytes(tmp_path, name), name
    # The other object is shown to the encoder that made these, at their rotations; the named one must be it.
    turned_views = surface.embed(views="both", rolls=2)
    both = semfm.transfer(mug.mesh, surface.mesh, mug.region, target_embeddings=turned_views)
    made = semfm.embed(mug.mesh, rolls=2, colors=True)
    same = semfm.transfer(
        mug.mesh, surface.mesh, mug.region, source_embeddings=made, target_embeddings=turned_views
    )
    named = semfm.transfer(
        mug.mesh, surface.mesh, mug.region, target_embeddings=turned_views, encoder="builtin"
    )
    assert np.array_equal(both.weights, same.weights)
    assert np.array_equal(both.weights, named.weights)
    # The other way round, the observed object is the demonstrated one.
    back = semfm.transfer(surface.mesh, mug.mesh, result.region, source_embeddings=embeddings)
    assert back.region.n_vertices == mug.mesh.n_vertices


def test_grasps_of_what_was_seen_are_those_of_the_shell(kettle, tmp_path):
    surface = kettle.surface()
    surface.write(tmp_path / "seen")
    height = surface.mesh.vertices[:, 1]
    region = semfm.Region.from_mask(np.ones_like(height, bool))
    region.write(tmp_path / "region.json", surface.mesh)
    run = shell(
        "grasp", tmp_path / "seen/surface.ply", "--region", tmp_path / "region.json", "--gripper", "franka",
        "--metres", "--scene", tmp_path / "seen/around.ply", "--unseen", 0.05, "-o", tmp_path / "shell.json",
    )  # fmt: skip
    assert run.returncode in (0, 1), run.stderr
    given = {"scale": 1.0, "scene_points": surface.around}
    grasps = semfm.find_grasps(surface.mesh, region, "franka", unseen=0.05, **given)
    told = json.loads((tmp_path / "shell.json").read_text())
    del told["settings"]
    assert {name: value for name, value in grasps.to_dict().items() if name != "settings"} == told
    assert len(grasps) > 0 and sum(told["rejected"].values()) > 100
    # Without it the gripper may close behind the surface, on the back of a sheet that is none.
    top = semfm.Region.from_mask(height < np.quantile(height, 0.3))
    kept_out = semfm.find_grasps(surface.mesh, top, "franka", unseen=0.05, **given)
    assert len(kept_out) < len(semfm.find_grasps(surface.mesh, top, "franka", **given))
    with pytest.raises(semfm.InvalidInput, match="gap"):
        semfm.find_grasps(surface.mesh, region, "franka", unseen=0.001, **given)


def test_a_pose_in_what_was_seen_is_that_of_the_shell(pair, kettle, tmp_path):
    files = write_files(tmp_path, kettle)
    pair[1].write(tmp_path / "kettle.obj")
    run = shell(
        "align", tmp_path / "kettle.obj", "--depth", files["depth"], "--intrinsics", files["intrinsics"],
        "--mask", files["mask"], "-o", tmp_path / "aligned.json",
    )  # fmt: skip
    assert run.returncode in (0, 1), run.stderr
    aligned = semfm.align(tmp_path / "kettle.obj", semfm.Observation.read(**files))
    told, ours = json.loads((tmp_path / "aligned.json").read_text()), aligned.to_dict()
    assert {**told, "stages_ms": None} == {**ours, "stages_ms": None}
    again = pickle.loads(pickle.dumps(aligned))
    assert np.array_equal(again.camera_from_object, aligned.camera_from_object)
    by_array = semfm.align(pair[1], kettle, mask=kettle.masks["object"], init=aligned)
    assert by_array.verdict in ("accept", "check", "refuse")
    # What it found is where a tracker begins.
    assert semfm.Tracker(pair[1], init=aligned).update(kettle).state in ("new", "tracking", "lost")
    with pytest.raises(semfm.InvalidInput, match="an Observation beside it"):
        semfm.align(pair[1], kettle.cloud("object"), mask="object")


def test_several_frames_become_one_surface(pair, tmp_path):
    frames = []
    for x in (-0.1, 0.0, 0.1):
        pose = np.eye(4)
        pose[0, 3] = -x
        frames.append(seen(turned(pair[1], [-x, 0, 0.6]), camera_from_world=pose))
    # One that does not show it.
    wall = {
        "depth": np.full((HEIGHT, WIDTH), WALL),
        "color": np.zeros((HEIGHT, WIDTH, 3), np.uint8),
    }
    frames.insert(1, semfm.Observation(K, **wall, camera_from_world=np.eye(4)))
    semfm.write_observations(tmp_path / "scene", frames)
    made = shell(
        "surface", tmp_path / "scene", "--merge", "--no-embeddings", "-o", tmp_path / "shell"
    )
    assert made.returncode == 0, made.stderr
    merged = semfm.merged_surface(semfm.read_observations(tmp_path / "scene"))
    merged.write(tmp_path / "python")
    for name in ("surface.ply", "around.ply", "surface.json"):
        assert same_bytes(tmp_path, name), name
    assert len(merged.observations) == 3 and repr(merged).endswith("of 3 frames)")
    assert merged.notes == ["frame 1 is left out: it has no mask of the object"]
    assert merged.notes[0] in made.stderr.splitlines()
    assert (
        pickle.loads(pickle.dumps(merged)).notes == merged.notes and frames[0].surface().notes == []
    )
    assert abs(merged.mesh.bounds.mean(axis=0)[0]) < 0.02
    # One frame of them is in the same frame, and stays there in a pickle.
    one = semfm.merged_surface(frames[:1])
    assert abs(one.mesh.bounds.mean(axis=0)[0]) < 0.06 and one.report["frame"] == "world"
    again = pickle.loads(pickle.dumps(one))
    assert np.array_equal(again.mesh.vertices, one.mesh.vertices)
    with pytest.raises(semfm.InvalidInput, match="the BOP scene"):
        list(semfm.read_observations(tmp_path / "scene", fixed_frame="map"))
    with pytest.raises(semfm.InvalidInput, match="pose in each frame"):
        semfm.merged_surface([seen(turned(pair[1], [0, 0, 0.6]))] * 2)


def test_a_surface_is_an_object_like_others(kettle):
    surface = kettle.surface(kettle.masks["object"], smooth_pixels=2, most_vertices=2000)
    assert surface.mesh.n_vertices <= 2000 and surface.report["object"] == "mask"
    again = pickle.loads(pickle.dumps(surface))
    assert again.mesh == surface.mesh and np.array_equal(again.around, surface.around)
    assert surface.observations[0] != kettle and surface.observations[0].depth is not None
    assert surface.picture().startswith(b"\x89PNG") and surface._repr_png_().startswith(b"\x89PNG")
    prepared = semfm.prepare(surface.mesh, embeddings=surface.embed(views="pictures"), k=20)
    assert prepared.encoder["name"] == "builtin"


def test_what_is_wrong_is_said(kettle, tmp_path):
    depth, mask = kettle.depth, kettle.masks["object"]
    wrong = [
        (lambda: semfm.Observation(K), "color, depth or cloud"),
        (lambda: semfm.Observation(K, cloud=[[0, 0, 1]]), "a picture that tells the size"),
        (lambda: semfm.Observation(np.ones((3, 3)), depth=depth), "no skew"),
        (lambda: semfm.Observation(K, depth=depth, color=kettle.color[:-1]), "color"),
        (lambda: semfm.Observation(K, depth=depth, masks={"cup": mask[:, 1:]}), "mask `cup`"),
        (lambda: semfm.Observation(K, depth=depth, masks={"cup": ~np.ones_like(mask)}), "marked"),
        (lambda: semfm.Observation(K, depth=depth, depth_scale=-1.0), "depth scale"),
        (lambda: semfm.Observation(K, depth=depth, distortion=[1.0, 2.0]), "4, 5 or 8"),
        (lambda: semfm.Observation(K, depth=depth, distortion=[0] * 4, distortion_model="x"), "plumb_bob"),
        (lambda: semfm.Observation(K, depth=depth, distortion_model="plumb_bob"), "`distortion` beside"),
        (lambda: semfm.Observation(K, color=kettle.color, depth_scale=1e3), "`depth` beside"),
        (lambda: semfm.Observation.read("K.json", color="c.png", depth_scale=1e3), "`depth` beside"),
        (lambda: kettle.cloud("cup"), "object"),
        (lambda: kettle.surface(smooth_pixels=99), "^smooth_pixels: "),
        (lambda: kettle.surface(trim_pixels=999), "^trim_pixels: "),
        (lambda: kettle.surface(most_vertices=1), "^most_vertices: "),
        (lambda: semfm.merged_surface([kettle], smooth_pixels=99), "^smooth_pixels: "),
        (lambda: kettle.surface().embed(views="mesh"), "`mesh`"),
        (lambda: kettle.surface().write(tmp_path, embeddings=semfm.embed(kettle.surface().mesh)), "embed"),
        (lambda: semfm.Observation(K, depth=depth).surroundings(), "that of an object"),
        (lambda: semfm.Observation(K, color=kettle.color).surface(), "colour alone"),
        (lambda: semfm.Observation.read(tmp_path / "K.json", depth=tmp_path / "d.png"), "d.png"),
    ]  # fmt: skip
    for call, words in wrong:
        with pytest.raises((semfm.InvalidInput, semfm.FileError), match=words):
            call()
    with pytest.raises(semfm.InvalidType, match="uint8"):
        semfm.Observation(K, color=kettle.color.astype(np.int32))
    several = semfm.Observation(K, depth=depth, masks={"a": mask, "b": ~mask})
    with pytest.raises(semfm.InvalidInput, match="a, b"):
        several.surface()
