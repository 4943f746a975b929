"""Two real RGB-D frames: where `semfm-cli align` puts an object, against where it was labelled.

    python bench/real_frames.py PATH/TO/semfm-cli [--shared ../shared]

DexYCB: a mustard bottle, reconstructed from one image (its own frame and scale), against the YCB bottle in the labelled
pose; with the camera of the colour, which is the right one, and with the depth camera's. LINEMOD: a watering can from its
true mesh, judged by the depth that it would have where it was found (there is no label). Needs the package `semfm`, scipy and
pillow.
"""

import argparse
import json
import resource
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np
from PIL import Image
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

import semfm

DEXYCB_COLOR = {
    "fx": 616.640869140625,
    "fy": 616.2581787109375,
    "cx": 308.548095703125,
    "cy": 248.52310180664062,
}
DEXYCB_DEPTH = {
    "fx": 596.8375854492188,
    "fy": 596.8375854492188,
    "cx": 320.359619140625,
    "cy": 237.62452697753906,
}
MUSTARD = 5  # its label; the first of the labelled poses
CAN = (slice(225, 319), slice(374, 439))  # rows and columns of a box drawn around the can by hand


def align(program, mesh, depth, camera, mask, folder, more=()):
    """The answer of `align` (its file), what it said, and its seconds of processor time."""
    k = folder / "K.json"
    k.write_text(json.dumps(camera))
    out = folder / "aligned.json"
    words = [program, "align", mesh, "--depth", depth, "--intrinsics", k, "-o", out, *more]
    if mask is not None:
        words += ["--mask", mask]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run([str(word) for word in words], capture_output=True, text=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return json.loads(out.read_text()), done.stderr, seconds


def placed(mesh, rows):
    """A mesh under a similarity (4 × 4)."""
    rows = np.asarray(rows, float)
    return semfm.Mesh(np.asarray(mesh.vertices) @ rows[:3, :3].T + rows[:3, 3], mesh.faces)


def surface_points(mesh, n=40_000):
    """Points on a surface, uniform by area (n × 3)."""
    corners = np.asarray(mesh.vertices)[np.asarray(mesh.faces)]
    areas = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    rng = np.random.default_rng(0)
    faces = rng.choice(len(areas), n, p=areas / areas.sum())
    a, b = np.sqrt(rng.random(n)), rng.random(n)
    weights = np.stack([1 - a, a * (1 - b), a * b], axis=1)
    return np.einsum("nk,nkd->nd", weights, corners[faces])


def apart(a, b):
    """Distances of the points of each surface from the other, in mm: median and 95th percentile of both together."""
    a, b = surface_points(a), surface_points(b)
    both = np.concatenate([cKDTree(b).query(a)[0], cKDTree(a).query(b)[0]])
    return 1e3 * np.median(both), 1e3 * np.quantile(both, 0.95)


def nearest_similarity(mesh, truth, starts=32):
    """The mesh where a similarity brings the two surfaces nearest: iterated closest points in both directions (Umeyama
    1991), from turns about the principal axes."""
    points, goal = surface_points(mesh, 4000), surface_points(truth, 20_000)
    tree = cKDTree(goal)
    axes, goal_axes = (np.linalg.eigh(np.cov(x.T))[1] for x in (points, goal))
    scale = np.sqrt(np.var(goal, 0).sum() / np.var(points, 0).sum())
    found = []
    for start in range(starts):
        signs = [1 - 2 * (start >> bit & 1) for bit in range(3)]
        quarter = Rotation.from_rotvec(np.pi / 2 * (start >> 3) * axes[:, 2]).as_matrix()
        turn = goal_axes @ np.diag(signs) @ axes.T @ quarter
        if np.linalg.det(turn) < 0:
            continue
        rows = np.eye(4)
        rows[:3, :3] = scale * turn
        rows[:3, 3] = goal.mean(0) - rows[:3, :3] @ points.mean(0)
        for _ in range(60):
            moved = points @ rows[:3, :3].T + rows[:3, 3]
            there = goal[tree.query(moved)[1]]
            back = cKDTree(moved).query(goal[::5])[1]
            a, b = np.concatenate([points, points[back]]), np.concatenate([there, goal[::5]])
            u, sizes, v = np.linalg.svd((b - b.mean(0)).T @ (a - a.mean(0)))
            flip = np.diag([1, 1, np.linalg.det(u @ v)])
            grown = np.trace(np.diag(sizes) @ flip) / ((a - a.mean(0)) ** 2).sum()
            rows[:3, :3] = grown * u @ flip @ v
            rows[:3, 3] = b.mean(0) - rows[:3, :3] @ a.mean(0)
        there = placed(mesh, rows)
        found.append((apart(there, truth)[0], there))
    return min(found, key=lambda one: one[0])[1]


def dexycb(program, shared):
    frame = shared / "data/rgbd/dexycb_frame"
    labels = np.load(frame / "labels.npz")
    truth = np.vstack([labels["pose_y"][0], [0, 0, 0, 1]])
    bottle = semfm.Mesh.read(shared / "data/ycb/mustard_bottle/textured.obj")
    # The dataset's model is this one with the middle of its box at the origin.
    low, high = np.min(bottle.vertices, axis=0), np.max(bottle.vertices, axis=0)
    bottle = placed(semfm.Mesh(np.asarray(bottle.vertices) - (low + high) / 2, bottle.faces), truth)
    seen = labels["seg"] == MUSTARD
    depth = np.asarray(Image.open(frame / "depth.png")).astype(float) / 1e3
    v, u = np.nonzero(seen & (depth > 0) & (depth < 10))
    c = DEXYCB_COLOR
    points = (
        np.stack([(u - c["cx"]) / c["fx"], (v - c["cy"]) / c["fy"], np.ones(len(u))], 1)
        * depth[v, u, None]
    )
    off = cKDTree(surface_points(bottle)).query(points)[0]
    print(f"| mustard bottle, as labelled | – | {1e3 * np.median(off):.1f} | 0 / 0 | 0 | – | – |")
    mesh = frame / "mustard.obj"
    there = nearest_similarity(semfm.Mesh.read(mesh), bottle)
    median, most = apart(there, bottle)
    middle = surface_points(there).mean(0) - surface_points(bottle).mean(0)
    seen_off = 1e3 * np.median(cKDTree(surface_points(there)).query(points)[0])
    print(
        f"| mustard bottle, nearest to the labelled one | – | {seen_off:.1f} | {median:.1f} / {most:.1f} "
        f"| {1e3 * np.linalg.norm(middle):.1f} | – | – |"
    )
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        np.save(folder / "mask.npy", seen)
        (folder / "color.json").write_text(json.dumps(DEXYCB_COLOR))
        rows = [
            ("colour camera (right)", DEXYCB_COLOR, []),
            ("depth camera (wrong)", DEXYCB_DEPTH, []),
            (
                "depth camera, `--color-intrinsics`",
                DEXYCB_DEPTH,
                ["--color-intrinsics", folder / "color.json"],
            ),
        ]
        for name, camera, more in rows:
            found, said, seconds = align(
                program, mesh, frame / "depth.png", camera, folder / "mask.npy", folder, more
            )
            there = placed(semfm.Mesh.read(mesh), found["camera_from_object"])
            middle = surface_points(there).mean(0) - surface_points(bottle).mean(0)
            median, most = apart(there, bottle)
            seen_off = 1e3 * np.median(cKDTree(surface_points(there)).query(points)[0])
            warned = any(
                line.startswith("warning: the depth lies on") for line in said.splitlines()
            )
            print(
                f"| mustard bottle, {name} | {found['verdict']} | {seen_off:.1f} | {median:.1f} / {most:.1f} "
                f"| {1e3 * np.linalg.norm(middle):.1f} | {seconds:.1f} | {'yes' if warned else 'no'} |"
            )


def linemod(program, shared, pictures):
    frame = shared / "data/rgbd/linemod_frame"
    k = json.loads((frame / "camera.json").read_text())["cam_K"]
    camera = {"fx": k[0], "fy": k[4], "cx": k[2], "cy": k[5]}
    pinhole = semfm.Pinhole.with_pixel_centres_at_integers(640, 480, *camera.values())
    depth = np.asarray(Image.open(frame / "depth.png")).astype(float) / 1e3
    mesh = semfm.Mesh.read(frame / "obj_000005.ply")  # millimetres
    box = np.zeros(depth.shape, bool)
    box[CAN] = True

    def judged(what, verdict, pose, seconds):
        drawn = np.asarray(semfm.render(placed(mesh, pose), [pinhole])[0].depth, float)
        is_object = np.isfinite(drawn) & (drawn > 0) & (depth > 0)
        off = 1e3 * np.abs(drawn[is_object] - depth[is_object])
        share = 100 * (off < 5).mean()
        seen = f"{np.median(off):.1f} ({share:.0f} % of its pixels within 5 mm)"
        print(f"| watering can, {what} | {verdict} | {seen} | – | – | {seconds:.2f} | – |")
        if pictures:
            rgb = np.asarray(Image.open(frame / "rgb.png"))
            Image.fromarray(picture(rgb, drawn)).save(pictures / f"can, {what}.png")

    for what, mask in (("a box as its mask", box), ("no mask", None)):
        with tempfile.TemporaryDirectory() as folder:
            folder = Path(folder)
            np.save(folder / "box.npy", box)
            path = None if mask is None else folder / "box.npy"
            settings = ["--scale-range", "0.001,0.001"]
            paths = (frame / "obj_000005.ply", frame / "depth.png")
            found, _, seconds = align(program, *paths, camera, path, folder, settings)
        judged(what, found["verdict"], found["camera_from_object"], seconds)
    for what, n_masked, n_frames in (
        ("tracked, the box in two frames", 2, 6),
        ("tracked, no mask", 0, 30),
    ):
        tracker = semfm.Tracker(mesh, scale=0.001)
        start, poses = time.process_time(), []
        for number in range(n_frames):
            masks = {"can": box} if number < n_masked else {}
            poses.append(tracker.update(semfm.Observation(pinhole, depth=depth, masks=masks)))
        seconds = (time.process_time() - start) / n_frames
        states = ", ".join(dict.fromkeys(pose.state for pose in poses))
        verdict = f"{states}; probability {min(pose.probability for pose in poses):.3f} and more"
        if poses[-1].camera_from_object is None:
            print(f"| watering can, {what} | {verdict} | – | – | – | {seconds:.2f} a frame | – |")
        else:
            judged(what, verdict, poses[-1].camera_from_object, seconds)


def picture(rgb, drawn):
    """The frame with the outline of what was drawn in it."""
    inside = np.isfinite(drawn) & (drawn > 0)
    edge = inside & ~(
        np.roll(inside, 1, 0)
        & np.roll(inside, -1, 0)
        & np.roll(inside, 1, 1)
        & np.roll(inside, -1, 1)
    )
    out = rgb[..., :3].copy()
    out[edge] = [255, 0, 255]
    return out


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("program", help="semfm-cli")
    parser.add_argument("--shared", type=Path, default=Path("../shared"))
    parser.add_argument(
        "--pictures", type=Path, help="folder for pictures of the can where it was found"
    )
    options = parser.parse_args()
    print(
        "| what | verdict | seen points off, mm | surface from the labelled, median / 95 %, mm | middle off, mm | CPU s "
        "| warned of the camera |"
    )
    print("| --- | --- | --- | --- | --- | --- | --- |")
    dexycb(options.program, options.shared)
    linemod(options.program, options.shared, options.pictures)


if __name__ == "__main__":
    main()
