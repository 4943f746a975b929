"""Planning problems of MotionBenchMaker as JSON, and what an independent checker says of them.

``pip install numpy pyyaml pin`` (pinocchio with coal), then for both robots::

    python bench/planning_problems.py unpack shared/data/planning/motion_bench_maker CACHE
    cargo run --release -p semfm-eval --example check_problems CACHE/panda > CACHE/panda/ours.jsonl
    python bench/planning_problems.py judge CACHE/panda CACHE/ur5
    python bench/planning_problems.py compare CACHE/panda CACHE/ur5

``unpack`` writes for each robot a folder with ``robot.urdf``, its meshes, ``robot.srdf`` and
``problems.json``::

    {"robot": "panda", "tip": "panda_link8", "joints": [...], "notes": [...],
     "problems": [{"name": "box_panda/0001", "start": [...], "goal": [...],
                   "scene": {"format": "semfm.scene/1", ...}}]}

Positions are in the order of ``joints``, scenes in the frame of the robot's root, which is where
the files have it: the base of the UR5 stands .9144 m above that and is turned. ``judge`` asks coal, on
the meshes as they are, which starts and goals are free, and which states halfway between them, many
of which are not; ``compare`` prints a table and every state on which the two differ. Pairs of links
follow the SRDF in both; links that no joint moves are held against nothing that stands still.
"""

from __future__ import annotations

import argparse
import json
import re
import shutil
import tarfile
from pathlib import Path

import numpy as np
import yaml

#: The link that the SRDF's group of each robot ends in.
TIPS = {"panda": "panda_link8", "ur5": "tool0"}
#: The UR5's force sensor names a mesh that is not part of the data: a cylinder of the maker's size
#: stands for it (Robotiq FT 300: 75 mm across, 37.5 mm high).
SENSOR = '<cylinder radius="0.0375" length="0.0375"/>'
SENSOR_ORIGIN = '<origin rpy="0 0 0" xyz="0 0 0.01875"/>'


def unpack(data: Path, cache: Path, every: int = 1) -> None:
    """Writes the folder of each robot, with each ``every``-th problem."""
    for robot in TIPS:
        source, folder = data / robot, cache / robot
        folder.mkdir(parents=True, exist_ok=True)
        for mesh in (path for path in (source / "meshes").rglob("*") if path.is_file()):
            copy = folder / mesh.relative_to(source)
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(mesh, copy)
        notes = write_urdf(source / f"{robot}.urdf", folder)
        shutil.copyfile(source / f"{robot}.srdf", folder / "robot.srdf")
        joints = arm_joints(folder / "robot.urdf")
        problems = list(read_problems(source / "problems.tar.bz2", joints, every))
        content = {
            "robot": robot,
            "tip": TIPS[robot],
            "joints": joints,
            "notes": notes,
            "problems": problems,
        }
        (folder / "problems.json").write_text(json.dumps(content))
        print(f"{folder}: {len(problems)} problems; {'; '.join(notes)}")


def write_urdf(source: Path, folder: Path) -> list[str]:
    """The description with meshes named relative to it, without visuals, and what the data lacks
    put right."""
    text = source.read_text()
    notes = []
    text = re.sub(r"<visual>.*?</visual>", "", text, flags=re.DOTALL).replace("package://", "")
    if "_fine.STL" in text:
        text = text.replace("_fine.STL", "_coarse.STL")
        notes.append(
            "the gripper's meshes are the coarse ones: the fine ones that are named are not there"
        )
    mesh = r'<mesh filename="meshes/robotiq_fts300.stl">\s*</mesh>'
    sensor = rf"<origin[^>]*/>\s*<geometry>\s*{mesh}\s*</geometry>"
    text, n = re.subn(sensor, f"{SENSOR_ORIGIN}<geometry>{SENSOR}</geometry>", text)
    if n:
        notes.append("a cylinder stands for the force sensor, whose mesh is not there")
    for mesh in re.findall(r'filename="([^"]*)"', text):
        if not (folder / mesh).is_file():
            raise SystemExit(f"{source}: {mesh} is not there")
    (folder / "robot.urdf").write_text(text)
    return notes


def arm_joints(urdf: Path) -> list[str]:
    """Names of the joints that move, in the file's order, which is from base to tip."""
    text = re.sub(r"<!--.*?-->", "", urdf.read_text(), flags=re.DOTALL)
    return re.findall(r'<joint name="([^"]*)" type="revolute"', text)


def read_problems(archive: Path, joints: list[str], every: int):
    """Each problem with its scene, sorted by name."""
    texts = {}
    with tarfile.open(archive) as tar:
        for member in tar:
            match = re.fullmatch(r"problems/([^/]+)/(scene|request)(\d+)\.yaml", member.name)
            if match:
                group, kind, number = match.groups()
                texts[f"{group}/{number}", kind] = tar.extractfile(member).read()
    load = lambda text: yaml.load(text, getattr(yaml, "CSafeLoader", yaml.SafeLoader))  # noqa: E731
    for name in sorted({name for name, _ in texts})[::every]:
        request, scene = (load(texts[name, kind]) for kind in ("request", "scene"))
        state = request["start_state"]["joint_state"]
        start = dict(zip(state["name"], state["position"]))
        (goal,) = request["goal_constraints"]
        goal = {c["joint_name"]: c["position"] for c in goal["joint_constraints"]}
        yield {
            "name": name,
            "start": [float(start[joint]) for joint in joints],
            "goal": [float(goal[joint]) for joint in joints],
            "scene": scene_file(name, scene),
        }


def scene_file(name: str, scene: dict) -> dict:
    """A PlanningScene as ``semfm.scene/1``. A box has [x, y, z], a cylinder [height, radius]."""
    file = {"format": "semfm.scene/1", "boxes": [], "cylinders": []}
    for obstacle in scene["world"]["collision_objects"]:
        shapes = zip(obstacle["primitives"], obstacle["primitive_poses"])  # noqa: B905
        for i, (shape, pose) in enumerate(shapes):
            placed = {
                "name": obstacle["id"] if i == 0 else f"{obstacle['id']} {i}",
                "position": [float(x) for x in pose["position"]],
                "quaternion_xyzw": [float(x) for x in pose["orientation"]],
            }
            sizes = [float(x) for x in shape["dimensions"]]
            if shape["type"] == "box":
                file["boxes"].append(placed | {"size": sizes})
            elif shape["type"] == "cylinder":
                file["cylinders"].append(placed | {"length": sizes[0], "radius": sizes[1]})
            else:
                raise SystemExit(f"{name}: a {shape['type']} is not expected")
    return file


class IndependentChecker:
    """Pinocchio's kinematics and coal's queries on the meshes of the links."""

    def __init__(self, folder: Path, joints: list[str]):
        import coal
        import pinocchio

        self.coal, self.pin = coal, pinocchio
        urdf = str(folder / "robot.urdf")
        self.model = pinocchio.buildModelFromUrdf(urdf)
        if list(self.model.names)[1:] != joints:
            raise SystemExit(
                f"{urdf}: expected joints {joints}, found {list(self.model.names)[1:]}"
            )
        self.links = pinocchio.buildGeomFromUrdf(
            self.model, urdf, pinocchio.GeometryType.COLLISION, package_dirs=[str(folder)]
        )
        self.links.addAllCollisionPairs()
        pinocchio.removeCollisionPairs(self.model, self.links, str(folder / "robot.srdf"), False)
        self.data = self.model.createData()

    def checks(self, scene: dict, first_only: bool = False):
        """Returns the contacts of joint values in a scene, each as two names; at most one with
        ``first_only``."""
        pin, coal = self.pin, self.coal
        geometry = self.links.copy()
        n_links = geometry.ngeoms
        for obstacle in scene["boxes"] + scene["cylinders"]:
            shape = (
                coal.Box(*obstacle["size"])
                if "size" in obstacle
                else coal.Cylinder(obstacle["radius"], obstacle["length"])
            )
            quaternion = pin.Quaternion(np.array(obstacle["quaternion_xyzw"])).normalized()
            at = pin.SE3(quaternion.matrix(), np.array(obstacle["position"]))
            added = geometry.addGeometryObject(pin.GeometryObject(obstacle["name"], 0, at, shape))
            for link in range(n_links):
                # Joint 0 is the world: such a link does not move.
                if geometry.geometryObjects[link].parentJoint != 0:
                    geometry.addCollisionPair(pin.CollisionPair(link, added))
        geometry_data = pin.GeometryData(geometry)

        def contacts(q: list[float]) -> list[tuple[str, str]]:
            pin.computeCollisions(
                self.model, self.data, geometry, geometry_data, np.array(q), first_only
            )
            return [
                tuple(
                    re.sub(r"_\d+$", "", geometry.geometryObjects[i].name)
                    for i in (pair.first, pair.second)
                )
                for pair, result in zip(geometry.collisionPairs, geometry_data.collisionResults)
                if result.isCollision()
            ]

        return contacts


def judge(folders: list[Path]) -> None:
    """Writes what touches at each start and goal, by coal."""
    for folder in folders:
        content = json.loads((folder / "problems.json").read_text())
        checker = IndependentChecker(folder, content["joints"])
        with (folder / "coal.jsonl").open("w") as lines:
            for problem in content["problems"]:
                contacts = checker.checks(problem["scene"])
                middle = [(a + b) / 2 for a, b in zip(problem["start"], problem["goal"])]
                for state, q in (
                    ("start", problem["start"]),
                    ("goal", problem["goal"]),
                    ("middle", middle),
                ):
                    found = contacts(q)
                    line = {
                        "problem": problem["name"],
                        "state": state,
                        "free": not found,
                        "contacts": found,
                    }
                    lines.write(json.dumps(line) + "\n")


def compare(folders: list[Path]) -> None:
    """Prints the table of free states and what the two checkers differ in."""
    rows, different = [], []
    for folder in folders:
        content = json.loads((folder / "problems.json").read_text())
        ours, theirs = (answers(folder / name) for name in ("ours.jsonl", "coal.jsonl"))
        groups: dict[str, list[dict]] = {}
        for problem in content["problems"]:
            answer = {}
            for state in ("start", "goal", "middle"):
                pair = ours[problem["name"], state], theirs[problem["name"], state]
                answer[state] = tuple(one["free"] for one in pair)
                if pair[0]["free"] != pair[1]["free"]:
                    different.append(
                        (problem["name"], state, *(one["contacts"] or "free" for one in pair))
                    )
            groups.setdefault(problem["name"].split("/")[0], []).append(answer)
        rows += [*groups.items(), (f"**{content['robot']}, all**", sum(groups.values(), []))]
    print(
        "| problems | n | starts free: ours | coal | goals free: ours | coal | valid: ours | coal "
        "| halfway free: ours | coal | states agreed |"
    )
    print("| --- " * 11 + "|")
    for group, found in rows:
        starts, goals, middles = (
            [sum(one[state][who] for one in found) for who in (0, 1)]
            for state in ("start", "goal", "middle")
        )
        valid = [sum(one["start"][who] and one["goal"][who] for one in found) for who in (0, 1)]
        agreed = sum(one[state][0] == one[state][1] for one in found for state in one)
        numbers = [len(found), *starts, *goals, *valid, *middles, f"{agreed} of {3 * len(found)}"]
        print(f"| {group} | {' | '.join(map(str, numbers))} |")
    for name, state, own, other in different:
        print(f"{name} {state}: ours {own}; coal {other}")


def answers(path: Path) -> dict:
    """A checker's answers by problem and state."""
    lines = map(json.loads, path.read_text().splitlines())
    return {(line["problem"], line["state"]): line for line in lines}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    commands = parser.add_subparsers(dest="command", required=True)
    command = commands.add_parser("unpack")
    command.add_argument("data", type=Path)
    command.add_argument("cache", type=Path)
    command.add_argument("--every", type=int, default=1, help="only each N-th problem")
    for name in ("judge", "compare"):
        command = commands.add_parser(name)
        command.add_argument("folders", type=Path, nargs="+")
    arguments = parser.parse_args()
    if arguments.command == "unpack":
        unpack(arguments.data, arguments.cache, arguments.every)
    elif arguments.command == "judge":
        judge(arguments.folders)
    else:
        compare(arguments.folders)


if __name__ == "__main__":
    main()
