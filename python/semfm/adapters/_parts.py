"""What every viewer is given: surfaces and points, named, painted and placed."""

from __future__ import annotations

import importlib
import os
from dataclasses import dataclass, field
from typing import Any, Optional, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._paint import PathLike, colors_of, position_colors, weight_colors, weights_of
from .._semfm import (
    Grasps,
    Mesh,
    MeshFile,
    PreparedObject,
    Region,
    SemanticCloud,
    Shape,
    StoredTransfer,
    Transfer,
)
from ..errors import InvalidInput, InvalidType, MissingPackage

Floats = NDArray[np.float64]

# Grippers that are shown: more hide each other and the object.
MOST_GRIPPERS = 6
# The colour of a gripper, sRGB.
GRIPPER = np.array([0.24, 0.45, 0.70])

# The gap between the two objects of a pair, as a share of the larger one's width.
GAP = 0.25


@dataclass
class Part:
    """One surface, or a set of points where there are no faces.

    `colors` are sRGB in 0..1, one row per vertex; `layers` further colours and `scalars` further
    numbers by name, for viewers that can switch. `offset` is where a viewer puts it.
    """

    name: str
    vertices: Floats
    faces: Optional[NDArray[np.uint32]] = None
    colors: Optional[Floats] = None
    scalars: dict[str, Floats] = field(default_factory=dict)
    layers: dict[str, Floats] = field(default_factory=dict)
    offset: Floats = field(default_factory=lambda: np.zeros(3))


def parts_of(
    thing: Any,
    region: Optional[Union[Region, PathLike, ArrayLike]] = None,
    colors: Optional[ArrayLike] = None,
) -> list[Part]:
    """The parts of an object: one; source and target of a transfer; object and grippers of grasps."""
    if region is not None and colors is not None:
        raise InvalidInput("region and colors: expected one of them, found both", place="region")
    if isinstance(thing, (Transfer, StoredTransfer, Grasps)):
        if region is not None or colors is not None:
            kind = type(thing).__name__
            raise InvalidInput(
                f"region and colors: expected none with {kind}, which has its own", place="region"
            )
        return with_grippers(thing) if isinstance(thing, Grasps) else sides(thing)
    if isinstance(thing, SemanticCloud):
        if region is not None:
            raise InvalidInput("region: expected none with a SemanticCloud", place="region")
        painted = None if colors is None else colors_of(colors, thing.n_points)
        views = {"n_views": thing.n_views.astype(np.float64)}
        return [Part("cloud", thing.points, colors=painted, scalars=views)]
    return [surface(thing, region, colors)]


def surface(
    thing: Any, region: Optional[Union[Region, PathLike, ArrayLike]], colors: Optional[ArrayLike]
) -> Part:
    """One mesh with its region or colours."""
    mesh = mesh_of(thing)
    part = Part("mesh", mesh.vertices, mesh.faces)
    if region is not None:
        part.scalars["region"] = weights_of(region, mesh)
        part.colors = weight_colors(part.scalars["region"])
    elif colors is not None:
        part.colors = colors_of(colors, mesh.n_vertices)
    elif isinstance(thing, MeshFile) and thing.vertex_colors is not None:
        part.colors = colors_of(thing.vertex_colors, mesh.n_vertices)
    return part


def mesh_of(thing: Any) -> Mesh:
    """The mesh as given of an object of ours."""
    if isinstance(thing, Mesh):
        return thing
    if isinstance(thing, (PreparedObject, MeshFile)):
        return thing.mesh
    if isinstance(thing, Shape):
        return thing.original
    if isinstance(thing, (str, os.PathLike)):
        return Mesh.read(thing)
    raise InvalidType(
        "expected a Mesh, path, MeshFile, Shape, PreparedObject, SemanticCloud, Transfer, "
        f"StoredTransfer or Grasps, found {type(thing).__name__}",
        "type",
    )


def with_grippers(grasps: Grasps) -> list[Part]:
    """The object in metres with its region, and the best grippers where they close, best first."""
    part = surface(grasps.mesh, grasps.region, None)
    part.name, part.vertices = "object", part.vertices * grasps.scale
    parts = [part]
    for rank in range(min(len(grasps), MOST_GRIPPERS)):
        grasp = grasps[rank]
        hand = grasps.gripper.mesh_at(grasp.width)
        pose = grasp.object_from_tcp
        vertices = hand.vertices @ pose[:3, :3].T + pose[:3, 3]
        share = 1.0 - 0.5 * rank / MOST_GRIPPERS
        colors = np.tile(GRIPPER * share + (1.0 - share), (len(vertices), 1))
        parts.append(Part(f"grasp {rank}", vertices, hand.faces, colors))
    return parts


def sides(transfer: Union[Transfer, StoredTransfer]) -> list[Part]:
    """Source and target with region and matched places, the target beside the source along x."""
    source = surface(transfer.source, transfer.source_region, None)
    target = surface(transfer.target, transfer.region, None)
    source.name, target.name = "source", "target"
    places = position_colors(source.vertices)
    source.layers["places"], target.layers["places"] = places, transfer.point_map.pull_back(places)
    target.scalars["source_of"] = transfer.point_map.source_of.astype(np.float64)
    boxes = [
        np.array([part.vertices.min(axis=0), part.vertices.max(axis=0)])
        for part in (source, target)
    ]
    widths = [box[1, 0] - box[0, 0] for box in boxes]
    target.offset = boxes[0].mean(axis=0) - boxes[1].mean(axis=0)
    target.offset[0] += sum(widths) / 2 + GAP * max(widths)
    return [source, target]


def library(name: str, install: str) -> Any:
    """A library that is needed now, or a `MissingPackage` that says why and how to get it."""
    try:
        return importlib.import_module(name)
    except (ImportError, OSError) as error:
        message = f"this needs {name}, which cannot be imported ({error}): pip install {install}"
        raise MissingPackage(message, "missing-package", name) from error


def color_bytes(colors: Floats) -> NDArray[np.uint8]:
    """(n, 4) RGBA bytes of (n, 3) fractions."""
    opaque = np.full((len(colors), 1), 255, dtype=np.uint8)
    return np.hstack([np.rint(colors * 255).astype(np.uint8), opaque])
