"""What the camera saw: picture, masks, and depth as a point map.

All files are read by ``semfm-cli frames``, as everywhere in SemFM: it checks sizes, units and
masks, takes the lens's distortion out, and names what is wrong with a file.
"""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Union

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from .._cli import run_semfm_cli
from .._semfm import Pinhole
from ..sidecar.errors import SidecarError, expected

_Path = Union[str, "os.PathLike[str]"]

#: Pixels of an object with a depth, at least: fewer tell neither its place nor its size.
RETURNS_AT_LEAST = 30


@dataclass(frozen=True)
class Seen:
    """One picture (height × width) with what belongs to it, without distortion.

    Attributes
    ----------
    picture
        (height × width × 3) uint8, sRGB.
    masks
        (height × width) bool each, in the order in which they were named.
    depth
        (height × width) float64, metres, NaN where nothing came back; None where there is no depth.
    camera
        None where no intrinsics are known.
    notes
        What the reader had to say.
    """

    picture: NDArray[np.uint8]
    masks: list[NDArray[np.bool_]]
    depth: NDArray[np.float64] | None
    camera: Pinhole | None
    notes: list[str]

    def point_map(self) -> NDArray[np.float32] | None:
        """(height × width × 3): the point that each pixel saw, in the camera's frame (x right, y
        down, z forward), metres; NaN where nothing came back. None where there is no depth.
        """
        if self.depth is None or self.camera is None:
            return None
        height, width = self.depth.shape
        # The centre of pixel (row, column) lies at (column + ½, row + ½).
        rows, columns = np.indices((height, width)) + 0.5
        pixels = np.stack([columns.ravel(), rows.ravel()], axis=1)
        rays = self.camera.rays(pixels).reshape(height, width, 3)
        return (self.depth[:, :, None] * rays).astype(np.float32)

    def check_returns(self, mask: NDArray[np.bool_], name: str) -> None:
        """Refuses a mask under which fewer than :data:`RETURNS_AT_LEAST` pixels have a depth, where
        there is depth; raises SidecarError.
        """
        if self.depth is None:
            return
        n_returns = int(np.isfinite(self.depth[mask]).sum())
        if n_returns < RETURNS_AT_LEAST:
            wanted = f"at least {RETURNS_AT_LEAST} pixels under it with a depth"
            raise expected(name, "mask", wanted, f"{n_returns} of {int(mask.sum())}")


def read_seen(
    picture: _Path,
    masks: Sequence[str],
    intrinsics: _Path | None = None,
    depth: _Path | None = None,
    depth_scale: float | None = None,
) -> Seen:
    """Reads what a camera saw.

    Parameters
    ----------
    picture
        PNG or JPEG.
    masks
        ``FILE`` or ``FILE#LABEL`` each, of the picture's size, as `semfm-cli` reads them.
    intrinsics
        The camera; needed with depth.
    depth
        Registered to the picture.
    depth_scale
        Units of the depth to the metre; 1000 for whole numbers and 1 for floats by default.

    Raises
    ------
    SidecarError
        For what is not as it must be, in the words of `semfm-cli`.
    """
    if depth is not None and intrinsics is None:
        raise expected("--depth", "camera", "--intrinsics beside it", "none")
    with tempfile.TemporaryDirectory() as folder:
        calibration = intrinsics or _any_camera(Path(folder), picture)
        scene = Path(folder, "scene")
        words = [
            "frames",
            f"--color={os.fspath(picture)}",
            f"--intrinsics={os.fspath(calibration)}",
        ]
        words += [f"--mask={mask}" for mask in masks]
        if depth is not None:
            words.append(f"--depth={os.fspath(depth)}")
        if depth_scale is not None:
            words.append(f"--depth-scale={depth_scale}")
        notes = run_semfm_cli([*words, "--quiet", "-o", os.fspath(scene)]).messages
        seen = _read_scene(scene, len(masks), intrinsics is not None, notes)
    return seen


def _any_camera(folder: Path, picture: _Path) -> Path:
    """A camera for the reader, where none is known: without distortion it changes no pixel."""
    try:
        with Image.open(picture) as image:
            width, height = image.size
    except (OSError, ValueError, Image.DecompressionBombError) as error:
        raise SidecarError(f"{os.fspath(picture)}: not a picture: {error}") from error
    camera = {"fx": width, "fy": width, "cx": (width - 1) / 2, "cy": (height - 1) / 2}
    path = folder / "K.json"
    path.write_text(json.dumps(camera))
    return path


def _read_scene(folder: Path, n_masks: int, has_camera: bool, notes: list[str]) -> Seen:
    """The one image of a BOP scene as `semfm-cli` has just written it."""
    record = json.loads((folder / "scene_camera.json").read_text())["0"]
    picture = np.asarray(Image.open(folder / "rgb/000000.png").convert("RGB"))
    masks = [
        np.asarray(Image.open(folder / f"mask_visib/000000_{i:06}.png")) >= 128
        for i in range(n_masks)
    ]
    height, width = picture.shape[:2]
    depth = None
    if "depth_scale" in record:
        counts = np.asarray(Image.open(folder / "depth/000000.png")).astype(np.float64)
        depth = np.where(counts > 0, counts * record["depth_scale"] / 1000, np.nan)
    matrix = np.array(record["cam_K"]).reshape(3, 3)
    camera = Pinhole.from_matrix(matrix, width, height) if has_camera else None
    return Seen(picture, masks, depth, camera, notes)
