"""The folder of a plan as others read it: the bag with rosbags, the scene with Foxglove's schemas, the
animated model with trimesh and by its numbers, the page in a browser."""

from __future__ import annotations

import json
import math
import struct
import subprocess
from pathlib import Path

import numpy as np
import pytest
from browser import browser, probe, semfm_cli  # noqa: F401

#: Ends of the sample's segments in seconds, as `write_sample_motion.rs` has them.
ENDS = [0.0, 1.6, 2.3, 2.7, 3.5]


@pytest.fixture(scope="module")
def plan(tmp_path_factory) -> Path:
    """The folder of the sample motion that the example of semfm-show writes."""
    writer = Path(semfm_cli()).parent / "examples" / "write_sample_motion"
    if not writer.is_file():
        pytest.skip(f"no {writer}: cargo build -p semfm-show --example write_sample_motion")
    folder = tmp_path_factory.mktemp("motion")
    subprocess.run([writer, folder], check=True)
    return folder / "plan"


@pytest.fixture(scope="module")
def trajectory(plan) -> dict:
    return json.loads((plan / "trajectory.json").read_text())


def hermite(trajectory: dict, time: float) -> np.ndarray:
    """The joints at a time: the cubic between two points, as docs/formats.md tells."""
    points = [p for segment in trajectory["segments"] for p in segment["points"]]
    for a, b in zip(points, points[1:]):
        if a["time"] <= time <= b["time"] and b["time"] > a["time"]:
            h = b["time"] - a["time"]
            s = (time - a["time"]) / h
            q0, q1 = (np.array(p["positions"]) for p in (a, b))
            v0, v1 = (h * np.array(p["velocities"]) for p in (a, b))
            return (
                (2 * s**3 - 3 * s**2 + 1) * q0
                + (s**3 - 2 * s**2 + s) * v0
                + (3 * s**2 - 2 * s**3) * q1
                + (s**3 - s**2) * v1
            )
    raise AssertionError(time)


# The bag.


@pytest.fixture(scope="module")
def bag(plan):
    """Every message of the bag by topic, read by rosbags: [(nanoseconds, message)], and its
    connections."""
    rosbag2 = pytest.importorskip("rosbags.rosbag2")
    stores = pytest.importorskip("rosbags.typesys")
    store = stores.get_typestore(stores.Stores.ROS2_HUMBLE)
    messages, connections = {}, {}
    with rosbag2.Reader(plan) as reader:
        for connection in reader.connections:
            connections[connection.topic] = connection
            # What the file says of a message is what every installation says.
            ours = stores.get_types_from_msg(connection.msgdef.data, connection.msgtype)
            for name, fields in ours.items():
                assert fields == store.fielddefs[name], name
        for connection, time, raw in reader.messages():
            message = store.deserialize_cdr(raw, connection.msgtype)
            assert bytes(store.serialize_cdr(message, connection.msgtype)) == bytes(raw)
            messages.setdefault(connection.topic, []).append((time, message))
        about = (reader.start_time, reader.duration, reader.message_count)
    return messages, connections, about


def test_the_bag_has_its_topics_and_the_metadata_counts_them(bag):
    messages, connections, (start, duration, count) = bag
    assert {topic: c.msgtype for topic, c in connections.items()} == {
        "/robot_description": "std_msgs/msg/String",
        "/tf_static": "tf2_msgs/msg/TFMessage",
        "/joint_trajectory": "trajectory_msgs/msg/JointTrajectory",
        "/gripper_trajectory": "trajectory_msgs/msg/JointTrajectory",
        "/joint_states": "sensor_msgs/msg/JointState",
        "/tf": "tf2_msgs/msg/TFMessage",
    }
    assert {t: c.msgcount for t, c in connections.items()} == {t: len(m) for t, m in messages.items()}
    assert count == sum(map(len, messages.values()))
    assert start == 1_000_000_000 and abs(duration - 3.5e9) <= 1
    assert len(messages["/joint_states"]) == 351
    assert all(len(messages[t]) == 1 for t in ("/robot_description", "/tf_static"))


def test_late_subscribers_get_the_description_and_the_static_frames(bag):
    _, connections, _ = bag
    kept = {"/robot_description", "/tf_static", "/joint_trajectory", "/gripper_trajectory"}
    for topic, connection in connections.items():
        (profile,) = connection.ext.offered_qos_profiles
        assert profile.reliability.name == "RELIABLE"
        wanted = "TRANSIENT_LOCAL" if topic in kept else "VOLATILE"
        assert profile.durability.name == wanted, topic


def test_a_controller_takes_the_trajectory(bag, trajectory):
    ((_, arm),) = bag[0]["/joint_trajectory"]
    assert arm.joint_names == trajectory["joint_names"]
    assert (arm.header.stamp.sec, arm.header.stamp.nanosec) == (0, 0)
    nanos = [p.time_from_start.sec * 10**9 + p.time_from_start.nanosec for p in arm.points]
    assert nanos[0] == 0 and all(b > a for a, b in zip(nanos, nanos[1:]))
    start = trajectory["segments"][0]["points"][0]
    np.testing.assert_array_equal(arm.points[0].positions, start["positions"])
    assert (arm.points[-1].velocities == 0.0).all()
    for time, point in zip(nanos, arm.points):
        np.testing.assert_allclose(point.positions, hermite(trajectory, time / 1e9), atol=1e-8)
        assert len(point.velocities) == len(point.accelerations) == 3 and len(point.effort) == 0
    ((_, fingers),) = bag[0]["/gripper_trajectory"]
    assert fingers.joint_names == ["left_finger"]
    positions = [float(p.positions[0]) for p in fingers.points]
    assert positions[0] == pytest.approx(0.035) and positions[-1] == pytest.approx(0.02)


def test_joint_states_follow_the_curve_at_a_hundred_hertz(bag, trajectory):
    names = ["turn", "pitch", "slide", "left_finger", "right_finger"]
    times = [time - 10**9 for time, _ in bag[0]["/joint_states"]]
    assert max(b - a for a, b in zip(times, times[1:])) <= 10_000_001
    before = None
    for time, state in bag[0]["/joint_states"]:
        assert state.name == names
        stamp = state.header.stamp.sec * 10**9 + state.header.stamp.nanosec
        assert stamp == time
        seconds = (time - 10**9) / 1e9
        np.testing.assert_allclose(state.position[:3], hermite(trajectory, seconds), atol=1e-8)
        assert state.position[3] == state.position[4]
        if before is not None:
            mean = (state.position - before.position) / 0.01
            # The finger's speed steps where closing begins and ends.
            np.testing.assert_allclose(mean[:3], (state.velocity + before.velocity)[:3] / 2, atol=2e-3)
        before = state
    closing = [s.velocity[3] for t, s in bag[0]["/joint_states"] if 2.4e9 < t - 10**9 < 2.6e9]
    np.testing.assert_allclose(closing, -0.015 / 0.4, atol=1e-9)


def frames_at(bag, index: int) -> dict:
    """The pose of each frame in the root's at a sample, from /tf_static and /tf."""
    (_, static), (_, moving) = bag[0]["/tf_static"][0], bag[0]["/tf"][index]
    parents = {t.child_frame_id: t for t in [*static.transforms, *moving.transforms]}

    def pose(frame: str) -> np.ndarray:
        if frame not in parents:
            return np.eye(4)
        t = parents[frame].transform
        x, y, z, w = t.rotation.x, t.rotation.y, t.rotation.z, t.rotation.w
        assert math.isclose(math.hypot(x, y, z, w), 1, abs_tol=1e-12)
        rotation = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
        here = np.eye(4)
        here[:3, :3] = rotation
        here[:3, 3] = t.translation.x, t.translation.y, t.translation.z
        return pose(parents[frame].header.frame_id) @ here

    return {frame: pose(frame) for frame in parents}


def hand_of(joints) -> np.ndarray:
    """The sample's hand in its base, by hand: turn about z, pitch about y, slide along z."""
    turn, pitch, slide = joints
    c, s = math.cos(turn), math.sin(turn)
    about_z = np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0.1], [0, 0, 0, 1.0]])
    c, s = math.cos(pitch), math.sin(pitch)
    about_y = np.array([[c, 0, s, 0], [0, 1, 0, 0], [-s, 0, c, 0.1], [0, 0, 0, 1.0]])
    along = np.eye(4)
    along[2, 3] = 0.3 + slide + 0.12
    return about_z @ about_y @ along


def test_frames_move_as_the_joints_do_and_the_object_goes_with_the_hand(bag, trajectory):
    in_hand = []
    for index in (0, 100, 200, 290, 350):
        frames = frames_at(bag, index)
        expected = hand_of(hermite(trajectory, index / 100))
        np.testing.assert_allclose(frames["hand"], expected, atol=1e-9)
        in_hand.append(np.linalg.inv(frames["hand"]) @ frames["object"])
    np.testing.assert_allclose(in_hand[3], in_hand[4], atol=1e-9)
    assert np.abs(in_hand[0] - in_hand[2]).max() > 0.05


def test_the_description_is_the_file(bag, plan):
    ((_, text),) = bag[0]["/robot_description"]
    assert text.data == (plan.parent / "sample.urdf").read_text()


# The scene for Foxglove.


def test_foxglove_sees_every_link_in_a_frame_that_moves(plan, trajectory):
    pytest.importorskip("mcap_protobuf")
    from foxglove_files import read

    scene = read(plan / "scene.mcap")
    assert scene.types == {
        "/tf": "foxglove.FrameTransform",
        "/robot": "foxglove.SceneUpdate",
        "/object": "foxglove.SceneUpdate",
        "/obstacles": "foxglove.SceneUpdate",
        "/joint_states": "foxglove.JointStates",
        "/segments": "foxglove.Log",
    }
    links = {"base", "shoulder", "upper", "fore", "hand", "left", "right"}
    for topic, names in {
        "/robot": links,
        "/object": {"object"},
        "/obstacles": {"crate", "table"},
    }.items():
        (update,) = scene.messages[topic]
        assert {e.frame_id for e in update.entities} == {e.id for e in update.entities} == names
        for entity in update.entities:
            assert entity.frame_locked
            (mesh,) = entity.triangles
            assert len(mesh.indices) % 3 == 0 and max(mesh.indices) < len(mesh.points)
    frames = {t.child_frame_id for t in scene.messages["/tf"]}
    assert frames == links - {"base"} | {"object", "crate", "table"}
    moved = [t.child_frame_id for t in scene.messages["/tf"]]
    assert moved.count("upper") == 176 and moved.count("hand") == 1
    assert [log.message for log in scene.messages["/segments"]] == [
        segment["kind"] for segment in trajectory["segments"]
    ]
    last = scene.messages["/joint_states"][-1]
    assert [joint.name for joint in last.joints] == trajectory["joint_names"]
    np.testing.assert_allclose(
        [joint.position for joint in last.joints], hermite(trajectory, 3.5), atol=1e-9
    )


# The animated model.


def gltf(path: Path) -> tuple[dict, bytes]:
    """The JSON and the buffer of a GLB, its lengths checked."""
    data = path.read_bytes()
    magic, version, total = struct.unpack_from("<4sII", data)
    assert (magic, version, total) == (b"glTF", 2, len(data))
    length, kind = struct.unpack_from("<I4s", data, 12)
    assert kind == b"JSON" and length % 4 == 0
    root = json.loads(data[20 : 20 + length])
    size, kind = struct.unpack_from("<I4s", data, 20 + length)
    assert kind == b"BIN\0" and 28 + length + size == len(data)
    assert root["buffers"] == [{"byteLength": size}]
    return root, data[28 + length :]


def array(root: dict, data: bytes, accessor: int) -> np.ndarray:
    about = root["accessors"][accessor]
    view = root["bufferViews"][about["bufferView"]]
    width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[about["type"]]
    dtype = {5126: "<f4", 5125: "<u4"}[about["componentType"]]
    count = about["count"] * width
    assert view["byteLength"] == 4 * count and view["byteOffset"] % 4 == 0
    return np.frombuffer(data, dtype, count, view["byteOffset"]).reshape(-1, width)


def test_the_model_moves_as_the_trajectory_does(plan, trajectory):
    root, data = gltf(plan / "motion.glb")
    names = [node["name"] for node in root["nodes"]]
    (animation,) = root["animations"]
    tracks = {}
    for channel in animation["channels"]:
        sampler = animation["samplers"][channel["sampler"]]
        times = array(root, data, sampler["input"])[:, 0]
        values = array(root, data, sampler["output"])
        assert len(times) == len(values) and (np.diff(times) > 0).all()
        tracks[names[channel["target"]["node"]], channel["target"]["path"]] = (times, values)
    assert set(tracks) == {
        ("shoulder", "rotation"),
        ("upper", "rotation"),
        ("fore", "translation"),
        ("left", "translation"),
        ("right", "translation"),
        ("object", "rotation"),
        ("object", "translation"),
    }
    times, turns = tracks["shoulder", "rotation"]
    for time, (x, y, z, w) in zip(times, turns):
        assert abs(math.hypot(x, y, z, w) - 1) < 1e-6
        assert abs(2 * math.atan2(z, w) - hermite(trajectory, min(time, 3.5))[0]) < 1e-5
    times, slides = tracks["fore", "translation"]
    for time, (_, _, z) in zip(times, slides):
        assert abs(z - 0.3 - hermite(trajectory, min(time, 3.5))[2]) < 1e-6
    for about in root["accessors"]:
        if "min" in about and about["type"] == "VEC3":
            values = array(root, data, root["accessors"].index(about))
            np.testing.assert_array_equal(values.min(0), np.float32(about["min"]))
            np.testing.assert_array_equal(values.max(0), np.float32(about["max"]))


def test_trimesh_reads_the_model_with_its_nodes(plan):
    trimesh = pytest.importorskip("trimesh")
    scene = trimesh.load(plan / "motion.glb")
    nodes = set(scene.graph.nodes_geometry)
    links = {"base", "shoulder", "upper", "fore", "hand", "left", "right"}
    assert links | {"object", "crate", "table"} == nodes
    # z up became y up: the table is flat in y.
    low, high = scene.bounds
    assert low[1] == pytest.approx(0, abs=1e-6) and 0.5 < high[1] < 0.9
    moved, _ = scene.graph.get("hand")
    x, y, z, _ = hand_of([-1.2, 0.2, 0.0])[:, 3]
    np.testing.assert_allclose(moved[:3, 3], [x, z, -y], atol=1e-6)


# The page.


@pytest.mark.full
def test_the_slider_moves_a_link(browser, plan, tmp_path):  # noqa: F811
    page = tmp_path / "motion.html"
    for shown in (plan / "trajectory.json", plan):
        done = subprocess.run([semfm_cli(), "show", shown, "-o", page], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
    body = """
    const [[panel]] = await window.semfmReady;
    const { controls } = panel, motion = panel.hands;
    await frame(); await frame();
    const pixels = () => panel.canvas.getContext("2d").getImageData(0, 0, panel.canvas.width, panel.canvas.height).data;
    const drawn = async () => { await frame(); await frame(); return pixels().slice(); };
    const differ = (a, b) => { let n = 0; for (let i = 0; i < a.length; i += 4) if (Math.abs(a[i] - b[i]) > 8) n++; return n; };
    const index = motion.data.bodies.findIndex(({ name }) => name === "upper");
    const place = () => motion.placeOf(motion.bodies[index], motion.time);
    const slide = value => { controls.slider.value = value; controls.slider.dispatchEvent(new Event("input")); };
    const told = { bodies: motion.data.bodies.map(b => b.name), start: place() };
    const first = await drawn();
    slide(1.6);
    told.later = place();
    told.text = [controls.clock.textContent, panel.output.textContent, controls.slider.getAttribute("aria-valuetext")];
    told.changed = differ(first, await drawn());
    slide(0);
    told.back = differ(first, await drawn());
    told.joints = [...document.querySelectorAll(".motion td")].map(cell => cell.textContent);
    controls.segmentButtons[2].click();
    told.closing = [motion.time, controls.opening.textContent, controls.segmentButtons[2].getAttribute("aria-pressed")];
    controls.slider.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowRight" }));
    told.stepped = motion.time;
    // A drag over a chart.
    const svg = document.querySelector(".chart svg"), box = svg.getBoundingClientRect();
    svg.dispatchEvent(new PointerEvent("pointerdown", { pointerId: 5, clientX: box.left + box.width * 0.999, clientY: box.top + 20, buttons: 1 }));
    told.end = motion.time;
    panel.canvas.dispatchEvent(new KeyboardEvent("keydown", { key: " ", bubbles: true }));
    told.playing = controls.isPlaying;
    await new Promise(done => setTimeout(done, 700));
    controls.playButton.click();
    told.stopped = [controls.isPlaying, motion.time];
    told.charts = [...document.querySelectorAll(".chart")].map(c => [c.textContent.slice(0, 9), c.querySelectorAll(".line").length]);
    told.loaded = performance.getEntriesByType("resource").map(e => e.name).filter(name => !name.startsWith("data:"));
    told.gl = panel.painter.gl.getError();
    return told;
    """
    told, console = probe(browser, page, body)
    ours = ("GPU stall", "Multiple readback", "willReadFrequently")
    assert [line for line in console if not any(word in line for word in ours)] == []
    assert told["loaded"] == [] and told["gl"] == 0
    assert {"shoulder", "upper", "fore", "hand", "left", "right", "object", "table"} == set(told["bodies"])
    a, b = np.reshape(told["start"], (3, 4)), np.reshape(told["later"], (3, 4))
    assert np.linalg.norm(a[:, 3] - b[:, 3]) > 0.1 and abs(a - b).max() > 0.3
    assert told["changed"] > 3000 and told["back"] == 0
    assert told["text"][0].startswith("1.60 of 3.50 s") and "approach" in told["text"][1]
    assert told["joints"][0] == f"{math.degrees(-1.2):.1f}°" and "mm" in told["joints"][4]
    assert told["closing"][0] == pytest.approx(2.3) and told["closing"][1:] == ["70.0 mm", "true"]
    assert told["stepped"] == pytest.approx(2.32) and told["end"] == pytest.approx(3.5)
    assert told["playing"] and not told["stopped"][0] and 0 < told["stopped"][1] < 3.5
    assert told["charts"] == [["positions", 2], ["speedsrad", 2], ["positions", 1], ["speedsm/s", 1]]
