"""To trimesh: ``pip install trimesh``."""

from __future__ import annotations

from typing import Any, Optional, Union

import numpy as np
from numpy.typing import ArrayLike

from .._semfm import Region
from ._parts import Part, color_bytes, library, parts_of


def to_trimesh(
    thing: Any,
    *,
    region: Optional[Union[Region, ArrayLike]] = None,
    colors: Optional[ArrayLike] = None,
) -> Any:
    """A `trimesh.Trimesh`, `trimesh.PointCloud` or, of a transfer, `trimesh.Scene`.

    Parameters
    ----------
    thing : Mesh, MeshFile, Shape, PreparedObject, SemanticCloud or Transfer
    region : Region or (n,) array_like, optional
        Painted grey to red by weight, and kept as the vertex attribute ``"region"``.
    colors : (n, 3) or (n, 4) array_like, optional
        sRGB of each vertex: uint8, or fractions of one.

    Returns
    -------
    trimesh.Trimesh, trimesh.PointCloud or trimesh.Scene
        No vertex is merged or moved. A scene has the nodes ``"source"`` and ``"target"``, which
        stands beside the source by its node's transform.

    Examples
    --------
    >>> import semfm, semfm.zoo
    >>> from semfm.adapters import to_trimesh
    >>> sphere = semfm.zoo.icosphere(2)
    >>> there = to_trimesh(sphere)  # doctest: +SKIP
    >>> semfm.Mesh.from_trimesh(there) == sphere  # doctest: +SKIP
    True
    """
    trimesh = library("trimesh", "trimesh")
    parts = parts_of(thing, region, colors)
    if len(parts) == 1:
        return geometry(trimesh, parts[0])
    scene = trimesh.Scene()
    for part in parts:
        transform = np.eye(4)
        transform[:3, 3] = part.offset
        shape = geometry(trimesh, part)
        scene.add_geometry(shape, node_name=part.name, geom_name=part.name, transform=transform)
    return scene


def geometry(trimesh: Any, part: Part) -> Any:
    """One part, vertex by vertex."""
    painted = None if part.colors is None else color_bytes(part.colors)
    if part.faces is None:
        return trimesh.PointCloud(np.array(part.vertices), colors=painted)
    return trimesh.Trimesh(
        np.array(part.vertices),
        part.faces.astype(np.int64),
        vertex_colors=painted,
        vertex_attributes=dict(part.scalars),
        process=False,
    )
