"""Signed distances: the solids that training objects are built from.

A `Solid` answers points (n, 3) float32 with distances (n,) float32: negative inside, positive
outside, zero on the surface, and never steeper than 1 per unit, so that a far point may be skipped.
It also knows a box that encloses it. Lengths have no unit; objects are about 1 across.

Formulas after Inigo Quilez, "Distance functions", https://iquilezles.org/articles/distfunctions/.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

Field = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Solid:
    """A distance field and a box, `low` to `high` (3,), around all that is inside it."""

    field: Field
    low: np.ndarray
    high: np.ndarray

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Signed distance of points (n, 3), (n,) float32."""
        return self.field(points)

    def moved(self, by=(0.0, 0.0, 0.0), rotation: np.ndarray | None = None) -> Solid:
        """The same solid turned about the origin by `rotation` (3, 3), then shifted."""
        by = np.asarray(by, np.float32)
        turn = np.eye(3, dtype=np.float32) if rotation is None else np.float32(rotation)
        corners = _corners(self.low, self.high) @ turn.T + by
        # world = turn · local + by, so local = turnᵀ (world − by), as rows (world − by) · turn
        return Solid(lambda p: self.field((p - by) @ turn), corners.min(0), corners.max(0))

    def mirrored(self, axis: int) -> Solid:
        """The same solid with one coordinate negated."""
        flip = np.ones(3, np.float32)
        flip[axis] = -1
        ends = np.stack([self.low * flip, self.high * flip])
        return Solid(lambda p: self.field(p * flip), ends.min(0), ends.max(0))


# --- solids ---------------------------------------------------------------------------------


def tube(curve, radii, *, closed: bool = False, flat=None) -> Solid:
    """A round tube along a curve.

    Parameters
    ----------
    curve : (n, 3) points of the curve, joined by straight pieces.
    radii : one radius, or n of them; it changes linearly along each piece.
    closed : whether the last point joins the first.
    flat : (direction (3,), share): squeeze the section along a direction to that share.
    """
    curve = np.asarray(curve, np.float32)
    radii = np.broadcast_to(np.asarray(radii, np.float32), (len(curve),))
    if closed:
        curve, radii = np.vstack([curve, curve[:1]]), np.append(radii, radii[0])
    axis, share = (None, 1.0) if flat is None else (_unit(flat[0]), float(flat[1]))

    def field(p: np.ndarray) -> np.ndarray:
        best = np.full(len(p), np.inf, np.float32)
        for a, b, ra, rb in zip(curve[:-1], curve[1:], radii[:-1], radii[1:]):
            ab = b - a
            t = np.clip((p - a) @ ab / max(ab @ ab, 1e-12), 0, 1)
            off = p - a - t[:, None] * ab
            if axis is not None:
                off = off + (off @ axis)[:, None] * (axis * np.float32(1 / share - 1))
            # squeezed space is steeper by 1/share: scale back to keep the distance a lower bound
            d = np.sqrt(np.einsum("ij,ij->i", off, off)) - (ra + t * (rb - ra))
            best = np.minimum(best, d * np.float32(share) if axis is not None else d)
        return best

    reach = radii.max()
    return Solid(field, curve.min(0) - reach, curve.max(0) + reach)


def box(half, *, round: float = 0.0) -> Solid:
    """A box of half sizes (3,) about the origin, its edges rounded by a radius."""
    half = np.asarray(half, np.float32)
    round = min(float(round), 0.95 * float(half.min()))

    def field(p: np.ndarray) -> np.ndarray:
        q = np.abs(p) - (half - np.float32(round))
        outside = np.sqrt((np.maximum(q, 0) ** 2).sum(1))
        return outside + np.minimum(q.max(1), 0) - np.float32(round)

    return Solid(field, -half, half)


def ellipsoid(radii) -> Solid:
    """An ellipsoid of three radii about the origin; its distance is a lower bound."""
    radii = np.asarray(radii, np.float32)

    def field(p: np.ndarray) -> np.ndarray:
        return (np.sqrt(((p / radii) ** 2).sum(1)) - 1) * radii.min()

    return Solid(field, -radii, radii)


def revolved(profile, *, square: float = 2.0) -> Solid:
    """A closed polygon (n, 2) of (radius, z) turned about the z axis.

    `square` is the exponent of the section: 2 is a circle, 4 a rounded square.
    """
    profile = np.asarray(profile, np.float32)

    def field(p: np.ndarray) -> np.ndarray:
        if square == 2.0:
            rho = np.hypot(p[:, 0], p[:, 1])
        else:
            rho = (np.abs(p[:, 0]) ** square + np.abs(p[:, 1]) ** square) ** (1 / square)
        return polygon_distance(profile, rho, p[:, 2])

    r = profile[:, 0].max()
    low, high = profile[:, 1].min(), profile[:, 1].max()
    return Solid(field, np.float32([-r, -r, low]), np.float32([r, r, high]))


def extruded(polygon, half: float, *, round: float = 0.0, taper: float = 0.0) -> Solid:
    """A closed polygon (n, 2) in x, y, drawn out to ±`half` along z.

    `taper` shrinks the outline by that length per unit of |z|: a chamfer from both faces.
    """
    polygon = np.asarray(polygon, np.float32)
    round = min(float(round), 0.9 * half)

    def field(p: np.ndarray) -> np.ndarray:
        height = np.abs(p[:, 2])
        side = polygon_distance(polygon, p[:, 0], p[:, 1]) + np.float32(round)
        side = (side + np.float32(taper) * height) / np.float32(np.hypot(1, taper))
        cap = height - np.float32(half - round)
        outside = np.hypot(np.maximum(side, 0), np.maximum(cap, 0))
        return outside + np.minimum(np.maximum(side, cap), 0) - np.float32(round)

    low = np.float32([*polygon.min(0), -half])
    return Solid(field, low, np.float32([*polygon.max(0), half]))


def torus(major: float, minor: float) -> Solid:
    """A ring in the x, y plane: radius of its centre line, radius of its tube."""

    def field(p: np.ndarray) -> np.ndarray:
        ring = np.hypot(p[:, 0], p[:, 1]) - np.float32(major)
        return np.hypot(ring, p[:, 2]) - np.float32(minor)

    reach = np.float32([major + minor, major + minor, minor])
    return Solid(field, -reach, reach)


def thread(radius: float, half: float, pitch: float, depth: float, starts: int = 1) -> Solid:
    """A screw along z: a cylinder with a triangular thread of that pitch and depth."""

    def field(p: np.ndarray) -> np.ndarray:
        turn = np.arctan2(p[:, 1], p[:, 0]) / np.float32(2 * np.pi) * starts
        wave = np.abs(((p[:, 2] / np.float32(pitch) - turn) % 1) - 0.5) * 2  # 0 to 1
        side = np.hypot(p[:, 0], p[:, 1]) - np.float32(radius) + np.float32(depth) * wave
        steepness = np.hypot(1, 2 * depth / pitch)
        return np.maximum(side / np.float32(steepness), np.abs(p[:, 2]) - np.float32(half))

    reach = np.float32([radius, radius, half])
    return Solid(field, -reach, reach)


def sheet(half_x: float, half_y: float, thickness: float, bend=(0.0, 0.0, 0.0)) -> Solid:
    """A thin plate in x, y, lifted to z = a x² + b y² + c x y for `bend` (a, b, c)."""
    a, b, c = (np.float32(v) for v in bend)
    flat = box((half_x, half_y, thickness / 2), round=thickness / 2)
    slope = 2 * (abs(a) * half_x + abs(b) * half_y) + abs(c) * (half_x + half_y)
    rise = float(abs(a) * half_x**2 + abs(b) * half_y**2 + abs(c) * half_x * half_y)

    def field(p: np.ndarray) -> np.ndarray:
        x = np.clip(p[:, 0], -half_x, half_x)
        y = np.clip(p[:, 1], -half_y, half_y)
        lowered = p.copy()
        lowered[:, 2] -= a * x * x + b * y * y + c * x * y
        return flat.field(lowered) / np.float32(np.hypot(1, slope))

    reach = np.float32([half_x, half_y, thickness / 2 + rise])
    return Solid(field, -reach, reach)


# --- combinations ---------------------------------------------------------------------------


def union(solids: Sequence[Solid]) -> Solid:
    """All of them together; a solid is only asked about points that its box may be nearest to."""

    def field(p: np.ndarray) -> np.ndarray:
        best = np.full(len(p), np.inf, np.float32)
        for solid in solids:
            near = np.flatnonzero(_box_distance(solid, p) < best)
            if len(near):
                best[near] = np.minimum(best[near], solid.field(p[near]))
        return best

    return Solid(field, *_bounds(solids))


def blend(solids: Sequence[Solid], radius: float) -> Solid:
    """All of them together with fillets of about that radius (polynomial smooth minimum)."""
    if radius <= 0:
        return union(solids)
    k = np.float32(radius)

    def field(p: np.ndarray) -> np.ndarray:
        best = np.full(len(p), np.inf, np.float32)
        for solid in solids:
            near = np.flatnonzero(_box_distance(solid, p) < best + k)
            if len(near) == 0:
                continue
            d, old = solid.field(p[near]), best[near]
            first = ~np.isfinite(old)
            h = np.clip(0.5 + 0.5 * (np.where(first, 0, old) - d) / k, 0, 1)
            mixed = np.where(first, d, old + h * (d - np.where(first, 0, old)) - k * h * (1 - h))
            best[near] = np.where(first, d, mixed)
        return best

    low, high = _bounds(solids)
    return Solid(field, low - k / 4, high + k / 4)


def minus(solid: Solid, cutters: Sequence[Solid]) -> Solid:
    """What is left of a solid once the cutters are taken away."""
    cutter = union(cutters)
    return Solid(lambda p: np.maximum(solid.field(p), -cutter.field(p)), solid.low, solid.high)


def common(a: Solid, b: Solid) -> Solid:
    """What is inside both."""
    low, high = np.maximum(a.low, b.low), np.minimum(a.high, b.high)
    return Solid(lambda p: np.maximum(a.field(p), b.field(p)), low, np.maximum(low, high))


def shell(solid: Solid, thickness: float) -> Solid:
    """The skin of a solid: its outside stays, its inside is hollow."""
    wall = np.float32(thickness)

    def field(p: np.ndarray) -> np.ndarray:
        d = solid.field(p)
        return np.maximum(d, -(d + wall))

    return Solid(field, solid.low, solid.high)


def above(height: float, size: float = 4.0) -> Solid:
    """All that lies above z = height, to cut with."""
    return box((size, size, size)).moved((0, 0, height + size))


# --- helpers --------------------------------------------------------------------------------


def polygon_distance(polygon: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Signed distance of points (x, y) from a closed polygon (n, 2), negative inside."""
    nearest = np.full(x.shape, np.inf, np.float32)
    inside = np.zeros(x.shape, bool)
    for (ax, ay), (bx, by) in zip(polygon, np.roll(polygon, -1, axis=0)):
        ex, ey = bx - ax, by - ay
        px, py = x - ax, y - ay
        t = np.clip((px * ex + py * ey) / max(ex * ex + ey * ey, 1e-12), 0, 1)
        nearest = np.minimum(nearest, (px - t * ex) ** 2 + (py - t * ey) ** 2)
        # even-odd rule: does the edge cross the ray from the point to the right?
        if ay != by:
            inside ^= ((ay > y) != (by > y)) & (px < ex * py / ey)
    return np.where(inside, -np.sqrt(nearest), np.sqrt(nearest)).astype(np.float32)


def _box_distance(solid: Solid, p: np.ndarray) -> np.ndarray:
    centre, half = (solid.low + solid.high) / 2, (solid.high - solid.low) / 2
    q = np.maximum(np.abs(p - centre) - half, 0)
    distance = np.sqrt(np.einsum("ij,ij->i", q, q))
    # inside the box nothing is known about the distance but that it may be very negative
    return np.where(distance > 0, distance, -np.inf).astype(np.float32)


def _bounds(solids: Sequence[Solid]) -> tuple[np.ndarray, np.ndarray]:
    return np.min([s.low for s in solids], axis=0), np.max([s.high for s in solids], axis=0)


def _corners(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    choose = np.array(np.meshgrid([0, 1], [0, 1], [0, 1])).reshape(3, -1).T
    return np.where(choose == 1, high, low).astype(np.float32)


def _unit(v) -> np.ndarray:
    v = np.asarray(v, np.float32)
    return v / np.linalg.norm(v)
