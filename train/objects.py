"""Training objects: a seed and a family in, a closed triangle mesh out.

    solid of the family → marching cubes → warps → dents and noise → sometimes a coarse copy

Coarse copies imitate reconstructions from single pictures: few triangles, soft edges, bumps.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from skimage import measure

from .curves import random_rotation
from .families import FAMILIES
from .sdf import Solid

#: Cells along the longest side of the solid's box. Thin sheets are about .025 thick: two cells.
RESOLUTION = 120
#: The distance is sampled in full only within this many coarse cells of the surface.
_COARSE = 4


@dataclass(frozen=True)
class TrainingObject:
    """A mesh: vertices (n, 3) float64 with bounding-box diagonal 1, faces (m, 3) int64."""

    family: str
    seed: int
    vertices: np.ndarray
    faces: np.ndarray


def make_object(family: str, seed: int) -> TrainingObject:
    """The object of that family and seed; the same on every call."""
    rng = np.random.default_rng([seed, *family.encode()])
    for _ in range(8):
        vertices, faces = surface(FAMILIES[family](rng))
        if len(faces) > 200:
            break
    else:
        raise RuntimeError(f"family {family}, seed {seed}: eight draws in a row gave no surface")
    vertices = _unit_diagonal(vertices)
    vertices = _unit_diagonal(_warped(vertices, rng))
    vertices = vertices + _bumps(vertices, rng)
    if rng.random() < 0.4:
        vertices = _smoothed(vertices, faces, steps=int(rng.integers(1, 8)))
    if rng.random() < 0.35:
        vertices, faces = _coarse(vertices, faces, cell=rng.uniform(0.012, 0.035), rng=rng)
    vertices = _unit_diagonal(vertices) @ random_rotation(rng).T
    return TrainingObject(family, seed, vertices, faces)


def surface(solid: Solid, resolution: int = RESOLUTION) -> tuple[np.ndarray, np.ndarray]:
    """Marching cubes: vertices (n, 3) and faces (m, 3), wound outwards; only the largest pieces.

    A coarse grid finds where the surface may be; elsewhere its interpolated distance, whose sign is
    certain there, stands in for the fine one.
    """
    margin = 0.03 * float((solid.high - solid.low).max())
    low, high = solid.low - margin, solid.high + margin
    step = float((high - low).max()) / resolution
    coarse_shape = np.ceil((high - low) / (step * _COARSE)).astype(int) + 1
    coarse = solid.distance(_grid(low, step * _COARSE, coarse_shape)).reshape(coarse_shape)
    # a cell of side s holds surface only if its corners are within its diagonal, √3 s
    near = np.abs(coarse) < 1.74 * step * _COARSE
    corner = [
        near[i:, j:, k:][: near.shape[0] - 1, : near.shape[1] - 1, : near.shape[2] - 1]
        for i in (0, 1)
        for j in (0, 1)
        for k in (0, 1)
    ]
    cells = np.logical_or.reduce(corner)
    shape = (coarse_shape - 1) * _COARSE
    fine = np.repeat(
        np.repeat(np.repeat(coarse[:-1, :-1, :-1], _COARSE, 0), _COARSE, 1), _COARSE, 2
    )
    wanted = np.repeat(np.repeat(np.repeat(cells, _COARSE, 0), _COARSE, 1), _COARSE, 2)
    where = np.argwhere(wanted)
    fine[wanted] = solid.distance((low + where * step).astype(np.float32))
    fine = np.pad(fine, 1, constant_values=step)
    if fine.min() >= 0 or fine.max() <= 0:
        return np.zeros((0, 3)), np.zeros((0, 3), int)
    vertices, faces, _, _ = measure.marching_cubes(fine, 0.0, allow_degenerate=False)
    assert fine.shape == tuple(n + 2 for n in shape)
    return _largest_pieces(low + (vertices - 1) * step, faces.astype(np.int64))


def _grid(low, step, shape) -> np.ndarray:
    axes = [low[i] + step * np.arange(shape[i]) for i in range(3)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3).astype(np.float32)


def _largest_pieces(vertices, faces, share: float = 0.02) -> tuple[np.ndarray, np.ndarray]:
    """Drops connected pieces with less than a share of the triangles of the largest one."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    edges = np.vstack([faces[:, :2], faces[:, 1:]])
    n = len(vertices)
    graph = coo_matrix((np.ones(len(edges)), edges.T), shape=(n, n))
    _, piece = connected_components(graph, directed=False)
    counts = np.bincount(piece[faces[:, 0]])
    keep = counts[piece[faces[:, 0]]] >= share * counts.max()
    return _compact(vertices, faces[keep])


def _compact(vertices, faces) -> tuple[np.ndarray, np.ndarray]:
    used, renumbered = np.unique(faces, return_inverse=True)
    return vertices[used], renumbered.reshape(-1, 3)


def _unit_diagonal(vertices: np.ndarray) -> np.ndarray:
    low, high = vertices.min(0), vertices.max(0)
    return (vertices - (low + high) / 2) / np.linalg.norm(high - low)


def _warped(v: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Stretched, and sometimes bent, tapered or twisted along a random axis."""
    v = v @ random_rotation(rng).T if rng.random() < 0.15 else v.copy()
    v *= np.exp(rng.normal(0, 0.13, 3))
    a = rng.integers(3)
    b, c = (a + 1) % 3, (a + 2) % 3
    if rng.random() < 0.35:
        v[:, b] += rng.normal(0, 0.3) * v[:, a] ** 2
    if rng.random() < 0.3:
        v[:, [b, c]] *= np.exp(rng.normal(0, 0.4) * v[:, [a]])
    if rng.random() < 0.15:
        angle = rng.normal(0, 0.7) * v[:, a]
        x, y = v[:, b].copy(), v[:, c].copy()
        v[:, b], v[:, c] = (
            np.cos(angle) * x - np.sin(angle) * y,
            np.sin(angle) * x + np.cos(angle) * y,
        )
    return v


def _bumps(v: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Displacements (n, 3): dents, waves of random direction, and grain."""
    out = np.zeros_like(v)
    for _ in range(rng.choice([0, 0, 2, 6])):
        centre, width = v[rng.integers(len(v))], rng.uniform(0.03, 0.1)
        weight = np.exp(-((v - centre) ** 2).sum(1) / (2 * width**2))
        out += weight[:, None] * rng.normal(0, 0.012, 3)
    if rng.random() < 0.2:
        size = rng.choice([0.002, 0.004, 0.008])
        for _ in range(4):
            wave = np.sin(v @ rng.normal(0, rng.uniform(15, 50), 3) + rng.uniform(0, 6.3))
            out += wave[:, None] * rng.normal(0, size / 2, 3)
    if rng.random() < 0.15:
        out += rng.normal(0, 0.0008, v.shape)
    return out


def _smoothed(v: np.ndarray, faces: np.ndarray, steps: int) -> np.ndarray:
    """Umbrella smoothing; soft edges as reconstructions have them."""
    from scipy.sparse import coo_matrix

    n = len(v)
    i, j = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    neighbours = coo_matrix((np.ones(len(i)), (i, j)), shape=(n, n)).tocsr()
    degree = np.asarray(neighbours.sum(1)).clip(1)
    for _ in range(steps):
        v = 0.4 * v + 0.6 * (neighbours @ v) / degree
    return v


def _coarse(vertices, faces, cell: float, rng) -> tuple[np.ndarray, np.ndarray]:
    """Vertices that share a cell of a grid become one, at their mean.

    Where that would pinch thin parts into edges of three triangles, the mesh stays as it is.
    """
    key = np.floor((vertices + rng.uniform(0, cell, 3)) / cell).astype(np.int64)
    _, first, cluster, counts = np.unique(
        key, axis=0, return_index=True, return_inverse=True, return_counts=True
    )
    cluster = cluster.ravel()
    means = np.stack([np.bincount(cluster, vertices[:, k]) for k in range(3)], 1) / counts[:, None]
    f = cluster[faces]
    f = f[(f[:, 0] != f[:, 1]) & (f[:, 1] != f[:, 2]) & (f[:, 2] != f[:, 0])]
    f = f[np.unique(np.sort(f, axis=1), axis=0, return_index=True)[1]]
    return _compact(means, f) if len(f) > 300 else (vertices, faces)
