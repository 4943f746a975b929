"""A long grip with a head, of eleven kinds."""

from __future__ import annotations

import numpy as np

from ..curves import arc, between, rotation, smooth, star
from ..sdf import (
    Solid,
    above,
    blend,
    box,
    ellipsoid,
    extruded,
    minus,
    sheet,
    shell,
    thread,
    torus,
    tube,
    union,
)
from .axes import Rng, X, Y, Z


def grip_and_head(rng: Rng) -> Solid:
    """A long grip that carries something across, along or around its end."""
    length = rng.uniform(0.45, 1.2)
    head = _HEADS[rng.integers(len(_HEADS))](rng)
    parts = [_grip(rng, length), head.moved((0, 0, length))]
    if rng.random() < 0.2:
        parts.append(_HEADS[rng.integers(len(_HEADS))](rng).mirrored(2))
    if rng.random() < 0.3:  # a ferrule
        parts.append(tube([[0, 0, length * 0.9], [0, 0, length]], rng.uniform(0.05, 0.08)))
    solid = blend(parts, rng.choice([0, 0.02, 0.06]))
    if rng.random() < 0.2:
        solid = minus(solid, [tube([[0, -1, 0.06], [0, 1, 0.06]], 0.02)])
    return solid


def _grip(rng: Rng, length: float) -> Solid:
    thick, sway = rng.uniform(0.025, 0.075), rng.normal(0, 0.05)
    z = np.linspace(0, length, 9)
    curve = np.stack([sway * np.sin(np.pi * z / length), 0 * z, z], 1)
    radii = smooth(np.exp(rng.normal(0, 0.18, (5, 1))), 9)[:, 0] * thick
    flat = (X if rng.random() < 0.5 else Y, rng.uniform(0.4, 1)) if rng.random() < 0.5 else None
    kind = rng.integers(5)
    parts = [tube(curve, radii, flat=flat)]
    if kind == 0:  # rings or finger grooves
        for at in np.arange(0.06, length * 0.5, 0.07):
            ring = torus(thick, thick * rng.uniform(0.2, 0.35))
            parts.append(ring.moved(curve[int(at / length * 8)] * [1, 1, 0] + [0, 0, at]))
    elif kind == 1:  # a thicker sleeve over a thin rod
        parts = [tube(curve, thick * 0.5), tube(curve[:5], thick * rng.uniform(1, 1.4), flat=flat)]
    elif kind == 2:  # an open loop
        wide = rng.uniform(0.08, 0.16)
        bow = arc(wide, 0, 2 * np.pi, 20, stretch=rng.uniform(1, 1.8))[:-1]
        parts.append(tube(bow, thick * 0.7, closed=True).moved((0, 0, -0.1)))
    elif kind == 3:  # a cross grip
        parts.append(tube([[-0.14, 0, 0], [0.14, 0, 0]], thick))
    return union(parts)


def _head_block(rng: Rng) -> Solid:
    a, b = rng.uniform(0.1, 0.4), rng.uniform(0.05, 0.35)
    r0, r1 = rng.uniform(0.05, 0.13, 2)
    return tube([[-a, 0, 0], [b, 0, 0]], [r0, r1], flat=(Y, rng.uniform(0.5, 1)))


def _head_hook(rng: Rng) -> Solid:
    n, reach, sag = 10, rng.uniform(0.2, 0.55), rng.uniform(-0.2, 0.1)
    x = np.linspace(-reach if rng.random() < 0.5 else 0, reach, n)
    curve = np.stack([x, 0 * x, sag * (x / reach) ** 2], 1)
    return tube(curve, between([0.02, 0.07, rng.uniform(0.015, 0.05)], n))


def _head_blade(rng: Rng) -> Solid:
    width, depth = rng.uniform(0.12, 0.35), rng.uniform(0.12, 0.3)
    outline = np.array(
        [
            [0, -depth * 0.4],
            [width, -depth * rng.uniform(0.6, 1.3)],
            [width * 1.1, 0],
            [width, depth * rng.uniform(0.3, 1)],
            [0, depth * 0.4],
            [-0.08, 0.07],
            [-0.08, -0.07],
        ]
    )
    blade = extruded(outline, rng.uniform(0.03, 0.06), taper=rng.uniform(0, 2))
    return blade.moved(rotation=rotation(X, np.pi / 2))


def _head_bowl(rng: Rng) -> Solid:
    a, b, c = rng.uniform(0.07, 0.2, 3)
    bowl = minus(
        shell(ellipsoid((a, b, c)), 0.03), [above(0).moved(rotation=rotation(Y, np.pi / 2))]
    )
    return bowl.moved((0.03, 0, c * 0.8))


def _head_tines(rng: Rng) -> Solid:
    n, width, tall = rng.integers(2, 6), rng.uniform(0.06, 0.2), rng.uniform(0.12, 0.4)
    ys = np.linspace(-width, width, n)
    bend = rng.uniform(-0.15, 0.15)
    tines = [
        tube(smooth([[0, y, 0], [bend / 2, y, tall / 2], [bend, y, tall]], 5), 0.018) for y in ys
    ]
    return union([tube([[0, -width, 0], [0, width, 0]], 0.025), *tines])


def _head_plate(rng: Rng) -> Solid:
    a, b = rng.uniform(0.06, 0.25), rng.uniform(0.08, 0.3)
    plate = sheet(a, b, rng.uniform(0.025, 0.05), rng.normal(0, 0.6, 3))
    return plate.moved((0, 0, b * 0.8), rotation(Y, np.pi / 2) @ rotation(Z, np.pi / 2))


def _head_jaw(rng: Rng) -> Solid:
    r, open_ = rng.uniform(0.08, 0.16), rng.uniform(0.03, 0.08)
    disc = extruded(star(rng, 20, r, 0.03), rng.uniform(0.025, 0.045))
    slot = box((r * 1.2, open_, 1)).moved((r * rng.uniform(0.9, 1.3), 0, 0))
    turn = rotation(Z, np.pi / 2 + rng.normal(0, 0.4))
    return minus(disc.moved((0, 0, 0)), [slot.moved(rotation=turn)]).moved(
        (0, 0, r * 0.7), rotation(X, np.pi / 2)
    )


def _head_brush(rng: Rng) -> Solid:
    a, b = rng.uniform(0.04, 0.12), rng.uniform(0.06, 0.25)
    back = box((0.03, a, b), round=0.02).moved((0, 0, b * 0.8))
    bristle = box((rng.uniform(0.05, 0.12), a * 0.9, b * 0.9), round=0.01).moved((0.08, 0, b * 0.8))
    return union([back, bristle])


def _head_tip(rng: Rng) -> Solid:
    tall = rng.uniform(0.15, 0.6)
    tip = tube([[0, 0, 0], [0, 0, tall]], [rng.uniform(0.02, 0.05), rng.uniform(0.008, 0.04)])
    if rng.random() < 0.4:
        tip = union([tip, thread(0.035, tall / 3, 0.04, 0.012).moved((0, 0, tall * 0.6))])
    return tip


def _head_ring(rng: Rng) -> Solid:
    r = rng.uniform(0.08, 0.3)
    ring = torus(r, rng.uniform(0.015, 0.04)).moved(rotation=rotation(X, np.pi / 2))
    if rng.random() < 0.4:  # a racket, a sieve
        ring = union([ring, sheet(r, r * 0.9, 0.025).moved(rotation=rotation(X, np.pi / 2))])
    return ring.moved((0, 0, r))


def _head_ball(rng: Rng) -> Solid:
    return ellipsoid(rng.uniform(0.06, 0.22, 3)).moved((0, 0, 0.05))


_HEADS = [
    _head_block,
    _head_hook,
    _head_blade,
    _head_bowl,
    _head_tines,
    _head_plate,
    _head_jaw,
    _head_brush,
    _head_tip,
    _head_ring,
    _head_ball,
]
