"""Replays a motion of ``semfm-cli plan`` in a checker that shares nothing with it: pinocchio and coal on real meshes.

Reads ``trajectory.json`` and the files that it is made of (the robot's URDF, the hand's meshes, the object's mesh), and looks
at every millisecond, by the cubics that ``docs/formats.md`` defines:

- positions, velocities and accelerations against limits, times that rise, rest at both ends of each segment;
- the arm and the hand against themselves, the table, obstacles and the object, as triangles. The object may be touched by
  fingers only, from the beginning of ``close``; from the beginning of ``lift`` it is carried, may still touch the table
  until it is a millimetre above its place, and never sinks.
"""

from __future__ import annotations

import json
import re
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree

import coal
import numpy as np
import pinocchio as pin

from cubics import Cubics

#: Half-size of the box that stands for what is below the table where a shape has no corners, metres.
GROUND = 2.0
#: By which share rounding may pass a limit, and by how much a position (radians).
ROUNDING, POSITION_ROUNDING = 1e-6, 1e-9
#: Height from which on the carried object may not touch the table, and how far it may sink, metres.
LIFTED, SINKING = 1e-3, 1e-4
#: Random states by which pairs of links that always touch are found where there is no SRDF.
N_SAMPLES = 200


@dataclass
class Arm:
    """A robot as its files have it."""

    urdf: Path
    #: Folders of `package://NAME/`.
    packages: dict[str, Path]
    srdf: Path | None
    #: Acceleration limit of each joint, base to tip.
    accelerations: list[float]
    #: The URDF of a gripper that the robot's URDF does not have.
    gripper: Path | None


@dataclass
class HandShape:
    """A shape of a hand that is no part of the robot's URDF."""

    #: Its number in pinocchio's list.
    index: int
    #: `palm`, `left` or `right`.
    role: str
    #: For each opening of the trajectory.
    tip_from_part: list[pin.SE3]
    part_from_shape: pin.SE3


@dataclass
class Replay:
    """What was found at one millisecond after the other."""

    n_states: int = 0
    #: A line for each thing that is wrong.
    faults: list[str] = field(default_factory=list)
    #: First time at which a finger touches the object, relative to the beginning of `close`, seconds.
    first_touch: float | None = None
    #: Distance from the object at the end of `close` of the finger that is farther from it, metres; 0 where both touch.
    gap: float = float("nan")


def read_obj(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and triangles."""
    vertices, faces = [], []
    for line in path.read_text().splitlines():
        words = line.split()
        if words[:1] == ["v"]:
            vertices.append([float(x) for x in words[1:4]])
        elif words[:1] == ["f"]:
            corners = [int(word.split("/")[0]) - 1 for word in words[1:]]
            faces += [[corners[0], corners[i], corners[i + 1]] for i in range(1, len(corners) - 1)]
    return np.array(vertices), np.array(faces)


def bvh(vertices: np.ndarray, faces: np.ndarray) -> coal.BVHModelOBBRSS:
    points = coal.StdVec_Vec3s()
    points.extend(list(vertices))
    triangles = coal.StdVec_Triangle()
    triangles.extend([coal.Triangle(*map(int, face)) for face in faces])
    model = coal.BVHModelOBBRSS()
    model.beginModel(len(triangles), len(points))
    model.addSubModel(points, triangles)
    model.endModel()
    return model


def corners(shape) -> np.ndarray | None:
    """Corners of a mesh or a box; none of a shape that is round."""
    if isinstance(shape, coal.BVHModelBase):
        return np.array(shape.vertices())
    if isinstance(shape, coal.Box):
        signs = np.array(np.meshgrid(*[[-1, 1]] * 3)).reshape(3, -1).T
        return signs * np.asarray(shape.halfSide).ravel()
    return None


def se3(matrix) -> pin.SE3:
    matrix = np.asarray(matrix)
    # Files round: the nearest rotation.
    u, _, vt = np.linalg.svd(matrix[:3, :3])
    return pin.SE3(u @ vt, matrix[:3, 3])


class Segment(Cubics):
    """Positions, velocities, accelerations and opening of a segment at any time."""

    def __init__(self, points: list[dict]):
        times, positions, velocities, self.opening = (
            np.array([point[key] for point in points]) for key in ("time", "positions", "velocities", "opening")
        )
        super().__init__(times, positions, velocities)

    def opening_at(self, times: np.ndarray) -> np.ndarray:
        return np.interp(times, self.times, self.opening)


class World:
    """A robot with its hand, a table, obstacles and an object."""

    def __init__(self, arm: Arm, motion: dict, object_file: Path):
        self.arm, self.motion = arm, motion
        text = arm.urdf.read_text()
        for name, folder in arm.packages.items():
            text = text.replace(f"package://{name}/", f"{folder}/")
        text = re.sub(r"<visual>.*?</visual>", "", text, flags=re.DOTALL)
        text = re.sub(r'filename="(\.[^"]*)"', lambda found: f'filename="{(arm.urdf.parent / found[1]).resolve()}"', text)
        self.model = pin.buildModelFromXML(text)
        self.geometry = pin.buildGeomFromUrdfString(self.model, text, pin.GeometryType.COLLISION)
        self.data = self.model.createData()
        self.base = self.model.getFrameId(motion["robot"]["base"])
        self.tip = self.model.getFrameId(motion["robot"]["tip"])
        self.columns = [self.model.joints[self.model.getJointId(name)].idx_q for name in motion["joint_names"]]
        self.fingers = self.finger_tables(ElementTree.fromstring(text))
        pin.framesForwardKinematics(self.model, self.data, pin.neutral(self.model))
        self.world_from_base = self.data.oMf[self.base].copy()
        self.links = list(range(self.geometry.ngeoms))
        self.hand = self.add_hand()
        self.standing = self.add_obstacles()
        vertices, faces = read_obj(object_file)
        self.vertices = vertices * motion["object"]["scale"]
        self.base_from_object = se3(motion["object"]["base_from_object"])
        self.object = self.add("object", 0, self.world_from_base * self.base_from_object, bvh(self.vertices, faces))
        self.pair_up()

    def finger_tables(self, urdf: ElementTree.Element) -> list[tuple[int, np.ndarray]]:
        """Each finger's joint with its openings and positions; joints that follow one by a mimic, too."""
        tables = {finger["joint"]: np.array(finger["positions"]) for finger in self.motion["robot"]["fingers"]}
        for joint in urdf.iterfind("joint"):
            mimic = joint.find("mimic")
            if mimic is not None and mimic.get("joint") in tables:
                factor, offset = float(mimic.get("multiplier", 1)), float(mimic.get("offset", 0))
                leader = tables[mimic.get("joint")]
                tables.setdefault(joint.get("name"), np.c_[leader[:, 0], factor * leader[:, 1] + offset])
        return [(self.model.joints[self.model.getJointId(name)].idx_q, table) for name, table in tables.items()]

    def add(self, name: str, joint: int, placement: pin.SE3, shape) -> int:
        return self.geometry.addGeometryObject(pin.GeometryObject(name, joint, placement, shape))

    def add_hand(self) -> list[HandShape]:
        """Meshes of a gripper that the robot's URDF does not have, at the tip; none where it has one."""
        if self.arm.gripper is None:
            return []
        hand, shapes, added = self.motion["hand"], gripper_shapes(self.arm.gripper), []
        joint = self.model.frames[self.tip].parentJoint
        for number, part in enumerate(hand["parts"]):
            poses = [se3(row[number]) for row in hand["tip_from_part"]]
            # A link with several shapes may be several parts: they move alike.
            for link_from_shape, shape in shapes.pop(part["link"], []):
                index = self.add(f"hand:{part['link']}_{len(added)}", joint, pin.SE3.Identity(), shape)
                added.append(HandShape(index, part["role"], poses, link_from_shape))
        return added

    def add_obstacles(self) -> list[int]:
        added = []
        #: Of each half-space its place.
        self.half_spaces: dict[int, pin.SE3] = {}
        for obstacle in self.motion["obstacles"]:
            at = self.world_from_base * se3(obstacle["base_from_obstacle"])
            shape = obstacle["shape"]
            if shape["type"] == "half_space":
                below = at * pin.SE3(np.eye(3), np.array([0, 0, -GROUND]))
                added.append(self.add(obstacle["name"], 0, below, coal.Box(2 * GROUND, 2 * GROUND, 2 * GROUND)))
                self.half_spaces[added[-1]] = at
            elif shape["type"] == "box":
                added.append(self.add(obstacle["name"], 0, at, coal.Box(*shape["size"])))
            else:
                raise SystemExit(f"obstacle {obstacle['name']}: a {shape['type']} is not expected")
        return added

    def pair_up(self) -> None:
        """Lists pairs of each kind, as places in the geometry's list of pairs."""
        geometry, hand = self.geometry, [part.index for part in self.hand]
        joint_of = [shape.parentJoint for shape in geometry.geometryObjects]
        columns = {column for column, _ in self.fingers}
        # Shapes of each finger: of each side of a hand, of each finger's joint of a robot that has them.
        self.sides: dict[str | int, list[int]] = {}
        for part in self.hand:
            if part.role != "palm":
                self.sides.setdefault(part.role, []).append(part.index)
        for link in self.links:
            if joint_of[link] and self.model.joints[joint_of[link]].idx_q in columns:
                self.sides.setdefault(joint_of[link], []).append(link)
        self.finger_shapes = {shape for side in self.sides.values() for shape in side}
        geometry.addAllCollisionPairs()
        if self.arm.srdf:
            pin.removeCollisionPairs(self.model, geometry, str(self.arm.srdf), False)
        all_pairs = [(pair.first, pair.second) for pair in geometry.collisionPairs]
        geometry.removeAllCollisionPairs()
        tip_joint = self.model.frames[self.tip].parentJoint
        links = [pair for pair in all_pairs if max(pair) < len(self.links) and not self.are_adjacent(*pair)]
        if not self.arm.srdf:
            links = self.without_constant(links)
        mounted = [(link, part) for link in self.links for part in hand if joint_of[link] != tip_joint]
        moving = [shape for shape in self.links + hand if joint_of[shape]]
        kinds = {
            "self": links + mounted,
            "around": [(shape, other) for shape in moving for other in self.standing],
            "object": [(shape, self.object) for shape in self.links + hand],
            "carried": [(self.object, other) for other in self.standing],
        }
        self.pairs: dict[str, range] = {}
        for kind, pairs in kinds.items():
            first = len(geometry.collisionPairs)
            self.pairs[kind] = range(first, first + len(pairs))
            for a, b in pairs:
                # Pinocchio wants the smaller number first.
                geometry.addCollisionPair(pin.CollisionPair(min(a, b), max(a, b)))
        self.geometry_data = pin.GeometryData(geometry)
        self.corners = {shape: corners(geometry.geometryObjects[shape].geometry) for shape in [*moving, self.object]}

    def are_adjacent(self, a: int, b: int) -> bool:
        """Whether no joint or one is between two links."""
        joints = [self.geometry.geometryObjects[shape].parentJoint for shape in (a, b)]
        return joints[0] == joints[1] or self.model.parents[max(joints)] == min(joints)

    def without_constant(self, pairs: list) -> list:
        """Without an SRDF: pairs that touch in every random state are meant to."""
        generator = np.random.default_rng(0)
        geometry = self.geometry.copy()
        geometry.removeAllCollisionPairs()
        for a, b in pairs:
            geometry.addCollisionPair(pin.CollisionPair(a, b))
        data = pin.GeometryData(geometry)
        low, high = self.model.lowerPositionLimit, self.model.upperPositionLimit
        always = np.ones(len(pairs), bool)
        for _ in range(N_SAMPLES):
            pin.computeCollisions(self.model, self.data, geometry, data, generator.uniform(low, high), False)
            always &= [result.isCollision() for result in data.collisionResults]
        return [pair for pair, touching in zip(pairs, always) if not touching]

    def configuration(self, q: np.ndarray, opening: float) -> np.ndarray:
        full = pin.neutral(self.model)
        full[self.columns] = q
        for column, table in self.fingers:
            full[column] = np.interp(opening, table[:, 0], table[:, 1])
        return full

    def place_hand(self, opening: float) -> None:
        """Puts the parts of a hand that is no part of the URDF where the trajectory has them."""
        if not self.hand:
            return
        openings = self.motion["hand"]["openings"]
        at = float(np.interp(opening, openings, np.arange(len(openings))))
        first = min(int(at), max(len(openings) - 2, 0))
        joint_from_tip = self.model.frames[self.tip].placement
        for part in self.hand:
            following = part.tip_from_part[min(first + 1, len(openings) - 1)]
            tip_from_part = pin.SE3.Interpolate(part.tip_from_part[first], following, at - first)
            placement = joint_from_tip * tip_from_part * part.part_from_shape
            self.geometry.geometryObjects[part.index].placement = placement

    def place_object(self, base_from_object: pin.SE3) -> None:
        self.geometry.geometryObjects[self.object].placement = self.world_from_base * base_from_object

    def lowest(self, base_from_object: pin.SE3) -> float:
        """Height of the object's lowest corner."""
        return float((base_from_object.rotation[2] @ self.vertices.T).min() + base_from_object.translation[2])

    def touching(self, kinds: list[str], q: np.ndarray) -> list[tuple[int, int]]:
        pin.updateGeometryPlacements(self.model, self.data, self.geometry, self.geometry_data, q)
        found = []
        for kind in kinds:
            for k in self.pairs[kind]:
                pair = self.geometry.collisionPairs[k]
                if self.overlap(k, pair.first, pair.second):
                    found.append((pair.first, pair.second))
        return found

    def overlap(self, k: int, a: int, b: int) -> bool:
        """Whether the `k`-th pair overlaps. What has corners is in a half-space where a corner is: no need for coal."""
        space, shape = (a, b) if a in self.half_spaces else (b, a)
        points = self.corners.get(shape)
        if space not in self.half_spaces or points is None:
            return pin.computeCollision(self.geometry, self.geometry_data, k)
        space_from_shape = self.half_spaces[space].inverse() * self.geometry_data.oMg[shape]
        return (points @ space_from_shape.rotation[2]).min() + space_from_shape.translation[2] < 0

    def gap(self, q: np.ndarray) -> float:
        """Distance from the object of the finger that is farther from it; where shapes overlap, 0."""
        pin.updateGeometryPlacements(self.model, self.data, self.geometry, self.geometry_data, q)
        distances = {}
        for k in self.pairs["object"]:
            pair = self.geometry.collisionPairs[k]
            distance = pin.computeDistance(self.geometry, self.geometry_data, k).min_distance
            distances[pair.first] = distances[pair.second] = max(distance, 0.0)
        return max(min(distances[shape] for shape in side) for side in self.sides.values())

    def name(self, shape: int) -> str:
        return self.geometry.geometryObjects[shape].name


def gripper_shapes(urdf: Path) -> dict[str, list]:
    """Of each link its shapes, with their places in its frame."""
    shapes: dict[str, list] = {}
    loader = coal.MeshLoader()
    for link in ElementTree.parse(urdf).iterfind("link"):
        for collision in link.iterfind("collision"):
            origin = collision.find("origin")
            xyz, rpy = ([float(x) for x in (origin.get(key, "0 0 0") if origin is not None else "0 0 0").split()] for key in ("xyz", "rpy"))
            at = pin.SE3(pin.rpy.rpyToMatrix(*rpy), np.array(xyz))
            mesh, box = collision.find("geometry/mesh"), collision.find("geometry/box")
            if mesh is not None:
                scale = np.array([float(x) for x in mesh.get("scale", "1 1 1").split()])
                shape = loader.load(str((urdf.parent / mesh.get("filename")).resolve()), scale)
            elif box is not None:
                shape = coal.Box(*(float(x) for x in box.get("size").split()))
            else:
                raise SystemExit(f"{urdf}: link {link.get('name')}: a shape that is not expected")
            shapes.setdefault(link.get("name"), []).append((at, shape))
    return shapes


def replay(arm: Arm, trajectory: Path, object_file: Path) -> Replay:
    """Looks at every millisecond of a motion."""
    motion = json.loads(trajectory.read_text())
    world = World(arm, motion, object_file)
    found = Replay()
    segments = {segment["kind"]: Segment(segment["points"]) for segment in motion["segments"]}
    ends = [(cubics.times[0], cubics.times[-1]) for cubics in segments.values()]
    if any(before[1] != after[0] for before, after in zip(ends, ends[1:])):
        found.faults.append("a segment does not begin where the one before ends")
    tip_from_object = None
    for kind, cubics in segments.items():
        times = np.append(np.arange(cubics.times[0], cubics.times[-1], 1e-3), cubics.times[-1])
        (q, v, a), openings = cubics.at(times), cubics.opening_at(times)
        faults = dict.fromkeys(out_of_limits(world, cubics, q, v, a))
        for time, positions, opening in zip(times, q, openings):
            full = world.configuration(positions, opening)
            pin.framesForwardKinematics(world.model, world.data, full)
            world.place_hand(opening)
            kinds = ["self", "around", "object"]
            if kind == "lift":
                base_from_tip = world.world_from_base.inverse() * world.data.oMf[world.tip]
                if tip_from_object is None:
                    tip_from_object = base_from_tip.inverse() * world.base_from_object
                base_from_object = base_from_tip * tip_from_object
                world.place_object(base_from_object)
                risen = world.lowest(base_from_object) - world.lowest(world.base_from_object)
                if risen < -SINKING:
                    faults.setdefault("the object sinks", f"by {-1e3 * risen:.2f} mm at {time:.3f} s")
                if risen > LIFTED:
                    kinds.append("carried")
            for pair in world.touching(kinds, full):
                if world.object in pair and world.finger_shapes & set(pair):
                    if found.first_touch is None:
                        found.first_touch = time - segments["close"].times[0]
                    if kind in ("close", "lift"):
                        continue
                faults.setdefault(" touches ".join(map(world.name, pair)), f"at {time:.3f} s")
            found.n_states += 1
        if kind == "close":
            found.gap = world.gap(full)
        found.faults += [" ".join(filter(None, (f"{kind}:", *fault))) for fault in faults.items()]
    return found


def out_of_limits(world: World, cubics: Cubics, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> list[str]:
    """What is wrong with a segment but for what it touches."""
    faults = []
    if (np.diff(cubics.times) <= 0).any():
        faults.append("times do not rise")
    if cubics.v[[0, -1]].any():
        faults.append("an end is not at rest")
    names = world.motion["joint_names"]
    velocity = world.model.velocityLimit[[world.model.joints[world.model.getJointId(name)].idx_v for name in names]]
    for what, values, limit in (("velocity", v, velocity), ("acceleration", a, np.array(world.arm.accelerations))):
        share = (abs(values) / limit).max()
        if share > 1 + ROUNDING:
            faults.append(f"{what}: {share:.6f} of its limit")
    low, high = (side[world.columns] for side in (world.model.lowerPositionLimit, world.model.upperPositionLimit))
    if (q < low - POSITION_ROUNDING).any() or (q > high + POSITION_ROUNDING).any():
        faults.append("a position is out of limits")
    return faults
