"""Planning and timing of our arms beside OMPL, TOPP-RA's authors' package, and a replay by an independent checker.

``pip install numpy pyyaml pin ompl==2.0.1 toppra``, then::

    python bench/planning_problems.py unpack shared/data/planning/motion_bench_maker CACHE
    cargo run --release -p semfm-eval --example plan_problems CACHE/panda CACHE/panda/plans.jsonl          # and ur5
    python bench/planning.py summary CACHE/panda/plans.jsonl CACHE/ur5/plans.jsonl
    python bench/planning.py toppra CACHE/panda/plans.jsonl CACHE/ur5/plans.jsonl
    python bench/planning.py replay CACHE/panda CACHE/panda/plans.jsonl --every 7
    python bench/planning.py ompl CACHE/panda CACHE/panda/plans.jsonl --every 35 --seeds 3

``summary`` prints the table of what was solved, how fast and how long. ``toppra`` times the same curves with toppra (the
same velocity and acceleration limits, constraints at both ends of each interval, 1 000 intervals, seidel). ``replay``
evaluates the cubics between samples at every millisecond by itself: limits, and contacts by coal on the robot's meshes as
they are. ``ompl`` plans the same problems by RRT-Connect and OMPL's simplification, states checked by coal, one process a
seed (OMPL's random numbers are global). All of it runs on one thread.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

from planning_problems import IndependentChecker

#: Lengths of VAMP's paths, radians (Thomason, Kingston & Kavraki, Motions in Microseconds via Vectorized Sampling-Based
#: Planning, ICRA 2024).
VAMP_LENGTHS = {"panda": 5.2, "ur5": 6.8}
#: Greatest step of OMPL's motion checks, radians.
OMPL_STEP = 0.05
#: Seconds after which OMPL gives up; a check by coal through Python takes some hundred times ours.
OMPL_SECONDS = 20.0
#: By which share rounding may pass a limit.
ROUNDING = 1e-6


def read(path: Path) -> tuple[dict, list[dict]]:
    """The first line, with limits, and one answer a problem."""
    lines = path.read_text().splitlines()
    return json.loads(lines[0]), [json.loads(line) for line in lines[1:]]


def solved(answers: list[dict]) -> list[dict]:
    return [answer for answer in answers if answer["outcome"] == "path"]


def summary(paths: list[Path]) -> None:
    """Prints the table of plans."""
    print(
        "| robot | valid | solved | within 1 s | plan + shorten ms: median | p95 | max | length rad: mean | median "
        "| VAMP's × 1.1 | round, ms | time, ms | replay, ms | motion s: mean | violations |"
    )
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    for path in paths:
        _, answers = read(path)
        valid = [a for a in answers if a["outcome"] not in ("not free", "out of limits")]
        plans = solved(answers)
        ms = np.array([a["ms"]["plan"] + a["ms"]["shorten"] for a in plans])
        length = np.array([a["length"] for a in plans])
        stage = lambda name: np.median([a["ms"][name] for a in plans])  # noqa: E731
        robot = path.parent.name
        bound = f"{1.1 * VAMP_LENGTHS[robot]:.2f}" if robot in VAMP_LENGTHS else "–"
        violations = [a for a in plans if a["violation"]]
        print(
            f"| {robot} | {len(valid)} of {len(answers)} | {len(plans)} ({len(plans) / len(valid):.2%}) "
            f"| {(ms < 1000).sum() / len(valid):.2%} | {np.median(ms):.2f} | {np.percentile(ms, 95):.1f} | {ms.max():.0f} "
            f"| {length.mean():.2f} | {np.median(length):.2f} | {bound} | {stage('blend'):.2f} | {stage('retime'):.2f} "
            f"| {stage('check'):.1f} | {np.mean([a['trajectory']['duration'] for a in plans]):.2f} | {len(violations)} |"
        )
        for answer in violations:
            print(f"{answer['problem']}: {answer['violation']}")
        for answer in valid:
            if answer["outcome"] != "path":
                print(f"{answer['problem']}: {answer['outcome']}")


def toppra(paths: list[Path], every: int) -> None:
    """Prints the durations of our motions over toppra's on the same curves."""
    import toppra as ta
    from toppra.algorithm import TOPPRA
    from toppra.constraint import DiscretizationType, JointAccelerationConstraint, JointVelocityConstraint
    from toppra.interpolator import AbstractGeometricPath

    class Pieces(AbstractGeometricPath):
        """q(σ) = value + slope σ + ½ curvature σ² on each piece."""

        def __init__(self, curve: dict):
            pieces = curve["pieces"]
            self.length = curve["length"]
            self.starts = np.array([piece["start"] for piece in pieces])
            self.parts = [np.array([piece[k] for piece in pieces]) for k in ("value", "slope", "curvature")]

        def __call__(self, s, order=0):
            s = np.asarray(s, float)
            number = np.maximum(np.searchsorted(self.starts, np.atleast_1d(s), side="right") - 1, 0)
            along = (np.atleast_1d(s) - self.starts[number])[:, None]
            value, slope, curvature = (part[number] for part in self.parts)
            found = [value + slope * along + 0.5 * curvature * along**2, slope + curvature * along, curvature][order]
            return found[0] if s.ndim == 0 else found

        @property
        def dof(self):
            return self.parts[0].shape[1]

        @property
        def path_interval(self):
            return np.array([0.0, self.length])

        @property
        def waypoints(self):
            return None

    ta.setup_logging("ERROR")
    print("| robot | curves | ours / toppra: median | max | TOPP-RA alone: median | max | ours ms | toppra ms |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    for path in paths:
        head, answers = read(path)
        velocity, acceleration = np.array(head["limits"]).T
        both, alone, ours, theirs, failed = [], [], [], [], 0
        for answer in solved(answers)[::every]:
            # toppra's path is smooth: a curve with stops has none that is comparable.
            if answer["curve"]["n_stops"] or not answer["curve"]["pieces"]:
                continue
            curve = Pieces(answer["curve"])
            begun = time.process_time()
            limits = [
                JointVelocityConstraint(np.c_[-velocity, velocity]),
                JointAccelerationConstraint(
                    np.c_[-acceleration, acceleration], discretization_scheme=DiscretizationType.Interpolation
                ),
            ]
            grid = np.linspace(0.0, curve.length, 1001)
            motion = TOPPRA(
                limits, curve, gridpoints=grid, solver_wrapper="seidel", parametrizer="ParametrizeConstAccel"
            ).compute_trajectory(0, 0)
            if motion is None:
                failed += 1
                continue
            theirs.append(1e3 * (time.process_time() - begun))
            ours.append(answer["ms"]["retime"])
            both.append(answer["trajectory"]["duration"] / motion.duration)
            alone.append(answer["trajectory"]["fastest"] / motion.duration)
        print(
            f"| {path.parent.name} | {len(both)} | {np.median(both):.4f} | {max(both):.4f} | {np.median(alone):.4f} "
            f"| {max(alone):.4f} | {np.median(ours):.2f} | {np.median(theirs):.1f} |"
        )
        if failed:
            print(f"toppra found no motion for {failed} more")


class Cubics:
    """Positions, velocities and accelerations of a trajectory at any time."""

    def __init__(self, points: list):
        self.times = np.array([point[0] for point in points])
        self.q = np.array([point[1] for point in points])
        self.v = np.array([point[2] for point in points])

    def at(self, times: np.ndarray):
        part = np.clip(np.searchsorted(self.times, times, side="right") - 1, 0, len(self.times) - 2)
        h = (self.times[part + 1] - self.times[part])[:, None]
        s = (times - self.times[part])[:, None]
        mean = (self.q[part + 1] - self.q[part]) / h
        v0, v1 = self.v[part], self.v[part + 1]
        a = (3 * mean - 2 * v0 - v1) / h
        b = (v0 + v1 - 2 * mean) / h**2
        return self.q[part] + s * (v0 + s * (a + s * b)), v0 + s * (2 * a + 3 * s * b), 2 * a + 6 * s * b


def replay(folder: Path, path: Path, every: int) -> None:
    """Evaluates motions at every millisecond and prints what passes a limit or touches."""
    content = json.loads((folder / "problems.json").read_text())
    scenes = {problem["name"]: problem["scene"] for problem in content["problems"]}
    checker = IndependentChecker(folder, content["joints"])
    head, answers = read(path)
    velocity, acceleration = np.array(head["limits"]).T
    n_states, beyond, touching, n_motions, moving, standing = 0, 0, 0, 0, 0, 0
    greatest = np.zeros(2)
    for answer in solved(answers)[::every]:
        cubics = Cubics(answer["trajectory"]["points"])
        n_motions += 1
        standing += bool((np.diff(cubics.times) <= 0).any())
        moving += bool(cubics.v[0].any() or cubics.v[-1].any())
        times = np.append(np.arange(0.0, cubics.times[-1], 1e-3), cubics.times[-1])
        q, v, a = cubics.at(times)
        shares = np.array([(abs(v) / velocity).max(), (abs(a) / acceleration).max()])
        greatest = np.maximum(greatest, shares)
        beyond += bool((shares > 1 + ROUNDING).any())
        contacts = checker.checks(scenes[answer["problem"]], first_only=True)
        n_states += len(times)
        found = next((i for i, state in enumerate(q) if contacts(state)), None)
        if found is not None:
            touching += 1
            print(f"{answer['problem']}: {contacts(q[found])} at {times[found]:.3f} s")
    print("| robot | motions | states, one a ms | beyond limits | greatest v / limit | a / limit | touching | not at rest | times that stand |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    print(
        f"| {content['robot']} | {n_motions} | {n_states} | {beyond} | {greatest[0]:.6f} | {greatest[1]:.6f} | {touching} "
        f"| {moving} | {standing} |"
    )


def ompl_seed(folder: Path, path: Path, every: int, seed: int) -> None:
    """Plans problems by OMPL with one seed and prints a line of JSON each."""
    from ompl import base, geometric, util

    util.RNG.setSeed(seed + 1)
    util.setLogLevel(util.LOG_ERROR)
    content = json.loads((folder / "problems.json").read_text())
    problems = {problem["name"]: problem for problem in content["problems"]}
    checker = IndependentChecker(folder, content["joints"])
    n = len(content["joints"])
    for answer in solved(read(path)[1])[::every]:
        problem = problems[answer["problem"]]
        contacts = checker.checks(problem["scene"], first_only=True)
        space = base.RealVectorStateSpace(n)
        bounds = base.RealVectorBounds(n)
        for j, (lower, upper) in enumerate(zip(checker.model.lowerPositionLimit, checker.model.upperPositionLimit)):
            bounds.setLow(j, float(lower))
            bounds.setHigh(j, float(upper))
        space.setBounds(bounds)
        setup = geometric.SimpleSetup(space)
        n_checks = 0

        def is_free(state) -> bool:
            nonlocal n_checks
            n_checks += 1
            return not contacts([state[j] for j in range(n)])

        setup.setStateValidityChecker(is_free)
        information = setup.getSpaceInformation()
        information.setStateValidityCheckingResolution(OMPL_STEP / space.getMaximumExtent())
        start, goal = space.allocState(), space.allocState()
        for j in range(n):
            start[j], goal[j] = problem["start"][j], problem["goal"][j]
        setup.setStartAndGoalStates(start, goal)
        planner = geometric.RRTConnect(information)
        planner.setRange(1.0)
        setup.setPlanner(planner)
        begun = time.process_time()
        setup.solve(OMPL_SECONDS)
        found = setup.haveExactSolutionPath()
        if found:
            setup.simplifySolution()
        seconds = time.process_time() - begun
        length = setup.getSolutionPath().length() if found else None
        line = {"problem": answer["problem"], "length": length, "seconds": seconds, "checks": n_checks}
        print(json.dumps(line), flush=True)


def ompl(folder: Path, path: Path, every: int, seeds: int) -> None:
    """Runs a process for each seed and prints OMPL's lengths beside ours."""
    ours = {answer["problem"]: answer["length"] for answer in solved(read(path)[1])}
    rows = []
    for seed in range(seeds):
        command = [sys.executable, __file__, "ompl-seed", str(folder), str(path), f"--every={every}", f"--seed={seed}"]
        out = subprocess.run(command, check=True, capture_output=True, text=True).stdout
        rows += [json.loads(line) for line in out.splitlines() if line.startswith("{")]
    found = [row for row in rows if row["length"] is not None]
    theirs = np.array([row["length"] for row in found])
    own = np.array([ours[row["problem"]] for row in found])
    print("| robot | runs | OMPL solved | length rad: OMPL mean | median | ours mean | median | OMPL checks, median | ms, median |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    print(
        f"| {folder.name} | {len(rows)} | {len(found)} | {theirs.mean():.2f} | {np.median(theirs):.2f} | {own.mean():.2f} "
        f"| {np.median(own):.2f} | {np.median([row['checks'] for row in rows]):.0f} "
        f"| {1e3 * np.median([row['seconds'] for row in rows]):.0f} |"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    command = commands.add_parser("summary")
    command.add_argument("plans", type=Path, nargs="+")
    command = commands.add_parser("toppra")
    command.add_argument("plans", type=Path, nargs="+")
    command.add_argument("--every", type=int, default=1)
    for name in ("replay", "ompl", "ompl-seed"):
        command = commands.add_parser(name)
        command.add_argument("folder", type=Path)
        command.add_argument("plans", type=Path)
        command.add_argument("--every", type=int, default=1)
        if name == "ompl":
            command.add_argument("--seeds", type=int, default=3)
        if name == "ompl-seed":
            command.add_argument("--seed", type=int, required=True)
    arguments = parser.parse_args()
    if arguments.command == "summary":
        summary(arguments.plans)
    elif arguments.command == "toppra":
        toppra(arguments.plans, arguments.every)
    elif arguments.command == "replay":
        replay(arguments.folder, arguments.plans, arguments.every)
    elif arguments.command == "ompl":
        ompl(arguments.folder, arguments.plans, arguments.every, arguments.seeds)
    else:
        ompl_seed(arguments.folder, arguments.plans, arguments.every, arguments.seed)


if __name__ == "__main__":
    main()
