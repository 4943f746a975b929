"""`semfm.Robot`: an arm out of its files, forward and inverse kinematics; the same at the shell."""

from __future__ import annotations

import copy
import json
import os
import pickle
from pathlib import Path

import numpy as np
import pytest
from small_arm import write_arm

import semfm
from semfm import _semfm

SHARED = Path(os.environ.get("SEMFM_SHARED") or Path(__file__).parents[3] / "shared")
ARMS = {
    "panda": "data/robots/panda/urdf/panda_local.urdf",
    "panda of MoveIt": "data/arms/moveit_panda/panda_description/urdf/panda.urdf",
    "ur5": "data/robots/ur5/urdf/ur5_local.urdf",
    "ur5e": "data/robots/ur5e/urdf/ur5e_local.urdf",
    "gen3": "data/arms/roboplan/kinova_robot_model/kinova_robotiq.urdf",
}


@pytest.fixture
def urdf(tmp_path):
    return write_arm(tmp_path)


@pytest.fixture
def robot(urdf):
    beside = {"srdf": urdf.with_suffix(".srdf"), "limits": urdf.with_name("joint_limits.yaml")}
    return semfm.Robot.from_urdf(urdf, **beside)


def test_what_the_files_say(robot):
    assert robot.joint_names == [f"j{i}" for i in range(1, 7)]
    assert (robot.name, robot.base, robot.tip, robot.n_joints) == ("small", "base", "flange", 6)
    assert robot.limits.tolist() == [[-2.9, 2.9]] * 6
    assert robot.velocity_limits.tolist() == [1.5] + [2.0] * 5
    assert robot.acceleration_limits.tolist() == [4.0] + [1.0] * 5
    assert np.allclose(robot.state("ready"), np.arange(1, 7) * 0.1)
    assert any("acceleration limit 1.0 assumed" in note for note in robot.notes)
    assert repr(robot) == "Robot(small, 6 joints from base to flange)"


def test_poses_and_jacobian_agree(urdf, robot):
    q = np.linspace(-1, 1, 6)
    poses = semfm.Robot.from_urdf(urdf, tip="flange", fixed={"slide": 0.03}).link_poses(q)
    assert np.allclose(poses["flange"], robot.forward(q), atol=1e-14)
    apart = np.linalg.inv(poses["flange"]) @ poses["finger"]
    assert np.allclose(apart[:3, 3], [0, 0.03, 0.05], atol=1e-14)
    jacobian, step = robot.jacobian(q), 1e-6
    for i in range(6):
        by = step * np.eye(6)[i]
        numeric = (robot.forward(q + by) - robot.forward(q - by)) / (2 * step)
        assert np.allclose(jacobian[:3, i], numeric[:3, 3], atol=1e-8)
        spin = numeric[:3, :3] @ robot.forward(q)[:3, :3].T
        assert np.allclose(jacobian[3:, i], [spin[2, 1], spin[0, 2], spin[1, 0]], atol=1e-8)
    assert np.isclose(robot.manipulability(q), abs(np.linalg.det(jacobian)))


def test_solutions_reach_the_pose(robot):
    q = np.array([0.3, 0.4, -0.8, 0.5, 0.7, -0.6])
    pose = robot.forward(q)
    answer = robot.solve_ik(pose, near=q)
    assert np.array_equal(answer["solutions"][0], q) and answer["closest"] is None
    for found in answer["solutions"]:
        assert np.allclose(robot.forward(found), pose, atol=2e-6)
    again = robot.solve_ik(pose, near=q)
    assert np.array_equal(answer["solutions"], again["solutions"])
    few = robot.solve_ik(pose, solutions=1, preference="limits")
    assert few["solutions"].shape == (1, 6)


def test_what_cannot_be_reached_is_told(robot):
    far = np.eye(4)
    far[0, 3] = 5.0
    answer = robot.solve_ik(far)
    assert answer["solutions"].shape == (0, 6) and answer["tries"] == 51
    assert 3.0 < answer["closest"]["position_error"] < 5.0


def test_bad_input_is_refused(urdf, robot):
    with pytest.raises(semfm.errors.InvalidInput, match="did you mean `flange`"):
        semfm.Robot.from_urdf(urdf, tip="flang")
    with pytest.raises(semfm.errors.SemfmError):
        semfm.Robot.from_urdf(urdf.with_name("none.urdf"))
    for pose in (np.zeros((4, 4)), 2 * np.eye(4), np.diag([2.0, 2.0, 2.0, 1.0]), np.eye(3)):
        with pytest.raises(semfm.errors.InvalidInput):
            robot.solve_ik(pose)
    with pytest.raises(semfm.errors.InvalidInput, match="restarts"):
        robot.solve_ik(np.eye(4), restarts=10**9)
    with pytest.raises(semfm.errors.InvalidInput, match="manipulability"):
        robot.solve_ik(np.eye(4), preference="best")
    with pytest.raises(semfm.errors.InvalidInput):
        robot.forward(np.zeros(5))
    with pytest.raises(semfm.errors.InvalidInput, match="did you mean `ready`"):
        robot.state("redy")


def test_robots_can_be_pickled_and_copied(robot):
    for again in (pickle.loads(pickle.dumps(robot)), copy.copy(robot), copy.deepcopy(robot)):
        assert repr(again) == repr(robot)
        assert np.array_equal(again.velocity_limits, robot.velocity_limits)


def test_the_shell_gives_the_same_solutions(urdf, robot, capfd):
    q = [0.3, 0.4, -0.8, 0.5, 0.7, -0.6]
    pose = robot.forward(q)
    matrix = urdf.with_name("pose.json")
    matrix.write_text(json.dumps(pose.tolist()))
    near = ",".join(map(str, q))
    files = ["--srdf", str(urdf.with_suffix(".srdf"))]
    call = ["ik", str(urdf), "--pose", str(matrix), *files, "--near", near, "--json"]
    assert _semfm.run_cli(call) == 0
    told = json.loads(capfd.readouterr().out)
    ours = robot.solve_ik(pose, near=q)["solutions"]
    assert np.array_equal([each["positions"] for each in told["solutions"]], ours)
    assert (told["base"], told["tip"]) == ("base", "flange")
    away = ["ik", str(urdf), "--tip", "flange", "--pose", "5,0,0,0,0,0"]
    assert _semfm.run_cli(away) == 1
    told = capfd.readouterr()
    assert told.out == "" and "no solution in 51 tries" in told.err


def test_the_shell_tells_joints_and_limits(urdf, capfd):
    assert _semfm.run_cli(["info", str(urdf), "--json"]) == 0
    arm = json.loads(capfd.readouterr().out)["arm"]
    assert (arm["base"], arm["tip"], len(arm["joints"])) == ("base", "flange", 6)
    assert arm["joints"][0]["upper"] == 2.9 and any("assumed" in note for note in arm["assumed"])
    assert _semfm.run_cli(["info", str(urdf)]) == 0
    assert "revolute, -2.9 to 2.9; velocity 2, acceleration 1" in capfd.readouterr().out


def random_positions(robot, generator):
    low, high = np.clip(robot.limits, -2 * np.pi, 2 * np.pi).T
    return generator.uniform(low, high)


@pytest.mark.full
@pytest.mark.parametrize("name", ARMS)
def test_forward_kinematics_and_jacobian_are_those_of_pinocchio(name):
    pin = pytest.importorskip("pinocchio")
    path = SHARED / ARMS[name]
    if not path.exists():
        pytest.skip(f"no shared data at {path}")
    robot = semfm.Robot.from_urdf(path)
    model = pin.buildModelFromUrdf(str(path))
    data, tip = model.createData(), model.getFrameId(robot.tip)
    joints = [model.joints[model.getJointId(joint)] for joint in robot.joint_names]
    ours = {joint.id for joint in joints}
    # Frames that nothing but our joints moves.
    frames = [
        frame
        for frame in range(model.nframes)
        if model.frames[frame].type == pin.FrameType.BODY
        and set(model.supports[model.frames[frame].parentJoint]) - {0} <= ours
    ]
    assert len(frames) > robot.n_joints
    generator = np.random.default_rng(0)
    for _ in range(50):
        q = random_positions(robot, generator)
        full = pin.neutral(model)
        for joint, position in zip(joints, q):
            on_circle = (np.cos(position), np.sin(position))
            full[joint.idx_q : joint.idx_q + joint.nq] = position if joint.nq == 1 else on_circle
        pin.framesForwardKinematics(model, data, full)
        poses = robot.link_poses(q)
        for frame in frames:
            theirs = data.oMf[frame].homogeneous
            assert np.abs(poses[model.frames[frame].name] - theirs).max() < 1e-12
        assert np.abs(robot.forward(q) - data.oMf[tip].homogeneous).max() < 1e-12
        whole = pin.computeFrameJacobian(model, data, full, tip, pin.LOCAL_WORLD_ALIGNED)
        theirs = whole[:, [joint.idx_v for joint in joints]]
        assert np.abs(robot.jacobian(q) - theirs).max() < 1e-12
