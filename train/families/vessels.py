"""Things that hold something: vessels, bottles, bags, plates."""

from __future__ import annotations

import numpy as np

from ..curves import arc, between, rotation, smooth, solid_profile, star, vessel_profile
from ..sdf import Solid, blend, box, ellipsoid, extruded, minus, revolved, thread, tube, union
from .axes import Rng, X, Y, Z


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
        parts += [
            tube([[0, 0, h], [0, 0, h + 0.1]], neck * 0.8),
            box((0.13, 0.05, 0.05), round=0.02).moved((0.07, 0, h + 0.13)),
            tube(smooth([[0.1, 0, h + 0.1], [0.14, 0, h], [0.1, 0, h - 0.1]], 6), 0.02),
        ]
    else:  # a pump
        reach = rng.uniform(0.1, 0.25)
        parts += [
            tube([[0, 0, h], [0, 0, h + 0.16]], 0.025),
            tube([[0, 0, h + 0.16], [reach, 0, h + 0.16], [reach, 0, h + 0.11]], 0.03),
        ]
    solid = blend(parts, rng.choice([0, 0.02]))
    if rng.random() < 0.3:
        hole = box((0.06, 1, 0.12), round=0.05).moved((w * 0.6, 0, h * 0.6))
        solid = minus(solid, [hole])
    return solid


def bag(rng: Rng) -> Solid:
    """A case, sack or basket with straps, bows or a slot to hold it by."""
    a, b, h = rng.uniform(0.2, 0.45), rng.uniform(0.07, 0.25), rng.uniform(0.25, 0.7)
    kind = rng.integers(4)
    if kind == 0:
        body = box((a, b, h / 2), round=rng.uniform(0.01, b * 0.9)).moved((0, 0, h / 2))
    elif kind == 1:
        body = ellipsoid((a, b * 1.2, h / 2)).moved((0, 0, h / 2))
    elif kind == 2:  # open
        body = minus(
            box((a, b, h / 2), round=0.03).moved((0, 0, h / 2)),
            [box((a - 0.03, b - 0.03, h / 2)).moved((0, 0, h / 2 + 0.04))],
        )
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
            curve = smooth(
                [
                    [s * a * 0.5, -b, h * 0.95],
                    [s * a * 0.6, -b - 0.15, h * 0.5],
                    [s * a * 0.5, -b, h * 0.1],
                ],
                10,
            )
            parts.append(tube(curve, thick, flat=(X, 1)))
        parts.append(box((a * 0.6, 0.06, h * 0.2), round=0.04).moved((0, b, h * 0.3)))
    else:
        bar = [[-a * 0.4, 0, h], [-a * 0.4, 0, h + 0.1], [a * 0.4, 0, h + 0.1], [a * 0.4, 0, h]]
        parts.append(tube(bar, thick))
    return blend(parts, rng.choice([0, 0.02, 0.05]))


def plate(rng: Rng) -> Solid:
    """A dish, tray, lid, coin or tile: wide, low, with rims, holes or feet."""
    r, h = rng.uniform(0.3, 0.5), rng.uniform(0.03, 0.2)
    if rng.random() < 0.6:
        rim = between([rng.uniform(0.4, 0.9), rng.uniform(0.6, 1), 1], 8) * r
        solid = revolved(
            vessel_profile(rim, h, rng.uniform(0.035, 0.06)), square=rng.choice([2.0, 2.0, 5.0])
        )
    else:
        solid = extruded(
            star(rng, rng.integers(3, 12), r, 0.15), rng.uniform(0.02, 0.08), round=0.01
        )
    if rng.random() < 0.4:
        parts = [
            tube(arc(0.12, 0, np.pi, 8), 0.025).moved((s * r, 0, h * 0.5), rotation(Z, np.pi / 2))
            for s in (-1, 1)
        ]
        solid = union([solid, *parts])
    if rng.random() < 0.4:
        n = rng.integers(1, 7)
        at = rng.uniform(0.3, 0.7) * r
        solid = minus(
            solid,
            [
                tube(
                    [[at * np.cos(q), at * np.sin(q), -1], [at * np.cos(q), at * np.sin(q), 1]],
                    0.04,
                )
                for q in np.arange(n) * 2 * np.pi / n
            ],
        )
    if rng.random() < 0.3:
        solid = union(
            [
                solid,
                *[
                    tube([[x * r * 0.6, y * r * 0.6, 0], [x * r * 0.6, y * r * 0.6, -0.1]], 0.03)
                    for x in (-1, 1)
                    for y in (-1, 1)
                ],
            ]
        )
    return solid
