"""Our eigensolver beside scipy's, on byte-identical matrices, in one run.

    cargo build --release -p semfm-geom --example bench_eigen
    python bench/eigen.py target/release/examples/bench_eigen [--n 5000 ...] [--k 30 ...]

The peer is what pyFM does: `scipy.sparse.linalg.eigsh(W, k, M, sigma=-0.01)`, ARPACK in shift-invert
mode on SuperLU. Both sides run on one thread (the BLAS by its environment variables, ours because
it always does); seconds are process CPU seconds, medians of the repeats, each side in a process of
its own so that peak memory means something. Runs alternate, so a busy machine slows both.

Goals: four times as fast as the peer; from 50 000 vertices on with half of its memory, the interpreter with the
matrix that both sides read (`idle MB`) not counted.
"""

import argparse
import json
import os
import resource
import struct
import subprocess
import sys
import tempfile
import time

THREADS = {name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")}


def torus(n, seed=1):
    """A bumpy torus of about n vertices in shuffled order: cotangent stiffness and lumped mass."""
    import numpy as np
    import scipy.sparse as sp

    rng = np.random.default_rng(seed)
    along = int(np.sqrt(n / 3.0))
    around = n // along
    n = around * along
    i, j = np.meshgrid(np.arange(around), np.arange(along), indexing="ij")
    a = 2 * np.pi * (i + rng.uniform(-0.25, 0.25, i.shape)) / around
    b = 2 * np.pi * (j + rng.uniform(-0.25, 0.25, i.shape)) / along
    tube = 0.35 * (1 + 0.2 * np.sin(3 * a) + 0.1 * np.cos(5 * b + 2 * a))
    ring = 1 + tube * np.cos(b)
    vertices = np.stack([ring * np.cos(a), 1.3 * ring * np.sin(a), tube * np.sin(b)], -1).reshape(-1, 3)
    at = lambda p, q: (p % around) * along + q % along
    corners = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]
    p, q, s, t = (c.ravel() for c in corners)
    order = rng.permutation(n)
    faces = order[np.concatenate([np.stack([p, q, s], 1), np.stack([p, s, t], 1)])]
    shuffled = np.empty_like(vertices)
    shuffled[order] = vertices
    return cotan(shuffled, faces)


def cotan(vertices, faces):
    """Cotangent stiffness (CSC, both triangles) and lumped mass of a mesh scaled to area 1."""
    import numpy as np
    import scipy.sparse as sp

    n = len(vertices)
    corner = vertices[faces]
    double_area = np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1)
    stiffness, mass = sp.csc_matrix((n, n)), np.zeros(n)
    for k in range(3):
        i, j, o = faces[:, (k + 1) % 3], faces[:, (k + 2) % 3], faces[:, k]
        to_i, to_j = vertices[i] - vertices[o], vertices[j] - vertices[o]
        w = 0.5 * np.einsum("ij,ij->i", to_i, to_j) / double_area
        rows, columns = np.concatenate([i, j, i, j]), np.concatenate([i, j, j, i])
        stiffness += sp.csc_matrix((np.concatenate([w, w, -w, -w]), (rows, columns)), (n, n))
        np.add.at(mass, o, double_area / 6)
    stiffness.sort_indices()
    return stiffness, mass / mass.sum()


def write(path, stiffness, mass):
    with open(path, "wb") as f:
        f.write(struct.pack("<qq", stiffness.shape[0], stiffness.nnz))
        f.write(stiffness.indptr.astype("<i8").tobytes())
        f.write(stiffness.indices.astype("<i8").tobytes())
        f.write(stiffness.data.astype("<f8").tobytes())
        f.write(mass.astype("<f8").tobytes())


def read(path):
    import numpy as np
    import scipy.sparse as sp

    words = np.fromfile(path, "<i8")
    n, nnz = words[:2]
    pointers, rows = words[2 : n + 3], words[n + 3 : n + 3 + nnz]
    numbers = words[n + 3 + nnz :].view("<f8")
    return sp.csc_matrix((numbers[:nnz], rows, pointers), (n, n)), numbers[nnz:]


def peer(path, k, repeats):
    """One side of the comparison: run in a process of its own, prints the same JSON as ours."""
    import numpy as np
    import scipy.sparse as sp
    from scipy.sparse.linalg import eigsh

    stiffness, mass = read(path)
    m = sp.diags(mass).tocsc()
    idle = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    seconds = []
    for _ in range(repeats):
        wall, cpu = time.perf_counter(), time.process_time()
        values, phi = eigsh(stiffness, k, m, sigma=-0.01)
        seconds.append((time.process_time() - cpu, time.perf_counter() - wall))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    cpu, wall = sorted(seconds)[len(seconds) // 2]
    rest = stiffness @ phi - (mass[:, None] * phi) * values
    residual = np.sqrt((rest**2 / mass[:, None]).sum(0)) / np.maximum(values, 1)
    print(json.dumps(dict(cpu=cpu, wall=wall, residual=residual.max(), peak_mb=peak, idle_mb=idle, last=float(values.max()))))


#: Times as fast as the peer; share of its memory, and from how many vertices on.
GOAL_SPEED, GOAL_MEMORY, LARGE = 4.0, 0.5, 50000


def verdict(is_met):
    return "reached" if is_met else "missed"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("ours", help="the bench_eigen example, built with --release")
    parser.add_argument("--n", type=int, nargs="+", default=[5000, 10000, 25000, 50000, 100000])
    parser.add_argument("--k", type=int, nargs="+", default=[30, 60, 100, 200])
    parser.add_argument("--repeats", type=int, default=3)
    options = parser.parse_args()
    environment = {**os.environ, **THREADS}
    print(
        f"{'n':>7} {'k':>4} {'ours s':>8} {'scipy s':>8} {'ratio':>6} {'goal':>5} verdict"
        f" {'MB':>6} {'scipy MB':>8} {'share':>6} {'goal':>5} verdict {'residual':>9} {'Δλ_k':>8}"
    )
    with tempfile.TemporaryDirectory() as folder:
        for n in options.n:
            path = os.path.join(folder, f"{n}.bin")
            write(path, *torus(n))
            for k in options.k:
                ours = [options.ours, path, str(k), str(options.repeats)]
                theirs = [sys.executable, __file__, "--peer", path, str(k), str(options.repeats)]
                o, t = (
                    json.loads(subprocess.run(command, env=environment, check=True, capture_output=True, text=True).stdout)
                    for command in (ours, theirs)
                )
                apart = abs(o["last"] - t["last"]) / t["last"]
                ratio, (ours_mb, their_mb) = t["cpu"] / o["cpu"], (side["peak_mb"] - side["idle_mb"] for side in (o, t))
                share = ours_mb / their_mb
                memory = f"{GOAL_MEMORY:5} {verdict(share <= GOAL_MEMORY)}" if n >= LARGE else f"{'–':>5} {'–':7}"
                print(
                    f"{n:7} {k:4} {o['cpu']:8.3f} {t['cpu']:8.3f} {ratio:6.2f} {GOAL_SPEED:5} {verdict(ratio >= GOAL_SPEED):7}"
                    f" {ours_mb:6.0f} {their_mb:8.0f} {share:6.2f} {memory} {o['residual']:9.1e} {apart:8.1e}",
                    flush=True,
                )


if __name__ == "__main__":
    if sys.argv[1:2] == ["--peer"]:
        peer(sys.argv[2], int(sys.argv[3]), int(sys.argv[4]))
    else:
        main()
