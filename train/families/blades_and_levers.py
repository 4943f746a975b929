"""A blade on a grip, and two levers on a hinge."""

from __future__ import annotations

import numpy as np

from ..curves import arc, between, rotation, smooth
from ..sdf import Solid, blend, box, ellipsoid, extruded, minus, tube, union
from .axes import Rng, X, Z


def blade(rng: Rng) -> Solid:
    """A flat pointed or blunt blade that goes on from its grip, with or without a guard."""
    long, wide = rng.uniform(0.3, 0.9), rng.uniform(0.05, 0.22)
    x = np.linspace(0, 1, 9)
    back = wide * rng.uniform(0.2, 0.6) * (1 - x ** rng.uniform(2, 9) * rng.uniform(0, 1))
    edge = (
        -wide
        * (0.5 + rng.uniform(-0.4, 0.5) * x)
        * (1 - x ** rng.uniform(1.5, 9) * rng.uniform(0.4, 1))
    )
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
        parts += [
            ellipsoid((0.03, thick * 1.3, thick)),
            ellipsoid((0.05, 0.06, 0.05)).moved(curve[-1]),
        ]
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
            outline = [
                [-0.04, 0.05 * side],
                [-0.04, -0.02 * side],
                [reach, tip_width * 0.3],
                [reach * 0.6, rng.uniform(0.04, 0.09) * side],
            ]
            working = extruded(np.array(outline), 0.018)
        elif end_kind == 1:  # round jaws
            working = tube(
                [[0, 0, 0], [reach * 0.5, 0.05 * side, 0], [reach * 0.6, 0, 0]], [0.05, 0.045, 0.02]
            )
        elif end_kind == 2:  # a hooked beak
            working = tube(
                smooth([[0, 0, 0], [reach * 0.3, 0.1 * side, 0], [reach * 0.55, 0, 0]], 7),
                between([0.05, 0.04, 0.015], 7),
                flat=(Z, 0.6),
            )
        else:  # spoons or pads
            arm = tube([[0, 0, 0], [reach, 0.03 * side, 0]], 0.022)
            working = union([arm, ellipsoid((0.09, 0.03, 0.06)).moved((reach, 0.03 * side, 0))])
        foot = np.array([-grips, -0.05 * side + curved * side, 0])
        middle = np.array([-grips / 2, (-0.06 + 2 * curved) * side, 0])
        grip = [
            tube(
                smooth([[0, 0, 0], middle, foot], 8),
                between([thick, thick * 1.3, thick], 8),
                flat=(Z, rng.uniform(0.6, 1)),
            )
        ]
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
