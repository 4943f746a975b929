"""OMPL and roboplan on planning problems that our planner solves, side by side.

``pip install numpy pyyaml pin ompl==2.0.1 roboplan``, and the folders that ``bench/planning_problems.py unpack`` makes::

    cargo build --release -p semfm-eval --examples
    python bench/planning_peers.py CACHE/panda CACHE/ur5 --bin target/release --every 35 --seeds 3

Each program plans and shortens by its own means, one process a seed (OMPL's random numbers are global), one thread:

- ours: RRT-Connect, then chords, with our collision checker;
- OMPL: RRT-Connect of range 1 rad, then ``simplifySolution``, states .05 rad apart checked by coal through pinocchio.
  OMPL has no robot: the check is called from Python, so that its milliseconds are mostly those of the calls; the number
  of checks says what a faster checker would leave of them;
- roboplan: its RRT-Connect and its ``PathShortcutter``, states .05 rad apart checked by coal, all of it in C++.

All have the meshes as they are (ours: convex pieces of them), the same pairs by the SRDF, and the same joint limits.
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

from planning import goals, plan, read
from planning_problems import IndependentChecker

#: Greatest step of the peers' motion checks, radians.
STEP = 0.05
#: Longest edge of a tree, radians: ours.
RANGE = 1.0
#: Seconds after which OMPL gives up; a check by coal through Python takes some hundred times ours.
OMPL_SECONDS = 20.0
#: Seconds after which roboplan gives up.
ROBOPLAN_SECONDS = 5.0

def content_of(folder: Path) -> dict:
    return json.loads((folder / "problems.json").read_text())


def path_length(path) -> float:
    return float(np.linalg.norm(np.diff(np.asarray(path), axis=0), axis=1).sum())


def ours(folder: Path, binaries: Path, every: int, seed: int, repeats: int) -> list[dict]:
    """A row for each problem that is valid."""
    with tempfile.TemporaryDirectory() as scratch:
        out = Path(scratch) / "plans.jsonl"
        plan(binaries, folder, out, every, seed, repeats)
        _, answers = read(out)
    rows = []
    for answer in answers:
        if answer["outcome"] in ("not free", "out of limits"):
            continue
        row = {"problem": answer["problem"], "length": answer.get("length")}
        row["ms"] = answer["ms"]["plan"] + answer["ms"].get("shorten", 0.0)
        rows.append(row)
    return rows


def ompl(folder: Path, names: list[str], seed: int) -> None:
    """Prints a row of JSON for each of the problems."""
    from ompl import base, geometric, util

    util.RNG.setSeed(seed + 1)
    util.setLogLevel(util.LOG_ERROR)
    content = content_of(folder)
    problems = {problem["name"]: problem for problem in content["problems"]}
    checker = IndependentChecker(folder, content["joints"])
    n = len(content["joints"])
    for name in names:
        problem = problems[name]
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
        information.setStateValidityCheckingResolution(STEP / space.getMaximumExtent())
        start, goal = space.allocState(), space.allocState()
        for j in range(n):
            start[j], goal[j] = problem["start"][j], problem["goal"][j]
        setup.setStartAndGoalStates(start, goal)
        planner = geometric.RRTConnect(information)
        planner.setRange(RANGE)
        setup.setPlanner(planner)
        begun = time.process_time()
        setup.solve(OMPL_SECONDS)
        found = setup.haveExactSolutionPath()
        if found:
            setup.simplifySolution()
        ms = 1e3 * (time.process_time() - begun)
        length = setup.getSolutionPath().length() if found else None
        print(json.dumps({"problem": name, "length": length, "ms": ms, "checks": n_checks}), flush=True)


def roboplan(folder: Path, names: list[str], seed: int) -> None:
    """Prints a row of JSON for each of the problems."""
    from roboplan import core, rrt

    content = content_of(folder)
    problems = {problem["name"]: problem for problem in content["problems"]}
    checker = IndependentChecker(folder, content["joints"])
    joints = content["joints"]
    # What no joint moves is held against nothing that stands still, as in the other checkers; roboplan would hold
    # obstacles against each other, too.
    base = {
        checker.model.frames[shape.parentFrame].name
        for shape in checker.links.geometryObjects
        if shape.parentJoint == 0
    }
    for name in names:
        problem = problems[name]
        description = core.loadUrdfSceneDescription(str(folder / "robot.urdf"), [str(folder)])
        scene = core.Scene(name, description)
        scene.importSrdf((folder / "robot.srdf").read_text())
        standing = set(base)
        for obstacle in problem["scene"]["boxes"] + problem["scene"]["cylinders"]:
            place(core, checker, scene, obstacle, standing)
            standing.add(obstacle["name"])
        options = rrt.RRTOptions(
            max_nodes=20_000,
            max_connection_distance=RANGE,
            collision_check_step_size=STEP,
            max_planning_time=ROBOPLAN_SECONDS,
            rrt_connect=True,
        )
        planner = rrt.RRT(scene, options)
        planner.setRngSeed(seed)
        shortener = core.PathShortcutter(scene, core.PathShortcuttingOptions(max_step_size=STEP, seed=seed))
        start, goal = (core.JointConfiguration(joints, np.array(problem[end])) for end in ("start", "goal"))
        begun = time.process_time()
        row = {"problem": name, "length": None}
        try:
            path = shortener.shortcut(planner.plan(start, goal))
            row["length"] = path_length(path.positions)
        except RuntimeError as error:
            row["error"] = str(error)
        row["ms"] = 1e3 * (time.process_time() - begun)
        print(json.dumps(row), flush=True)


def place(core, checker: IndependentChecker, scene, obstacle: dict, standing: set[str]) -> None:
    """Adds a box or a cylinder to roboplan's scene, which may touch what is `standing`."""
    pose = np.eye(4, order="F")
    pose[:3, :3] = checker.pin.Quaternion(np.array(obstacle["quaternion_xyzw"])).normalized().matrix()
    pose[:3, 3] = obstacle["position"]
    name, color = obstacle["name"], np.ones(4)
    if "size" in obstacle:
        scene.addBoxGeometry(name, "universe", core.Box(*obstacle["size"]), pose, color)
    else:
        shape = core.Cylinder(obstacle["radius"], obstacle["length"])
        scene.addCylinderGeometry(name, "universe", shape, pose, color)
    for other in standing:
        scene.setCollisions(other, name, False)


PEERS = {"OMPL": ompl, "roboplan": roboplan}


def ask(peer: str, folder: Path, names: list[str], seed: int) -> list[dict]:
    """A peer's rows, from a process of its own."""
    command = [sys.executable, __file__, str(folder), "--as", peer, "--seed", str(seed)]
    run = subprocess.run(command, input="\n".join(names), capture_output=True, text=True)
    if run.returncode:
        raise SystemExit(f"{peer}: {run.stderr.strip()[-2000:]}")
    return [json.loads(line) for line in run.stdout.splitlines() if line.startswith("{")]


def compare(folder: Path, binaries: Path, every: int, seeds: int, repeats: int, peers: list[str]) -> None:
    """Prints a row for each program, and what became of our goals on these problems."""
    found = {"ours": [row for seed in range(seeds) for row in ours(folder, binaries, every, seed, repeats)]}
    names = list(dict.fromkeys(row["problem"] for row in found["ours"]))
    for peer in peers:
        found[peer] = [row for seed in range(seeds) for row in ask(peer, folder, names, seed)]
    robot = content_of(folder)["robot"]
    for program, rows in found.items():
        solved = [row for row in rows if row["length"] is not None]
        ms = np.array([row["ms"] for row in rows])
        lengths = np.array([row["length"] for row in solved])
        checks = [row["checks"] for row in rows if "checks" in row]
        print(
            f"| {robot} | {program} | {len(solved)} of {len(rows)} | {np.median(ms):.2f} | {np.percentile(ms, 95):.1f} "
            f"| {ms.max():.0f} | {lengths.mean():.2f} | {np.median(lengths):.2f} "
            f"| {f'{np.median(checks):.0f}' if checks else '–'} |",
            flush=True,
        )
        for error in dict.fromkeys(row["error"] for row in rows if "error" in row):
            print(f"{program}: {error}", file=sys.stderr)
    own = found["ours"]
    ms = np.array([row["ms"] for row in own])
    lengths = np.array([row["length"] for row in own if row["length"] is not None])
    goals(robot, ms, (ms[[row["length"] is not None for row in own]] < 1000).sum() / len(own), lengths.mean())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", type=Path, nargs="+")
    parser.add_argument("--bin", type=Path, default=Path("target/release"), help="folder of the built programs")
    parser.add_argument("--every", type=int, default=35, help="only each N-th problem")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--repeats", type=int, default=1, help="runs of ours of the same work, whose mean time is taken")
    parser.add_argument("--peers", nargs="*", choices=PEERS, default=list(PEERS))
    parser.add_argument("--as", dest="peer", choices=PEERS, help=argparse.SUPPRESS)
    parser.add_argument("--seed", type=int, default=0, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.peer:
        PEERS[arguments.peer](arguments.folders[0], sys.stdin.read().split("\n"), arguments.seed)
        return
    print("| arm | program | solved | plan + shorten ms: median | p95 | max | length rad: mean | median | checks, median |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    for folder in arguments.folders:
        compare(folder, arguments.bin, arguments.every, arguments.seeds, arguments.repeats, arguments.peers)


if __name__ == "__main__":
    main()
