"""Two real RGB-D frames: where `semfm-cli align` puts an object, against where it was labelled.

    python bench/real_frames.py PATH/TO/semfm-cli [--shared ../shared]

DexYCB: a mustard bottle, reconstructed from one image (its own frame and scale), against the YCB bottle in the labelled
pose; with the camera of the colour, which is the right one, and with the depth camera's. LINEMOD: a watering can from its
true mesh, judged by the depth that it would have where it was found (there is no label). Needs the package `semfm`, scipy and
pillow.
"""

import argparse
import json
import subprocess
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image
from scipy.spatial import cKDTree

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
    done = subprocess.run(
        ["bash", "-c", 'time "$0" "$@"', *map(str, words)], capture_output=True, text=True
    )
    user = [line for line in done.stderr.splitlines() if line.startswith(("user", "sys"))]
    seconds = sum(
        float(line.split("m")[1].rstrip("s")) + 60 * float(line.split()[1].split("m")[0])
        for line in user
    )
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


def linemod(program, shared):
    frame = shared / "data/rgbd/linemod_frame"
    k = json.loads((frame / "camera.json").read_text())["cam_K"]
    camera = {"fx": k[0], "fy": k[4], "cx": k[2], "cy": k[5]}
    depth = np.asarray(Image.open(frame / "depth.png")).astype(float) / 1e3
    mesh = frame / "obj_000005.ply"
    box = np.zeros(depth.shape, bool)
    box[CAN] = True
    for masked in (True, False):
        with tempfile.TemporaryDirectory() as folder:
            folder = Path(folder)
            np.save(folder / "box.npy", box)
            found, _, seconds = align(
                program,
                mesh,
                frame / "depth.png",
                camera,
                folder / "box.npy" if masked else None,
                folder,
                ["--scale-range", "0.001,0.001"],
            )
            there = placed(semfm.Mesh.read(mesh), found["camera_from_object"])
            pinhole = semfm.Pinhole.with_pixel_centres_at_integers(
                640, 480, camera["fx"], camera["fy"], camera["cx"], camera["cy"]
            )
            drawn = np.asarray(semfm.render(there, [pinhole])[0].depth, float)
            is_object = np.isfinite(drawn) & (drawn > 0) & (depth > 0)
            off = drawn[is_object] - depth[is_object]
            agree = np.abs(off) < 0.005
            print(
                f"| watering can, {'a box as its mask' if masked else 'no mask'} | {found['verdict']} | {1e3 * np.median(np.abs(off)):.1f} ({100 * agree.mean():.0f} % "
                f"of its pixels within 5 mm) | – | – | {seconds:.1f} | – |"
            )
            Image.fromarray(picture(np.asarray(Image.open(frame / "rgb.png")), drawn)).save(
                f"linemod_{masked}.png"
            )


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
    options = parser.parse_args()
    print(
        "| what | verdict | seen points off, mm | surface from the labelled, median / 95 %, mm | middle off, mm | CPU s "
        "| warned of the camera |"
    )
    print("| --- | --- | --- | --- | --- | --- | --- |")
    dexycb(options.program, options.shared)
    linemod(options.program, options.shared)


if __name__ == "__main__":
    main()
