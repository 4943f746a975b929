"""Bent wire, assemblies, carved blocks, repeated parts, fasteners."""

from __future__ import annotations

import numpy as np

from ..curves import (
    arc,
    between,
    gear,
    helix,
    random_rotation,
    rotation,
    smooth,
    solid_profile,
    star,
)
from ..sdf import (
    Solid,
    blend,
    box,
    ellipsoid,
    extruded,
    minus,
    revolved,
    sheet,
    thread,
    torus,
    tube,
    union,
)
from .axes import Rng, X, Z


def wire(rng: Rng) -> Solid:
    """Bent rods: hooks, springs, frames, hangers, spectacles."""
    t = rng.uniform(0.016, 0.035)
    kind = rng.integers(5)
    if kind == 0:
        spring = helix(rng.uniform(0.1, 0.25), rng.uniform(0.4, 0.9), rng.integers(3, 8), 70)
        return tube(spring, t)
    if kind == 1:
        a, b = rng.uniform(0.3, 0.5), rng.uniform(0.1, 0.3)
        loop = [[-a, 0, 0], [a, 0, 0], [0, 0, b]]
        hook = arc(0.08, -np.pi * 0.6, np.pi * 0.9, 9) + [0, 0, b + 0.14]
        return blend([tube(loop, t, closed=True), tube(np.vstack([[[0, 0, b]], hook]), t)], 0.02)
    if kind == 2:
        r, apart = rng.uniform(0.13, 0.2), rng.uniform(0.03, 0.08)
        parts = []
        for s in (-1, 1):
            ring = arc(r, 0, 2 * np.pi, 16, stretch=rng.uniform(0.6, 1))[:-1]
            parts.append(tube(ring, t, closed=True).moved((s * (r + apart), 0, 0)))
            end = s * (2 * r + apart)
            parts.append(tube([[end, 0, 0.02], [end, 0.5, 0.02], [end, 0.62, -0.1]], t))
        return union([*parts, tube([[-apart, 0, 0], [apart, 0, 0]], t)])
    if kind == 3:
        points = np.cumsum(rng.normal(0, 0.22, (rng.integers(3, 8), 3)), 0)
        return tube(smooth(points, 30), between(rng.uniform(0.02, 0.07, 4), 30))
    corners = np.array(
        [[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    ) * rng.uniform(0.15, 0.4, 3)
    edges = [(i, j) for i in range(8) for j in range(i) if bin(i ^ j).count("1") == 1]
    return union([tube(corners[[i, j]], t) for i, j in edges])


def assembly(rng: Rng) -> Solid:
    """Two to eight random parts, each set on an earlier one."""
    parts, anchors = [], [np.zeros(3)]
    for _ in range(rng.integers(2, 9)):
        anchor, turn = anchors[rng.integers(len(anchors))], random_rotation(rng)
        part, reach = random_part(rng)
        parts.append(part.moved(anchor + turn @ [0, 0, reach * 0.8], turn))
        anchors += [anchor + turn @ [0, 0, 1.6 * reach], anchor + turn @ [0.7 * reach, 0, reach]]
    return blend(parts, rng.choice([0, 0.02, 0.06, 0.12]))


def random_part(rng: Rng) -> tuple[Solid, float]:
    """A part about the origin and its half length along z."""
    kind, h, r = rng.integers(7), rng.uniform(0.1, 0.35), rng.uniform(0.04, 0.18)
    if kind == 0:
        return tube(
            [[0, 0, -h], [rng.normal(0, 0.05), 0, 0], [0, 0, h]],
            r * 0.6 * np.exp(rng.normal(0, 0.3, 3)),
        ), h
    if kind == 1:
        return box((r, rng.uniform(0.03, 0.2), h), round=rng.uniform(0, 0.03)), h
    if kind == 2:
        return ellipsoid((r, rng.uniform(0.05, 0.2), h)), h
    if kind == 3:
        return torus(r + 0.06, rng.uniform(0.02, 0.05)).moved(
            rotation=rotation(X, np.pi / 2)
        ), r + 0.06
    if kind == 4:
        return revolved(solid_profile(r * np.exp(rng.normal(0, 0.3, 6)), 2 * h)).moved(
            (0, 0, -h)
        ), h
    if kind == 5:
        return sheet(r, h, 0.03, rng.normal(0, 0.8, 3)).moved(rotation=rotation(X, np.pi / 2)), h
    return extruded(star(rng, rng.integers(4, 9), r, 0.25), h, round=0.01), h


def carved(rng: Rng) -> Solid:
    """A block with pieces cut out: edges, bores, slots, pockets."""
    half = rng.uniform(0.1, 0.5, 3)
    body = box(half, round=rng.choice([0, 0.02, 0.08])) if rng.random() < 0.6 else ellipsoid(half)
    if rng.random() < 0.3:
        body = extruded(star(rng, rng.integers(5, 10), 0.4, 0.2), half[2])
    cuts = []
    for _ in range(rng.integers(1, 6)):
        at, turn = (
            rng.uniform(-1, 1, 3) * half,
            random_rotation(rng) if rng.random() < 0.4 else np.eye(3),
        )
        kind, size = rng.integers(4), rng.uniform(0.04, 0.2)
        if kind == 0:
            axis = np.eye(3)[rng.integers(3)]
            cuts.append(tube([at - 2 * axis, at + 2 * axis], size * 0.6))
        elif kind == 1:
            cuts.append(box(size * np.exp(rng.normal(0, 0.6, 3))).moved(at, turn))
        elif kind == 2:
            cuts.append(ellipsoid(size * np.exp(rng.normal(0, 0.4, 3))).moved(at, turn))
        else:
            cuts.append(torus(size + 0.1, 0.04).moved(at, turn))
    return minus(body, cuts)


def repeated(rng: Rng) -> Solid:
    """One small part many times over: in a row, a ring, a grid, a stack or a ladder."""
    part, _ = random_part(rng)
    n, kind, size = rng.integers(3, 9), rng.integers(4), rng.uniform(0.1, 0.3)
    small = _scaled(part, rng.uniform(0.3, 0.7))
    if kind == 0:
        copies = [small.moved((0.12 * (i - n / 2), 0, 0)) for i in range(n)]
        base = box((0.07 * n, 0.06, 0.03)).moved((0, 0, -0.08))
    elif kind == 1:
        copies = [
            small.moved(rotation(Z, q) @ [size, 0, 0], rotation(Z, q))
            for q in np.arange(n) * 2 * np.pi / n
        ]
        base = torus(size, 0.04)
    elif kind == 2:
        copies = [small.moved((0, 0, 0.1 * i), rotation(Z, 0.5 * i)) for i in range(n)]
        base = tube([[0, 0, -0.05], [0, 0, 0.1 * n]], 0.03)
    else:
        copies = [small.moved((0.15 * (i % 3), 0.15 * (i // 3), 0)) for i in range(n)]
        base = box((0.28, 0.28, 0.025)).moved((0.15, 0.15, -0.06))
    return blend([base, *copies], rng.choice([0, 0.02]))


def _scaled(solid: Solid, s: float) -> Solid:
    return Solid(
        lambda p: solid.field(p / np.float32(s)) * np.float32(s), solid.low * s, solid.high * s
    )


def fastener(rng: Rng) -> Solid:
    """A screw, nut, tap, gear or valve: turned and threaded parts."""
    r, long = rng.uniform(0.06, 0.15), rng.uniform(0.3, 0.9)
    kind = rng.integers(4)
    if kind == 0:
        head = extruded(
            gear(3, r * 2, 0) if rng.random() < 0.5 else star(rng, 6, r * 2, 0.02), r * 0.6
        )
        shaft = thread(r, long / 2, rng.uniform(0.04, 0.1), r * 0.3).moved((0, 0, -long / 2))
        return union([head, shaft])
    if kind == 1:
        wheel = extruded(
            gear(rng.integers(6, 24), rng.uniform(0.25, 0.45), rng.uniform(0.04, 0.1)),
            rng.uniform(0.04, 0.12),
        )
        return minus(wheel, [tube([[0, 0, -1], [0, 0, 1]], r)])
    if kind == 2:  # a valve: pipe, wheel, stem
        rim = torus(0.22, 0.03).moved((0, 0, 0.4))
        spokes = [
            tube([[0, 0, 0.4], [0.22 * np.cos(q), 0.22 * np.sin(q), 0.4]], 0.02)
            for q in np.arange(3) * 2.1
        ]
        pipe = minus(
            tube([[-0.45, 0, 0], [0.45, 0, 0]], r + 0.03), [tube([[-1, 0, 0], [1, 0, 0]], r * 0.7)]
        )
        return blend([rim, *spokes, tube([[0, 0, 0], [0, 0, 0.4]], 0.03), pipe], 0.02)
    tap = smooth([[0, 0, 0], [0, 0, long * 0.6], [0.15, 0, long * 0.75], [0.35, 0, long * 0.5]], 12)
    return blend(
        [
            tube(tap, rng.uniform(0.03, 0.06)),
            tube([[0, 0, 0], [0, 0, 0.05]], 0.1),
            tube([[0, -0.12, 0.15], [0, 0.12, 0.15]], 0.025),
        ],
        0.02,
    )
