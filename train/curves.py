"""Curves and outlines that solids are built along: points in rows, float64."""

from __future__ import annotations

import numpy as np


def arc(
    radius: float, start: float, stop: float, n: int = 12, *, stretch: float = 1.0
) -> np.ndarray:
    """Points (n, 3) of a circle's arc in the x, z plane, angles in radians; z is stretched."""
    t = np.linspace(start, stop, n)
    return np.stack([radius * np.cos(t), 0 * t, stretch * radius * np.sin(t)], 1)


def helix(radius: float, height: float, turns: float, n: int = 40) -> np.ndarray:
    """Points (n, 3) of a screw line about z."""
    t = np.linspace(0, 1, n)
    angle = 2 * np.pi * turns * t
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), height * t], 1)


def smooth(points, n: int = 12) -> np.ndarray:
    """Catmull-Rom spline through points (m, d), as n points."""
    p = np.asarray(points, float)
    p = np.vstack([2 * p[0] - p[1], p, 2 * p[-1] - p[-2]])
    t = np.linspace(0, len(p) - 3 - 1e-9, n)
    i, s = t.astype(int), (t % 1)[:, None]
    a, b, c, d = p[i], p[i + 1], p[i + 2], p[i + 3]
    return 0.5 * (
        2 * b + (c - a) * s + (2 * a - 5 * b + 4 * c - d) * s**2 + (3 * b - a - 3 * c + d) * s**3
    )


def between(values, n: int) -> np.ndarray:
    """Values spread evenly and interpolated at n places, for radii along a curve."""
    values = np.atleast_1d(np.asarray(values, float))
    return np.interp(np.linspace(0, 1, n), np.linspace(0, 1, len(values)), values)


def vessel_profile(radii, height: float, wall: float, *, base: float | None = None) -> np.ndarray:
    """Outline (n, 2) of (radius, z) of a vessel that is open at the top.

    `radii` are the outer radii from the bottom up, at even heights. The floor lies at the first of
    these heights above `base`; where none is given that is the wall's thickness, or half the height
    where that is less.
    """
    radii = np.asarray(radii, float)
    z = np.linspace(0, height, len(radii))
    inner = np.stack([np.maximum(radii - wall, 0.004), z], 1)
    inner = inner[inner[:, 1] > (min(wall, height / 2) if base is None else base)]
    floor = [[0, inner[0, 1]]]
    return np.vstack([[[0, 0]], np.stack([radii, z], 1), inner[::-1], floor])


def solid_profile(radii, height: float) -> np.ndarray:
    """Outline (n + 2, 2) of (radius, z) of a full turned body."""
    radii = np.asarray(radii, float)
    z = np.linspace(0, height, len(radii))
    return np.vstack([[[0, 0]], np.stack([radii, z], 1), [[0, height]]])


def star(rng: np.random.Generator, n: int, radius: float, roughness: float) -> np.ndarray:
    """A random outline (n, 2) about the origin that every ray from there meets once."""
    angle = np.linspace(0, 2 * np.pi, n, endpoint=False)
    r = radius * np.exp(rng.normal(0, roughness, n))
    return np.stack([r * np.cos(angle), r * np.sin(angle)], 1)


def gear(teeth: int, radius: float, depth: float) -> np.ndarray:
    """Outline (4·teeth, 2) of a gear wheel."""
    angle = np.linspace(0, 2 * np.pi, 4 * teeth, endpoint=False)
    r = radius - depth * np.tile([0, 0, 1, 1], teeth)
    return np.stack([r * np.cos(angle), r * np.sin(angle)], 1)


def rotation(axis, angle: float) -> np.ndarray:
    """Matrix (3, 3) that turns by an angle in radians about an axis (3,), Rodrigues' formula."""
    x, y, z = np.asarray(axis, float) / np.linalg.norm(axis)
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * (k @ k)


def random_rotation(rng: np.random.Generator) -> np.ndarray:
    """Uniform over all rotations, (3, 3)."""
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q if np.linalg.det(q) > 0 else q[:, ::-1]
