"""Planning and timing of our arms beside TOPP-RA's authors' package, and a replay by an independent checker.

``pip install numpy pyyaml pin toppra``, then, for a folder of built programs::

    cargo build --release -p semfm-eval --examples
    python bench/planning.py run shared/data/planning/motion_bench_maker CACHE --bin target/release [--every 7]

which unpacks the problems (``bench/planning_problems.py``), and does for both arms what can be asked for one by one::

    target/release/examples/plan_problems CACHE/panda CACHE/panda/plans.jsonl          # and ur5
    python bench/planning.py summary CACHE/panda/plans.jsonl CACHE/ur5/plans.jsonl
    python bench/planning.py toppra CACHE/panda/plans.jsonl CACHE/ur5/plans.jsonl
    python bench/planning.py replay CACHE/panda CACHE/panda/plans.jsonl --every 7

``summary`` prints the table of what was solved, how fast and how long, and which goals are met. ``toppra`` times the same
curves with toppra (the same velocity and acceleration limits, constraints at both ends of each interval, 1 000 intervals,
seidel). ``replay`` evaluates the cubics between samples at every millisecond by itself: limits, and contacts by coal on the
robot's meshes as they are. All of it runs on one thread. Other planners: ``bench/planning_peers.py``.

On a busy machine, ``--repeats 12`` plans every problem so often, with the same seed and so the same work, and takes the mean of
its milliseconds.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

from cubics import Cubics
from planning_problems import TIPS, IndependentChecker, unpack

#: Lengths of VAMP's paths, radians (Thomason, Kingston & Kavraki, Motions in Microseconds via Vectorized Sampling-Based
#: Planning, ICRA 2024).
VAMP_LENGTHS = {"panda": 5.2, "ur5": 6.8}
#: The goals: share of the valid problems, milliseconds of planning and shortening (median, p95), length over VAMP's.
GOAL_SOLVED, GOAL_MEDIAN, GOAL_P95, GOAL_LENGTH = 0.995, 3.0, 30.0, 1.1
#: Motions of each arm that are replayed by coal in `run`.
N_REPLAYED = 20
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
        goals(robot, ms, (ms < 1000).sum() / len(valid), length.mean())
        for answer in violations:
            print(f"{answer['problem']}: {answer['violation']}")
        for answer in valid:
            if answer["outcome"] != "path":
                print(f"{answer['problem']}: {answer['outcome']}")


def goals(robot: str, ms: np.ndarray, solved_within: float, length: float) -> None:
    """Says which goals are met."""
    for what, value, goal, met in (
        ("solved within 1 s", solved_within, GOAL_SOLVED, solved_within >= GOAL_SOLVED),
        ("median ms", np.median(ms), GOAL_MEDIAN, np.median(ms) <= GOAL_MEDIAN),
        ("p95 ms", np.percentile(ms, 95), GOAL_P95, np.percentile(ms, 95) <= GOAL_P95),
        ("mean length, rad", length, GOAL_LENGTH * VAMP_LENGTHS[robot], length <= GOAL_LENGTH * VAMP_LENGTHS[robot]),
    ):
        print(f"{robot}: {what}: {value:.4g}, goal {goal:.4g}: {'met' if met else 'missed'}", file=sys.stderr)


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
        points = answer["trajectory"]["points"]
        cubics = Cubics(*(np.array([point[i] for point in points]) for i in range(3)))
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


def plan(binaries: Path, folder: Path, out: Path, every: int, seed: int, repeats: int) -> None:
    """Writes our answers, each with the mean milliseconds of `repeats` runs of the same work."""
    command = [binaries / "examples" / "plan_problems", folder, out, "--every", str(every), "--seed", str(seed)]
    subprocess.run(command, check=True)
    if repeats == 1:
        return
    head, answers = read(out)
    with tempfile.TemporaryDirectory() as scratch:
        command[2] = Path(scratch) / out.name
        for _ in range(repeats - 1):
            subprocess.run(command, check=True, stderr=subprocess.DEVNULL)
            for answer, again in zip(answers, read(command[2])[1], strict=True):
                if answer["outcome"] != again["outcome"]:
                    name, (first, then) = answer["problem"], (answer["outcome"], again["outcome"])
                    raise SystemExit(f"{name}: first {first}, then {then}, with the same seed")
                for stage, ms in again.get("ms", {}).items():
                    answer["ms"][stage] += ms
    for answer in answers:
        if "ms" in answer:
            answer["ms"] = {stage: ms / repeats for stage, ms in answer["ms"].items()}
    out.write_text("".join(json.dumps(line) + "\n" for line in [head, *answers]))


def run(data: Path, cache: Path, binaries: Path, every: int, seed: int, repeats: int) -> None:
    """All of it for both arms."""
    folders = [cache / robot for robot in TIPS]
    if not all((folder / "problems.json").is_file() for folder in folders):
        unpack(data, cache)
    plans = [folder / "plans.jsonl" for folder in folders]
    for folder, out in zip(folders, plans):
        plan(binaries, folder, out, every, seed, repeats)
    summary(plans)
    toppra(plans, 1)
    for folder, out in zip(folders, plans):
        replay(folder, out, max(1, len(solved(read(out)[1])) // N_REPLAYED))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    command = commands.add_parser("summary")
    command.add_argument("plans", type=Path, nargs="+")
    command = commands.add_parser("toppra")
    command.add_argument("plans", type=Path, nargs="+")
    command.add_argument("--every", type=int, default=1)
    command = commands.add_parser("replay")
    command.add_argument("folder", type=Path)
    command.add_argument("plans", type=Path)
    command.add_argument("--every", type=int, default=1)
    command = commands.add_parser("run")
    command.add_argument("data", type=Path)
    command.add_argument("cache", type=Path)
    command.add_argument("--bin", type=Path, default=Path("target/release"), help="folder of the built programs")
    command.add_argument("--every", type=int, default=1, help="only each N-th problem")
    command.add_argument("--seed", type=int, default=0)
    command.add_argument("--repeats", type=int, default=1, help="runs of the same work, whose mean time is taken")
    arguments = parser.parse_args()
    if arguments.command == "summary":
        summary(arguments.plans)
    elif arguments.command == "toppra":
        toppra(arguments.plans, arguments.every)
    elif arguments.command == "replay":
        replay(arguments.folder, arguments.plans, arguments.every)
    else:
        run(arguments.data, arguments.cache, arguments.bin, arguments.every, arguments.seed, arguments.repeats)


if __name__ == "__main__":
    main()
