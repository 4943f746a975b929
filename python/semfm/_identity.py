"""What names a mesh or a file in reports, so that a mix-up is an error and not a wrong answer."""

from __future__ import annotations

import hashlib
import json
import os
from typing import Any

from PIL import Image

from ._semfm import Mesh, read_file


def mesh_identity(mesh: Mesh) -> dict[str, Any]:
    """The mesh as regions and poses name it: counts and hash."""
    return {"n_vertices": mesh.n_vertices, "n_triangles": mesh.n_faces, "hash": mesh.hash}


def file_identity(path: str | os.PathLike[str]) -> dict[str, str]:
    """A file by its path and the SHA-256 of its bytes; raises FileError."""
    digest = hashlib.sha256(read_file(path)).hexdigest()
    return {"file": os.fspath(path), "hash": f"sha256:{digest}"}


def content_name(decides: Any) -> str:
    """The SHA-256 (hexadecimal) of a JSON value: the name of what it decides in a cache."""
    return hashlib.sha256(json.dumps(decides, sort_keys=True).encode()).hexdigest()


def picture_identity(picture: Image.Image) -> str:
    """A picture by its mode, size and pixels, whatever file it came from: ``sha256:…``."""
    size = f"{picture.mode} {picture.width} {picture.height} ".encode()
    return "sha256:" + hashlib.sha256(size + picture.tobytes()).hexdigest()
