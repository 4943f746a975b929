"""An object with its rendered views: mesh, cameras, pictures, and the surface behind each pixel.

A views file holds all of it. Its ``/mesh`` has the vertices and triangles in the order of the mesh
as read, so that what is lifted onto it speaks of the same vertex ids as everything else.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..sidecar.errors import expected
from ..sidecar.views_file import ViewRecord, ViewsFile, decode, read_views

#: Pixels whose triangle does not lie behind them, at most this share of the object's: rounding of
#: thin triangles. More, and pictures and mesh are not of the same object.
MISPLACED_AT_MOST = 0.01
#: How far outside a triangle, as a barycentric coordinate, a pixel may lie.
_OUTSIDE = 0.05


@dataclass(frozen=True)
class Camera:
    """A pinhole camera; axes x right, y down, z forward; pixel (c, r) has its centre at +½.

    Attributes
    ----------
    focal, centre
        (2) float, in pixels.
    rotation, translation
        (3 × 3) and (3): ``camera_from_object``, in units of the mesh.
    """

    focal: np.ndarray
    centre: np.ndarray
    rotation: np.ndarray
    translation: np.ndarray

    @property
    def eye(self) -> np.ndarray:
        """Where the camera stands, (3), in the object's frame."""
        return -self.rotation.T @ self.translation

    def from_object(self, points: np.ndarray) -> np.ndarray:
        """Points (n × 3) of the object in the camera's frame."""
        return points @ self.rotation.T + self.translation

    def project(self, points: np.ndarray) -> np.ndarray:
        """Pixel positions (n × 2), as (u, v), of points (n × 3) in the camera's frame."""
        return self.focal * points[:, :2] / points[:, 2:] + self.centre


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
    camera: Camera
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
    vertices, triangles
        (n × 3) float and (m × 3) int, as in the mesh file.
    mesh_hash
        ``blake3:…``, the mesh's name.
    views
        In the file's order.
    """

    path: str
    vertices: np.ndarray
    triangles: np.ndarray
    mesh_hash: str
    views: list[ObjectView]

    @property
    def identity(self) -> dict[str, Any]:
        """The mesh as regions name it."""
        return {
            "n_vertices": len(self.vertices),
            "n_triangles": len(self.triangles),
            "hash": self.mesh_hash,
        }


def read_object(path: str | os.PathLike[str]) -> ObjectViews:
    """Read an object from its views file.

    Raises
    ------
    SidecarError
        If the file is damaged or foreign, has no mesh, or its pictures do not show its mesh.
    """
    file = read_views(path)
    vertices, triangles = _mesh(file)
    views = [_view(file, view, vertices, triangles) for view in file.views]
    return ObjectViews(file.path, vertices, triangles, file.metadata.get("mesh_hash", ""), views)


def _mesh(file: ViewsFile) -> tuple[np.ndarray, np.ndarray]:
    if file.mesh is None:
        raise expected(file.path, "/mesh", "the object's mesh", "none")
    scene = decode(file.path, "mesh", file.mesh)
    lists = [triangles for entity in scene.entities for triangles in entity.triangles]
    if len(lists) != 1:
        raise expected(file.path, "/mesh", "one list of triangles", len(lists))
    vertices = np.array([(p.x, p.y, p.z) for p in lists[0].points], float).reshape(-1, 3)
    indices = np.array(lists[0].indices, np.int64)
    if len(indices) % 3:
        raise expected(file.path, "/mesh", "three indices a triangle", len(indices))
    triangles = indices.reshape(-1, 3)
    for key, count in (("n_vertices", len(vertices)), ("n_triangles", len(triangles))):
        if file.metadata.get(key) != str(count):
            found = f"{count} in /mesh"
            raise expected(file.path, f"metadata {key}", repr(file.metadata.get(key)), found)
    if len(indices) and indices.max() >= len(vertices):
        raise expected(file.path, "/mesh", f"vertex ids below {len(vertices)}", indices.max())
    if not np.isfinite(vertices).all():
        raise expected(file.path, "/mesh", "finite coordinates", "others")
    return vertices, triangles


def _view(
    file: ViewsFile, record: ViewRecord, vertices: np.ndarray, triangles: np.ndarray
) -> ObjectView:
    place = f"/views/{record.name}/triangles"
    if record.triangles.max() >= len(triangles):
        found = record.triangles.max()
        raise expected(file.path, place, f"triangles below {len(triangles)}", found)
    camera = _camera(file, record)
    surface = _surface(camera, record.triangles, vertices, triangles)
    misplaced = np.mean(surface.barycentric.min(1) < -_OUTSIDE) if len(surface.rows) else 0.0
    if not misplaced <= MISPLACED_AT_MOST:
        found = f"{misplaced:.0%} of the pixels elsewhere"
        raise expected(file.path, place, "the triangles of /mesh behind their pixels", found)
    return ObjectView(record.name, record.rgb, record.on_object, camera, surface)


def _camera(file: ViewsFile, record: ViewRecord) -> Camera:
    k = np.array(decode(file.path, "camera", record.camera).K).reshape(3, 3)
    pose = decode(file.path, "tf", record.tf)
    q, t = pose.rotation, pose.translation
    quaternion = np.array([q.x, q.y, q.z, q.w])
    translation = np.array([t.x, t.y, t.z])
    focal, centre = k[[0, 1], [0, 1]], k[:2, 2]
    place = f"/views/{record.name}/camera"
    if not (np.isfinite(k).all() and (focal > 0).all() and k[0, 1] == 0):
        raise expected(file.path, place, "K of a pinhole camera without skew", k.tolist())
    if abs(np.linalg.norm(quaternion) - 1) > 1e-5 or not np.isfinite(translation).all():
        found = f"{quaternion.tolist()}, {translation.tolist()}"
        raise expected(file.path, "/tf", "a rigid transform (finite, unit quaternion)", found)
    rotation = _rotation(quaternion / np.linalg.norm(quaternion)).T
    return Camera(focal, centre, rotation, -rotation @ translation)


def _rotation(xyzw: np.ndarray) -> np.ndarray:
    """The rotation matrix (3 × 3) of a unit quaternion."""
    x, y, z, w = xyzw
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def _surface(
    camera: Camera, ids: np.ndarray, vertices: np.ndarray, triangles: np.ndarray
) -> Surface:
    """Intersect each pixel's ray with the plane of the triangle that it shows.

    The ray s·d meets the triangle (a, b, c) where its barycentric coordinates are in proportion to
    d·(b × c), d·(c × a), d·(a × b): solve s·d = w₀a + w₁b + w₂c by Cramer's rule.
    """
    rows, cols = np.nonzero(ids >= 0)
    corners = triangles[ids[rows, cols]]
    a, b, c = (camera.from_object(vertices[corners[:, i]]) for i in range(3))
    centres = np.stack([cols, rows], 1) + 0.5
    rays = np.concatenate([(centres - camera.centre) / camera.focal, np.ones((len(rows), 1))], 1)
    w = np.stack([(rays * np.cross(*edge)).sum(1) for edge in ((b, c), (c, a), (a, b))], 1)
    total = w.sum(1, keepdims=True)
    # A triangle seen exactly edge-on has no such point; its middle is as good as any.
    barycentric = np.divide(w, total, out=np.full_like(w, 1 / 3), where=np.abs(total) > 1e-300)
    points = np.einsum("pi,pid->pd", barycentric, vertices[corners])
    return Surface(rows, cols, corners, barycentric, points)
