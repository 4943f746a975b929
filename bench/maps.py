"""ZoomOut, point maps and precise maps beside pyFM, on the same bases, in one run.

    pip install numpy scipy pyfmaps==1.3.1
    cargo build --release -p semfm-fmap --example bench_maps
    python bench/maps.py target/release/examples/bench_maps [--n 2000 5000 ...] [--shared ../shared] [--repeats 3]

Two lumpy bodies of n vertices each, and two people of FAUST_r and two animals of SMAL_r (5000 vertices) where the shared
data are at hand. Bases are computed once, by pyFM, and given to both. Each side runs in a process of its own, so that
peak memory means something, on one thread (the BLAS by its environment variables, pyFM's searches by `n_jobs=1`, ours by
RAYON_NUM_THREADS); the two take turns, so that a busy machine slows both. Seconds are process CPU seconds, medians of the
repeats. The last column says how far the answers are apart: of maps ‖ΔC‖ / ‖C‖, of point maps the vertices that differ,
of precise maps how much farther from its triangle our point lies at most, relative to pyFM's.

`--threads 2` runs ours alone, with 1 and with 2 threads, and prints how much sooner the second ends (wall time).
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ONE = {name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "RAYON_NUM_THREADS")}
K_START, K = 20, 200
N_SAMPLES = 1000
#: What is printed, the task of both programs, how many times as fast as the peer, at how many vertices at most.
TASKS = [
    ("ZoomOut 20 → 100, step 1", "zoomout:20:100:1", 9, 25000),
    ("sampled ZoomOut 20 → 200, step 5", "sampled:20:200:5", 6, 25000),
    ("point map, k = 200", "point_map:200", 5, 25000),
    ("precise map, k = 50", "precise:50", 20, 5000),
]
#: MB that a precise map may take.
PRECISE_MEMORY = 200
PAIRS = [
    ("people", "FAUST_r/tr_reg_000.npz", "FAUST_r/tr_reg_008.npz"),
    ("animals", "SMAL_r/wolf_alph3.npz", "SMAL_r/Brown-And-White-Akita-Dog_alph.npz"),
]


def body(n, instance):
    """Vertices and triangles of a ball with bumps, which differ a little from instance to instance."""
    import numpy as np
    from scipy.spatial import ConvexHull

    i = np.arange(n) + 0.5
    z, turn = 1 - 2 * i / n, np.pi * (1 + 5**0.5) * i + instance
    ring = np.sqrt(1 - z * z)
    way = np.stack([ring * np.cos(turn), ring * np.sin(turn), z], 1)
    faces = ConvexHull(way).simplices
    bumps = np.random.default_rng(3).normal(size=(7, 3))
    bumps /= np.linalg.norm(bumps, axis=1)[:, None]
    heights = 1.2 + 0.3 * np.sin(np.arange(7) * 2.0 + 0.8 * instance)
    out = 0.6 + (np.exp(9 * (way @ bumps.T - 1)) * heights).sum(1)
    return out[:, None] * way * [1.0, 0.8, 1.3], outward(way, faces), way


def outward(points, faces):
    import numpy as np

    a, b, c = (points[faces[:, corner]] for corner in range(3))
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), a) < 0
    faces[inward] = faces[inward][:, ::-1]
    return faces


def synthetic(n):
    """Both bodies, and for each vertex of the second that of the first in the same direction."""
    from scipy.spatial import cKDTree

    (vertices, faces, way), (others, other_faces, other_way) = body(n, 0), body(n, 1)
    return (vertices, faces), (others, other_faces), cKDTree(way).query(other_way)[1]


def real(shared, source, target):
    """Two meshes of the shared data, and each vertex's partner: that of the nearest sample."""
    import numpy as np
    from scipy.spatial import cKDTree

    a, b = (np.load(Path(shared) / "data/matching" / name) for name in (source, target))
    nearest = cKDTree(b["V"][b["gt"]]).query(b["V"])[1]
    return (a["V"], a["F"]), (b["V"], b["F"]), a["gt"][nearest]


def prepare(folder, source, target, partners):
    """Writes bases, samples and the true map of a pair."""
    import numpy as np
    from pyFM.mesh import TriMesh

    sides = {}
    for name, (vertices, faces) in (("source", source), ("target", target)):
        mesh = TriMesh(np.array(vertices, float), np.array(faces, int), area_normalize=True)
        mesh.process(k=K)
        sides[name] = mesh
        # pyFM's farthest points begin anywhere; every n/1000-th vertex of a random order is as good here.
        samples = np.random.default_rng(5).permutation(len(vertices))[: min(N_SAMPLES, len(vertices))]
        arrays = dict(
            functions=mesh.eigenvectors, mass=mesh.A.diagonal(), vertices=mesh.vertices, faces=mesh.faces.astype(float)
        )
        for what, array in arrays.items():
            np.save(folder / f"{name}.{what}.npy", np.ascontiguousarray(array, float))
        np.save(folder / f"{name}.samples.npy", samples.astype(np.uint32))
    a, b = sides["source"], sides["target"]
    np.save(folder / "start.npy", b.eigenvectors.T @ (b.A @ a.eigenvectors[partners]))


def peer(folder, task):
    """pyFM's side: run in a process of its own, prints the same JSON as ours and writes `peer.npy`."""
    import numpy as np
    import pyFM.refine
    import pyFM.spectral
    import scipy.sparse as sp
    from pyFM.spectral.projection_utils import nn_query_precise_np

    load = lambda name: np.load(folder / f"{name}.npy")
    source, target, start = load("source.functions"), load("target.functions"), load("start")
    faces, mass = load("source.faces").astype(int), sp.diags(load("target.mass"))
    samples = (load("source.samples"), load("target.samples"))
    kind, *numbers = task.split(":")
    numbers = [int(number) for number in numbers]
    first = start[: numbers[0], : numbers[0]]
    idle = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    wall, cpu = time.perf_counter(), time.process_time()
    if kind in ("zoomout", "sampled"):
        k_start, k_final, step = numbers
        among = dict(subsample=samples) if kind == "sampled" else dict(A2=mass)
        turns = (k_final - k_start) // step
        answer = pyFM.refine.zoomout_refine(first, source, target, nit=turns, step=step, n_jobs=1, **among)
    elif kind == "point_map":
        answer = pyFM.spectral.FM_to_p2p(first, source, target, n_jobs=1)[:, None]
    else:
        k = numbers[0]
        chosen, weights = nn_query_precise_np(source[:, :k] @ first.T, faces, target[:, :k], n_jobs=1)
        answer = np.column_stack([chosen, weights])
    cpu, wall = time.process_time() - cpu, time.perf_counter() - wall
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    np.save(folder / "peer.npy", answer)
    print(json.dumps(dict(cpu=cpu, wall=wall, idle_mb=idle, peak_mb=peak)))


def apart(folder, task):
    """How far the answers of both sides are apart, in words."""
    import numpy as np

    ours, theirs = np.load(folder / "answer.npy"), np.load(folder / "peer.npy")
    kind, k = task.split(":")[0], int(task.split(":")[1])
    if kind == "point_map":
        return f"{(ours != theirs).sum()} of {len(ours)} differ"
    if kind != "precise":
        return f"{np.linalg.norm(ours - theirs) / np.linalg.norm(theirs):.0e}"
    start = np.load(folder / "start.npy")[:k, :k]
    corners = np.load(folder / "source.functions.npy")[:, :k] @ start.T
    faces = np.load(folder / "source.faces.npy").astype(int)
    queries = np.load(folder / "target.functions.npy")[:, :k]

    def distances(answer):
        points = np.einsum("ij,ijk->ik", answer[:, 1:], corners[faces[answer[:, 0].astype(int)]])
        return np.linalg.norm(points - queries, axis=1)

    d_ours, d_theirs = distances(ours), distances(theirs)
    return f"{((d_ours - d_theirs) / d_theirs.max()).max():.0e} farther, {(d_theirs - d_ours > 1e-9).sum()} nearer"


def median(runs, what):
    return sorted(run[what] for run in runs)[len(runs) // 2]


def once(command, environment=ONE):
    done = subprocess.run(command, env={**os.environ, **environment}, check=True, capture_output=True, text=True)
    return json.loads(done.stdout)


def beside_peer(program, label, folder, n, repeats):
    for name, task, goal, most in TASKS:
        if n > most:
            continue
        ours, theirs = [], []
        for _ in range(repeats):
            ours.append(once([program, folder, task, "1"]))
            theirs.append(once([sys.executable, __file__, "--peer", folder, task]))
        mine, other = median(ours, "cpu"), median(theirs, "cpu")
        memory = [max(run["peak_mb"] - run["idle_mb"] for run in runs) for runs in (ours, theirs)]
        is_met = other / mine >= goal and not (task.startswith("precise") and memory[0] > PRECISE_MEMORY)
        print(
            f"{label:8} {n:6} {name:34} {mine:9.3f} {other:9.3f} {other / mine:6.1f}x {goal:4}x"
            f" {'reached' if is_met else 'missed':8} {memory[0]:6.0f} {memory[1]:7.0f}  {apart(Path(folder), task)}",
            flush=True,
        )


def with_threads(program, label, folder, n, repeats, threads):
    for name, task, _, most in TASKS:
        if n > most:
            continue
        runs = {1: [], threads: []}
        for _ in range(repeats):
            for count, seen in runs.items():
                seen.append(once([program, folder, task, "1"], {**ONE, "RAYON_NUM_THREADS": str(count)}))
        one, many = (median(seen, "wall") for seen in runs.values())
        print(f"{label:8} {n:6} {name:34} {one:9.3f} {many:9.3f} {one / many:6.2f}x", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("ours", help="the bench_maps example, built with --release")
    parser.add_argument("--n", type=int, nargs="*", default=[2000, 5000, 10000, 25000])
    parser.add_argument("--shared", default=os.environ.get("SEMFM_SHARED", "../shared"))
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--threads", type=int, default=1)
    options = parser.parse_args()
    pairs = [("bodies", lambda n=n: synthetic(n)) for n in options.n]
    if (Path(options.shared) / "data/matching").is_dir():
        pairs += [(label, lambda names=names: real(options.shared, *names)) for label, *names in PAIRS]
    else:
        print(f"no shared data at {options.shared}: bodies alone", file=sys.stderr)
    if options.threads > 1:
        print(f"{'pair':8} {'n':>6} {'':34} {'1 thread':>9} {options.threads:>7} t. wall")
    else:
        print(f"{'pair':8} {'n':>6} {'':34} {'ours s':>9} {'pyFM s':>9} {'ratio':>7} {'goal':>5} verdict  {'MB':>6} {'pyFM MB':>7}  apart")
    for label, make in pairs:
        with tempfile.TemporaryDirectory() as folder:
            source, target, partners = make()
            prepare(Path(folder), source, target, partners)
            arguments = (options.ours, label, folder, len(target[0]), options.repeats)
            if options.threads > 1:
                with_threads(*arguments, options.threads)
            else:
                beside_peer(*arguments)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--peer"]:
        peer(Path(sys.argv[2]), sys.argv[3])
    else:
        main()
