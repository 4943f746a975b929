#!/usr/bin/env python3
"""Turns objects with patch samples into the folder of .npy files that bench_transfer reads.

  python bench_transfer_data.py DATA OUT [LEVEL]

DATA holds NAME.obj, NAME_LEVEL.npz (X (p,3) positions and E (p,d) features of patch samples) and
NAME_gt.npz (grip: the true region per vertex). For each object two clouds are written: 1200
farthest-point samples out of 7200, and 400 area-uniform ones (the published method's), each point
with the mean of the patch samples within 6 % of the bounding box's diagonal, or the nearest one.
Needs numpy and scipy.
"""
import glob
import os
import sys

import numpy as np
from scipy.spatial import cKDTree


def read_obj(path):
    V, F = [], []
    for line in open(path):
        w = line.split()
        if w and w[0] == "v":
            V.append([float(x) for x in w[1:4]])
        elif w and w[0] == "f":
            F.append([int(x.split("/")[0]) - 1 for x in w[1:4]])
    return np.array(V), np.array(F, dtype=np.uint32)


def uniform(V, F, n, rng):
    T = V[F]
    area = np.linalg.norm(np.cross(T[:, 1] - T[:, 0], T[:, 2] - T[:, 0]), axis=1)
    T = T[rng.choice(len(F), n, p=area / area.sum())]
    u, v = np.sqrt(rng.random(n))[:, None], rng.random(n)[:, None]
    return (1 - u) * T[:, 0] + u * (1 - v) * T[:, 1] + u * v * T[:, 2]


def farthest(P, n):
    chosen, distance = [0], np.full(len(P), np.inf)
    while len(chosen) < n:
        distance = np.minimum(distance, ((P - P[chosen[-1]]) ** 2).sum(1))
        chosen.append(int(distance.argmax()))
    return P[chosen]


def lift(P, X, E, radius):
    tree = cKDTree(X)
    hits = tree.query_ball_point(P, radius)
    return np.stack([E[h if h else [tree.query(p)[1]]].mean(0) for p, h in zip(P, hits)]).astype(np.float32)


def main():
    data, out = sys.argv[1:3]
    level = sys.argv[3] if len(sys.argv) > 3 else "medium"
    os.makedirs(out, exist_ok=True)
    for path in sorted(glob.glob(f"{data}/*.obj")):
        name = os.path.basename(path)[:-4]
        V, F = read_obj(path)
        z = np.load(f"{data}/{name}_{level}.npz")
        X, E = z["X"].astype(float), z["E"].astype(np.float32)
        rng = np.random.default_rng(0)
        radius = 0.06 * np.linalg.norm(np.ptp(V, axis=0))
        arrays = {"vertices": V, "faces": F, "grip": np.load(f"{data}/{name}_gt.npz")["grip"].astype(np.uint8)}
        for tag, P in (("even", farthest(uniform(V, F, 7200, rng), 1200)), ("uniform", uniform(V, F, 400, rng))):
            arrays[f"{tag}_points"], arrays[f"{tag}_features"] = P, lift(P, X, E, radius)
        for what, array in arrays.items():
            np.save(f"{out}/{name}.{what}.npy", np.ascontiguousarray(array))
        print(name, len(V), "vertices,", E.shape, "patch samples")


if __name__ == "__main__":
    main()
