"""From a carried region to a trajectory: six YCB objects on a table, two arms, replayed by an independent checker.

``pip install numpy pin`` and a built ``semfm-cli``, then::

    python bench/motion.py --shared ../shared --bin target/release [--poses 4] [--objects mug banana] [--arms panda]

For each object a region is marked (``region``), on itself or on another object from which it is carried over (``transfer``
with the built-in encoder); ``grasp`` finds grasps in it on a table, ``plan`` plans to them from several places and headings
of the object on the table, between two boxes that stand there as well. Every trajectory is replayed at each millisecond by
``bench/motion_replay.py``. The first table says what was solved, the second which gates grasps did not pass (summed over
the places). Seconds are CPU time of the whole process, start and reading of meshes included.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import resource
import subprocess
import sys
import tempfile
from cmath import rect
from collections import Counter
from dataclasses import dataclass
from math import pi
from pathlib import Path
from statistics import median

from motion_replay import Arm, read_obj, replay

#: Where objects stand on the table, metres from the arm's base.
X, Y = (0.38, 0.55), (-0.22, 0.22)
#: Boxes that stand on either side of them.
BOXES = [
    {"name": f"box {side}", "size": [0.3, 0.06, 0.3], "position": [0.5, y, 0.15]}
    for side, y in (("left", 0.42), ("right", -0.42))
]
#: Grasps that the planner may choose from.
N_GRASPS = 40
#: Points of a region from which candidates are grown.
N_SAMPLES = 400
#: Exit code of "no answer".
NO_ANSWER = 1


@dataclass
class Object:
    """Where a region is marked, and on what."""

    #: The object that is marked; the region is carried from it where it is another one.
    source: str
    #: A point of it, in its frame, and the region's geodesic radius, metres.
    near: str
    radius: float


OBJECTS = {
    "mug": Object("mug", "0.0496,0.016,0.0423", 0.03),  # the handle
    "pitcher_base": Object("mug", "0.0496,0.016,0.0423", 0.03),
    "mustard_bottle": Object("mustard_bottle", "-0.015,-0.055,0.1", 0.09),  # the body
    "bleach_cleanser": Object("mustard_bottle", "-0.015,-0.055,0.1", 0.09),
    "hammer": Object("spoon", "0.04,-0.032,0.008", 0.05),  # the handle
    "banana": Object("banana", "-0.02,0,0.036", 0.06),  # the middle
}


@dataclass
class Setup:
    """An arm, and what the commands are told of it."""

    arm: Arm
    gripper: Path
    options: list[str]


def setups(data: Path) -> dict[str, Setup]:
    panda, robots = data / "arms" / "moveit_panda", data / "robots"
    description, config = panda / "panda_description", panda / "panda_moveit_config" / "config"
    srdf, packages = config / "panda.srdf", {"moveit_resources_panda_description": description}
    urdf = description / "urdf" / "panda.urdf"
    # joint_limits.yaml of the same folder; UR5e has none, and 1 rad/s² is assumed.
    accelerations = [3.75, 1.875, 2.5, 3.125, 3.75, 5.0, 5.0]
    options = ["--srdf", srdf, "--limits", config / "joint_limits.yaml", "--tip", "panda_link8"]
    options += ["--package", f"moveit_resources_panda_description={description}", "--start", "ready"]
    ur5e = robots / "ur5e" / "urdf" / "ur5e_local.urdf"
    robotiq = robots / "robotiq_2f_85" / "urdf" / "2f85_local.urdf"
    return {
        "panda": Setup(Arm(urdf, packages, srdf, accelerations, None), urdf, [str(word) for word in options]),
        "ur5e": Setup(
            Arm(ur5e, {}, None, [1.0] * 6, robotiq), robotiq, ["--tip", "tool0", "--start", "0,-1.6,1.6,-1.6,-1.57,0"]
        ),
    }


class Shell:
    """Runs the program and keeps its CPU seconds by command."""

    def __init__(self, program: Path):
        self.program = program
        self.seconds: dict[str, list[float]] = {}

    def run(self, *words) -> subprocess.CompletedProcess:
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        done = subprocess.run([self.program, *map(str, words)], capture_output=True, text=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        self.seconds.setdefault(str(words[0]), []).append(seconds)
        if done.returncode not in (0, NO_ANSWER):
            raise SystemExit(f"{' '.join(map(str, words))}\n{done.stderr}")
        return done

    def total(self, *commands: str) -> float:
        return sum(sum(self.seconds.get(command, [])) for command in commands)


def carried_region(shell: Shell, data: Path, name: str, folder: Path) -> Path:
    """The region on an object, and how it came there."""
    wanted = OBJECTS[name]
    source, target = (data / "ycb" / which / "textured.obj" for which in (wanted.source, name))
    marked = folder / "marked.json"
    shell.run("region", source, f"--near={wanted.near}", "--radius", wanted.radius, "-o", marked)
    if source == target:
        return marked
    shell.run("transfer", source, target, "--region", marked, "-o", folder / "carried", "--only", "region", "--no-cache")
    return folder / "carried" / "region.json"


def places(name: str, vertices, n: int, seed: int) -> list[str]:
    """Where an object stands, lowest corner on the table, its middle at a random place, at a random heading."""
    generator = random.Random(f"{name} {seed}")
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    answer = []
    for _ in range(n):
        x, y, yaw = generator.uniform(*X), generator.uniform(*Y), generator.uniform(-pi, pi)
        middle = complex(*((low + high)[:2] / 2)) * rect(1.0, yaw)
        answer.append(f"{x - middle.real},{y - middle.imag},{-low[2]},0,0,{yaw}")
    return answer


def bench(name: str, setup: Setup, shared: Path, program: Path, folder: Path, n_places: int, seed: int) -> dict:
    """Plans to one object with one arm; a row of the table."""
    shell, data = Shell(program), shared / "data"
    folder.mkdir(parents=True, exist_ok=True)
    mesh = data / "ycb" / name / "textured.obj"
    vertices, _ = read_obj(mesh)
    region = carried_region(shell, data, name, folder)
    grasps = folder / "grasps.json"
    table = f"0,0,{vertices[:, 2].min()},0,0,1"
    packages = [word for item in setup.arm.packages.items() for word in ("--package", "=".join(map(str, item)))]
    shell.run(
        "grasp", mesh, "--region", region, "--gripper", setup.gripper, "--metres", f"--table={table}", *packages,
        "--top", N_GRASPS, "--samples", N_SAMPLES, "--seed", seed, "-o", grasps,
    )  # fmt: skip
    row = {"grasps": len(json.loads(grasps.read_text())["grasps"]), "places": n_places, "solved": 0, "gates": Counter()}
    row |= {"states": 0, "faults": [], "durations": [], "gaps": [], "touched": 0, "plan": []}
    scene = folder / "scene.json"
    scene.write_text(json.dumps({"format": "semfm.scene/1", "boxes": BOXES}))
    for i, place in enumerate(places(name, vertices, n_places, seed)):
        if not row["grasps"]:
            break
        out = folder / f"plan{i}"
        done = shell.run(
            "plan", "--robot", setup.arm.urdf, *setup.options, "--grasps", grasps, "--object", mesh, "--scene", scene,
            f"--base-from-object={place}", "--seed", seed, "-o", out,
        )  # fmt: skip
        plan = json.loads((out / "plan.json").read_text())
        row["gates"].update({gate["gate"]: gate["n"] for gate in plan["gates"]})
        if done.returncode == NO_ANSWER:
            print(f"{name} at {place}: {done.stderr.strip()}", file=sys.stderr)
            continue
        row["solved"] += 1
        row["durations"].append(sum(segment["seconds"] for segment in plan["segments"]))
        found = replay(setup.arm, out / "trajectory.json", mesh)
        row["states"] += found.n_states
        row["gaps"].append(1e3 * found.gap)
        row["touched"] += found.first_touch is not None
        if found.faults:
            row["faults"].append(f"{out}: {'; '.join(found.faults)}")
            print(row["faults"][-1], file=sys.stderr)
    row["n_faults"] = len(row["faults"])
    row["region"], row["grasp"] = shell.total("region", "transfer"), shell.total("grasp")
    row["plan"] = median(shell.seconds["plan"]) if "plan" in shell.seconds else float("nan")
    return row


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--shared", type=Path, default=Path(os.environ.get("SEMFM_SHARED", "../shared")))
    parser.add_argument("--bin", type=Path, default=Path("target/release"), help="folder of the built programs")
    parser.add_argument("--poses", type=int, default=4, help="places of each object")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--objects", nargs="+", choices=OBJECTS, default=list(OBJECTS))
    parser.add_argument("--arms", nargs="+", choices=("panda", "ur5e"), default=["panda", "ur5e"])
    parser.add_argument("--out", type=Path, help="keep all files here")
    arguments = parser.parse_args()
    scratch = tempfile.TemporaryDirectory()
    out = (arguments.out or Path(scratch.name)).resolve()
    shared, program = arguments.shared.resolve(), (arguments.bin / "semfm-cli").resolve()
    rows = {}
    print(
        "| arm | object | region from | grasps | solved | seconds: region | grasps | plan, median | motion s, median "
        "| fingers stop short by mm, largest | states replayed | motions with a fault |"
    )
    print("| --- " * 12 + "|")
    for arm in arguments.arms:
        setup = setups(shared / "data")[arm]
        for name in arguments.objects:
            row = bench(name, setup, shared, program, out / arm / name, arguments.poses, arguments.seed)
            rows[arm, name] = row
            source = OBJECTS[name].source
            duration = f"{median(row['durations']):.1f}" if row["durations"] else "–"
            gap = f"{max(row['gaps']):.2f}" if row["gaps"] else "–"
            print(
                f"| {arm} | {name} | {'itself' if source == name else source} | {row['grasps']} "
                f"| {row['solved']} of {row['places']} | {row['region']:.2f} | {row['grasp']:.2f} | {row['plan']:.2f} "
                f"| {duration} | {gap} | {row['states']} | {len(row['faults'])} |",
                flush=True,
            )
    print()
    gates = list(dict.fromkeys(gate for row in rows.values() for gate in row["gates"]))
    if gates:
        print(f"| arm | object | {' | '.join(gates)} |")
        print("| --- " * (2 + len(gates)) + "|")
    for (arm, name), row in rows.items() if gates else ():
        print(f"| {arm} | {name} | {' | '.join(str(row['gates'][gate]) for gate in gates)} |")
    solved, places_, faults, touched = (
        sum(row[key] for row in rows.values()) for key in ("solved", "places", "n_faults", "touched")
    )
    print(f"\n{solved} of {places_} solved; {faults} motions with a fault; goal 0: {'met' if not faults else 'missed'}")
    print(f"motions in which a finger overlaps the object (allowed from the beginning of close): {touched}")


if __name__ == "__main__":
    main()
