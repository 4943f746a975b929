"""A reconstructed mesh and where it stands before the camera."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._semfm import Mesh
from ..sidecar.errors import expected
from .poses import Matrix, moved, scale_of, similarity


@dataclass(frozen=True)
class PlacedMesh:
    """A mesh in its own frame and unit, its colours, and its pose. Made by :func:`place_mesh`.

    Attributes
    ----------
    mesh
        Positions are numbers of 32 bits, so that a GLB and a PLY of it are the same mesh.
    colors
        (n × 4) uint8, RGBA of each vertex in sRGB; None where there are none.
    camera_from_mesh
        (4 × 4): to the camera's frame (x right, y down, z forward), in metres where the point map
        was, else in its unit.
    """

    mesh: Mesh
    colors: NDArray[np.uint8] | None
    camera_from_mesh: Matrix

    @property
    def scale(self) -> float:
        """Lengths of the camera's frame to one of the mesh."""
        return scale_of(self.camera_from_mesh)

    @property
    def size(self) -> NDArray[np.float64]:
        """(3) sides of the box along the mesh's own axes, in lengths of the camera's frame."""
        low, high = self.mesh.bounds
        return (high - low) * self.scale

    def in_camera(self) -> Mesh:
        """The mesh in the camera's frame."""
        return Mesh(moved(self.mesh.vertices, self.camera_from_mesh), self.mesh.faces)

    def centred(self) -> PlacedMesh:
        """The mesh at its size in the camera's frame, its origin in the middle of the box around
        it, its axes kept: what trackers of poses ask for. Its pose is rigid.
        """
        middle = self.mesh.bounds.mean(axis=0)
        vertices = (self.mesh.vertices - middle) * self.scale
        pose = self.camera_from_mesh.copy()
        pose[:3, :3] /= self.scale
        pose[:3, 3] = moved(middle[None], self.camera_from_mesh)[0]
        return replace(self, mesh=Mesh(vertices, self.mesh.faces), camera_from_mesh=pose)

    def rescaled(self, factor: float) -> PlacedMesh:
        """As large and as far away as ``factor`` times before: the same picture."""
        pose = self.camera_from_mesh.copy()
        pose[:3] *= factor
        return replace(self, camera_from_mesh=pose)


def place_mesh(
    mesh: Mesh, camera_from_mesh: ArrayLike, colors: ArrayLike | None = None, tool: str = "mesh"
) -> PlacedMesh:
    """A mesh with its pose.

    Parameters
    ----------
    mesh : Mesh
        In any frame and unit.
    camera_from_mesh : (4, 4) array_like
        A rotation, a scale and a shift; points are columns.
    colors : (n, 3) or (n, 4) array_like, optional
        RGB or RGBA of each vertex, uint8.
    tool : str
        Who made it, for messages.

    Raises
    ------
    SidecarError
        For another shape or type of the colours, a matrix that is no similarity, or a mesh that
        lies behind the camera.
    """
    pose = similarity(camera_from_mesh, tool, "camera_from_mesh")
    placed = PlacedMesh(
        Mesh(mesh.vertices.astype(np.float32), mesh.faces),
        _rgba(colors, mesh.n_vertices, tool),
        pose,
    )
    depth = moved(placed.mesh.vertices, pose)[:, 2]
    if depth.max() <= 0:
        wanted = "a mesh before the camera (z forward, points as columns)"
        raise expected(tool, "camera_from_mesh", wanted, f"depths up to {depth.max():.4g}")
    return placed


def _rgba(colors: ArrayLike | None, n: int, tool: str) -> NDArray[np.uint8] | None:
    if colors is None:
        return None
    found = np.asarray(colors)
    if found.dtype != np.uint8 or found.shape not in ((n, 3), (n, 4)):
        wanted = f"uint8 of shape ({n}, 3) or ({n}, 4)"
        raise expected(tool, "colors", wanted, f"{found.dtype} of shape {found.shape}")
    if found.shape[1] == 4:
        return found
    return np.concatenate([found, np.full((n, 1), 255, np.uint8)], axis=1)
