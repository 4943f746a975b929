"""Frames of a depth camera, rendered: an object before a wall, as arrays and as files."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import semfm
from PIL import Image

WIDTH, HEIGHT = 320, 240
K = [[300.0, 0.0, 159.5], [0.0, 300.0, 119.5], [0.0, 0.0, 1.0]]
CAMERA = semfm.Pinhole.from_matrix(K, WIDTH, HEIGHT)
#: Metres from the camera to the wall.
WALL = 1.0


def shell(*words: Any, timeout: float = 300) -> subprocess.CompletedProcess[str]:
    """``semfm-cli WORDS`` of this installation."""
    command = [sys.executable, "-m", "semfm", *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, timeout=timeout)


def in_metres(mesh: semfm.Mesh, diagonal: float = 0.25) -> semfm.Mesh:
    """The mesh with its middle at the origin, so many metres across."""
    low, high = mesh.bounds
    scale = diagonal / np.linalg.norm(high - low)
    return semfm.Mesh(scale * (mesh.vertices - (low + high) / 2), mesh.faces)


def turned(mesh: semfm.Mesh, place, degrees: float = 0.0) -> semfm.Mesh:
    """The mesh turned about y and moved."""
    angle = np.radians(degrees)
    turn = [[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]]
    return semfm.Mesh(mesh.vertices @ np.transpose(turn) + place, mesh.faces)


def seen(mesh: semfm.Mesh, **more: Any) -> semfm.Observation:
    """A mesh in the camera's frame as it is seen, depth in whole millimetres, with its mask `object`."""
    view = semfm.render(mesh, [CAMERA], supersampling=1)[0]
    on_object = np.asarray(view.triangles) >= 0
    depth = np.where(on_object, np.where(on_object, view.depth, 0), WALL)
    color = np.where(on_object[..., None], view.rgb, np.uint8(90))
    millimetres = np.round(1e3 * depth).astype(np.uint16)
    return semfm.Observation(K, color=color, depth=millimetres, masks={"object": on_object}, **more)


def write_files(folder: Path, observation: semfm.Observation) -> dict[str, Path]:
    """The files of an observation: color, depth, intrinsics, mask."""
    folder.mkdir(parents=True, exist_ok=True)
    files = {
        "color": folder / "c.png",
        "depth": folder / "d.png",
        "intrinsics": folder / "K.json",
        "mask": folder / "object.png",
    }
    Image.fromarray(np.asarray(observation.color)).save(files["color"])
    millimetres = np.round(1e3 * np.asarray(observation.depth, np.float64)).astype(np.uint16)
    Image.fromarray(millimetres).save(files["depth"])
    files["intrinsics"].write_text(json.dumps({"K": K}))
    mask = np.asarray(observation.masks["object"])
    Image.fromarray(np.where(mask, np.uint8(255), np.uint8(0))).save(files["mask"])
    return files
