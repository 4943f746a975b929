"""Hands, grasps and alignment through Python: the numbers of the shell, pickles, and refusals."""

from __future__ import annotations

import json
import pickle
import subprocess
import sys

import numpy as np
import pytest

import semfm


@pytest.fixture(scope="module")
def mug():
    return semfm.demo_object("containers", instance=0)


@pytest.fixture(scope="module")
def scale(mug) -> float:
    low, high = mug.mesh.vertices.min(axis=0), mug.mesh.vertices.max(axis=0)
    return 0.2 / float(np.linalg.norm(high - low))


@pytest.fixture(scope="module")
def grasps(mug, scale):
    return semfm.find_grasps(mug.mesh, mug.region, "franka", scale=scale, n_samples=300)


def test_grasps_are_those_of_the_shell(mug, scale, grasps, tmp_path):
    files = mug.write(tmp_path)
    del files
    mesh = next(tmp_path.glob("*.obj"))
    arguments = ["grasp", mesh, "--region", mesh.with_suffix(".json"), "--gripper", "franka"]
    arguments += ["--scale", repr(scale), "--samples", "300", "-o", tmp_path / "grasps.json"]
    done = subprocess.run(
        [sys.executable, "-m", "semfm", *map(str, arguments)], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    by_shell = json.loads((tmp_path / "grasps.json").read_text())
    ours = grasps.to_dict()
    assert ours["grasps"] == by_shell["grasps"] and ours["rejected"] == by_shell["rejected"]


def test_poses_are_rigid_and_contacts_lie_on_the_region(mug, scale, grasps):
    assert len(grasps) > 0 and grasps.object_from_tcp.shape == (len(grasps), 4, 4)
    turn = grasps.object_from_tcp[:, :3, :3]
    np.testing.assert_allclose(turn @ turn.transpose(0, 2, 1), np.tile(np.eye(3), (len(grasps), 1, 1)), atol=1e-9)
    handle = mug.mesh.vertices[mug.region.mask] * scale
    for grasp in grasps:
        for contact in grasp.contacts:
            assert np.linalg.norm(handle - contact, axis=1).min() < 0.01
        assert set(grasp.terms) >= {"contact", "friction", "epsilon"}
        assert 0 <= grasp.score <= 1
    assert grasps.camera_from_tcp is None and grasps[-1].width == grasps.widths[-1]
    with pytest.raises(IndexError):
        grasps[len(grasps)]


def test_the_camera_is_one_multiplication_away(mug, scale, grasps):
    pose = np.array([[0, -1, 0, 0.1], [1, 0, 0, 0.2], [0, 0, 1, 0.7], [0, 0, 0, 1.0]])
    seen = semfm.find_grasps(
        mug.mesh, mug.region, "franka", scale=scale, n_samples=300, camera_from_object=pose
    )
    np.testing.assert_allclose(seen.camera_from_tcp, pose @ seen.object_from_tcp, atol=1e-9)
    np.testing.assert_array_equal(seen.object_from_tcp, grasps.object_from_tcp)


def test_pickles_come_back_and_files_are_written(grasps, tmp_path):
    again = pickle.loads(pickle.dumps(grasps))
    assert again.to_dict() == grasps.to_dict()
    assert pickle.loads(pickle.dumps(grasps.gripper)).name == "franka"
    for format in ("json", "ros2", "isaac"):
        grasps.write(tmp_path / format, format=format)
        assert (tmp_path / format).stat().st_size > 100
    with pytest.raises(ValueError, match="json, ros2 or isaac"):
        grasps.write(tmp_path / "x", format="xml")


def test_ros_and_yaml_readers_take_the_files(grasps, tmp_path):
    reader = pytest.importorskip("mcap.reader")
    decoder = pytest.importorskip("mcap_ros2.decoder")
    grasps.write(tmp_path / "grasps.mcap", format="ros2")
    with open(tmp_path / "grasps.mcap", "rb") as stream:
        made = reader.make_reader(stream, decoder_factories=[decoder.DecoderFactory()])
        messages = list(made.iter_decoded_messages())
    told = {channel.topic: (schema.name, message) for schema, channel, _, message in messages}
    assert len(told) == len(messages) == 6
    name, message = told["/grasps/poses"]
    assert name == "geometry_msgs/msg/PoseArray"
    assert message.header.frame_id == "object" and len(message.poses) == len(grasps)
    first = message.poses[0].position
    np.testing.assert_allclose([first.x, first.y, first.z], grasps.object_from_tcp[0, :3, 3])
    for topic, values in (
        ("/grasps/widths", grasps.widths),
        ("/grasps/openings", [grasp.opening for grasp in grasps]),
        ("/grasps/contact_widths", [grasp.contact_width for grasp in grasps]),
        ("/grasps/command_widths", [grasp.command_width for grasp in grasps]),
        ("/grasps/scores", grasps.scores),
    ):
        name, message = told[topic]
        assert name == "std_msgs/msg/Float64MultiArray"
        np.testing.assert_array_equal(message.data, values)
        [dimension] = message.layout.dim
        assert dimension.size == dimension.stride == len(grasps) and dimension.label
    yaml = pytest.importorskip("yaml")
    grasps.write(tmp_path / "grasps.yaml", format="isaac")
    file = yaml.safe_load((tmp_path / "grasps.yaml").read_text())
    assert file["format"] == "isaac_grasp" and len(file["grasps"]) == len(grasps)
    best = file["grasps"]["grasp_0"]
    assert best["cspace_position"]["panda_finger_joint1"] == pytest.approx(
        grasps[0].command_width / 2, abs=1e-8
    )


def test_nothing_found_says_why(mug, scale):
    none = semfm.find_grasps(
        mug.mesh, mug.region, "franka", scale=scale, n_samples=100, width_range=(0, 0.001)
    )
    assert len(none) == 0 and none.rejected["width"] > 0
    reason, by, unit = none.nearest_miss
    assert by > 0 and unit == "m" and reason == "width"
    assert "width_range" in none.advice


def test_an_alignment_is_taken_whole(mug, scale, tmp_path):
    pose = np.eye(4)
    pose[:3, :3] *= scale
    pose[2, 3] = 0.6
    file = {"camera_from_object": pose.tolist(), "verdict": "check", "reasons": ["hidden"], "position_std_m": 0.004}
    path = tmp_path / "aligned.json"
    path.write_text(json.dumps(file))
    grasps = semfm.find_grasps(mug.mesh, mug.region, "franka", alignment=path, n_samples=200)
    assert len(grasps) > 0 and grasps.camera_from_tcp is not None
    for grasp in grasps:
        assert grasp.opening - grasp.width > 2 * 0.0038
        assert grasp.command_width < grasp.contact_width
    path.write_text(json.dumps({**file, "verdict": "refuse"}))
    with pytest.raises(semfm.InvalidInput, match="refuse"):
        semfm.find_grasps(mug.mesh, mug.region, "franka", alignment=path)
    for both in ({}, {"alignment": path, "scale": scale}):
        with pytest.raises(semfm.InvalidInput, match="scale and alignment"):
            semfm.find_grasps(mug.mesh, mug.region, "franka", **both)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"scale": -1.0}, "scale"),
        ({"friction": 0.0}, "friction"),
        ({"camera_from_object": np.diag([2.0, 2, 2, 1])}, "scale of 2"),
        ({"camera_from_object": np.eye(3)}, r"\(4, 4\)"),
        ({"approach": [0, 0, 0]}, "axis"),
        ({"scene_points": [[0, 0]]}, "scene_points"),
    ],
)
def test_what_makes_no_sense_is_named(mug, change, words):
    arguments = {"scale": 1.0, "n_samples": 10, **change}
    with pytest.raises(ValueError, match=words):
        semfm.find_grasps(mug.mesh, mug.region, "franka", **arguments)


def test_an_unknown_hand_is_told_the_known_ones():
    with pytest.raises(ValueError, match="robotiq-2f85"):
        semfm.Gripper("barrett")


def test_a_cloud_is_found_again(mug):
    mesh = mug.mesh
    turn = np.linalg.qr(np.array([[1.0, 0.3, 0.2], [-0.4, 1.0, 0.1], [0.2, -0.3, 1.0]]))[0]
    turn *= np.sign(np.linalg.det(turn))
    truth = np.eye(4)
    truth[:3, :3], truth[:3, 3] = 0.2 * turn, [0.02, -0.03, 0.6]
    points = mesh.vertices @ truth[:3, :3].T + truth[:3, 3]
    found = semfm.align(mesh, points, viewpoint=None, seed=0)
    assert found.verdict in ("accept", "check"), found.reasons
    assert found.scale == pytest.approx(0.2, rel=5e-3)
    placed = mesh.vertices @ found.camera_from_object[:3, :3].T + found.camera_from_object[:3, 3]
    assert np.abs(placed - points).max() < 2e-3
    np.testing.assert_allclose(found.rigid[:3, :3] * found.scale, found.camera_from_object[:3, :3])
