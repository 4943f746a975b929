"""The Python package beside pyFM on the same bases and descriptors, in one run.

    pip install . pyfmaps==1.3.1
    python bench/python_peers.py [--n 2000 5000 10000] [--repeats 3]

Both sides run on one thread: the BLAS by its environment variables, pyFM's searches by `n_jobs=1`,
ours by `semfm.set_num_threads(1)`. Seconds are process CPU seconds, medians of the repeats, which
take turns, so that a busy machine slows both. Bases are computed once, by pyFM, and given to both.
Each line also says how far the two answers are apart.
"""

import os

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[name] = "1"

import argparse
import time

import numpy as np
import pyFM.refine
import pyFM.signatures
import pyFM.spectral
from pyFM.functional import FunctionalMapping
from pyFM.mesh import TriMesh

import semfm

K_START, K_FINAL, STEP = 20, 100, 5
N_DESCRIPTORS = 40
K_SIGNATURES, N_SIGNATURES = 50, 100


def pair(n):
    """Two procedural containers of about n vertices: pyFM's meshes, and our bases of theirs."""
    sides = []
    for instance in (0, 1):
        mesh = semfm.demo_object("containers", instance=instance, n_vertices=n).mesh
        theirs = TriMesh(np.array(mesh.vertices), mesh.faces.astype(int), area_normalize=True)
        theirs.process(k=K_FINAL)
        mass = theirs.A.diagonal()
        ours = semfm.Eigenbasis(theirs.eigenvalues.clip(0), theirs.eigenvectors, mass)
        sides.append((theirs, ours))
    return zip(*sides)


def timed(repeats, *calls):
    """Medians of CPU seconds of calls that take turns, and what each returned last."""
    seconds, answers = [[] for _ in calls], [None] * len(calls)
    for _ in range(repeats):
        for number, call in enumerate(calls):
            start = time.process_time()
            answers[number] = call()
            seconds[number].append(time.process_time() - start)
    return [sorted(each)[len(each) // 2] for each in seconds], answers


def told(n, name, seconds, apart):
    ours, theirs = seconds
    print(f"{n:6} {name:36} {ours:9.4f} {theirs:9.4f} {theirs / ours:7.1f} {apart}", flush=True)


def fit_of_theirs(meshes, functions, k, weights):
    # Built by hand: the constructor copies both meshes, which is not what is timed.
    model = FunctionalMapping.__new__(FunctionalMapping)
    model.mesh1, model.mesh2 = meshes
    model.descr1, model.descr2 = functions
    model.fit(K=(k, k), use_resolvent_laplacian=False, **{"w_descr": 1, **weights})
    return model.FM_12


def compare_signatures(n, repeats, theirs, ours):
    """100 wave kernel signatures and k = 50, the same weights on both sides."""
    functions = [pyFM.signatures.mesh_WKS(each, N_SIGNATURES, k=K_SIGNATURES) for each in theirs]
    meshes = [semfm.Mesh(each.vertices, each.faces) for each in theirs]
    turned = dict(orientation=1.0, source_mesh=meshes[0], target_mesh=meshes[1])
    for name, our_weights, their_weights in [
        ("", dict(), dict()),
        (" + orientation", turned, dict(w_orient=1)),
    ]:
        seconds, _ = timed(
            repeats,
            lambda ours_too=our_weights: semfm.FunctionalMap.fit(
                *ours, *functions, k=K_SIGNATURES, laplacian=0.01, descriptors=1, **ours_too
            ),
            lambda theirs_too=their_weights: fit_of_theirs(
                theirs, functions, K_SIGNATURES, dict(w_lap=0.01, w_dcomm=1, **theirs_too)
            ),
        )
        told(n, f"fit 50 × 50, 100 WKS{name}", seconds, "scales of the weights differ")


def compare(n, repeats):
    theirs, ours = pair(n)
    n = theirs[0].n_vertices
    # Random smooth functions, with the same coefficients on both sides.
    # Without a constant part, of which pyFM pins the image.
    coefficients = np.random.default_rng(0).normal(size=(K_START, N_DESCRIPTORS))
    coefficients[0] = 0
    functions = [each.reconstruct(coefficients) for each in ours]
    fits = [
        ("fit 20 × 20", dict(), dict(w_lap=0, w_dcomm=0)),
        ("fit, Laplacian", dict(laplacian=0.01), dict(w_lap=0.01, w_dcomm=0)),
        (
            "fit, Laplacian, descriptors",
            dict(laplacian=0.01, descriptors=0.1),
            dict(w_lap=0.01, w_dcomm=0.1),
        ),
    ]
    for name, our_weights, their_weights in fits:

        def their_fit():
            return fit_of_theirs(theirs, functions, K_START, their_weights)

        def our_fit():
            return semfm.FunctionalMap.fit(*ours, *functions, k=K_START, **our_weights)

        seconds, (map, matrix) = timed(repeats, our_fit, their_fit)
        plain = not our_weights
        apart = np.linalg.norm((map.matrix - matrix)[:, 1:]) / np.linalg.norm(matrix)
        told(n, name, seconds, f"{apart:.0e}" if plain else "scales of the weights differ")
    compare_signatures(n, repeats, theirs, ours)
    start = semfm.FunctionalMap(np.eye(K_START))
    vectors = [each.eigenvectors for each in theirs]

    def their_zoomout():
        steps = (K_FINAL - K_START) // STEP
        return pyFM.refine.zoomout_refine(
            start.matrix, *vectors, nit=steps, step=STEP, A2=theirs[1].A, n_jobs=1
        )

    seconds, (refined, matrix) = timed(
        repeats, lambda: start.zoomout(*ours, k_final=K_FINAL, step=STEP), their_zoomout
    )
    apart = np.linalg.norm(refined.matrix - matrix) / np.linalg.norm(matrix)
    told(n, f"ZoomOut {K_START} → {K_FINAL}, step {STEP}", seconds, f"{apart:.0e}")
    seconds, (point_map, indices) = timed(
        repeats,
        lambda: refined.to_point_map(*ours),
        lambda: pyFM.spectral.FM_to_p2p(refined.matrix, *vectors, n_jobs=1),
    )
    told(n, "point map, k = 100", seconds, f"{(point_map.source_of != indices).sum()} of {n}")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--n", type=int, nargs="+", default=[2000, 5000, 10000])
    parser.add_argument("--repeats", type=int, default=3)
    options = parser.parse_args()
    semfm.set_num_threads(1)
    print(f"{'n':>6} {'':36} {'ours s':>9} {'pyFM s':>9} {'ratio':>7} apart")
    for n in options.n:
        compare(n, options.repeats)


if __name__ == "__main__":
    main()
