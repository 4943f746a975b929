"""Cases with buttons, and machines in a hand."""

from __future__ import annotations

import numpy as np

from ..curves import arc, between, gear, rotation, smooth, solid_profile
from ..sdf import Solid, blend, box, ellipsoid, extruded, minus, revolved, torus, tube
from .axes import Rng, X, Y, Z


def panel(rng: Rng) -> Solid:
    """A hand-sized case with buttons, sticks, screens or keys on one face; some have two horns."""
    a, b, c = rng.uniform(0.15, 0.55), rng.uniform(0.1, 0.35), rng.uniform(0.03, 0.09)
    case = box((a, b, c), round=rng.uniform(0.01, c))
    parts, cuts = [case], []
    if rng.random() < 0.4:  # horns
        drop, out = rng.uniform(0.1, 0.35), rng.uniform(0, 0.15)
        for s in (-1, 1):
            horn = smooth(
                [
                    [s * a * 0.8, 0, 0],
                    [s * (a + out), -b - drop / 2, -0.02],
                    [s * (a + out * 0.7), -b - drop, -0.05],
                ],
                8,
            )
            parts.append(tube(horn, between([b * 0.6, 0.09, 0.05], 8), flat=(Z, 0.8)))
    for _ in range(rng.integers(1, 6)):
        x, y = rng.uniform(-0.7, 0.7, 2) * [a, b]
        kind = rng.integers(6)
        if kind == 0:
            parts.append(knob(rng).moved((x, y, c)))
        elif kind == 1:
            parts.append(tube([[x, y, c], [x, y, c + 0.06]], [0.02, 0.03]))
        elif kind == 2:  # a field of keys
            n, m = rng.integers(2, 5, 2)
            step = rng.uniform(0.05, 0.09)
            parts += [
                box((step * 0.35, step * 0.35, 0.02), round=0.01).moved(
                    (x + step * (i - n / 2), y + step * (j - m / 2), c)
                )
                for i in range(n)
                for j in range(m)
            ]
        elif kind == 3:  # a screen
            cuts.append(
                box((a * rng.uniform(0.2, 0.6), b * 0.4, 0.02)).moved((x * 0.3, y * 0.5, c + 0.005))
            )
        elif kind == 4:  # a cross
            parts += [
                box((0.06, 0.02, 0.02)).moved((x, y, c)),
                box((0.02, 0.06, 0.02)).moved((x, y, c)),
            ]
        else:
            cuts.append(ellipsoid((0.06, 0.06, 0.03)).moved((x, y, c)))
    if rng.random() < 0.25:
        parts.append(tube([[a * 0.7, b, 0], [a * 0.7, b + rng.uniform(0.1, 0.5), 0]], 0.02))
    solid = blend(parts, rng.choice([0, 0.01, 0.04]))
    return minus(solid, cuts) if cuts else solid


def machine(rng: Rng) -> Solid:
    """A motor body with a pistol grip or a bail, a nose, fins and knobs."""
    long, r = rng.uniform(0.3, 0.7), rng.uniform(0.08, 0.16)
    body = tube([[-long / 2, 0, 0], [long / 2, 0, 0]], [r, r * rng.uniform(0.7, 1)])
    if rng.random() < 0.4:
        body = box((long / 2, r * 0.9, r), round=0.04)
    nose = rng.uniform(0.1, 0.4)
    parts = [
        body,
        tube([[long / 2, 0, 0], [long / 2 + nose, 0, 0]], [r * 0.7, r * rng.uniform(0.1, 0.5)]),
    ]
    hold = rng.integers(4)
    if hold <= 1:
        lean, drop = rng.uniform(-0.15, 0.1), rng.uniform(0.3, 0.5)
        foot = np.array([lean - 0.05, 0, -drop])
        parts.append(tube([[-0.05, 0, -r * 0.6], foot], [0.06, 0.07], flat=(Y, 0.75)))
        parts.append(
            tube(smooth([[0.06, 0, -r], [0.1, 0, -r - 0.08], [0.05, 0, -r - 0.13]], 6), 0.018)
        )
        if rng.random() < 0.6:
            parts.append(box((0.12, 0.07, 0.05), round=0.02).moved(foot))
    elif hold == 2:
        bail = arc(long * 0.4, 0, np.pi, 12, stretch=rng.uniform(0.5, 1))
        parts.append(tube(bail, 0.035).moved((0, 0, r * 0.8)))
    else:
        bar = [
            [-long * 0.4, 0, r],
            [-long * 0.35, 0, r + 0.15],
            [long * 0.3, 0, r + 0.15],
            [long * 0.4, 0, r],
        ]
        parts.append(tube(bar, 0.04))
        parts.append(box((long * 0.7, r * 1.4, 0.025), round=0.02).moved((0, 0, -r * 1.05)))
    for at in rng.uniform(-long / 2, long / 2, rng.integers(0, 4)):
        parts.append(torus(r, 0.02).moved((at, 0, 0), rotation(Y, np.pi / 2)))
    if rng.random() < 0.4:
        wheel = extruded(gear(rng.integers(8, 20), rng.uniform(0.12, 0.25), 0.03), 0.03)
        parts.append(wheel.moved((long / 2 + nose, 0, 0), rotation(Y, np.pi / 2)))
    if rng.random() < 0.3:
        parts.append(knob(rng).moved((0, r * 0.9, 0), rotation(X, -np.pi / 2)))
    return blend(parts, rng.choice([0, 0.02, 0.05]))


def knob(rng: Rng) -> Solid:
    r, h = rng.uniform(0.03, 0.08), rng.uniform(0.02, 0.08)
    return revolved(solid_profile([r, r, r * 0.9], h), square=2.0)
