"""To polyscope: ``pip install polyscope``."""

from __future__ import annotations

from typing import Any, Optional, Union

import numpy as np
from numpy.typing import ArrayLike

from .._paint import PathLike
from .._semfm import Region
from ._parts import Part, library, parts_of


def to_polyscope(
    thing: Any,
    name: Optional[str] = None,
    *,
    region: Optional[Union[Region, PathLike, ArrayLike]] = None,
    colors: Optional[ArrayLike] = None,
) -> Any:
    """Registers a structure with polyscope, after ``polyscope.init()``.

    Parameters
    ----------
    thing : Mesh, path, MeshFile, Shape, PreparedObject, SemanticCloud, Transfer, StoredTransfer or
        Grasps
    name : str, optional
        Name of the structure, of which ``NAME source`` and ``NAME target`` are made for a transfer.
        ``"mesh"`` or ``"cloud"``, ``"source"`` and ``"target"`` where none is given.
    region : Region, path or (n,) array_like, optional
        Painted grey to red by weight, and a scalar quantity ``"region"``.
    colors : (n, 3) or (n, 4) array_like, optional
        sRGB of each vertex: uint8, or fractions of one.

    Returns
    -------
    polyscope.SurfaceMesh, polyscope.PointCloud or tuple
        For a transfer both meshes, with the colour quantities ``"colors"`` (region) and
        ``"places"`` (equal colours are matched); the target is moved beside the source.
    """
    polyscope = library("polyscope", "polyscope")
    parts = parts_of(thing, region, colors)
    named = [part.name if name is None else name for part in parts]
    if name is not None and len(parts) > 1:
        named = [f"{name} {part.name}" for part in parts]
    made = tuple(structure(polyscope, part, called) for part, called in zip(parts, named))
    return made[0] if len(made) == 1 else made


def structure(polyscope: Any, part: Part, name: str) -> Any:
    """One part with its quantities."""
    on_vertices = {}
    if part.faces is None:
        shown = polyscope.register_point_cloud(name, part.vertices)
    else:
        shown = polyscope.register_surface_mesh(
            name, part.vertices, part.faces.astype(np.int64), smooth_shade=True
        )
        on_vertices = {"defined_on": "vertices"}
    for called, values in part.scalars.items():
        shown.add_scalar_quantity(called, values, **on_vertices)
    for called, layer in part.layers.items():
        shown.add_color_quantity(called, layer, **on_vertices)
    if part.colors is not None:
        shown.add_color_quantity("colors", part.colors, enabled=True, **on_vertices)
    if part.offset.any():
        shown.translate(part.offset)
    return shown
