"""To open3d: ``pip install open3d``."""

from __future__ import annotations

from typing import Any, Optional, Union

import numpy as np
from numpy.typing import ArrayLike

from .._paint import PathLike
from .._semfm import Region
from ._parts import Part, library, parts_of


def to_open3d(
    thing: Any,
    *,
    region: Optional[Union[Region, PathLike, ArrayLike]] = None,
    colors: Optional[ArrayLike] = None,
) -> Any:
    """An `open3d.geometry.TriangleMesh` or `PointCloud`; of a transfer, a tuple of two meshes.

    Parameters
    ----------
    thing : Mesh, path, MeshFile, Shape, PreparedObject, SemanticCloud, Transfer, StoredTransfer or
        Grasps
    region : Region, path or (n,) array_like, optional
        Painted grey to red by weight.
    colors : (n, 3) or (n, 4) array_like, optional
        sRGB of each vertex: uint8, or fractions of one.

    Returns
    -------
    open3d.geometry.TriangleMesh, open3d.geometry.PointCloud or tuple
        Meshes have vertex normals, so that they are shaded. Source and target of a transfer keep
        their own frames; ``translate`` them to see them side by side.
    """
    open3d = library("open3d", "open3d")
    made = tuple(geometry(open3d, part) for part in parts_of(thing, region, colors))
    return made[0] if len(made) == 1 else made


def geometry(open3d: Any, part: Part) -> Any:
    """One part, vertex by vertex."""
    vectors = open3d.utility.Vector3dVector
    points = vectors(np.array(part.vertices))
    if part.faces is None:
        cloud = open3d.geometry.PointCloud(points)
        if part.colors is not None:
            cloud.colors = vectors(part.colors)
        return cloud
    triangles = open3d.utility.Vector3iVector(part.faces.astype(np.int32))
    mesh = open3d.geometry.TriangleMesh(points, triangles)
    if part.colors is not None:
        mesh.vertex_colors = vectors(part.colors)
    mesh.compute_vertex_normals()
    return mesh
