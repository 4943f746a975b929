"""Laplacians and geodesics beside robust_laplacian and potpourri3d, on the same arrays, one core.

    pip install numpy scipy robust_laplacian==1.1.0 potpourri3d==1.4.0
    cargo build --release -p semfm-geom --example bench_laplacian
    python bench/laplacian.py target/release/examples/bench_laplacian mesh.obj [mesh.obj ...]

Prints a table of process CPU seconds (medians of REPEATS) and the ratio peer / ours.
"""

import os

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "RAYON_NUM_THREADS"):
    os.environ[variable] = "1"

import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import potpourri3d
import robust_laplacian

REPEATS = 5
LONG_ENOUGH = 0.2  # seconds of one measurement, as in the Rust program


def read_obj(path):
    """Positions and triangles of an OBJ; polygons are cut into fans, unused vertices dropped."""
    points, faces = [], []
    for line in Path(path).read_text().splitlines():
        words = line.split()
        if words[:1] == ["v"]:
            points.append([float(x) for x in words[1:4]])
        elif words[:1] == ["f"]:
            ids = [int(word.split("/")[0]) - 1 for word in words[1:]]
            faces += [[ids[0], ids[k], ids[k + 1]] for k in range(1, len(ids) - 1)]
    points, faces = np.array(points), np.array(faces)
    faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
    used, faces = np.unique(faces, return_inverse=True)
    return points[used], faces.reshape(-1, 3)


def median(work):
    seconds = []
    for _ in range(REPEATS):
        start, calls, spent = time.process_time(), 0, 0.0
        while spent < LONG_ENOUGH:
            work()
            calls += 1
            spent = time.process_time() - start
        seconds.append(spent / calls)
    return sorted(seconds)[REPEATS // 2]


def peers(points, faces):
    make_solver = lambda: potpourri3d.MeshHeatMethodDistanceSolver(points, faces, use_robust=True)
    solver = make_solver()
    return {
        "tufted": median(lambda: robust_laplacian.mesh_laplacian(points, faces)),
        "cloud": median(lambda: robust_laplacian.point_cloud_laplacian(points)),
        "geodesics_factor": median(make_solver),
        "geodesics_source": median(lambda: solver.compute_distance(0)),
    }


def ours(program, points, faces):
    with tempfile.TemporaryDirectory() as folder:
        np.save(Path(folder) / "points.npy", points)
        np.save(Path(folder) / "faces.npy", faces.astype(np.float64))
        answer = subprocess.run([program, folder, str(REPEATS)], check=True, capture_output=True, text=True)
    rows = [line.split(maxsplit=2) for line in answer.stdout.splitlines()]
    return {row[0]: (float(row[1]), row[2] if len(row) > 2 else "") for row in rows}


def main():
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    program, *paths = sys.argv[1:]
    for path in paths:
        points, faces = read_obj(path)
        mine, theirs = ours(program, points, faces), peers(points, faces)
        print(f"{Path(path).stem}: {len(points)} vertices, {len(faces)} triangles")
        for name, (seconds, remark) in mine.items():
            peer = f"peer {theirs[name]:.4f}  {theirs[name] / seconds:5.1f}x" if name in theirs else ""
            print(f"  {name:22} {seconds:.4f}  {peer} {remark}")


if __name__ == "__main__":
    main()
