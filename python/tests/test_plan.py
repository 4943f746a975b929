"""`semfm.plan`: the motion of an arm to a grasp, as the shell finds it from the same files."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest
from browser import semfm_cli

import semfm

START = [0, -0.35, 0, 1.9, 0, 1.55, 0]
SRDF = """<robot name="synth_arm"><group name="arm"><chain base_link="base" tip_link="flange"/></group>
<group_state name="ready" group="arm">{}</group_state></robot>"""


@pytest.fixture(scope="module")
def demo(tmp_path_factory) -> Path:
    """The folder of the shell's demonstration: an arm, a table, a kettle with its grasps."""
    out = tmp_path_factory.mktemp("plan")
    done = subprocess.run([semfm_cli(), "demo", "-q", "-o", out], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return out


@pytest.fixture(scope="module")
def place(demo) -> np.ndarray:
    trajectory = json.loads((demo / "plan/trajectory.json").read_text())
    return np.array(trajectory["object"]["base_from_object"])


@pytest.fixture(scope="module")
def robot(demo) -> semfm.Robot:
    return semfm.Robot.from_urdf(demo / "arm.urdf", tip="flange")


@pytest.fixture(scope="module")
def asked(demo, place) -> dict:
    mesh, scene = demo / "containers_1_s0.obj", demo / "scene.json"
    return {"object": mesh, "base_from_object": place, "start": START, "scene": scene}


@pytest.fixture(scope="module")
def plan(demo, robot, asked) -> semfm.GraspPlan:
    return semfm.plan(robot, demo / "transfer/grasps.json", **asked)


def test_the_shell_finds_the_same_from_the_same_files(demo, place, plan):
    (demo / "place.json").write_text(json.dumps({"base_from_object": place.tolist()}))
    words = [
        "plan", "--robot", "arm.urdf", "--tip", "flange", "--grasps", "transfer/grasps.json",
        "--object", "containers_1_s0.obj", "--base-from-object", "place.json",
        "--start", ",".join(map(str, START)), "--scene", "scene.json", "-o", "by_shell",
    ]  # fmt: skip
    done = subprocess.run([semfm_cli(), *words], capture_output=True, text=True, cwd=demo)
    assert done.returncode == 0, done.stderr
    written = plan.write(demo / "by_python")
    by_shell = sorted(path.name for path in (demo / "by_shell").iterdir())
    assert sorted(Path(path).name for path in written) == by_shell
    assert {"plan.json", "trajectory.json", "trajectory.mcap", "motion.png"} <= set(by_shell)
    for name in by_shell:
        files = [demo / folder / name for folder in ("by_shell", "by_python")]
        assert files[0].read_bytes() == files[1].read_bytes(), name

    told = json.loads((demo / "by_shell/trajectory.json").read_text())
    assert plan.joint_names == told["joint_names"] and plan.grasp == told["grasp"]
    assert plan.notes == told["notes"] and any("acceleration" in note for note in plan.notes)
    assert [segment.kind for segment in plan.segments] == [s["kind"] for s in told["segments"]]
    for segment, from_shell in zip(plan.segments, told["segments"]):
        points = from_shell["points"]
        assert segment.times.tolist() == [point["time"] for point in points]
        assert segment.openings.tolist() == [point["opening"] for point in points]
        for name in ("positions", "velocities", "accelerations"):
            assert getattr(segment, name).tolist() == [point[name] for point in points], name
    assert plan.to_dict() == json.loads((demo / "by_shell/plan.json").read_text())


def test_the_motion_is_one_curve_within_limits(robot, plan):
    assert plan.duration > 1 and plan.n_replayed > 1000 * plan.duration
    segments = plan.segments
    assert segments[0].positions[0].tolist() == START
    for before, after in zip(segments, segments[1:]):
        assert before.times[-1] == after.times[0]
        assert before.positions[-1].tolist() == after.positions[0].tolist()
    times = np.linspace(0, plan.duration, 2000)
    states = plan.at(times)
    assert states["positions"].shape == (2000, 7) and states["openings"].shape == (2000,)
    low, high = robot.limits.T
    assert (states["positions"] >= low).all() and (states["positions"] <= high).all()
    assert (np.abs(states["velocities"]) <= 1.001 * robot.velocity_limits).all()
    assert (np.abs(states["accelerations"]) <= 1.001 * robot.acceleration_limits).all()
    moved = plan.at(times + 1e-6)["positions"] - states["positions"]
    np.testing.assert_allclose(moved[:-1] / 1e-6, states["velocities"][:-1], atol=1e-4)
    at_points = plan.at(segments[1].times)
    np.testing.assert_allclose(at_points["positions"], segments[1].positions, atol=1e-12)
    assert repr(plan).startswith("GraspPlan(grasp ") and "lift" in repr(plan)
    assert repr(segments[-1]).startswith("Segment(lift, ")


def test_grasps_of_this_process_need_no_file(demo, robot, asked, tmp_path):
    kettle = semfm.Mesh.read(demo / "containers_1_s0.obj")
    region = semfm.Region.read(demo / "transfer/region.json", kettle)
    told = json.loads((demo / "transfer/grasps.json").read_text())
    found = semfm.find_grasps(kettle, region, demo / "arm.urdf", scale=told["object_scale"])
    asked = {name: value for name, value in asked.items() if name != "object"}
    plan = semfm.plan(robot, found, **asked)
    assert plan.grasp is not None
    # Where the fingers close, the point between the pads is the grasp's.
    q = plan.segments[1].positions[-1]
    wanted = asked["base_from_object"] @ np.append(found[plan.grasp].position, 1)
    flange_from_tcp = np.array(found.to_dict()["grasps"][plan.grasp]["flange_from_tcp"])
    tcp = (robot.forward(q) @ flange_from_tcp)[:3, 3]
    assert np.linalg.norm(tcp - wanted[:3]) < 2e-3
    names = {Path(path).name for path in plan.write(tmp_path / "plan")}
    assert "planned_object.ply" in names, "nothing that the trajectory could name"
    page = tmp_path / "page.html"
    show = [semfm_cli(), "show", tmp_path / "plan", "-o", page]
    done = subprocess.run(show, capture_output=True, text=True)
    assert done.returncode == 0 and page.is_file(), done.stderr


def test_a_hand_that_is_not_in_the_description_is_in_the_bag(demo, robot, asked, tmp_path):
    rosbag2 = pytest.importorskip("rosbags.rosbag2")
    stores = pytest.importorskip("rosbags.typesys")
    store = stores.get_typestore(stores.Stores.ROS2_HUMBLE)
    kettle = semfm.Mesh.read(demo / "containers_1_s0.obj")
    region = semfm.Region.read(demo / "transfer/region.json", kettle)
    found = semfm.find_grasps(kettle, region, "franka", scale=0.24, n_samples=300)
    plan = semfm.plan(robot, found, **{**asked, "object": None})
    assert any("a hand of its own" in note for note in plan.notes)
    plan.write(tmp_path / "plan")
    with rosbag2.Reader(tmp_path / "plan") as reader:
        messages = list(reader.messages())
    for connection, _, _ in messages[:8]:
        # What the file says of a message is what every installation says.
        ours = stores.get_types_from_msg(connection.msgdef.data, connection.msgtype)
        assert all(fields == store.fielddefs[name] for name, fields in ours.items())
    (raw,) = [raw for connection, _, raw in messages if connection.topic == "/hand"]
    name = "visualization_msgs/msg/MarkerArray"
    hand = store.deserialize_cdr(raw, name)
    assert bytes(store.serialize_cdr(hand, name)) == bytes(raw)
    parts = {marker.header.frame_id: marker for marker in hand.markers}
    assert len(parts) == 7 and {marker.ns for marker in hand.markers} == {"franka"}
    assert all(m.type == 11 and m.frame_locked and len(m.points) == 36 for m in hand.markers)
    at_tip = set()
    for topic in ("/tf", "/tf_static"):
        first = next(raw for connection, _, raw in messages if connection.topic == topic)
        frames = store.deserialize_cdr(first, "tf2_msgs/msg/TFMessage").transforms
        at_tip |= {f.child_frame_id for f in frames if f.header.frame_id == "flange"}
    assert set(parts) <= at_tip


def test_what_cannot_be_done_is_an_answer_with_its_gates(demo, robot, asked, tmp_path):
    far = np.eye(4)
    far[0, 3] = 4
    grasps = demo / "transfer/grasps.json"
    plan = semfm.plan(robot, grasps, **{**asked, "base_from_object": far})
    assert plan.grasp is None and plan.segments == [] and plan.duration == 0
    (row,) = plan.gates
    assert row["gate"] == "reach" and row["n"] == len(plan.outcomes)
    assert row["obstruction"]["why"] == "unreachable" and row["obstruction"]["position"] > 1
    assert "mm" in row["text"]
    assert repr(plan) == f"GraspPlan(none of {row['n']} grasps: {row['n']} at reach stopped)"
    assert plan.picture()[:4] == b"\x89PNG" == plan._repr_png_()[:4]
    names = {Path(path).name for path in plan.write(tmp_path / "plan")}
    assert names == {"plan.json", "miss.png"}
    with pytest.raises(semfm.InvalidInput, match="motion"):
        plan.at([0.0])
    # What stands at the start is named, too.
    block = semfm.Scene().with_sphere("block", radius=0.1, position=robot.forward(START)[:3, 3])
    plan = semfm.plan(robot, grasps, **{**asked, "scene": block})
    assert plan.grasp is None
    assert plan.start_contact is None or "block" in (plan.start_contact["a"], plan.start_contact["b"])


def test_a_scene_is_built_as_its_file_has_it(demo, robot, asked, plan):
    table = semfm.Scene().with_table("table", point=[0, 0, -0.002])
    again = semfm.plan(robot, demo / "transfer/grasps.json", **{**asked, "scene": table})
    assert again.grasp == plan.grasp
    for one, other in zip(again.segments, plan.segments):
        np.testing.assert_array_equal(one.positions, other.positions)
    pose = np.eye(4)
    pose[2, 3] = 5
    scene = (
        table.with_box("box", size=[1, 1, 0.1], pose=pose)
        .with_cylinder("post", radius=0.1, length=1, pose=pose)
        .with_sphere("ball", radius=0.1, position=[0, 0, 9])
        .with_mesh("mesh", semfm.zoo.icosphere(1), scale=0.1, pose=pose)
        .with_cloud("cloud", np.ones((5, 3)) * 7, margin=0.01)
    )
    assert len(table) == 1 and len(scene) == 6
    assert scene.names == ["table", "box", "post", "ball", "mesh", "cloud"]
    assert repr(semfm.Scene.read(demo / "scene.json")) == "Scene(table)"
    for wrong in (
        lambda: scene.with_box("box", size=[1, 1, 1]),
        lambda: scene.with_box("b", size=[1, -1, 1]),
        lambda: scene.with_table("t", point=[0, 0, 0], normal=[0, 0, 0]),
        lambda: scene.with_sphere("s", radius=np.nan, position=[0, 0, 0]),
        lambda: semfm.Scene.read(demo / "none.json"),
    ):
        with pytest.raises(semfm.SemfmError):
            wrong()


def test_states_have_names_and_progress_may_stop(demo, asked):
    joints = "".join(f'<joint name="joint{i + 1}" value="{q}"/>' for i, q in enumerate(START))
    srdf = demo / "arm.srdf"
    srdf.write_text(SRDF.format(joints))
    robot = semfm.Robot.from_urdf(demo / "arm.urdf", srdf=srdf, tip="flange")
    grasps = demo / "transfer/grasps.json"
    for start in ("ready", None):
        plan = semfm.plan(robot, grasps, **{**asked, "start": start})
        assert plan.segments[0].positions[0].tolist() == START
    pose = robot.forward(START)
    near = robot.solve_ik(pose, near="ready")["solutions"][0]
    np.testing.assert_allclose(near, START, atol=1e-6)

    def stop(stage, done, total):
        raise RuntimeError(stage)

    with pytest.raises(RuntimeError):
        semfm.plan(robot, grasps, **asked, progress=stop)


def test_bad_input_says_what_is_wrong(demo, robot, asked):
    grasps = demo / "transfer/grasps.json"
    unnamed = semfm.Robot.from_urdf(demo / "arm.urdf")
    elbow = semfm.Robot.from_urdf(demo / "arm.urdf", tip="link4")
    scaled = np.diag([2.0, 2, 2, 1])
    for arguments, says in [
        (dict(robot=unnamed), "tip"),
        (dict(robot=elbow, start=START[:4]), "joint5"),
        (dict(base_from_object=None), "neither"),
        (dict(base_from_camera=np.eye(4)), "both"),
        (dict(base_from_object=None, base_from_camera=np.eye(4)), "camera"),
        (dict(base_from_object=scaled), "scale of 2"),
        (dict(start=START[:6]), r"\(7,\)"),
        (dict(start=[9, *START[1:]]), "joint1"),
        (dict(start="ready"), "ready"),
        (dict(start=None), "start"),
        (dict(object=semfm.zoo.icosphere(1)), "vertices"),
        (dict(speed=0.0), "speed"),
    ]:
        given = {"robot": robot, "grasps": grasps, **asked, **arguments}
        with pytest.raises(semfm.InvalidInput, match=says):
            semfm.plan(given.pop("robot"), given.pop("grasps"), **given)
    with pytest.raises(semfm.InvalidType, match="Grasps"):
        semfm.plan(robot, 3, **asked)
    with pytest.raises(semfm.InvalidType, match="Robot"):
        semfm.plan("arm.urdf", grasps, **asked)
    with pytest.raises(semfm.InvalidType, match="Scene"):
        semfm.plan(robot, grasps, **{**asked, "scene": 3})
    empty = json.loads(grasps.read_text()) | {"grasps": []}
    (demo / "empty.json").write_text(json.dumps(empty))
    with pytest.raises(semfm.InvalidInput, match="at least one"):
        semfm.plan(robot, demo / "empty.json", **asked)
