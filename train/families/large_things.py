"""Furniture, animals, vehicles."""

from __future__ import annotations

import numpy as np

from ..curves import between, rotation, smooth, solid_profile, vessel_profile
from ..sdf import Solid, blend, box, ellipsoid, revolved, sheet, torus, tube
from .axes import Rng, X, Y, Z


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
        parts += [
            tube(
                [[x * w * 0.7, y * d * 0.7, h], [x * w * 0.75 * splay, y * d * 0.75 * splay, 0]],
                [leg, leg * 0.8],
            )
            for x in (-1, 1)
            for y in (-1, 1)
        ]
    elif stand == 1:
        n = rng.integers(3, 6)
        parts.append(tube([[0, 0, h], [0, 0, 0.06]], leg * 1.3))
        parts += [
            tube([[0, 0, 0.08], [w * np.cos(q), w * np.sin(q), 0]], leg)
            for q in np.arange(n) * 2 * np.pi / n
        ]
    else:
        parts += [box((t, d, h / 2)).moved((s * w * 0.9, 0, h / 2)) for s in (-1, 1)]
    extra = rng.integers(5)
    if extra == 0:
        parts.append(
            sheet(d, rng.uniform(0.15, 0.35), 0.05, (rng.uniform(0, 0.6), 0, 0)).moved(
                (-w * 0.9, 0, h + 0.3), rotation(Y, -np.pi / 2) @ rotation(Z, np.pi / 2)
            )
        )
    elif extra == 1:
        parts += [
            tube([[-w * 0.8, y, h + z], [-w, y, h + z + 0.01]], 0.02)
            for y in (-d, d)
            for z in (0.1,)
        ]
        parts += [
            tube([[-w * 0.9, y, h], [-w, y, h + 0.4]], leg) for y in np.linspace(-d, d, 4) * 0.8
        ]
        parts.append(tube([[-w, -d, h + 0.4], [-w, d, h + 0.4]], leg))
    elif extra == 2:
        parts += [box((w * 0.9, d * 0.9, t)).moved((0, 0, z)) for z in np.arange(0.12, h, 0.2)]
    elif extra == 3:  # a shade on a stem
        parts.append(tube([[0, 0, h], [0, 0, h + 0.4]], 0.02))
        shade = revolved(vessel_profile(between([0.3, 0.15], 6), 0.3, 0.04, base=-1))
        parts.append(shade.moved((0, 0, h + 0.35)))
    return blend(parts, rng.choice([0, 0, 0.03]))


def animal(rng: Rng) -> Solid:
    """A soft body with legs, neck, head, ears and tail, standing, sitting or winged."""
    long, r, h = rng.uniform(0.3, 0.6), rng.uniform(0.1, 0.2), rng.uniform(0.15, 0.5)
    tilt = rng.choice([0, 0, rng.uniform(0, 1.3)])
    spine = rotation(Y, -tilt)
    front, back = spine @ [long / 2, 0, 0] + [0, 0, h], spine @ [-long / 2, 0, 0] + [0, 0, h]
    parts = [
        tube(
            [back, (front + back) / 2 + [0, 0, rng.normal(0, 0.04)], front],
            r * np.exp(rng.normal(0, 0.2, 3)),
        )
    ]
    head = front + [rng.uniform(0, 0.25), 0, rng.uniform(0.05, 0.4)]
    size = rng.uniform(0.07, 0.16)
    parts += [
        tube([front, head], [r * 0.6, size * 0.7]),
        ellipsoid(size * np.exp(rng.normal(0, 0.2, 3))).moved(head),
    ]
    snout = rng.uniform(0.05, 0.25)
    parts.append(
        tube([head, head + [snout, 0, -0.04]], [size * 0.6, size * rng.uniform(0.15, 0.5)])
    )
    for s in (-1, 1):
        ear = head + [0, s * size * 0.8, size + rng.uniform(0, 0.15)]
        parts.append(tube([head + [0, s * size * 0.6, size * 0.5], ear], [0.035, 0.015]))
        for end in (front, back):
            if rng.random() < 0.95:
                foot = np.array([end[0] + rng.normal(0, 0.05), s * r * 0.8, 0])
                parts.append(
                    tube([end + [0, s * r * 0.5, -0.02], foot], [0.07, rng.uniform(0.025, 0.05)])
                )
        if rng.random() < 0.2:
            wing = sheet(0.12, 0.3, 0.03, (0, 0.5, 0)).moved((0, s * 0.3, h + 0.1))
            parts.append(wing)
    tail = back + [-rng.uniform(0.05, 0.35), 0, rng.uniform(-0.15, 0.3)]
    parts.append(
        tube(smooth([back, (back + tail) / 2 + [0, 0, 0.06], tail], 6), between([0.05, 0.02], 6))
    )
    return blend(parts, rng.uniform(0.02, 0.08))


def vehicle(rng: Rng) -> Solid:
    """A hull with wheels, wings, a cabin or rotors."""
    long, r = 1.0, rng.uniform(0.08, 0.17)
    hull = tube(
        [[-0.5, 0, 0], [-0.2, 0, 0], [0.3, 0, 0], [0.5, 0, rng.normal(0, 0.03)]],
        r * np.array([rng.uniform(0.3, 0.9), 1, 1, rng.uniform(0.3, 0.8)]),
    )
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
            parts += [
                torus(wheel, wheel * 0.35).moved((x, s * r * 1.5, -r * 0.8), rotation(X, np.pi / 2))
                for s in (-1, 1)
            ]
            parts.append(tube([[x, -r * 1.5, -r * 0.8], [x, r * 1.5, -r * 0.8]], wheel * 0.6))
    elif kind == 1:
        span, sweep = rng.uniform(0.3, 0.6), rng.uniform(0, 0.3)
        for s in (-1, 1):
            parts.append(
                tube([[0.1, 0, 0], [0.1 - sweep, s * span, 0.03]], [0.14, 0.07], flat=(Z, 0.2))
            )
            parts.append(
                tube([[-0.45, 0, 0], [-0.5, s * span * 0.4, 0]], [0.08, 0.05], flat=(Z, 0.25))
            )
        parts.append(tube([[-0.43, 0, 0], [-0.5, 0, 0.25]], [0.09, 0.05], flat=(Y, 0.25)))
    else:
        parts.append(tube([[0, 0, 0], [0, 0, rng.uniform(0.3, 0.6)]], 0.02))
        parts.append(
            sheet(0.2, 0.3, 0.025, (0.8, 0, 0)).moved((0, 0, 0.35), rotation(X, np.pi / 2))
        )
    return blend(parts, rng.choice([0, 0.02, 0.05]))
