"""The folder of a reconstruction, and the commands that go on from it.

::

    mesh.ply, mesh.glb        the object in its own frame and unit, with colours
    centred.ply               the object at its size, its origin in the middle of its box
    hand.ply                  the hand in the camera's frame, where there is one
    camera_from_object.json   the pose of mesh.ply, `semfm.aligned/1`
    overlay.png               the picture with both drawn over it, where intrinsics are known
    report.json               `semfm.reconstruction/1`, written last
"""

from __future__ import annotations

import json
import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from .._identity import mesh_identity
from .._pictures import png_bytes
from .._semfm import check_output, write_file
from ..sidecar.errors import SidecarError
from .fit import COVERS_AT_LEAST, Fit
from .placed_mesh import PlacedMesh

REPORT_FORMAT = "semfm.reconstruction/1"
#: The form of `semfm-cli align`, whose readers read the pose.
_POSE_FORMAT = "semfm.aligned/1"
_FILES = (
    "mesh.ply",
    "mesh.glb",
    "centred.ply",
    "hand.ply",
    "camera_from_object.json",
    "overlay.png",
    "report.json",
)

_IS_A_GUESS = "the pose is a network's guess from one picture: a start value for `semfm-cli align`"
_NO_METRES = (
    "lengths are in units of the point map that the tool guessed, not metres: give --depth with "
    "--intrinsics and --mask (the drawn object must lie over its mask), or --longest"
)


@dataclass(frozen=True)
class Reconstruction:
    """What was made of one picture.

    Attributes
    ----------
    object
        The object.
    hand
        The hand, in the same camera's frame.
    metres_from
        What makes lengths of the camera's frame metres: ``depth``, ``pose`` (its file says so) or
        ``longest``; None where they are no metres.
    object_fit, hand_fit
        How they agree with the picture, where that could be told.
    overlay
        (height × width × 3) uint8, or None.
    """

    object: PlacedMesh
    hand: PlacedMesh | None
    metres_from: str | None
    object_fit: Fit | None = None
    hand_fit: Fit | None = None
    overlay: NDArray[np.uint8] | None = None

    @property
    def is_metric(self) -> bool:
        """Whether lengths of the camera's frame are metres."""
        return self.metres_from is not None

    def rescaled(self, factor: float, metres_from: str) -> Reconstruction:
        """Object and hand ``factor`` times as large and as far away, which makes lengths metres."""
        hand = self.hand.rescaled(factor) if self.hand else None
        return Reconstruction(self.object.rescaled(factor), hand, metres_from)

    @property
    def reasons(self) -> list[str]:
        """What speaks against the pose, in words; never empty."""
        found = [_IS_A_GUESS] if self.is_metric else [_IS_A_GUESS, _NO_METRES]
        for name, fit in (("object", self.object_fit), ("hand", self.hand_fit)):
            if fit is not None and fit.silhouette_iou < COVERS_AT_LEAST:
                share = f"{100 * fit.silhouette_iou:.0f} %"
                found.append(f"the drawn {name} and its mask overlap by {share}: see overlay.png")
        return found

    def pose_file(self) -> dict[str, Any]:
        """The content of ``camera_from_object.json``: the verdict is `check`, and `refuse` where
        lengths are no metres, so that nobody grasps by it.
        """
        return {
            "format": _POSE_FORMAT,
            "mesh": mesh_identity(self.object.mesh),
            "camera_from_object": self.object.camera_from_mesh.tolist(),
            "scale": self.object.scale,
            "verdict": "check" if self.is_metric else "refuse",
            "reasons": self.reasons,
        }


def check_folder(folder: Path, inputs: Sequence[str]) -> None:
    """Makes the folder; refuses it where a file in it would replace an input or not be written."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SidecarError(f"{folder}: {error.strerror or error}") from error
    for name in _FILES:
        check_output(folder / name, inputs)


def write_folder(folder: Path, made: Reconstruction, report: dict[str, Any]) -> dict[str, Any]:
    """Writes all files, the report last; returns it. Those that an earlier run left and this one
    does not make are removed.
    """
    for name in _FILES[::-1]:  # without its report a folder is unfinished
        (folder / name).unlink(missing_ok=True)
    item, centred = made.object, made.object.centred()
    for name in ("mesh.ply", "mesh.glb"):
        item.mesh.write(folder / name, colors=item.colors)
    centred.mesh.write(folder / "centred.ply", colors=centred.colors)
    if made.hand is not None:
        made.hand.in_camera().write(folder / "hand.ply", colors=made.hand.colors)
    _write_json(folder / "camera_from_object.json", made.pose_file())
    if made.overlay is not None:
        write_file(folder / "overlay.png", png_bytes(Image.fromarray(made.overlay)))
    report = {"format": REPORT_FORMAT, **report, **_measures(made, centred)}
    _write_json(folder / "report.json", report)
    return report


def _measures(made: Reconstruction, centred: PlacedMesh) -> dict[str, Any]:
    item, hand = made.object, made.hand
    return {
        "unit": "metre" if made.is_metric else "point map",
        "metres_from": made.metres_from,
        "object": {
            "mesh": mesh_identity(item.mesh),
            "camera_from_object": item.camera_from_mesh.tolist(),
            "scale": item.scale,
            "size": item.size.tolist(),
            "camera_from_centred": centred.camera_from_mesh.tolist(),
            "fit": made.object_fit.to_dict() if made.object_fit else None,
        },
        "hand": None
        if hand is None
        else {
            "camera_from_hand": hand.camera_from_mesh.tolist(),
            "scale": hand.scale,
            "size": hand.size.tolist(),
            "fit": made.hand_fit.to_dict() if made.hand_fit else None,
        },
        "verdict": made.pose_file()["verdict"],
        "reasons": made.reasons,
    }


@dataclass(frozen=True)
class SeenFiles:
    """The files of the observation as the user named them, for the next commands."""

    mask: str | None = None
    hand_mask: str | None = None
    depth: str | None = None
    intrinsics: str | None = None
    depth_scale: float | None = None


def next_commands(folder: Path, made: Reconstruction, files: SeenFiles) -> list[str]:
    """What to run next: with depth the pose is found by `align`, which starts from ours; then the
    hand's region. Empty where lengths are no metres and there is nothing to find them in.
    """
    mesh, pose = folder / "mesh.ply", folder / "camera_from_object.json"
    commands = []
    if files.depth and files.intrinsics and files.mask:
        aligned = folder / "aligned.json"
        seen = ["--depth", files.depth, "--intrinsics", files.intrinsics, "--mask", files.mask]
        if files.depth_scale is not None:
            seen += ["--depth-scale", f"{files.depth_scale:g}"]
        commands.append(["align", mesh, *seen, "--init", pose, "-o", aligned])
        pose = aligned
    elif not made.is_metric:
        return []
    if made.hand is not None:
        words = ["region", mesh, "--hand", folder / "hand.ply", "--aligned", pose]
        if files.depth and files.intrinsics and files.hand_mask:
            words += ["--hand-depth", files.depth, "--hand-mask", files.hand_mask]
            words += ["--hand-intrinsics", files.intrinsics]
            if files.depth_scale is not None:
                words += ["--hand-depth-scale", f"{files.depth_scale:g}"]
        commands.append([*words, "-o", folder / "grip.json"])
    return [shlex.join(["semfm-cli", *(str(word) for word in words)]) for words in commands]


def _write_json(path: Path, value: dict[str, Any]) -> None:
    write_file(path, (json.dumps(value, indent=1, allow_nan=False) + "\n").encode())
