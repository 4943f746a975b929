"""Families of training objects: each function draws one random solid of its kind.

Kinds are broad on purpose: what they share (handles, openings, hinges, rims, buttons, legs) comes in
many builds, so that a net cannot learn a catalogue. None is a copy of a real object, and none is one
of the workspace's demonstration objects, which stay unseen. Objects are about 1 across; poses, sizes
and deformations are drawn later, see `objects.py`.
"""

from __future__ import annotations

import numpy as np

from .curves import (
    arc,
    between,
    gear,
    helix,
    random_rotation,
    rotation,
    smooth,
    solid_profile,
    star,
    vessel_profile,
)
from .sdf import (
    Solid,
    above,
    blend,
    box,
    common,
    ellipsoid,
    extruded,
    minus,
    revolved,
    sheet,
    shell,
    thread,
    torus,
    tube,
    union,
)

Rng = np.random.Generator
X, Y, Z = np.eye(3)


def vessel(rng: Rng) -> Solid:
    """A hollow body with none to two handles, a spout, a lid or a foot."""
    height, width = rng.uniform(0.35, 1.1), rng.uniform(0.18, 0.42)
    radii = width * np.exp(rng.normal(0, rng.choice([0.05, 0.2, 0.35]), rng.integers(3, 7)))
    radii = smooth(np.stack([radii, radii], 1), 14)[:, 0].clip(0.06, 0.55)
    if rng.random() < 0.3:  # a neck
        radii[-4:] *= np.linspace(0.9, rng.uniform(0.3, 0.6), 4)
    wall = rng.uniform(0.03, 0.055)
    square = rng.choice([2.0, 2.0, 2.0, 4.0, 6.0])
    if rng.random() < 0.75:
        body = revolved(vessel_profile(radii, height, wall), square=square)
    else:
        body = revolved(solid_profile(radii, height), square=square)
    parts = [body]
    for side in range(rng.choice([0, 1, 1, 1, 2])):
        parts.append(_side_handle(rng, radii, height).moved(rotation=rotation(Z, np.pi * side)))
    if rng.random() < 0.25:
        parts.append(_spout(rng, radii, height))
    if rng.random() < 0.15:
        parts.append(_overhead_handle(rng, radii[-1], height))
    if rng.random() < 0.3:
        parts.append(_lid(rng, radii[-1], height))
    return blend(parts, rng.choice([0, 0.02, 0.05]))


def _radius_at(radii, height, z):
    return np.interp(z, np.linspace(0, height, len(radii)), radii)


def _side_handle(rng: Rng, radii, height) -> Solid:
    low, high = height * rng.uniform(0.1, 0.4), height * rng.uniform(0.6, 0.95)
    reach, thick = rng.uniform(0.1, 0.3), rng.uniform(0.025, 0.055)
    a = np.array([_radius_at(radii, height, low) - 0.01, 0, low])
    b = np.array([_radius_at(radii, height, high) - 0.01, 0, high])
    out = max(a[0], b[0]) + reach
    kind = rng.integers(4)
    if kind == 0:  # an ear
        curve = smooth([a, [out, 0, 0.7 * low + 0.3 * high], [out, 0, 0.3 * low + 0.7 * high], b])
    elif kind == 1:  # angular
        curve = np.array([a, [out, 0, low], [out, 0, high], b])
    elif kind == 2:  # open below
        curve = smooth([b, [out, 0, high], [out + 0.02, 0, low]])
    else:  # a bar standing out sideways, as on a pan
        end = b + [rng.uniform(0.3, 0.8), 0, rng.uniform(-0.1, 0.15)]
        curve = np.array([b, end])
    return tube(curve, thick, flat=(Y, rng.uniform(0.6, 1)) if rng.random() < 0.5 else None)


def _spout(rng: Rng, radii, height) -> Solid:
    z = height * rng.uniform(0.3, 0.8)
    start = np.array([-_radius_at(radii, height, z) + 0.03, 0, z])
    end = start + [-rng.uniform(0.1, 0.3), 0, rng.uniform(0.05, 0.35)]
    middle = (start + end) / 2 + [0, 0, -rng.uniform(0, 0.06)]
    return tube(smooth([start, middle, end], 8), between([0.07, rng.uniform(0.03, 0.05)], 8))


def _overhead_handle(rng: Rng, radius, height) -> Solid:
    bow = arc(radius, 0, np.pi, stretch=rng.uniform(0.6, 1.3))
    return tube(bow, rng.uniform(0.02, 0.04)).moved((0, 0, height - 0.02))


def _lid(rng: Rng, radius, height) -> Solid:
    dome = ellipsoid((radius * 1.03, radius * 1.03, rng.uniform(0.03, 0.15))).moved((0, 0, height))
    knob = ellipsoid(rng.uniform(0.03, 0.08, 3)).moved((0, 0, height + rng.uniform(0.08, 0.14)))
    return blend([dome, knob, tube([[0, 0, height], [0, 0, height + 0.1]], 0.025)], 0.02)


def bottle(rng: Rng) -> Solid:
    """A closed body with shoulder, neck and cap; some have a trigger, a pump or a grip cut in."""
    h, w = rng.uniform(0.5, 0.9), rng.uniform(0.12, 0.28)
    neck = w * rng.uniform(0.25, 0.6)
    waist = rng.uniform(0.7, 1.0)
    radii = smooth(np.array([[w], [w], [w * waist], [w], [w * 0.9], [neck], [neck]]), 24)[:, 0]
    body = revolved(solid_profile(radii, h), square=rng.choice([2.0, 2.0, 4.0, 8.0]))
    parts = [body]
    top = rng.integers(4)
    if top == 0:
        cap = np.full(4, neck * rng.uniform(1.05, 1.4))
        parts.append(revolved(solid_profile(cap, rng.uniform(0.05, 0.15))).moved((0, 0, h)))
    elif top == 1:
        parts.append(thread(neck, 0.07, 0.035, 0.02).moved((0, 0, h + 0.06)))
    elif top == 2:  # a trigger
        parts += [tube([[0, 0, h], [0, 0, h + 0.1]], neck * 0.8),
                  box((0.13, 0.05, 0.05), round=0.02).moved((0.07, 0, h + 0.13)),
                  tube(smooth([[0.1, 0, h + 0.1], [0.14, 0, h], [0.1, 0, h - 0.1]], 6), 0.02)]  # fmt: skip
    else:  # a pump
        reach = rng.uniform(0.1, 0.25)
        parts += [tube([[0, 0, h], [0, 0, h + 0.16]], 0.025),
                  tube([[0, 0, h + 0.16], [reach, 0, h + 0.16], [reach, 0, h + 0.11]], 0.03)]  # fmt: skip
    solid = blend(parts, rng.choice([0, 0.02]))
    if rng.random() < 0.3:
        hole = box((0.06, 1, 0.12), round=0.05).moved((w * 0.6, 0, h * 0.6))
        solid = minus(solid, [hole])
    return solid


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
        parts = [tube(curve, thick * 0.5),
                 tube(curve[:5], thick * rng.uniform(1, 1.4), flat=flat)]  # fmt: skip
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
    outline = np.array([[0, -depth * 0.4], [width, -depth * rng.uniform(0.6, 1.3)],
                        [width * 1.1, 0], [width, depth * rng.uniform(0.3, 1)],
                        [0, depth * 0.4], [-0.08, 0.07], [-0.08, -0.07]])  # fmt: skip
    blade = extruded(outline, rng.uniform(0.03, 0.06), taper=rng.uniform(0, 2))
    return blade.moved(rotation=rotation(X, np.pi / 2))


def _head_bowl(rng: Rng) -> Solid:
    a, b, c = rng.uniform(0.07, 0.2, 3)
    bowl = minus(shell(ellipsoid((a, b, c)), 0.03), [above(0).moved(rotation=rotation(Y, np.pi / 2))])
    return bowl.moved((0.03, 0, c * 0.8))


def _head_tines(rng: Rng) -> Solid:
    n, width, tall = rng.integers(2, 6), rng.uniform(0.06, 0.2), rng.uniform(0.12, 0.4)
    ys = np.linspace(-width, width, n)
    bend = rng.uniform(-0.15, 0.15)
    tines = [tube(smooth([[0, y, 0], [bend / 2, y, tall / 2], [bend, y, tall]], 5), 0.018) for y in ys]
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


_HEADS = [_head_block, _head_hook, _head_blade, _head_bowl, _head_tines, _head_plate, _head_jaw,
          _head_brush, _head_tip, _head_ring, _head_ball]  # fmt: skip


def blade(rng: Rng) -> Solid:
    """A flat pointed or blunt blade that goes on from its grip, with or without a guard."""
    long, wide = rng.uniform(0.3, 0.9), rng.uniform(0.05, 0.22)
    x = np.linspace(0, 1, 9)
    back = wide * rng.uniform(0.2, 0.6) * (1 - x ** rng.uniform(2, 9) * rng.uniform(0, 1))
    edge = -wide * (0.5 + rng.uniform(-0.4, 0.5) * x) * (1 - x ** rng.uniform(1.5, 9) * rng.uniform(0.4, 1))
    if rng.random() < 0.25:
        edge = edge + 0.015 * np.tile([0, 1], 5)[:9]  # saw teeth
    outline = np.vstack([np.stack([long * x, back], 1), np.stack([long * x, edge], 1)[::-1]])
    plate = extruded(outline, rng.uniform(0.013, 0.03), taper=rng.uniform(0, 0.15))
    grip_long, thick = rng.uniform(0.25, 0.6), rng.uniform(0.03, 0.06)
    drop = rng.normal(0, 0.06)
    curve = smooth([[0.03, 0, 0], [-grip_long / 2, drop / 2, 0], [-grip_long, drop, 0]], 9)
    radii = smooth(np.exp(rng.normal(0, 0.15, (4, 1))), 9)[:, 0] * thick
    parts = [plate, tube(curve, radii, flat=(Z, rng.uniform(0.35, 0.8)))]
    kind = rng.integers(5)
    if kind == 0:  # a guard
        parts.append(box((0.02, rng.uniform(0.08, 0.2), 0.035), round=0.015))
    elif kind == 1:  # bolster and pommel
        parts += [ellipsoid((0.03, thick * 1.3, thick)), ellipsoid((0.05, 0.06, 0.05)).moved(curve[-1])]
    elif kind == 2:  # a knuckle bow
        parts.append(tube(smooth([curve[0], [-grip_long / 2, -0.17, 0], curve[-1]], 10), 0.018))
    solid = blend(parts, rng.choice([0, 0.01, 0.03]))
    if rng.random() < 0.2:
        at = rng.uniform(0.3, 0.8) * long
        solid = minus(solid, [tube([[at, 0, -1], [at, 0, 1]], wide * 0.2)])
    return solid


def two_levers(rng: Rng) -> Solid:
    """Two crossed or joined levers: a hinge, working ends on one side, grips on the other."""
    spread, reach = rng.uniform(0.05, 0.5), rng.uniform(0.2, 0.7)
    grips, thick = rng.uniform(0.25, 0.6), rng.uniform(0.02, 0.05)
    crossed = rng.random() < 0.75
    loops, curved = rng.random() < 0.5, rng.normal(0, 0.06)
    end_kind = rng.integers(4)
    levers = []
    for side in (1, -1):
        a = side * spread / 2
        tip_width = 0.02 * side
        if end_kind == 0:  # flat blades
            outline = [[-0.04, 0.05 * side], [-0.04, -0.02 * side], [reach, tip_width * 0.3],
                       [reach * 0.6, rng.uniform(0.04, 0.09) * side]]  # fmt: skip
            working = extruded(np.array(outline), 0.018)
        elif end_kind == 1:  # round jaws
            working = tube([[0, 0, 0], [reach * 0.5, 0.05 * side, 0], [reach * 0.6, 0, 0]],
                           [0.05, 0.045, 0.02])  # fmt: skip
        elif end_kind == 2:  # a hooked beak
            working = tube(smooth([[0, 0, 0], [reach * 0.3, 0.1 * side, 0], [reach * 0.55, 0, 0]], 7),
                           between([0.05, 0.04, 0.015], 7), flat=(Z, 0.6))  # fmt: skip
        else:  # spoons or pads
            arm = tube([[0, 0, 0], [reach, 0.03 * side, 0]], 0.022)
            working = union([arm, ellipsoid((0.09, 0.03, 0.06)).moved((reach, 0.03 * side, 0))])
        foot = np.array([-grips, -0.05 * side + curved * side, 0])
        middle = np.array([-grips / 2, (-0.06 + 2 * curved) * side, 0])
        grip = [tube(smooth([[0, 0, 0], middle, foot], 8), between([thick, thick * 1.3, thick], 8),
                     flat=(Z, rng.uniform(0.6, 1)))]  # fmt: skip
        if loops:
            wide, tall = rng.uniform(0.07, 0.13), rng.uniform(1, 1.9)
            bow = arc(wide, 0, 2 * np.pi, 18, stretch=1 / tall)[:-1] @ rotation(X, -np.pi / 2).T
            bow = bow * [tall, 1, 1]
            grip.append(tube(bow, thick * 0.8, closed=True).moved(foot + [-wide, -0.06 * side, 0]))
        layer = 0.014 * side
        parts = [working.moved((0, 0, layer)), union(grip) if crossed else union(grip).mirrored(1)]
        levers.append(union(parts).moved(rotation=rotation(Z, a)))
    pivot = tube([[0, 0, -0.035], [0, 0, 0.035]], rng.uniform(0.03, 0.06))
    return blend([*levers, pivot], rng.choice([0, 0.01, 0.03]))


def footwear(rng: Rng) -> Solid:
    """A long low hollow body that opens upwards at one end, on a flat or raised sole."""
    long, wide = 1.0, rng.uniform(0.15, 0.23)
    toe, instep = rng.uniform(0.08, 0.16), rng.uniform(0.15, 0.3)
    shaft = rng.choice([0.2, 0.3, 0.35, rng.uniform(0.5, 1.0)])
    heel = rng.choice([0, 0, 0.05, rng.uniform(0.1, 0.3)])
    x = np.linspace(0, long, 9)
    rise = heel * np.clip(1 - x / (0.55 * long), 0, 1) ** 1.3
    foot = tube(np.stack([x * 0.86 + 0.1, 0.02 * np.sin(3 * x), rise + between([instep, instep, toe], 9) * 0.5], 1),
                between([instep * 0.5, instep * 0.55, toe * 0.6, toe * 0.5], 9),
                flat=None)  # fmt: skip
    foot = _widen(foot, wide / (instep * 0.55))
    ankle = tube([[0.12, 0, rise[0] + 0.1], [0.12 + rng.normal(0, 0.03), 0, rise[0] + shaft]],
                 [0.12, rng.uniform(0.1, 0.17)])  # fmt: skip
    upper = blend([foot, ankle], 0.12)
    kind = rng.integers(4)
    if kind != 0:
        inside = tube([[0.13, 0, rise[0] + 0.14], [0.13, 0, rise[0] + shaft + 0.4]],
                      [0.08, rng.uniform(0.1, 0.14)])  # fmt: skip
        hole = tube(np.stack([x[1:6], 0 * x[1:6], rise[1:6] + instep * 0.55], 1), instep * 0.36)
        cutters = [inside, hole, above(rise[0] + shaft - rng.uniform(0, 0.1))]
        if kind == 3:  # an open top, as a clog or a sandal
            cutters.append(tube([[0.2, 0, 0.5], [rng.uniform(0.35, 0.6), 0, 0.34]], 0.12))
        upper = minus(upper, cutters)
    sole = sheet(long / 2 * 0.98, wide * 0.9, rng.uniform(0.03, 0.1)).moved((long / 2, 0, 0.01))
    outline = np.stack([np.cos(np.linspace(0, 2 * np.pi, 24)[:-1]),
                        np.sin(np.linspace(0, 2 * np.pi, 24)[:-1])], 1)  # fmt: skip
    waist = 1 - rng.uniform(0, 0.35) * np.exp(-((outline[:, 0] + 0.15) ** 2) / 0.1)
    outline = outline * np.stack([np.full(len(waist), 0.52), wide * waist], 1) + [0.5, 0]
    base = extruded(outline, rng.uniform(0.02, 0.06), round=0.01)
    parts = [upper, base if heel == 0 else common(base, sole.moved((0, 0, 0)))]
    if heel > 0:
        parts = [upper, box((0.08, wide * 0.6, heel / 2 + 0.03), round=0.02).moved((0.1, 0, heel / 2))]
        parts.append(tube(np.stack([x[2:], 0 * x[2:], rise[2:] + 0.02], 1), 0.03))
    if rng.random() < 0.35:  # straps or laces
        for at in rng.uniform(0.25, 0.6, rng.integers(1, 5)):
            bow = arc(wide * 0.8, 0.1, np.pi - 0.1, 9, stretch=instep / wide)
            strap = tube(bow @ rotation(Z, np.pi / 2).T, rng.uniform(0.012, 0.025))
            parts.append(strap.moved((at, 0, 0.05)))
    return blend(parts, rng.choice([0, 0.02, 0.04]))


def _widen(solid: Solid, factor: float) -> Solid:
    scale = np.float32([1, factor, 1])
    least = np.float32(min(1, factor))
    return Solid(lambda p: solid.field(p / scale) * least, solid.low * scale, solid.high * scale)


def panel(rng: Rng) -> Solid:
    """A hand-sized case with buttons, sticks, screens or keys on one face; some have two horns."""
    a, b, c = rng.uniform(0.15, 0.55), rng.uniform(0.1, 0.35), rng.uniform(0.03, 0.09)
    case = box((a, b, c), round=rng.uniform(0.01, c))
    parts, cuts = [case], []
    if rng.random() < 0.4:  # horns
        drop, out = rng.uniform(0.1, 0.35), rng.uniform(0, 0.15)
        for s in (-1, 1):
            horn = smooth([[s * a * 0.8, 0, 0], [s * (a + out), -b - drop / 2, -0.02],
                           [s * (a + out * 0.7), -b - drop, -0.05]], 8)  # fmt: skip
            parts.append(tube(horn, between([b * 0.6, 0.09, 0.05], 8), flat=(Z, 0.8)))
    for _ in range(rng.integers(1, 6)):
        x, y = rng.uniform(-0.7, 0.7, 2) * [a, b]
        kind = rng.integers(6)
        if kind == 0:
            parts.append(_knob(rng).moved((x, y, c)))
        elif kind == 1:
            parts.append(tube([[x, y, c], [x, y, c + 0.06]], [0.02, 0.03]))
        elif kind == 2:  # a field of keys
            n, m = rng.integers(2, 5, 2)
            step = rng.uniform(0.05, 0.09)
            parts += [box((step * 0.35, step * 0.35, 0.02), round=0.01).moved(
                (x + step * (i - n / 2), y + step * (j - m / 2), c)) for i in range(n) for j in range(m)]  # fmt: skip
        elif kind == 3:  # a screen
            cuts.append(box((a * rng.uniform(0.2, 0.6), b * 0.4, 0.02)).moved((x * 0.3, y * 0.5, c + 0.005)))
        elif kind == 4:  # a cross
            parts += [box((0.06, 0.02, 0.02)).moved((x, y, c)), box((0.02, 0.06, 0.02)).moved((x, y, c))]
        else:
            cuts.append(ellipsoid((0.06, 0.06, 0.03)).moved((x, y, c)))
    if rng.random() < 0.25:
        parts.append(tube([[a * 0.7, b, 0], [a * 0.7, b + rng.uniform(0.1, 0.5), 0]], 0.02))
    solid = blend(parts, rng.choice([0, 0.01, 0.04]))
    return minus(solid, cuts) if cuts else solid


def _knob(rng: Rng) -> Solid:
    r, h = rng.uniform(0.03, 0.08), rng.uniform(0.02, 0.08)
    return revolved(solid_profile([r, r, r * 0.9], h), square=2.0)


def bag(rng: Rng) -> Solid:
    """A case, sack or basket with straps, bows or a slot to hold it by."""
    a, b, h = rng.uniform(0.2, 0.45), rng.uniform(0.07, 0.25), rng.uniform(0.25, 0.7)
    kind = rng.integers(4)
    if kind == 0:
        body = box((a, b, h / 2), round=rng.uniform(0.01, b * 0.9)).moved((0, 0, h / 2))
    elif kind == 1:
        body = ellipsoid((a, b * 1.2, h / 2)).moved((0, 0, h / 2))
    elif kind == 2:  # open
        body = minus(box((a, b, h / 2), round=0.03).moved((0, 0, h / 2)),
                     [box((a - 0.03, b - 0.03, h / 2)).moved((0, 0, h / 2 + 0.04))])  # fmt: skip
    else:
        body = revolved(vessel_profile(between([a * 0.7, a], 8), h, 0.04))
        b = a * 0.8
    thick, up = rng.uniform(0.015, 0.04), rng.uniform(0.3, 1.3)
    parts = [body]
    hold = rng.integers(4)
    if hold == 0:
        parts.append(tube(arc(a * 0.7, 0, np.pi, 14, stretch=up), thick).moved((0, 0, h * 0.93)))
    elif hold == 1:
        bow = tube(arc(a * 0.5, 0, np.pi, 14, stretch=up), thick, flat=(Y, 0.7))
        parts += [bow.moved((0, s * b * 0.8, h * 0.9)) for s in (-1, 1)]
    elif hold == 2:  # a strap to wear, on a back
        for s in (-1, 1):
            curve = smooth([[s * a * 0.5, -b, h * 0.95], [s * a * 0.6, -b - 0.15, h * 0.5],
                            [s * a * 0.5, -b, h * 0.1]], 10)  # fmt: skip
            parts.append(tube(curve, thick, flat=(X, 1)))
        parts.append(box((a * 0.6, 0.06, h * 0.2), round=0.04).moved((0, b, h * 0.3)))
    else:
        bar = [[-a * 0.4, 0, h], [-a * 0.4, 0, h + 0.1], [a * 0.4, 0, h + 0.1], [a * 0.4, 0, h]]
        parts.append(tube(bar, thick))
    return blend(parts, rng.choice([0, 0.02, 0.05]))


def furniture(rng: Rng) -> Solid:
    """A seat, table, shelf or lamp: plates on legs."""
    w, d, h = rng.uniform(0.2, 0.5), rng.uniform(0.2, 0.4), rng.uniform(0.2, 0.7)
    t, leg = rng.uniform(0.02, 0.05), rng.uniform(0.018, 0.045)
    round_top = rng.random() < 0.3
    top = revolved(solid_profile([w, w], 2 * t)) if round_top else box((w, d, t), round=0.015)
    parts = [top.moved((0, 0, h))]
    splay = rng.uniform(0.9, 1.3)
    stand = rng.integers(3)
    if stand == 0:
        parts += [tube([[x * w * 0.7, y * d * 0.7, h], [x * w * 0.75 * splay, y * d * 0.75 * splay, 0]], [leg, leg * 0.8])
                  for x in (-1, 1) for y in (-1, 1)]  # fmt: skip
    elif stand == 1:
        n = rng.integers(3, 6)
        parts.append(tube([[0, 0, h], [0, 0, 0.06]], leg * 1.3))
        parts += [tube([[0, 0, 0.08], [w * np.cos(q), w * np.sin(q), 0]], leg)
                  for q in np.arange(n) * 2 * np.pi / n]  # fmt: skip
    else:
        parts += [box((t, d, h / 2)).moved((s * w * 0.9, 0, h / 2)) for s in (-1, 1)]
    extra = rng.integers(5)
    if extra == 0:
        parts.append(sheet(d, rng.uniform(0.15, 0.35), 0.05, (rng.uniform(0, 0.6), 0, 0)).moved(
            (-w * 0.9, 0, h + 0.3), rotation(Y, -np.pi / 2) @ rotation(Z, np.pi / 2)))  # fmt: skip
    elif extra == 1:
        parts += [tube([[-w * 0.8, y, h + z], [-w, y, h + z + 0.01]], 0.02) for y in (-d, d) for z in (0.1,)]
        parts += [tube([[-w * 0.9, y, h], [-w, y, h + 0.4]], leg) for y in np.linspace(-d, d, 4) * 0.8]
        parts.append(tube([[-w, -d, h + 0.4], [-w, d, h + 0.4]], leg))
    elif extra == 2:
        parts += [box((w * 0.9, d * 0.9, t)).moved((0, 0, z)) for z in np.arange(0.12, h, 0.2)]
    elif extra == 3:  # a shade on a stem
        parts.append(tube([[0, 0, h], [0, 0, h + 0.4]], 0.02))
        shade = revolved(vessel_profile(between([0.3, 0.15], 6), 0.3, 0.04, base=-1))
        parts.append(shade.moved((0, 0, h + 0.35)))
    return blend(parts, rng.choice([0, 0, 0.03]))


def machine(rng: Rng) -> Solid:
    """A motor body with a pistol grip or a bail, a nose, fins and knobs."""
    long, r = rng.uniform(0.3, 0.7), rng.uniform(0.08, 0.16)
    body = tube([[-long / 2, 0, 0], [long / 2, 0, 0]], [r, r * rng.uniform(0.7, 1)])
    if rng.random() < 0.4:
        body = box((long / 2, r * 0.9, r), round=0.04)
    nose = rng.uniform(0.1, 0.4)
    parts = [body, tube([[long / 2, 0, 0], [long / 2 + nose, 0, 0]], [r * 0.7, r * rng.uniform(0.1, 0.5)])]
    hold = rng.integers(4)
    if hold <= 1:
        lean, drop = rng.uniform(-0.15, 0.1), rng.uniform(0.3, 0.5)
        foot = np.array([lean - 0.05, 0, -drop])
        parts.append(tube([[-0.05, 0, -r * 0.6], foot], [0.06, 0.07], flat=(Y, 0.75)))
        parts.append(tube(smooth([[0.06, 0, -r], [0.1, 0, -r - 0.08], [0.05, 0, -r - 0.13]], 6), 0.018))
        if rng.random() < 0.6:
            parts.append(box((0.12, 0.07, 0.05), round=0.02).moved(foot))
    elif hold == 2:
        bail = arc(long * 0.4, 0, np.pi, 12, stretch=rng.uniform(0.5, 1))
        parts.append(tube(bail, 0.035).moved((0, 0, r * 0.8)))
    else:
        bar = [[-long * 0.4, 0, r], [-long * 0.35, 0, r + 0.15], [long * 0.3, 0, r + 0.15], [long * 0.4, 0, r]]
        parts.append(tube(bar, 0.04))
        parts.append(box((long * 0.7, r * 1.4, 0.025), round=0.02).moved((0, 0, -r * 1.05)))
    for at in rng.uniform(-long / 2, long / 2, rng.integers(0, 4)):
        parts.append(torus(r, 0.02).moved((at, 0, 0), rotation(Y, np.pi / 2)))
    if rng.random() < 0.4:
        wheel = extruded(gear(rng.integers(8, 20), rng.uniform(0.12, 0.25), 0.03), 0.03)
        parts.append(wheel.moved((long / 2 + nose, 0, 0), rotation(Y, np.pi / 2)))
    if rng.random() < 0.3:
        parts.append(_knob(rng).moved((0, r * 0.9, 0), rotation(X, -np.pi / 2)))
    return blend(parts, rng.choice([0, 0.02, 0.05]))


def animal(rng: Rng) -> Solid:
    """A soft body with legs, neck, head, ears and tail, standing, sitting or winged."""
    long, r, h = rng.uniform(0.3, 0.6), rng.uniform(0.1, 0.2), rng.uniform(0.15, 0.5)
    tilt = rng.choice([0, 0, rng.uniform(0, 1.3)])
    spine = rotation(Y, -tilt)
    front, back = spine @ [long / 2, 0, 0] + [0, 0, h], spine @ [-long / 2, 0, 0] + [0, 0, h]
    parts = [tube([back, (front + back) / 2 + [0, 0, rng.normal(0, 0.04)], front], r * np.exp(rng.normal(0, 0.2, 3)))]
    head = front + [rng.uniform(0, 0.25), 0, rng.uniform(0.05, 0.4)]
    size = rng.uniform(0.07, 0.16)
    parts += [tube([front, head], [r * 0.6, size * 0.7]), ellipsoid(size * np.exp(rng.normal(0, 0.2, 3))).moved(head)]
    snout = rng.uniform(0.05, 0.25)
    parts.append(tube([head, head + [snout, 0, -0.04]], [size * 0.6, size * rng.uniform(0.15, 0.5)]))
    for s in (-1, 1):
        ear = head + [0, s * size * 0.8, size + rng.uniform(0, 0.15)]
        parts.append(tube([head + [0, s * size * 0.6, size * 0.5], ear], [0.035, 0.015]))
        for end in (front, back):
            if rng.random() < 0.95:
                foot = np.array([end[0] + rng.normal(0, 0.05), s * r * 0.8, 0])
                parts.append(tube([end + [0, s * r * 0.5, -0.02], foot], [0.07, rng.uniform(0.025, 0.05)]))
        if rng.random() < 0.2:
            wing = sheet(0.12, 0.3, 0.03, (0, 0.5, 0)).moved((0, s * 0.3, h + 0.1))
            parts.append(wing)
    tail = back + [-rng.uniform(0.05, 0.35), 0, rng.uniform(-0.15, 0.3)]
    parts.append(tube(smooth([back, (back + tail) / 2 + [0, 0, 0.06], tail], 6), between([0.05, 0.02], 6)))
    return blend(parts, rng.uniform(0.02, 0.08))


def vehicle(rng: Rng) -> Solid:
    """A hull with wheels, wings, a cabin or rotors."""
    long, r = 1.0, rng.uniform(0.08, 0.17)
    hull = tube([[-0.5, 0, 0], [-0.2, 0, 0], [0.3, 0, 0], [0.5, 0, rng.normal(0, 0.03)]],
                r * np.array([rng.uniform(0.3, 0.9), 1, 1, rng.uniform(0.3, 0.8)]))  # fmt: skip
    if rng.random() < 0.5:
        hull = box((long / 2, r * 1.4, r * 0.8), round=rng.uniform(0.01, 0.06))
    parts = [hull]
    if rng.random() < 0.6:
        cabin = box((rng.uniform(0.12, 0.3), r * 1.1, r * 0.7), round=0.04)
        parts.append(cabin.moved((rng.uniform(-0.15, 0.15), 0, r * 1.1)))
    kind = rng.integers(3)
    if kind == 0:
        wheel = rng.uniform(0.07, 0.14)
        for x in (-0.33, 0.33):
            parts += [torus(wheel, wheel * 0.35).moved((x, s * r * 1.5, -r * 0.8), rotation(X, np.pi / 2)) for s in (-1, 1)]
            parts.append(tube([[x, -r * 1.5, -r * 0.8], [x, r * 1.5, -r * 0.8]], wheel * 0.6))
    elif kind == 1:
        span, sweep = rng.uniform(0.3, 0.6), rng.uniform(0, 0.3)
        for s in (-1, 1):
            parts.append(tube([[0.1, 0, 0], [0.1 - sweep, s * span, 0.03]], [0.14, 0.07], flat=(Z, 0.2)))
            parts.append(tube([[-0.45, 0, 0], [-0.5, s * span * 0.4, 0]], [0.08, 0.05], flat=(Z, 0.25)))
        parts.append(tube([[-0.43, 0, 0], [-0.5, 0, 0.25]], [0.09, 0.05], flat=(Y, 0.25)))
    else:
        parts.append(tube([[0, 0, 0], [0, 0, rng.uniform(0.3, 0.6)]], 0.02))
        parts.append(sheet(0.2, 0.3, 0.025, (0.8, 0, 0)).moved((0, 0, 0.35), rotation(X, np.pi / 2)))
    return blend(parts, rng.choice([0, 0.02, 0.05]))


def plate(rng: Rng) -> Solid:
    """A dish, tray, lid, coin or tile: wide, low, with rims, holes or feet."""
    r, h = rng.uniform(0.3, 0.5), rng.uniform(0.03, 0.2)
    if rng.random() < 0.6:
        rim = between([rng.uniform(0.4, 0.9), rng.uniform(0.6, 1), 1], 8) * r
        solid = revolved(vessel_profile(rim, h, rng.uniform(0.035, 0.06)), square=rng.choice([2.0, 2.0, 5.0]))
    else:
        solid = extruded(star(rng, rng.integers(3, 12), r, 0.15), rng.uniform(0.02, 0.08), round=0.01)
    if rng.random() < 0.4:
        parts = [tube(arc(0.12, 0, np.pi, 8), 0.025).moved((s * r, 0, h * 0.5), rotation(Z, np.pi / 2)) for s in (-1, 1)]
        solid = union([solid, *parts])
    if rng.random() < 0.4:
        n = rng.integers(1, 7)
        at = rng.uniform(0.3, 0.7) * r
        solid = minus(solid, [tube([[at * np.cos(q), at * np.sin(q), -1], [at * np.cos(q), at * np.sin(q), 1]], 0.04)
                              for q in np.arange(n) * 2 * np.pi / n])  # fmt: skip
    if rng.random() < 0.3:
        solid = union([solid, *[tube([[x * r * 0.6, y * r * 0.6, 0], [x * r * 0.6, y * r * 0.6, -0.1]], 0.03)
                                for x in (-1, 1) for y in (-1, 1)]])  # fmt: skip
    return solid


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
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * rng.uniform(0.15, 0.4, 3)
    edges = [(i, j) for i in range(8) for j in range(i) if bin(i ^ j).count("1") == 1]
    return union([tube(corners[[i, j]], t) for i, j in edges])


def assembly(rng: Rng) -> Solid:
    """Two to eight random parts, each set on an earlier one."""
    parts, anchors = [], [np.zeros(3)]
    for _ in range(rng.integers(2, 9)):
        anchor, turn = anchors[rng.integers(len(anchors))], random_rotation(rng)
        part, reach = _random_part(rng)
        parts.append(part.moved(anchor + turn @ [0, 0, reach * 0.8], turn))
        anchors += [anchor + turn @ [0, 0, 1.6 * reach], anchor + turn @ [0.7 * reach, 0, reach]]
    return blend(parts, rng.choice([0, 0.02, 0.06, 0.12]))


def _random_part(rng: Rng) -> tuple[Solid, float]:
    """A part about the origin and its half length along z."""
    kind, h, r = rng.integers(7), rng.uniform(0.1, 0.35), rng.uniform(0.04, 0.18)
    if kind == 0:
        return tube([[0, 0, -h], [rng.normal(0, 0.05), 0, 0], [0, 0, h]], r * 0.6 * np.exp(rng.normal(0, 0.3, 3))), h
    if kind == 1:
        return box((r, rng.uniform(0.03, 0.2), h), round=rng.uniform(0, 0.03)), h
    if kind == 2:
        return ellipsoid((r, rng.uniform(0.05, 0.2), h)), h
    if kind == 3:
        return torus(r + 0.06, rng.uniform(0.02, 0.05)).moved(rotation=rotation(X, np.pi / 2)), r + 0.06
    if kind == 4:
        return revolved(solid_profile(r * np.exp(rng.normal(0, 0.3, 6)), 2 * h)).moved((0, 0, -h)), h
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
        at, turn = rng.uniform(-1, 1, 3) * half, random_rotation(rng) if rng.random() < 0.4 else np.eye(3)
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
    part, _ = _random_part(rng)
    n, kind, size = rng.integers(3, 9), rng.integers(4), rng.uniform(0.1, 0.3)
    small = _scaled(part, rng.uniform(0.3, 0.7))
    if kind == 0:
        copies = [small.moved((0.12 * (i - n / 2), 0, 0)) for i in range(n)]
        base = box((0.07 * n, 0.06, 0.03)).moved((0, 0, -0.08))
    elif kind == 1:
        copies = [small.moved(rotation(Z, q) @ [size, 0, 0], rotation(Z, q)) for q in np.arange(n) * 2 * np.pi / n]
        base = torus(size, 0.04)
    elif kind == 2:
        copies = [small.moved((0, 0, 0.1 * i), rotation(Z, 0.5 * i)) for i in range(n)]
        base = tube([[0, 0, -0.05], [0, 0, 0.1 * n]], 0.03)
    else:
        copies = [small.moved((0.15 * (i % 3), 0.15 * (i // 3), 0)) for i in range(n)]
        base = box((0.28, 0.28, 0.025)).moved((0.15, 0.15, -0.06))
    return blend([base, *copies], rng.choice([0, 0.02]))


def _scaled(solid: Solid, s: float) -> Solid:
    return Solid(lambda p: solid.field(p / np.float32(s)) * np.float32(s), solid.low * s, solid.high * s)


def fastener(rng: Rng) -> Solid:
    """A screw, nut, tap, gear or valve: turned and threaded parts."""
    r, long = rng.uniform(0.06, 0.15), rng.uniform(0.3, 0.9)
    kind = rng.integers(4)
    if kind == 0:
        head = extruded(gear(3, r * 2, 0) if rng.random() < 0.5 else star(rng, 6, r * 2, 0.02), r * 0.6)
        shaft = thread(r, long / 2, rng.uniform(0.04, 0.1), r * 0.3).moved((0, 0, -long / 2))
        return union([head, shaft])
    if kind == 1:
        wheel = extruded(gear(rng.integers(6, 24), rng.uniform(0.25, 0.45), rng.uniform(0.04, 0.1)), rng.uniform(0.04, 0.12))
        return minus(wheel, [tube([[0, 0, -1], [0, 0, 1]], r)])
    if kind == 2:  # a valve: pipe, wheel, stem
        rim = torus(0.22, 0.03).moved((0, 0, 0.4))
        spokes = [tube([[0, 0, 0.4], [0.22 * np.cos(q), 0.22 * np.sin(q), 0.4]], 0.02) for q in np.arange(3) * 2.1]
        pipe = minus(tube([[-0.45, 0, 0], [0.45, 0, 0]], r + 0.03), [tube([[-1, 0, 0], [1, 0, 0]], r * 0.7)])
        return blend([rim, *spokes, tube([[0, 0, 0], [0, 0, 0.4]], 0.03), pipe], 0.02)
    tap = smooth([[0, 0, 0], [0, 0, long * 0.6], [0.15, 0, long * 0.75], [0.35, 0, long * 0.5]], 12)
    return blend([tube(tap, rng.uniform(0.03, 0.06)), tube([[0, 0, 0], [0, 0, 0.05]], 0.1),
                  tube([[0, -0.12, 0.15], [0, 0.12, 0.15]], 0.025)], 0.02)  # fmt: skip


#: Families by name. Those in `LEFT_OUT` are drawn for validation alone.
FAMILIES = {f.__name__: f for f in (vessel, bottle, grip_and_head, blade, two_levers, footwear, panel, bag, furniture,
                                    machine, animal, vehicle, plate, wire, assembly, carved, repeated, fastener)}  # fmt: skip

#: How often each family is drawn.
WEIGHTS = {name: 1.0 for name in FAMILIES} | {
    "grip_and_head": 2.0, "assembly": 2.0, "vessel": 1.5, "blade": 1.3, "two_levers": 1.3, "footwear": 1.3,
    "panel": 1.2, "repeated": 0.6, "fastener": 0.6, "carved": 0.8, "plate": 0.6}  # fmt: skip

#: Never trained on: what a family that the net has not seen costs is measured on these.
LEFT_OUT = ("bottle", "machine", "vehicle")
