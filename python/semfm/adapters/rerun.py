"""To rerun: ``pip install rerun-sdk``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Optional, Union

import numpy as np
from numpy.typing import ArrayLike

from .._paint import PathLike
from .._semfm import Grasps, Pinhole, Region, View
from ._parts import Part, color_bytes, library, parts_of


def to_rerun(
    thing: Any,
    path: Optional[str] = None,
    *,
    region: Optional[Union[Region, PathLike, ArrayLike]] = None,
    colors: Optional[ArrayLike] = None,
    recording: Optional[Any] = None,
) -> list[str]:
    """Logs an object to rerun, in its own frame and units.

    Parameters
    ----------
    thing : Mesh, path, MeshFile, Shape, PreparedObject, SemanticCloud, Transfer, StoredTransfer, Grasps,
        Pinhole, View or list
        A list of cameras or views is numbered.
    path : str, optional
        Entity to log to, below which a transfer has ``source`` and ``target``. Named after the kind
        of object where none is given.
    region : Region, path or (n,) array_like, optional
        Painted grey to red by weight.
    colors : (n, 3) or (n, 4) array_like, optional
        sRGB of each vertex: uint8, or fractions of one.
    recording : rerun.RecordingStream, optional
        The current one (``rerun.init``) where none is given.

    Returns
    -------
    list of str
        The entities.
    """
    rerun = library("rerun", "rerun-sdk")
    if isinstance(thing, (list, tuple)):
        base = path or "views"
        each = (
            to_rerun(one, f"{base}/{number}", recording=recording)
            for number, one in enumerate(thing)
        )
        return [entity for entities in each for entity in entities]
    if isinstance(thing, (Pinhole, View)):
        return view(rerun, thing, path or "view", recording)
    parts = parts_of(thing, region, colors)
    base = path or ("grasps" if isinstance(thing, Grasps) else "transfer")
    entities = []
    for part in parts:
        single = len(parts) == 1
        entity = (path or part.name) if single else f"{base}/{part.name}"
        if part.offset.any():
            beside = rerun.Transform3D(translation=part.offset)
            rerun.log(entity, beside, static=True, recording=recording)
        rerun.log(entity, geometry(rerun, part), static=True, recording=recording)
        entities.append(entity)
    return entities


def geometry(rerun: Any, part: Part) -> Any:
    """One part as an archetype."""
    painted = None if part.colors is None else color_bytes(part.colors)
    if part.faces is None:
        return rerun.Points3D(part.vertices, colors=painted)
    return rerun.Mesh3D(
        vertex_positions=part.vertices,
        triangle_indices=part.faces,
        vertex_colors=painted,
        vertex_normals=vertex_normals(part.vertices, part.faces),
    )


def vertex_normals(
    vertices: np.ndarray[Any, np.dtype[np.float64]], faces: np.ndarray[Any, np.dtype[np.uint32]]
) -> Any:
    """(n, 3) unit normals, by area: without them there is no shade."""
    corners = vertices[faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.zeros_like(vertices)
    for corner in range(3):
        np.add.at(normals, faces[:, corner], across)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return normals / np.maximum(lengths, np.finfo(np.float64).tiny)


def view(rerun: Any, thing: Union[Pinhole, View], path: str, recording: Optional[Any]) -> list[str]:
    """A camera where it stands, with the picture that it took."""
    camera = thing.camera if isinstance(thing, View) else thing
    object_from_camera = np.linalg.inv(camera.camera_from_world)
    posed = rerun.Transform3D(
        translation=object_from_camera[:3, 3], mat3x3=object_from_camera[:3, :3]
    )
    size: Sequence[int] = (camera.width, camera.height)
    pinhole = rerun.Pinhole(
        focal_length=(camera.fx, camera.fy),
        principal_point=(camera.cx, camera.cy),
        resolution=size,
        camera_xyz=rerun.ViewCoordinates.RDF,
    )
    rerun.log(path, posed, static=True, recording=recording)
    rerun.log(path, pinhole, static=True, recording=recording)
    if isinstance(thing, View):
        rerun.log(f"{path}/rgb", rerun.Image(thing.rgb), static=True, recording=recording)
    return [path]
