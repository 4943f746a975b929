"""Families of training objects: each function draws one random solid of its kind.

Kinds are broad on purpose: what they share (handles, openings, hinges, rims, buttons, legs) comes
in many builds, so that a net cannot learn a catalogue. None is a copy of a real object, and none is
one of the workspace's demonstration objects, which stay unseen. Objects are about 1 across; poses,
sizes and deformations are drawn later, see `..objects`.
"""

from __future__ import annotations

from .abstract_things import assembly, carved, fastener, repeated, wire
from .blades_and_levers import blade, two_levers
from .devices import machine, panel
from .footwear import footwear
from .large_things import animal, furniture, vehicle
from .long_tools import grip_and_head
from .vessels import bag, bottle, plate, vessel

#: Families by name. Those in `LEFT_OUT` are drawn for validation alone.
FAMILIES = {
    f.__name__: f
    for f in (
        vessel,
        bottle,
        grip_and_head,
        blade,
        two_levers,
        footwear,
        panel,
        bag,
        furniture,
        machine,
        animal,
        vehicle,
        plate,
        wire,
        assembly,
        carved,
        repeated,
        fastener,
    )
}

#: How often each family is drawn.
WEIGHTS = {name: 1.0 for name in FAMILIES} | {
    "grip_and_head": 2.0,
    "assembly": 2.0,
    "vessel": 1.5,
    "blade": 1.3,
    "two_levers": 1.3,
    "footwear": 1.3,
    "panel": 1.2,
    "repeated": 0.6,
    "fastener": 0.6,
    "carved": 0.8,
    "plate": 0.6,
}

#: Never trained on: what a family that the net has not seen costs is measured on these.
LEFT_OUT = ("bottle", "machine", "vehicle")
