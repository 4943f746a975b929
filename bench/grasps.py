"""Judges grasps with tools that SemFM does not use: trimesh and python-fcl.

Reads nothing but ``grasps.json`` files and the meshes they are of::

    pip install numpy trimesh python-fcl
    python bench/grasps.py mug.grasps.json=mug.obj … [--region mug.grasps.json=region.json] [--friction 0.5]

With ``--steady``, it runs the search itself: noise, seeds and large meshes, on meshes in metres::

    python bench/grasps.py --steady semfm-cli hammer.obj mug.obj … [--noise .001 .002 .005] [--seeds 5] [--dense 2]

Noise is independent and normal on each coordinate, as a share of the diagonal of the object's box. ``--dense N`` cuts
each triangle into four, N times. Times are CPU seconds of the process (user and system) on one thread.

For each grasp: whether the hand, open where it arrives, anywhere on its way in, or closed, meets the
object's exact triangles; whether it is in force closure by rays of our own; whether both contacts
lie in the region.
"""

from __future__ import annotations

import argparse
import json
import math
import resource
import subprocess
import tempfile
from pathlib import Path

import fcl
import numpy as np
import trimesh

#: Where along the approach the hand is tried, metres behind the grasp.
RETREATS = (0.0, 0.005, 0.01, 0.02, 0.04)
#: The rays that look for a contact start this far outside the pad, metres.
STAND_OFF = 0.002


class Hand:
    """The parts of the gripper as convex hulls for fcl."""

    def __init__(self, gripper: dict):
        self.parts = []
        for part in gripper["parts"]:
            shapes = [_bvh(trimesh.convex.convex_hull(np.array(points))) for points in part["hulls"]]
            self.parts.append((part["role"], shapes))

    def meets(self, scene: fcl.CollisionObject, object_from_tcp: np.ndarray, poses: list) -> bool:
        """Whether any part at the poses (tcp_from_part) touches the scene."""
        for (_, shapes), tcp_from_part in zip(self.parts, poses):
            pose = object_from_tcp @ np.array(tcp_from_part)
            transform = fcl.Transform(pose[:3, :3], pose[:3, 3])
            for shape in shapes:
                answer = fcl.CollisionResult()
                fcl.collide(fcl.CollisionObject(shape, transform), scene, fcl.CollisionRequest(), answer)
                if answer.is_collision:
                    return True
        return False


def _bvh(mesh: trimesh.Trimesh) -> fcl.BVHModel:
    model = fcl.BVHModel()
    model.beginModel(len(mesh.vertices), len(mesh.faces))
    model.addSubModel(np.asarray(mesh.vertices), np.asarray(mesh.faces))
    model.endModel()
    return model


def judge(grasps_path: Path, mesh_path: Path, region_path: Path | None, friction: float) -> dict:
    """Counts of one file."""
    answer = json.loads(grasps_path.read_text())
    mesh = trimesh.load(mesh_path, process=False, force="mesh")
    # trimesh cuts vertices where texture coordinates part; the triangles stay.
    if len(mesh.faces) != answer["mesh"]["n_triangles"]:
        raise SystemExit(
            f"{mesh_path}: expected {answer['mesh']['n_triangles']} triangles, found {len(mesh.faces)}"
        )
    mesh.apply_scale(answer["object_scale"])
    scene = fcl.CollisionObject(_bvh(mesh))
    hand = Hand(answer["gripper"])
    inside = None
    if region_path:
        if len(mesh.vertices) != answer["mesh"]["n_vertices"]:
            raise SystemExit(f"{mesh_path}: vertex ids are lost; strip its texture coordinates")
        inside = _region(region_path, len(mesh.vertices))
    counts = {"grasps": len(answer["grasps"]), "colliding": 0, "closure": 0, "in_region": 0}
    for grasp in answer["grasps"]:
        pose = np.array(grasp["object_from_tcp"])
        counts["colliding"] += _collides(hand, scene, pose, grasp)
        counts["closure"] += _in_force_closure(mesh, pose, grasp, friction)
        if inside is not None:
            _, _, faces = trimesh.proximity.closest_point(mesh, np.array(grasp["contacts"]))
            counts["in_region"] += bool(inside[mesh.faces[faces]].any(axis=1).all())
    return counts


def _collides(hand: Hand, scene: fcl.CollisionObject, pose: np.ndarray, grasp: dict) -> bool:
    for retreat in RETREATS:
        back = pose.copy()
        back[:3, 3] -= retreat * pose[:3, 2]
        if hand.meets(scene, back, grasp["hand"]["open"]):
            return True
    return hand.meets(scene, pose, grasp["hand"]["closed"])


def _in_force_closure(mesh: trimesh.Trimesh, pose: np.ndarray, grasp: dict, friction: float) -> bool:
    """Two contacts with friction are in force closure where their line lies in both cones (Nguyen
    1988). Each surface is found by a ray along the closing direction from outside its contact."""
    contacts = np.array(grasp["contacts"])
    line = contacts[1] - contacts[0]
    length = np.linalg.norm(line)
    if length < 1e-6:
        return False
    line /= length
    closing = pose[:3, 1] * (1 if pose[:3, 1] @ line > 0 else -1)
    for contact, inward in ((contacts[0], closing), (contacts[1], -closing)):
        origin = contact - STAND_OFF * inward
        places, _, faces = mesh.ray.intersects_location([origin], [inward], multiple_hits=True)
        near = [f for p, f in zip(places, faces) if np.linalg.norm(p - contact) < 2 * STAND_OFF]
        if not near:
            return False
        straight = inward if inward @ line > 0 else -inward
        toward = line if straight @ line > 0 else -line
        toward = toward if toward @ inward > 0 else -toward
        slope = max(abs(mesh.face_normals[f] @ toward) for f in near)
        if slope < math.cos(math.atan(friction)):
            return False
    return True


def _region(path: Path, n_vertices: int) -> np.ndarray:
    region = json.loads(path.read_text())
    region = region.get("region", region)
    inside = np.zeros(n_vertices, bool)
    weights = np.array(region.get("weights", [1.0] * len(region["vertices"])))
    inside[np.array(region["vertices"], int)[weights >= 0.5]] = True
    return inside


def search(cli: str, mesh: Path, folder: Path, seed: int = 0, hand: str = "franka") -> tuple[dict, float]:
    """The answer of one search over the whole object, and its CPU seconds."""
    n_vertices = len(trimesh.load(mesh, process=False, force="mesh").vertices)
    # Ids of vertices that trimesh counts otherwise than we do are of no use here: the region is all of them.
    region, out = folder / "all.json", folder / "grasps.json"
    info = json.loads(subprocess.run([cli, "info", "--json", str(mesh)], capture_output=True, check=True).stdout)
    info = info[0] if isinstance(info, list) else info
    n_vertices = info.get("n_vertices", n_vertices)
    region.write_text(json.dumps({"vertices": list(range(n_vertices))}))
    command = [cli, "grasp", str(mesh), "--region", str(region), "--gripper", hand, "--metres", "--threads", "1"]
    command += ["--seed", str(seed), "--quiet", "-o", str(out)]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, stdout=subprocess.DEVNULL, check=False)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return json.loads(out.read_text()), seconds


def steady(cli: str, meshes: list[str], noises: list[float], n_seeds: int, dense: int, hand: str) -> None:
    """Survivors under noise, the way of the best grasp over seeds, time and collisions by number of triangles."""
    print("| object | triangles | noise | survivors | of those without | best moves (mm) | colliding | CPU s |")
    print("|---|---|---|---|---|---|---|---|")
    for name in meshes:
        clean = trimesh.load(name, process=False, force="mesh")
        diagonal = float(np.linalg.norm(clean.extents))
        with tempfile.TemporaryDirectory() as folder:
            plain = {"vertices": clean.vertices, "faces": clean.faces}
            mesh = trimesh.Trimesh(**plain, process=True)  # vertices that lie in one place are one
            base = None
            for noise in [0.0, *noises]:
                rng = np.random.default_rng(1)
                moved = mesh.copy()
                moved.vertices = mesh.vertices + noise * diagonal * rng.standard_normal(mesh.vertices.shape)
                base = steady_row(cli, Path(name), moved, noise, base, n_seeds, Path(folder), hand)
            for _ in range(dense):
                mesh = mesh.subdivide()
                steady_row(cli, Path(name), mesh, 0.0, base, 1, Path(folder), hand)


def steady_row(
    cli: str, name: Path, mesh: trimesh.Trimesh, noise: float, base: int | None, n_seeds: int, folder: Path, hand: str
) -> int:
    path = folder / "object.ply"
    path.write_bytes(trimesh.exchange.ply.export_ply(mesh, encoding="binary"))
    answers = [search(cli, path, folder, seed, hand) for seed in range(n_seeds)]
    # Contacts tell where a grasp is: a hand that comes from elsewhere to the same place holds the same.
    middles = [np.mean(a["grasps"][0]["contacts"], axis=0) for a, _ in answers if a["grasps"]]
    way = max((np.linalg.norm(p - q) for p in middles for q in middles), default=float("nan"))
    answer, seconds = answers[0]
    stored = trimesh.load(path, process=False)
    scene, hand_parts = fcl.CollisionObject(_bvh(stored)), Hand(answer["gripper"])
    poses = [(np.array(g["object_from_tcp"]), g) for g in answer["grasps"]]
    colliding = sum(_collides(hand_parts, scene, pose, grasp) for pose, grasp in poses)
    survivors = answer["n_survivors"]
    share = f"{100 * survivors / base:.0f} %" if base else "–"
    label = name.parent.name if name.stem == "textured" else name.stem
    moves = f"{1e3 * way:.1f}" if n_seeds > 1 else "–"
    print(
        f"| {label} | {len(mesh.faces)} | {100 * noise:g} % | {survivors} | {share} | {moves} "
        f"| {colliding} of {len(poses)} | {seconds:.1f} |",
        flush=True,
    )
    return base or survivors


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("pairs", nargs="+", metavar="GRASPS.json=MESH")
    parser.add_argument("--steady", metavar="SEMFM_CLI")
    parser.add_argument("--noise", type=float, nargs="*", default=[0.001, 0.002, 0.005])
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--dense", type=int, default=0)
    parser.add_argument("--gripper", default="franka")
    parser.add_argument("--region", action="append", default=[], metavar="GRASPS.json=REGION.json")
    parser.add_argument("--friction", type=float, default=0.5)
    arguments = parser.parse_args()
    if arguments.steady:
        a = arguments
        return steady(a.steady, a.pairs, a.noise, a.seeds, a.dense, a.gripper)
    regions = dict(text.split("=", 1) for text in arguments.region)
    total: dict[str, int] = {}
    print("| file | grasps | colliding | in force closure | contacts in region |")
    print("|---|---|---|---|---|")
    for text in arguments.pairs:
        grasps, mesh = text.split("=", 1)
        region = regions.get(grasps)
        counts = judge(Path(grasps), Path(mesh), Path(region) if region else None, arguments.friction)
        total = {key: total.get(key, 0) + n for key, n in counts.items()}
        print(_row(Path(grasps).stem, counts, region is not None))
    print(_row("all", total, bool(regions)))


def _row(name: str, counts: dict, with_region: bool) -> str:
    n = max(counts["grasps"], 1)
    share = f"{100 * counts['in_region'] / n:.0f} %" if with_region else "–"
    return (
        f"| {name} | {counts['grasps']} | {counts['colliding']} "
        f"| {100 * counts['closure'] / n:.1f} % | {share} |"
    )


if __name__ == "__main__":
    main()
