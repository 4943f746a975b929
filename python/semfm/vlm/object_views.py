"""An object with its rendered views: mesh, cameras, pictures, and the surface behind each pixel.

A views file holds all of it. Its ``/mesh`` has the vertices and triangles in the order of the mesh
as read, so that what is lifted onto it speaks of the same vertex ids as everything else.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any

import numpy as np

from .. import Pinhole, Mesh, View, ViewsFile
from .._identity import mesh_identity
from ..sidecar.errors import expected

#: Pixels whose triangle does not lie behind them, at most this share of the object's: rounding of
#: thin triangles. More, and pictures and mesh are not of the same object.
MISPLACED_AT_MOST = 0.01
#: How far outside a triangle, as a barycentric coordinate, a pixel may lie.
_OUTSIDE = 0.05


@dataclass(frozen=True)
class Surface:
    """What the pixels on the object show, for p pixels in row-major order.

    Attributes
    ----------
    rows, cols
        (p) int, where the pixels lie.
    corners
        (p × 3) int, the vertices of the triangle that each shows.
    barycentric
        (p × 3) float, where in the triangle the ray through the pixel's centre meets it.
    points
        (p × 3) float, the same in the object's frame.
    """

    rows: np.ndarray
    cols: np.ndarray
    corners: np.ndarray
    barycentric: np.ndarray
    points: np.ndarray


@dataclass(frozen=True)
class ObjectView:
    """One view: its number in the file, picture (height × width × 3) uint8, camera, surface."""

    name: str
    rgb: np.ndarray
    on_object: np.ndarray  # (height × width) bool
    camera: Pinhole
    surface: Surface

    def image(self, values: np.ndarray, fill: Any = 0) -> np.ndarray:
        """Values (p) of the surface's pixels as an image (height × width), ``fill`` elsewhere."""
        image = np.full(self.on_object.shape, fill, values.dtype)
        image[self.surface.rows, self.surface.cols] = values
        return image


@dataclass(frozen=True)
class ObjectViews:
    """An object and all views of its file.

    Attributes
    ----------
    path
        The views file, for messages.
    mesh
        As rendered.
    views
        In the file's order.
    """

    path: str
    mesh: Mesh
    views: list[ObjectView]

    @property
    def vertices(self) -> np.ndarray:
        """Positions (n × 3) of the mesh."""
        return self.mesh.vertices

    @property
    def identity(self) -> dict[str, Any]:
        """The mesh as regions name it."""
        return mesh_identity(self.mesh)


def read_object(path: str | os.PathLike[str]) -> ObjectViews:
    """Read an object from its views file.

    Raises
    ------
    FormatError
        If the file is damaged or foreign, or its mesh is not the one that its metadata name.
    FileError
        If it cannot be read.
    SidecarError
        If it has no mesh, or its pictures do not show its mesh.
    """
    name, file = os.fspath(path), ViewsFile.read(path)
    if file.mesh is None:
        raise expected(name, "/mesh", "the object's mesh", "none")
    vertices, triangles = file.mesh.vertices, file.mesh.faces.astype(np.int64)
    views = [
        _view(name, f"{number:03}", view, vertices, triangles)
        for number, view in enumerate(file.views)
    ]
    return ObjectViews(name, file.mesh, views)


def _view(
    path: str, name: str, view: View, vertices: np.ndarray, triangles: np.ndarray
) -> ObjectView:
    surface = _surface(view.camera, view.triangles, vertices, triangles)
    misplaced = np.mean(surface.barycentric.min(1) < -_OUTSIDE) if len(surface.rows) else 0.0
    if not misplaced <= MISPLACED_AT_MOST:
        place, found = f"/views/{name}/triangles", f"{misplaced:.0%} of the pixels elsewhere"
        raise expected(path, place, "the triangles of /mesh behind their pixels", found)
    return ObjectView(name, view.rgb, view.triangles >= 0, view.camera, surface)


def _surface(
    camera: Pinhole, ids: np.ndarray, vertices: np.ndarray, triangles: np.ndarray
) -> Surface:
    """Intersect each pixel's ray with the plane of the triangle that it shows.

    The ray s·d meets the triangle (a, b, c) where its barycentric coordinates are in proportion to
    d·(b × c), d·(c × a), d·(a × b): solve s·d = w₀a + w₁b + w₂c by Cramer's rule.
    """
    rows, cols = np.nonzero(ids >= 0)
    corners = triangles[ids[rows, cols]]
    rotation, translation = camera.camera_from_world[:3, :3], camera.camera_from_world[:3, 3]
    a, b, c = (vertices[corners[:, i]] @ rotation.T + translation for i in range(3))
    x, y = (cols + 0.5 - camera.cx) / camera.fx, (rows + 0.5 - camera.cy) / camera.fy
    rays = np.stack([x, y, np.ones(len(rows))], 1)
    w = np.stack([(rays * np.cross(*edge)).sum(1) for edge in ((b, c), (c, a), (a, b))], 1)
    total = w.sum(1, keepdims=True)
    # A triangle seen exactly edge-on has no such point; its middle is as good as any.
    barycentric = np.divide(w, total, out=np.full_like(w, 1 / 3), where=np.abs(total) > 1e-300)
    points = np.einsum("pi,pid->pd", barycentric, vertices[corners])
    return Surface(rows, cols, corners, barycentric, points)
