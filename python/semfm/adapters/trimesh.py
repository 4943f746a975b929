"""To trimesh: ``pip install trimesh``."""

from __future__ import annotations

from typing import Any, Optional, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._paint import PathLike
from .._semfm import Region
from ..errors import InvalidInput
from ._parts import Floats, Part, color_bytes, library, parts_of


def to_trimesh(
    thing: Any,
    *,
    region: Optional[Union[Region, PathLike, ArrayLike]] = None,
    colors: Optional[ArrayLike] = None,
) -> Any:
    """A `trimesh.Trimesh`, `trimesh.PointCloud` or, of a transfer, `trimesh.Scene`.

    Parameters
    ----------
    thing : Mesh, path, MeshFile, Shape, PreparedObject, SemanticCloud, Transfer, StoredTransfer or
        Grasps
    region : Region, path or (n,) array_like, optional
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


def scene_arrays(scene: Any) -> tuple[Floats, NDArray[np.uint32]]:
    """Vertices (n, 3) and faces (m, 3) of all meshes of a scene.

    They are in the order of its graph, each where its node stands.
    """
    vertices: list[Floats] = [np.zeros((0, 3))]
    faces: list[NDArray[np.uint32]] = [np.zeros((0, 3), np.uint32)]
    first = 0
    for node in scene.graph.nodes_geometry:
        transform, name = scene.graph[node]
        shape = scene.geometry[name]
        corners = np.asarray(getattr(shape, "faces", ()))
        if corners.ndim != 2 or corners.shape[1] != 3 or len(corners) == 0:
            continue
        matrix = np.asarray(transform, dtype=np.float64)
        points = np.asarray(shape.vertices, dtype=np.float64)
        vertices.append(points @ matrix[:3, :3].T + matrix[:3, 3])
        # A mirrored node turns its triangles inside out.
        wound = corners[:, ::-1] if np.linalg.det(matrix[:3, :3]) < 0 else corners
        faces.append((wound + first).astype(np.uint32))
        first += len(points)
    if first == 0:
        raise InvalidInput("mesh: expected a scene with a mesh, found none in it", place="mesh")
    return np.concatenate(vertices), np.concatenate(faces)
