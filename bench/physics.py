"""Tries grasps in MuJoCo: pads close, the object is lifted, shaken and tilted.

    python bench/physics.py mug.grasps.json=mug.obj@0.118 … [--friction 0.3 0.5 0.8] [--force 15 30 60]
        [--seeds 1] [--limit 20] [-o trials.jsonl] [--frames 0 -o frames.json]

Reads nothing but ``grasps.json`` (docs/formats.md) and the mesh that it is of; after ``@`` the object's mass
in kilograms, else ``--density`` gives it. Where MuJoCo is missing the program makes an environment of its
own (``.venv-physics`` beside ``bench``) and starts again there.

**Object.** Only pads touch it, so it is cut into convex columns along the closing axis, a fifth of the pad
wide, over the pads and 8 mm around them: each column is the hull of what a grid of rays (half a column
apart) and the mesh's vertices meet between the pads. What a gap narrower than a finger separates is one, as
for the grasp itself. The error of the columns is measured at rays in between (``column_error``) and printed.
Mass, centre of mass and inertia are those of the whole: of the volume where the mesh is watertight, of the
surface where it is not.

**Hand.** Two boxes with the pad's rectangle, coupled as in the hands (both fingers always move alike), and an
elastic foundation of ``FOUNDATION`` on them: 3 mm of rubber. Fingers and palm are left out: they can only
help to hold. The pads begin 3 mm off the object and close at a constant speed until the force is reached.

**Trial.** The hand stands still and gravity moves, which by the equivalence of both is the same for every
acceleration; centrifugal forces of the slow tilt are left out. Weight comes on, the hand lifts with 4 m/s²,
is shaken once along each of three axes (5 m/s², 6.7 Hz) and tilted: the weight goes around a cone of 45°. Where the file
names a table its normal is up, otherwise the hand comes from above.

Each seed moves hand and object against each other by 1 mm and 1.5° (standard deviations). A trial tells
``hold`` (both pads touch at the end), ``slip`` (metres, of the point between the contacts) and ``turn``
(radians) while carried, ``closing_turn`` and ``closing_shift`` while the pads close, and ``strict``: held,
with less than 1 cm and 20° from the first touch to the end. Results are cached by the content of everything
that they depend on.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import own_environment

#: Modules and what pip is asked for.
PACKAGES = {"mujoco": "mujoco>=3.3", "numpy": "numpy", "scipy": "scipy", "trimesh": "trimesh"}

if __name__ == "__main__":
    own_environment.enter("physics", PACKAGES)

import mujoco  # noqa: E402
import numpy as np  # noqa: E402
import trimesh  # noqa: E402
from scipy.spatial import ConvexHull, QhullError  # noqa: E402
from scipy.spatial.transform import Rotation  # noqa: E402

#: Raised whenever a trial would come out otherwise: part of the key under which results are kept.
VERSION = 1
#: Stiffness of the pads, N/m³: rubber of 1.5 MPa, 3 mm thick. 30 N press a full pad of 18 mm in by .2 mm.
FOUNDATION = 5e8
#: Columns across a pad, and how far beside it they still stand, metres.
COLUMNS, BESIDE = 5, 0.008
#: What stands out of the interval between the contacts by less than this belongs to what is held, metres.
WINDOW = 0.006
#: Least thickness of a column, metres: a sheet without inside has none of its own.
THINNEST = 1e-3
#: A column of less than this is none, m³: a splinter that MuJoCo would not take.
LEAST_VOLUME = 1e-13
#: Kilograms and inertia factor of a finger.
FINGER_MASS = 0.2
STEP, STEPS_A_CONTROL = 0.0025, 4
STAND_OFF, SPEED = 0.003, 0.03
G = 9.81
#: Standard deviations of the hand's place: metres, radians.
PLACE_ERROR, TURN_ERROR = 1e-3, np.radians(1.5)
STRICT_SLIP, STRICT_TURN = 0.01, np.radians(20)
#: Farther than this from where it was, the object is lost, metres.
LOST = 0.05


@dataclass
class Body:
    """An object in metres with the mass properties of a density of one (of volume or area)."""

    vertices: np.ndarray
    faces: np.ndarray
    centre: np.ndarray
    #: Inertia about the centre for a mass of one kilogram, m².
    inertia: np.ndarray
    #: None where the mesh is not watertight.
    volume: float | None

    @classmethod
    def read(cls, path: Path, scale: float, n_triangles: int | None = None) -> Body:
        mesh = trimesh.Trimesh(*read_obj(path), process=False) if path.suffix == ".obj" else None
        mesh = mesh or trimesh.load(path, process=False, force="mesh", skip_materials=True)
        if n_triangles is not None and len(mesh.faces) != n_triangles:
            raise SystemExit(f"{path}: expected {n_triangles} triangles, found {len(mesh.faces)}")
        mesh.apply_scale(scale)
        welded = trimesh.Trimesh(mesh.vertices, mesh.faces, process=True)
        if welded.is_volume and welded.volume > 0:
            inertia = welded.moment_inertia / welded.volume
            return cls(mesh.vertices, mesh.faces, welded.center_mass, inertia, welded.volume)
        corners, areas = mesh.triangles, mesh.area_faces
        centre = (areas[:, None] * corners.mean(1)).sum(0) / areas.sum()
        # ∫ x xᵀ over a triangle: area / 12 · (Σ cᵢcᵢᵀ + s sᵀ), s the sum of its corners.
        local = corners - centre
        total = local.sum(1)
        second = np.einsum("f,fki,fkj->ij", areas / 12, local, local)
        second += np.einsum("f,fi,fj->ij", areas / 12, total, total)
        inertia = (np.trace(second) * np.eye(3) - second) / areas.sum()
        return cls(mesh.vertices, mesh.faces, centre, inertia, None)


def read_obj(path: Path) -> tuple[list, list]:
    """Vertices and triangles alone, as they stand in the file: no textures, which would need other packages."""
    vertices, faces = [], []
    for line in path.read_text(errors="replace").splitlines():
        word, *rest = line.split() or [""]
        if word == "v":
            vertices.append([float(x) for x in rest[:3]])
        elif word == "f":
            ids = [int(corner.split("/")[0]) for corner in rest]
            ids = [i - 1 if i > 0 else len(vertices) + i for i in ids]
            faces += [(ids[0], b, c) for b, c in zip(ids[1:], ids[2:])]
    return vertices, faces


@dataclass
class Columns:
    """The object between the pads as convex pieces, in the TCP's frame, metres."""

    pieces: list[np.ndarray]
    #: Median, 95th percentile and largest distance along the closing axis between surface and pieces at rays
    #: that did not make them, metres, and the share of those rays that miss the pieces.
    error: dict[str, float]


def crossings(triangles: np.ndarray, rays: np.ndarray) -> np.ndarray:
    """For each ray (n × 2: x and z, along y) the least and largest y at which it meets a triangle; NaN where
    there is none. (n × 2)"""
    out = np.full((len(rays), 2), np.nan)
    a, b, c = (triangles[:, k] for k in range(3))
    ab, ac = (b - a)[:, [0, 2]], (c - a)[:, [0, 2]]
    det = ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]
    use = np.abs(det) > 1e-14
    a, ab, ac, det = a[use], ab[use], ac[use], det[use]
    dyb, dyc = (b[use] - a)[:, 1], (c[use] - a)[:, 1]
    if not len(a):
        return out
    for start in range(0, len(rays), 256):
        ap = rays[start : start + 256, None] - a[None][:, :, [0, 2]]
        u = (ap[..., 0] * ac[:, 1] - ap[..., 1] * ac[:, 0]) / det
        v = (ab[:, 0] * ap[..., 1] - ab[:, 1] * ap[..., 0]) / det
        inside = (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1 + 1e-9)
        y = a[:, 1] + u * dyb + v * dyc
        low = np.where(inside, y, np.inf).min(1)
        high = np.where(inside, y, -np.inf).max(1)
        met = inside.any(1)
        out[start : start + 256][met] = np.stack([low, high], 1)[met]
    return out


def columns_of(body: Body, object_from_tcp: np.ndarray, held: np.ndarray, pad: np.ndarray) -> Columns:
    """Cuts what is held between ``held`` (least and largest y in the TCP's frame) into columns."""
    pitch = pad[0] / COLUMNS
    n = [int(np.ceil((extent / 2 + BESIDE) / pitch - 0.5)) * 2 + 1 for extent in pad]
    half = np.array(n) * pitch / 2
    local = (body.vertices - object_from_tcp[:3, 3]) @ object_from_tcp[:3, :3]
    triangles = local[body.faces]
    low, high = triangles.min(1), triangles.max(1)
    beyond = np.array([half[0], 0, half[1]])
    window = held + [-WINDOW, WINDOW]
    near = (low[:, 0] <= beyond[0]) & (high[:, 0] >= -beyond[0])
    near &= (low[:, 2] <= beyond[2]) & (high[:, 2] >= -beyond[2])
    near &= (low[:, 1] <= window[1]) & (high[:, 1] >= window[0])
    triangles = triangles[near]
    axes = [np.linspace(-h, h, 2 * k + 1) for h, k in zip(half, n)]
    # Off the mesh's own vertices and edges, which often lie on round numbers.
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), -1) + 1.7e-7
    hits = crossings(triangles, grid.reshape(-1, 2)).reshape(*grid.shape[:2], 2)
    hits = np.clip(hits, *window)
    corners = triangles.reshape(-1, 3)
    corners = np.unique(corners[(corners[:, 1] >= window[0]) & (corners[:, 1] <= window[1])], axis=0)
    cell = np.floor((corners[:, [0, 2]] + half) / pitch).astype(int)
    pieces, where = [], {}
    for i in range(n[0]):
        for k in range(n[1]):
            sides = (slice(2 * i, 2 * i + 3), slice(2 * k, 2 * k + 3))
            xz, y = grid[sides].reshape(-1, 2), hits[sides].reshape(-1, 2)
            met = ~np.isnan(y[:, 0])
            low = np.column_stack([xz[met, 0], y[met, 0], xz[met, 1]])
            high = np.column_stack([xz[met, 0], y[met, 1], xz[met, 1]])
            points = np.vstack([low, high, corners[(cell == [i, k]).all(1)]])
            piece = hull(points)
            if piece is not None:
                where[i, k] = len(pieces)
                pieces.append(piece)
    return Columns(pieces, column_error(triangles, pieces, where, pad, half, pitch, window))


def hull(points: np.ndarray) -> np.ndarray | None:
    """Corners of the convex hull, made at least ``THINNEST`` thick along y; None for less than a body."""
    if len(points) < 3:
        return None
    if np.ptp(points[:, 1]) < THINNEST:
        grown = (THINNEST - np.ptp(points[:, 1])) / 2
        points = np.vstack([points - [0, grown, 0], points + [0, grown, 0]])
    if np.ptp(points[:, 0]) < 1e-4 or np.ptp(points[:, 2]) < 1e-4:
        return None
    try:
        convex = ConvexHull(points)
    except QhullError:
        return None
    return points[convex.vertices] if convex.volume > LEAST_VOLUME else None


def column_error(triangles, pieces, where, pad, half, pitch, window) -> dict[str, float]:
    """Compares pieces and surface at rays of a grid that did not make them, within the pad."""
    axes = [np.arange(-e / 2 + pitch / 4, e / 2, pitch / 2) for e in pad]
    rays = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 2)
    true = np.clip(crossings(triangles, rays), *window)
    off, missed, n = [], 0, 0
    for ray, ends in zip(rays, true):
        if np.isnan(ends[0]):
            continue
        n += 1
        piece = where.get(tuple(np.floor((ray + half) / pitch).astype(int)))
        if piece is None:
            missed += 1
            continue
        corners = ConvexHull(pieces[piece])
        found = crossings(pieces[piece][corners.simplices], ray[None])[0]
        if np.isnan(found[0]):
            missed += 1
        else:
            off.extend(np.abs(found - ends))
    off = np.array(off or [0.0])
    return {
        "median": float(np.median(off)),
        "p95": float(np.quantile(off, 0.95)),
        "largest": float(off.max()),
        "missed": missed / max(n, 1),
    }


class Bench:
    """One grasp in MuJoCo, tried under any friction, force, mass and seed."""

    def __init__(self, body: Body, answer: dict, grasp: dict):
        self.body = body
        self.pad = np.array(answer["gripper"]["pad"])
        self.pose = np.array(grasp["object_from_tcp"])
        local = self._into_tcp(np.array(grasp["contacts"]))
        #: The point whose way is the slip: between the contacts.
        self.middle = local.mean(0)
        self.width = float(grasp["width"])
        held = np.array([-self.width / 2, self.width / 2])
        self.columns = columns_of(body, self.pose, held, self.pad)
        table = answer.get("table")
        down = -np.array(table["normal"]) if table else self.pose[:3, 2]
        self.down = self.pose[:3, :3].T @ down
        self.model = self._model()
        self.data = mujoco.MjData(self.model)
        self.pads = [self.model.geom(name).id for name in ("left", "right")]

    def _into_tcp(self, points: np.ndarray) -> np.ndarray:
        return (points - self.pose[:3, 3]) @ self.pose[:3, :3]

    def _model(self) -> mujoco.MjModel:
        spec = mujoco.MjSpec()
        option = spec.option
        option.timestep, option.gravity = STEP, [0, 0, 0]
        option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        option.cone, option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, 20
        option.iterations, option.tolerance = 30, 1e-7
        # One contact a column: the columns are the foundation's elements.
        option.disableflags |= mujoco.mjtDisableBit.mjDSBL_MULTICCD
        self.start = self.width / 2 + STAND_OFF
        # A column counts whole where the box meets it: half a column smaller all round, the box meets as many
        # as fit on the pad.
        half = (self.pad - self.pad[0] / COLUMNS) / 2
        for name, side in (("left", -1), ("right", 1)):
            finger = spec.worldbody.add_body(name=name, pos=[0, side * self.start, 0])
            finger.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, -side, 0])
            finger.add_geom(
                name=name,
                type=mujoco.mjtGeom.mjGEOM_BOX,
                size=[half[0], 0.005, half[1]],
                pos=[0, side * 0.005, 0],
                mass=FINGER_MASS,
                priority=1,
                contype=2,
                conaffinity=1,
                solimp=[0.5, 0.5, 0.001, 0.5, 2],
            )
            motor = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
            motor.gaintype, motor.biastype = mujoco.mjtGain.mjGAIN_FIXED, mujoco.mjtBias.mjBIAS_AFFINE
            motor.gainprm[0], motor.biasprm[:3] = 3e4, [0, -3e4, -60]
            motor.forcelimited = True
            motor.forcerange = [-30, 30]
        both = spec.add_equality(type=mujoco.mjtEq.mjEQ_JOINT, name1="left", name2="right")
        both.solref, both.data[:5] = [2 * STEP, 1], [0, 1, 0, 0, 0]
        thing = spec.worldbody.add_body(name="object")
        thing.add_freejoint()
        turn, centre = self.pose[:3, :3], self._into_tcp(self.body.centre)
        thing.explicitinertial, thing.mass, thing.ipos = True, 1.0, centre
        inertia = turn.T @ self.body.inertia @ turn
        inertia = [inertia[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
        thing.fullinertia = inertia
        for i, piece in enumerate(self.columns.pieces):
            mesh = spec.add_mesh(name=f"piece{i}", uservert=piece.ravel())
            mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX
            thing.add_geom(
                type=mujoco.mjtGeom.mjGEOM_MESH,
                meshname=f"piece{i}",
                contype=1,
                conaffinity=2,
                condim=3,
            )
        return spec.compile()

    def _set(self, friction: float, force: float, mass: float) -> None:
        model = self.model
        thing = model.body("object").id
        ratio = mass / model.body_mass[thing]
        model.body_mass[thing] *= ratio
        model.body_inertia[thing] *= ratio
        mujoco.mj_setConst(model, self.data)
        # At impedance d a contact has the stiffness k d / ((1 - d) A) for the reference k / d, where A is
        # the inverse mass of both sides; the foundation asks for FOUNDATION times the column's area.
        pitch = self.pad[0] / COLUMNS
        inverse = model.body_invweight0[thing][0]
        inverse += model.body_invweight0[model.body("left").id][0]
        k = FOUNDATION * pitch * pitch * inverse
        # Beyond this the step could not follow; the pads are then softer than asked.
        k = min(k, (0.7 / STEP) ** 2)
        for pad in self.pads:
            model.geom_solref[pad] = [-k * 0.5, -2 * np.sqrt(k) * 0.5]
            model.geom_friction[pad] = [friction, 0.005, 1e-4]
            model.geom_condim[pad] = 3
        model.actuator_forcerange[:] = [-force, force]

    def trial(self, friction: float, force: float, mass: float, seed: int, frames: list | None = None) -> dict:
        """One trial; ``frames``, where given, takes the object's pose in the TCP's frame and the pads' places."""
        model, data = self.model, self.data
        self._set(friction, force, mass)
        mujoco.mj_resetData(model, data)
        rng = np.random.default_rng([seed, 17])
        place, turn = rng.normal(size=3) * PLACE_ERROR, rng.normal(size=3) * TURN_ERROR
        place[1] = 0.0  # the pads would begin in the object; which pad touches first is shown by the turn
        rotation = Rotation.from_rotvec(turn if seed else 0 * turn)
        data.qpos[2:5] = self.middle - rotation.apply(self.middle) + (place if seed else 0)
        data.qpos[5:9] = rotation.as_quat()[[3, 0, 1, 2]]
        mujoco.mj_forward(model, data)
        begin = self._state()
        closed = None
        slip = turned = 0.0
        lost = False
        schedule = Schedule(self.down)
        model.opt.gravity[:] = 0
        t = 0.0
        while t < schedule.end:
            model.opt.gravity[:] = schedule.gravity(t)
            data.ctrl[:] = SPEED * t
            mujoco.mj_step(model, data, STEPS_A_CONTROL)
            t += STEP * STEPS_A_CONTROL
            now = self._state()
            if frames is not None:
                frames.append({"time": round(t, 4), "object": now, "pads": [float(q) for q in data.qpos[:2]]})
            if t < schedule.closed:
                continue
            closed = closed or now
            moved, angle = between(closed, now, self.middle)
            slip, turned = max(slip, moved), max(turned, angle)
            if moved > LOST or not np.isfinite(moved):
                lost = True
                break
        closing_shift, closing_turn = between(begin, closed, self.middle)
        total_shift, total_turn = between(begin, now, self.middle)
        hold = not lost and self._touching()
        strict = hold and max(slip, total_shift) < STRICT_SLIP and max(turned, total_turn) < STRICT_TURN
        return {
            "hold": bool(hold),
            "strict": bool(strict),
            "slip": float(min(slip, LOST)),
            "turn": float(turned),
            "closing_turn": closing_turn,
            "closing_shift": closing_shift,
        }

    def _state(self) -> tuple[list, list]:
        return self.data.qpos[2:5].tolist(), self.data.qpos[5:9].tolist()

    def _touching(self) -> bool:
        touched = {pair for contact in self.data.contact[: self.data.ncon] for pair in contact.geom}
        return all(pad in touched for pad in self.pads)


class Schedule:
    """Gravity in the hand's frame over time, less the hand's own acceleration."""

    LIFT, SHAKE, TILT = 0.25, 0.45, 0.6

    def __init__(self, down: np.ndarray):
        self.down = down / np.linalg.norm(down)
        self.closed = STAND_OFF / SPEED + 0.15
        self.end = self.closed + self.LIFT + self.SHAKE + self.TILT
        across = np.cross(self.down, [0, 1, 0])
        if np.linalg.norm(across) < 0.1:
            across = np.cross(self.down, [1, 0, 0])
        self.u = across / np.linalg.norm(across)
        self.v = np.cross(self.down, self.u)

    def gravity(self, t: float) -> np.ndarray:
        t -= self.closed
        if t < 0:
            return np.zeros(3)
        if t < self.LIFT:
            weight = G * min(1.0, t / 0.05)
            lift = 4.0 * np.sign(0.15 - t) if t > 0.05 else 0.0
            return (weight + lift) * self.down
        t -= self.LIFT
        if t < self.SHAKE:
            axis = np.eye(3)[int(3 * t / self.SHAKE)]
            return G * self.down + 5.0 * np.sin(2 * np.pi * 3 * t / self.SHAKE) * axis
        s = (t - self.SHAKE) / self.TILT
        angle = np.radians(45) * min(1.0, 5 * s, max(0.0, 5 * (1 - s)))
        around = 2 * np.pi * np.clip((s - 0.2) / 0.6, 0, 1)
        side = np.cos(around) * self.u + np.sin(around) * self.v
        return G * (np.cos(angle) * self.down + np.sin(angle) * side)


def between(before: tuple, after: tuple, point: np.ndarray) -> tuple[float, float]:
    """How far a point of the object moved (metres) and by how much the object turned (radians)."""
    (p, q), (r, s) = before, after
    a, b = (Rotation.from_quat(np.roll(x, -1)) for x in (q, s))
    moved = float(np.linalg.norm(np.add(b.apply(point), r) - np.add(a.apply(point), p)))
    return moved, float((b * a.inv()).magnitude())


def object_mass(body: Body, mass: float | None, density: float) -> float:
    """Kilograms: as given, or by density, or 0.2 for a surface without volume."""
    if mass is not None:
        return mass
    return float(np.clip(density * body.volume, 0.02, 1.5)) if body.volume else 0.2


class Cache:
    """Results by the content of what they depend on: one JSON line each, in one file."""

    def __init__(self, path: Path | None):
        self.path = path
        self.known = {}
        if path and path.exists():
            for line in path.read_text().splitlines():
                try:
                    record = json.loads(line)
                except json.JSONDecodeError:
                    continue  # cut off where a run was stopped
                self.known[record["key"]] = record["result"]

    def add(self, key: str, result: dict) -> None:
        self.known[key] = result
        if self.path:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            with self.path.open("a") as out:
                out.write(json.dumps({"key": key, "result": result}) + "\n")


def key_of(*things) -> str:
    text = json.dumps([VERSION, *things], sort_keys=True)
    return hashlib.blake2b(text.encode(), digest_size=16).hexdigest()


def try_grasps(answer: dict, body: Body, mesh_hash: str, conditions, cache: Cache, which) -> list[dict]:
    """Trials of the grasps ``which``; ``conditions(i)`` lists friction, force, mass and seed of grasp i."""
    out = []
    for i in which:
        grasp = answer["grasps"][i]
        what = {name: grasp[name] for name in ("object_from_tcp", "contacts", "width")}
        gripper = {"pad": answer["gripper"]["pad"], "table": answer.get("table")}
        bench = None
        for friction, force, mass, seed in conditions(i):
            key = key_of(mesh_hash, answer["object_scale"], what, gripper, friction, force, mass, seed)
            if key not in cache.known:
                bench = bench or Bench(body, answer, grasp)
                result = bench.trial(friction, force, mass, seed)
                result["column_error"] = bench.columns.error
                cache.add(key, result)
            conditions_of = {"friction": friction, "force": force, "mass": mass, "seed": seed}
            out.append({"grasp": i, **conditions_of, **cache.known[key]})
    return out


@dataclass
class Case:
    """A file of grasps, its mesh, and the mass where one was given."""

    grasps: Path
    mesh: Path
    mass: float | None

    @classmethod
    def parse(cls, text: str) -> Case:
        grasps, _, rest = text.partition("=")
        mesh, _, mass = rest.partition("@")
        if not mesh:
            raise SystemExit(f"{text}: expected GRASPS.json=MESH or GRASPS.json=MESH@KILOGRAMS")
        return cls(Path(grasps), Path(mesh), float(mass) if mass else None)

    def read(self) -> tuple[dict, Body, str]:
        answer = json.loads(self.grasps.read_text())
        if answer.get("format") != "semfm.grasps/1":
            raise SystemExit(f"{self.grasps}: expected semfm.grasps/1, found {answer.get('format')}")
        body = Body.read(self.mesh, answer["object_scale"], answer["mesh"]["n_triangles"])
        return answer, body, hashlib.blake2b(self.mesh.read_bytes(), digest_size=16).hexdigest()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("cases", nargs="+", metavar="GRASPS.json=MESH[@KG]", type=Case.parse)
    parser.add_argument("--friction", type=float, nargs="+", default=[0.5])
    parser.add_argument("--force", type=float, nargs="+", default=[30.0])
    parser.add_argument("--seeds", type=int, default=1, help="seed 0 is the grasp exactly")
    parser.add_argument("--density", type=float, default=600.0, help="kg/m³ where no mass is given")
    parser.add_argument("--limit", type=int, help="grasps of each file")
    parser.add_argument("--cache", type=Path, help="a file of results that is read and grown")
    parser.add_argument("--frames", type=int, metavar="GRASP", help="write one trial of this grasp over time")
    parser.add_argument("-o", "--output", type=Path, help="trials as JSON lines")
    arguments = parser.parse_args()
    cache = Cache(arguments.cache)
    lines, start = [], time.process_time()
    print("| file | hand | grasps | trials | hold | strict | median slip (mm) | columns off, p95 (mm) |")
    print("|---|---|---|---|---|---|---|---|")
    for case in arguments.cases:
        answer, body, mesh_hash = case.read()
        mass = object_mass(body, case.mass, arguments.density)
        if arguments.frames is not None:
            frames: list = []
            bench = Bench(body, answer, answer["grasps"][arguments.frames])
            result = bench.trial(arguments.friction[0], arguments.force[0], mass, 0, frames)
            arguments.output.write_text(json.dumps({"result": result, "mass": mass, "frames": frames}))
            continue
        which = range(min(len(answer["grasps"]), arguments.limit or 10**9))
        conditions = [
            (friction, force, mass, seed)
            for friction in arguments.friction
            for force in arguments.force
            for seed in range(arguments.seeds)
        ]
        trials = try_grasps(answer, body, mesh_hash, lambda _: conditions, cache, which)
        lines += [{"file": case.grasps.name, **trial} for trial in trials]
        print(row(case.grasps.stem, answer["gripper"]["name"], trials))
    if arguments.output and arguments.frames is None:
        arguments.output.write_text("".join(json.dumps(line) + "\n" for line in lines))
        print(arguments.output)
    print(f"{time.process_time() - start:.1f} s of processor time", file=sys.stderr)


def row(name: str, hand: str, trials: list[dict]) -> str:
    if not trials:
        return f"| {name} | {hand} | 0 | 0 | – | – | – | – |"
    mean = {what: np.mean([trial[what] for trial in trials]) for what in ("hold", "strict")}
    slip = 1e3 * np.median([trial["slip"] for trial in trials])
    off = 1e3 * np.quantile([trial["column_error"]["p95"] for trial in trials], 0.95)
    n_grasps = len({trial["grasp"] for trial in trials})
    return (
        f"| {name} | {hand} | {n_grasps} | {len(trials)} | {mean['hold']:.2f} | {mean['strict']:.2f} "
        f"| {slip:.1f} | {off:.2f} |"
    )


if __name__ == "__main__":
    main()
