"""Poses of reconstructions, in the conventions of the tools that make them, and in ours.

Ours is ``camera_from_mesh``: a 4 × 4 matrix that takes points of the mesh, as columns, to the
camera's frame (x right, y down, z forward); its linear part is a rotation times a scale.

SAM 3D Objects has three conventions at once (its ``postprocessing_utils.to_glb``,
``SceneVisualizer.object_pointcloud`` and ``camera_to_pytorch3d_camera``):

* the GLB stands y up, while the pose is that of the same mesh z up;
* PyTorch3D multiplies points as **rows**: ``p = (scale · v) R + t`` with R the matrix of the
  quaternion (w first). As columns that is Rᵀ, the inverse of what the quaternion seems to name;
* its camera looks along z with x to the **left** and y **up**.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._files import read_json
from .._identity import mesh_identity
from .._semfm import Mesh
from ..sidecar.errors import expected

Matrix = NDArray[np.float64]

#: Axes of a GLB (y up) to those of the pose of SAM 3D Objects (z up): (x, y, z) becomes (x, −z, y).
ZUP_FROM_YUP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
#: Axes of PyTorch3D's camera (x left, y up) to ours (x right, y down), and back: it is its own
#: inverse.
OPENCV_FROM_PYTORCH3D = np.diag([-1.0, -1.0, 1.0])

#: How far the linear part of a matrix may be from a rotation times a scale, relative to the scale:
#: poses are written with five digits or more.
_SKEW_AT_MOST = 1e-4
#: How much the three scales of a pose may differ, relative: those that were fitted are equal but
#: for rounding.
_STRETCH_AT_MOST = 1e-3


@dataclass(frozen=True)
class StoredPose:
    """A pose out of a file.

    Attributes
    ----------
    camera_from_mesh
        (4 × 4).
    is_metric
        Whether the file's form says that lengths are metres; not where its verdict is ``refuse``.
    mesh
        What the file says of the mesh (counts, hash), if anything.
    """

    camera_from_mesh: Matrix
    is_metric: bool
    mesh: dict[str, Any] = field(default_factory=dict)


def of_sam3d(
    rotation: ArrayLike, translation: ArrayLike, scale: ArrayLike, where: object = "pose"
) -> Matrix:
    """``camera_from_mesh`` (4 × 4) of a GLB by the pose that SAM 3D Objects gives for it.

    With S = scale · 1 and R the matrix of the quaternion:

        camera_from_mesh = OPENCV_FROM_PYTORCH3D · [S Rᵀ | translation] · ZUP_FROM_YUP

    Parameters
    ----------
    rotation : (4) array_like
        Quaternion, w first.
    translation : (3) array_like
        In units of the point map.
    scale : (3) or (1) array_like
        Units of the point map to one unit of the mesh; the three are equal.
    where
        Its file, for messages.

    Raises
    ------
    SidecarError
        For numbers that are no pose; the message names which.
    """
    quaternion = _numbers(where, "rotation", rotation, (4,))
    shift = _numbers(where, "translation", translation, (3,))
    scales = _numbers(where, "scale", scale, (1, 3))
    length = float(np.linalg.norm(quaternion))
    if length < 1e-6:
        raise expected(where, "rotation", "a quaternion, w first", quaternion.tolist())
    if scales.min() <= 0 or scales.max() > (1 + _STRETCH_AT_MOST) * scales.min():
        wanted = "one positive number, or three that are equal"
        raise expected(where, "scale", wanted, scales.tolist())
    as_columns = _rotation_matrix(quaternion / length).T
    pose = np.eye(4)
    pose[:3, :3] = OPENCV_FROM_PYTORCH3D @ (scales.mean() * as_columns) @ ZUP_FROM_YUP
    pose[:3, 3] = OPENCV_FROM_PYTORCH3D @ shift
    return pose


def similarity(matrix: ArrayLike, where: object, place: str) -> Matrix:
    """A 4 × 4 matrix that is a rotation, a scale and a shift; else a SidecarError."""
    try:
        found = np.array(matrix, dtype=np.float64)
    except (TypeError, ValueError):
        found = np.empty(0)
    if found.shape != (4, 4) or not np.isfinite(found).all():
        raise expected(where, place, "a 4 × 4 matrix of numbers, rows first", _short(matrix))
    if np.abs(found[3] - [0, 0, 0, 1]).max() > 1e-9:
        raise expected(where, place, "0, 0, 0, 1 in the last row", found[3].tolist())
    linear = found[:3, :3]
    scale = _scale(linear)
    skew = linear.T @ linear - scale**2 * np.eye(3)
    if not (scale > 0 and np.abs(skew).max() <= _SKEW_AT_MOST * scale**2):
        wanted = "a rotation times a scale (right-handed) in the first three rows"
        raise expected(where, place, wanted, linear.tolist())
    return found


def scale_of(pose: Matrix) -> float:
    """Lengths of the camera's frame to one of the mesh."""
    return _scale(pose[:3, :3])


def moved(points: NDArray[np.float64], pose: Matrix) -> NDArray[np.float64]:
    """Points (n × 3) in the frame that a pose leads to."""
    return points @ pose[:3, :3].T + pose[:3, 3]


def read_pose(path: str | os.PathLike[str]) -> StoredPose:
    """Reads a pose: ``camera_from_object`` (metres, ours: what `semfm-cli align` writes, or a bare
    4 × 4 matrix), or ``rotation``, ``translation`` and ``scale`` as SAM 3D Objects returned them.

    Raises
    ------
    FileError, FormatError
        If the file cannot be read or is not JSON.
    SidecarError
        If it holds no pose; the message names the file and the field.
    """
    value = read_json(path)
    if isinstance(value, dict) and "rotation" in value:
        for key in ("translation", "scale"):
            if key not in value:
                raise expected(path, key, "a field beside `rotation`", "none")
        pose = of_sam3d(value["rotation"], value["translation"], value["scale"], path)
        return StoredPose(pose, is_metric=False)
    mesh: dict[str, Any] = {}
    place, matrix = "matrix", value
    if isinstance(value, dict):
        place, matrix = "camera_from_object", value.get("camera_from_object")
        if matrix is None:
            wanted = "a 4 × 4 matrix, or `rotation`, `translation` and `scale` of SAM 3D Objects"
            raise expected(path, place, wanted, f"the fields {sorted(value)}")
        mesh = value.get("mesh") or {}
        if not isinstance(mesh, dict):
            raise expected(path, "mesh", "counts and hash of a mesh", _short(mesh))
    # `semfm-reconstruct` says `refuse` where lengths are in a unit that nobody knows.
    is_metric = not (isinstance(value, dict) and value.get("verdict") == "refuse")
    return StoredPose(similarity(matrix, path, place), is_metric, mesh)


def check_mesh(pose: StoredPose, mesh: Mesh, where: object) -> None:
    """Refuses a pose that names another mesh than ``mesh``; raises SidecarError."""
    for name, found in mesh_identity(mesh).items():
        if pose.mesh.get(name, found) != found:
            wanted = f"{found}, as the mesh has it"
            raise expected(where, f"mesh.{name}", wanted, pose.mesh[name])


def _scale(linear: Matrix) -> float:
    """The cube root of the volume; negative for a mirror image."""
    return float(np.cbrt(np.linalg.det(linear)))


def _numbers(
    where: object, name: str, values: Any, lengths: tuple[int, ...]
) -> NDArray[np.float64]:
    """Finite numbers, so many; axes of length 1 around them are dropped, as the batch's."""
    try:
        found = np.asarray(values, dtype=np.float64).reshape(-1)
    except (TypeError, ValueError):
        found = np.empty(0)
    if len(found) not in lengths or not np.isfinite(found).all():
        wanted = f"{' or '.join(map(str, lengths))} finite numbers"
        raise expected(where, name, wanted, _short(values))
    return found


def _rotation_matrix(q: NDArray[np.float64]) -> Matrix:
    """The matrix of a unit quaternion, w first, that turns columns."""
    w, x, y, z = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 200 else text[:200] + " …"
