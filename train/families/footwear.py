"""Shoes, boots, clogs, sandals."""

from __future__ import annotations

import numpy as np

from ..curves import arc, between, rotation
from ..sdf import Solid, above, blend, box, common, extruded, minus, sheet, tube
from .axes import Rng, Z


def footwear(rng: Rng) -> Solid:
    """A long low hollow body that opens upwards at one end, on a flat or raised sole."""
    long, wide = 1.0, rng.uniform(0.15, 0.23)
    toe, instep = rng.uniform(0.08, 0.16), rng.uniform(0.15, 0.3)
    shaft = rng.choice([0.2, 0.3, 0.35, rng.uniform(0.5, 1.0)])
    heel = rng.choice([0, 0, 0.05, rng.uniform(0.1, 0.3)])
    x = np.linspace(0, long, 9)
    rise = heel * np.clip(1 - x / (0.55 * long), 0, 1) ** 1.3
    foot = tube(
        np.stack(
            [x * 0.86 + 0.1, 0.02 * np.sin(3 * x), rise + between([instep, instep, toe], 9) * 0.5],
            1,
        ),
        between([instep * 0.5, instep * 0.55, toe * 0.6, toe * 0.5], 9),
        flat=None,
    )
    foot = _widen(foot, wide / (instep * 0.55))
    ankle = tube(
        [[0.12, 0, rise[0] + 0.1], [0.12 + rng.normal(0, 0.03), 0, rise[0] + shaft]],
        [0.12, rng.uniform(0.1, 0.17)],
    )
    upper = blend([foot, ankle], 0.12)
    kind = rng.integers(4)
    if kind != 0:
        inside = tube(
            [[0.13, 0, rise[0] + 0.14], [0.13, 0, rise[0] + shaft + 0.4]],
            [0.08, rng.uniform(0.1, 0.14)],
        )
        hole = tube(np.stack([x[1:6], 0 * x[1:6], rise[1:6] + instep * 0.55], 1), instep * 0.36)
        cutters = [inside, hole, above(rise[0] + shaft - rng.uniform(0, 0.1))]
        if kind == 3:  # an open top, as a clog or a sandal
            cutters.append(tube([[0.2, 0, 0.5], [rng.uniform(0.35, 0.6), 0, 0.34]], 0.12))
        upper = minus(upper, cutters)
    sole = sheet(long / 2 * 0.98, wide * 0.9, rng.uniform(0.03, 0.1)).moved((long / 2, 0, 0.01))
    outline = np.stack(
        [np.cos(np.linspace(0, 2 * np.pi, 24)[:-1]), np.sin(np.linspace(0, 2 * np.pi, 24)[:-1])], 1
    )
    waist = 1 - rng.uniform(0, 0.35) * np.exp(-((outline[:, 0] + 0.15) ** 2) / 0.1)
    outline = outline * np.stack([np.full(len(waist), 0.52), wide * waist], 1) + [0.5, 0]
    base = extruded(outline, rng.uniform(0.02, 0.06), round=0.01)
    parts = [upper, base if heel == 0 else common(base, sole.moved((0, 0, 0)))]
    if heel > 0:
        parts = [
            upper,
            box((0.08, wide * 0.6, heel / 2 + 0.03), round=0.02).moved((0.1, 0, heel / 2)),
        ]
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
