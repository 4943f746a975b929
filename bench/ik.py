"""Inverse kinematics beside optik and TRAC-IK, judged by pinocchio.

    pip install . pin optik-py pytracik xacro
    python bench/ik.py [--poses 1000] [--branch-poses 200] [--shared ../shared] [--robots panda ur5e]

For each arm, random joint values within limits give poses that can be reached; every solver begins at
the same random joint values and may begin anew 50 times (TRAC-IK knows no count: it has 50 ms on the
clock, and two threads; the others have one). An answer counts where pinocchio's forward kinematics puts
the tip within 5e-6 m and 5e-6 rad of the pose and every joint is within limits; an answer given that does
not count is listed as disowned. Times are CPU milliseconds of a call from Python, the solvers taking turns.

Then, for the arms of Universal Robots, all branches: those that the closed form knows (two shoulders, two
wrists, two elbows; Hawkins 2013, "Analytic inverse kinematics for the Universal Robots UR-5/UR-10 arms")
must each be found, for poses at which none of them is near a singular position.
"""

import argparse
import itertools
import os
import statistics
import tempfile
import time
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import optik
import pinocchio as pin
import pytracik

import semfm

RESTARTS = 50
TRAC_SECONDS = 0.05
TOLERANCE = 5e-6
#: Of optik's objective, which is a square.
OPTIK_TOLERANCE = 1e-12
#: What the solvers allow on each coordinate.
TRAC_TOLERANCE = 1e-6
#: File, base, tip.
ROBOTS = {
    "panda": ("data/robots/panda/urdf/panda_local.urdf", "panda_link0", "panda_link8"),
    "fr3": ("data/arms/roboplan/franka_robot_model/fr3.urdf", "fr3_link0", "fr3_link8"),
    "ur5": ("data/robots/ur5/urdf/ur5_local.urdf", "base_link", "tool0"),
    "ur5e": ("data/robots/ur5e/urdf/ur5e_local.urdf", "base_link", "tool0"),
    "gen3": ("data/arms/roboplan/kinova_robot_model/kinova_robotiq.urdf", "base_link", "end_effector_link"),
}
#: d1, a2, a3, d4, d5, d6 of Denavit and Hartenberg, metres, by the maker.
UNIVERSAL = {
    "ur5": (0.089159, -0.425, -0.39225, 0.10915, 0.09465, 0.0823),
    "ur5e": (0.1625, -0.425, -0.3922, 0.1333, 0.0997, 0.0996),
}
#: How far the closed form's positions may be from ours, radians: descriptions round the maker's lengths.
SAME = 0.05
#: Below this, sines of wrist and elbow and the shoulder's clearance make a pose singular.
SINGULAR = 0.05


class Judge:
    """Forward kinematics by pinocchio."""

    def __init__(self, path, robot):
        self.model = pin.buildModelFromUrdf(str(path))
        self.data = self.model.createData()
        self.joints = [self.model.joints[self.model.getJointId(name)] for name in robot.joint_names]
        self.base, self.tip = (self.model.getFrameId(name) for name in (robot.base, robot.tip))
        self.limits = robot.limits

    def pose(self, q):
        full = pin.neutral(self.model)
        for joint, position in zip(self.joints, q):
            # A continuous joint is a point on a circle.
            full[joint.idx_q : joint.idx_q + joint.nq] = (
                position if joint.nq == 1 else (np.cos(position), np.sin(position))
            )
        pin.framesForwardKinematics(self.model, self.data, full)
        base, tip = self.data.oMf[self.base], self.data.oMf[self.tip]
        return (base.inverse() * tip).homogeneous

    def holds(self, q, pose):
        low, high = self.limits.T
        if np.any(q < low - 1e-9) or np.any(q > high + 1e-9):
            return False
        found = self.pose(q)
        angle = np.linalg.norm(pin.log3(found[:3, :3].T @ pose[:3, :3]))
        return np.linalg.norm(found[:3, 3] - pose[:3, 3]) <= TOLERANCE and angle <= TOLERANCE


def expanded(path):
    """A URDF without xacro: FR3 comes as a source."""
    if "xacro:" not in path.read_text():
        return path
    import xacro

    here = Path.cwd()
    os.chdir(path.parent)  # its includes are relative
    try:
        text = xacro.process_file(path.name).toprettyxml(indent=" ")
    finally:
        os.chdir(here)
    out = Path(tempfile.mkdtemp()) / path.name
    out.write_text(text)
    return out


def without_continuous(path):
    """A URDF for optik, which knows no continuous joints: they may turn once to either side."""
    tree = ElementTree.parse(path)
    for joint in tree.iterfind("joint[@type='continuous']"):
        joint.set("type", "revolute")
        limit = joint.find("limit")
        limit = ElementTree.SubElement(joint, "limit") if limit is None else limit
        limit.set("lower", str(-2 * np.pi))
        limit.set("upper", str(2 * np.pi))
    out = Path(tempfile.mkdtemp()) / path.name
    tree.write(out)
    return out


def solvers(path, robot):
    """Name and function of pose and start that gives joint values or None."""

    def ours(pose, near):
        answer = robot.solve_ik(pose, near=near, solutions=1, restarts=RESTARTS)
        return next(iter(answer["solutions"]), None)

    yield "semfm", ours

    theirs = optik.Robot.from_urdf_file(str(without_continuous(path)), robot.base, robot.tip)
    theirs.set_parallelism(1)
    config = optik.SolverConfig(
        solution_mode="speed", max_time=0.0, max_restarts=RESTARTS, tol_f=OPTIK_TOLERANCE
    )

    def by_optik(pose, near):
        low, high = (np.array(side) for side in theirs.joint_limits())
        found = theirs.ik(config, pose.tolist(), np.clip(near, low, high).tolist())
        return None if found is None else np.array(found[0])

    yield "optik", by_optik

    tracik = pytracik.TRAC_IK(
        robot.base, robot.tip, path.read_text(), TRAC_SECONDS, TRAC_TOLERANCE, pytracik.SolveType.Speed
    )
    # It reads limits of 0 from joints without a safety controller.
    sides = (pytracik.get_joint_lower_bounds(tracik), pytracik.get_joint_upper_bounds(tracik))
    sides = [np.where(np.isfinite(ours), ours, side) for ours, side in zip(robot.limits.T, sides)]
    pytracik.set_joint_limits(tracik, *(side.tolist() for side in sides))

    def by_tracik(pose, near):
        x, y, z, w = pin.Quaternion(pose[:3, :3]).coeffs()
        found = pytracik.ik(tracik, near, *pose[:3, 3], x, y, z, w)
        return found[1:] if found[0] >= 0 else None

    yield "TRAC-IK", by_tracik


def random_positions(robot, generator):
    low, high = np.clip(robot.limits, -2 * np.pi, 2 * np.pi).T
    return generator.uniform(low, high)


def compare(name, path, robot, n_poses):
    judge, generator = Judge(path, robot), np.random.default_rng(0)
    calls = dict(solvers(path, robot))
    times = {solver: [] for solver in calls}
    solved = dict.fromkeys(calls, 0)
    disowned = dict.fromkeys(calls, 0)
    for _ in range(n_poses):
        pose = judge.pose(random_positions(robot, generator))
        near = random_positions(robot, generator)
        for solver, call in calls.items():
            start = time.process_time()
            q = call(pose, near)
            times[solver].append(1e3 * (time.process_time() - start))
            if q is not None:
                holds = judge.holds(q, pose)
                solved[solver] += holds
                disowned[solver] += not holds
    for solver in calls:
        median, p95 = statistics.median(times[solver]), np.percentile(times[solver], 95)
        share = 100 * solved[solver] / n_poses
        print(
            f"| {name} | {solver} | {share:.1f} % | {disowned[solver]} | {median:.3f} | {p95:.3f} "
            f"| {statistics.mean(times[solver]):.3f} |",
            flush=True,
        )


def dh(theta, d, a, alpha):
    ct, st, ca, sa = np.cos(theta), np.sin(theta), np.cos(alpha), np.sin(alpha)
    return np.array(
        [[ct, -st * ca, st * sa, a * ct], [st, ct * ca, -ct * sa, a * st], [0, sa, ca, d], [0, 0, 0, 1]]
    )


def closed_form(lengths, pose):
    """All branches of an arm of Universal Robots, and the least of the numbers that vanish at singular positions."""
    d1, a2, a3, d4, d5, d6 = lengths
    branches, least = [], np.inf
    wrist = pose @ [0, 0, -d6, 1]
    radius = np.hypot(wrist[0], wrist[1])
    if radius < abs(d4):
        return [], 0.0
    least = min(least, np.sqrt(1 - (d4 / radius) ** 2))
    for shoulder, turn in itertools.product((1, -1), (1, -1)):
        q1 = np.arctan2(wrist[1], wrist[0]) + shoulder * np.arccos(d4 / radius) + np.pi / 2
        s1, c1 = np.sin(q1), np.cos(q1)
        cosine = (pose[0, 3] * s1 - pose[1, 3] * c1 - d4) / d6
        if abs(cosine) > 1:
            least = min(least, abs(cosine) - 1)
            continue
        q5 = turn * np.arccos(cosine)
        least = min(least, abs(np.sin(q5)))
        inverse = np.linalg.inv(pose)
        sign = np.sign(np.sin(q5))
        q6 = np.arctan2(
            sign * (-inverse[1, 0] * s1 + inverse[1, 1] * c1), sign * (inverse[0, 0] * s1 - inverse[0, 1] * c1)
        )
        first, last = dh(q1, d1, 0, np.pi / 2), dh(q5, d5, 0, -np.pi / 2) @ dh(q6, d6, 0, 0)
        middle = np.linalg.inv(first) @ pose @ np.linalg.inv(last)
        p = middle @ [0, -d4, 0, 1]
        reach = np.linalg.norm(p[:3])
        cosine = (reach**2 - a2**2 - a3**2) / (2 * a2 * a3)
        if abs(cosine) > 1:
            least = min(least, abs(cosine) - 1)
            continue
        for elbow in (1, -1):
            q3 = elbow * np.arccos(cosine)
            least = min(least, abs(np.sin(q3)))
            q2 = np.arctan2(p[1], p[0]) - np.arctan2(a3 * np.sin(q3), a2 + a3 * np.cos(q3))
            rest = np.linalg.inv(dh(q2, 0, a2, 0) @ dh(q3, 0, a3, 0)) @ middle
            q4 = np.arctan2(rest[1, 0], rest[0, 0])
            branches.append(np.array([q1, q2, q3, q4, q5, q6]))
    return branches, least


def apart(a, b):
    """The greatest difference of a joint, whole turns aside."""
    return np.abs((a - b + np.pi) % (2 * np.pi) - np.pi).max()


def branches(name, path, n_poses):
    """Share of poses of which every branch is found."""
    robot = semfm.Robot.from_urdf(path, base="base", tip="tool0")
    generator = np.random.default_rng(1)
    lengths = UNIVERSAL[name]
    complete, n_branches, strangers, times = 0, [], 0, []
    while len(n_branches) < n_poses:
        pose = robot.forward(generator.uniform(-np.pi, np.pi, 6))
        known, least = closed_form(lengths, pose)
        if least < SINGULAR:
            continue
        start = time.process_time()
        found = robot.solve_ik(pose, solutions=8, restarts=RESTARTS)["solutions"]
        times.append(1e3 * (time.process_time() - start))
        complete += all(any(apart(q, mine) < SAME for mine in found) for q in known)
        strangers += sum(all(apart(q, mine) >= SAME for q in known) for mine in found)
        n_branches.append(len(known))
    print(
        f"| {name} | {100 * complete / n_poses:.1f} % | {statistics.mean(n_branches):.2f} | {strangers} "
        f"| {statistics.median(times):.3f} |",
        flush=True,
    )


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--poses", type=int, default=1000)
    parser.add_argument("--branch-poses", type=int, default=200)
    parser.add_argument("--shared", type=Path, default=Path(os.environ.get("SEMFM_SHARED", "../shared")))
    parser.add_argument("--robots", nargs="+", choices=ROBOTS, default=list(ROBOTS))
    arguments = parser.parse_args()
    semfm.set_num_threads(1)

    print("| arm | solver | solved | disowned | median ms | p95 ms | mean ms |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for name in arguments.robots:
        file, base, tip = ROBOTS[name]
        path = expanded(arguments.shared / file)
        compare(name, path, semfm.Robot.from_urdf(path, base=base, tip=tip), arguments.poses)
    print("\n| arm | all branches | branches a pose | unknown to the closed form | median ms |")
    print("| --- | --- | --- | --- | --- |")
    for name in filter(UNIVERSAL.get, arguments.robots):
        branches(name, arguments.shared / ROBOTS[name][0], arguments.branch_poses)


if __name__ == "__main__":
    main()
