"""Reads a ``*.views.mcap`` file: pictures, triangle images, cameras, and the mesh if it is there.

Contract: ``/views/NNN/{image,camera,triangles}`` and ``/tf``, NNN from 000 without gaps, and the
metadata record ``semfm``. Messages of cameras, poses and the mesh are not interpreted here beyond
what guards against a foreign file; their bytes and schemas are handed on as they are.
"""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from io import BytesIO
from typing import Any

import numpy as np
from google.protobuf.message import DecodeError
from PIL import Image

from . import schemas
from .errors import expected
from .mcap_reader import read_mcap
from .mcap_records import McapFile, Message

#: Name of our metadata record, and its ``format`` entry in a views file.
METADATA_NAME = "semfm"
VIEWS_FORMAT = "semfm.views/1"
_TOPIC = re.compile(r"/views/(\d{3,})/(image|camera|triangles)")
_SCHEMAS = {
    "image": ("foxglove.CompressedImage", schemas.CompressedImage),
    "camera": ("foxglove.CameraCalibration", schemas.CameraCalibration),
    "triangles": ("foxglove.RawImage", schemas.RawImage),
    "tf": ("foxglove.FrameTransform", schemas.FrameTransform),
    "mesh": ("foxglove.SceneUpdate", schemas.SceneUpdate),
}


@dataclass(frozen=True)
class ViewRecord:
    """One view: its picture, the triangle seen in each pixel, and the messages to hand on."""

    name: str  # "000"
    rgb: np.ndarray  # (height × width × 3) uint8
    triangles: np.ndarray  # (height × width) int32, as in the mesh; −1 on the background
    image: Message
    camera: Message
    tf: Message

    @property
    def on_object(self) -> np.ndarray:
        """Where a triangle is seen, (height × width) bool."""
        return self.triangles >= 0

    @property
    def frame_id(self) -> str:
        """The camera's frame on /tf."""
        return f"view_{self.name}"


@dataclass(frozen=True)
class ViewsFile:
    """A checked views file: views in order, all of one size, and the metadata ``semfm``."""

    path: str
    views: list[ViewRecord]
    metadata: dict[str, str]
    mesh: Message | None = None  # /mesh: the object, a foxglove.SceneUpdate

    @property
    def size(self) -> tuple[int, int]:
        """Height and width of every picture, in pixels."""
        return self.views[0].rgb.shape[0], self.views[0].rgb.shape[1]


def read_views(path: str | os.PathLike[str]) -> ViewsFile:
    """Read and check a views file.

    Raises
    ------
    SidecarError
        If the file is damaged (see :func:`.read_mcap`) or is not a views file of ours.
    """
    name = os.fspath(path)
    file = read_mcap(name)
    metadata = _metadata(name, file)
    by_view, tf, mesh = _sort(name, file)
    if not by_view:
        raise expected(name, "topics", "/views/NNN/image from NNN = 000", "no views")
    views = []
    for i, number in enumerate(sorted(by_view)):
        if number != i:
            raise expected(name, "topics", f"/views/{i:03}/…", f"/views/{number:03}/…")
        views.append(_view(name, f"{i:03}", by_view[number], tf))
    if unknown := sorted(set(tf) - {view.frame_id for view in views}):
        raise expected(name, "/tf", "frames of the file's own views", ", ".join(unknown))
    sizes = {view.rgb.shape[:2] for view in views}
    if len(sizes) > 1:
        raise expected(name, "images", "one size", ", ".join(f"{w}×{h}" for h, w in sorted(sizes)))
    (height, width), n_views = views[0].rgb.shape[:2], len(views)
    for key, value in (("n_views", n_views), ("width", width), ("height", height)):
        if metadata.get(key) != str(value):
            raise expected(name, f"metadata {key}", value, repr(metadata.get(key)))
    return ViewsFile(name, views, metadata, mesh)


def _metadata(path: str, file: McapFile) -> dict[str, str]:
    found = [pairs for name, pairs in file.metadata if name == METADATA_NAME]
    if len(found) != 1:
        raise expected(path, "metadata", f"one record '{METADATA_NAME}' (a views file)", len(found))
    if (form := found[0].get("format")) != VIEWS_FORMAT:
        raise expected(path, "metadata format", f"'{VIEWS_FORMAT}'", repr(form))
    return found[0]


def _sort(
    path: str, file: McapFile
) -> tuple[dict[int, dict[str, Message]], dict[str, Message], Message | None]:
    """Messages by view and kind, poses by frame, and the mesh; each there at most once."""
    by_view: dict[int, dict[str, Message]] = {}
    tf: dict[str, Message] = {}
    mesh: dict[str, Message] = {}
    for message in file.messages:
        topic = message.channel.topic
        if topic == "/tf":
            kind, slots = decode(path, "tf", message).child_frame_id, tf
        elif topic == "/mesh":
            kind, slots = "mesh", mesh
        elif match := _TOPIC.fullmatch(topic):
            kind, slots = match[2], by_view.setdefault(int(match[1]), {})
        else:
            continue
        if kind in slots:
            raise expected(path, topic, f"one message ({kind})", "a second one")
        slots[kind] = message
    return by_view, tf, mesh.get("mesh")


def decode(path: str, kind: str, message: Message) -> Any:
    """The message as its schema's class; ``kind``: image, camera, triangles, tf or mesh."""
    wanted, message_class = _SCHEMAS[kind]
    channel = message.channel
    found = channel.schema.name if channel.schema else "none"
    if (channel.encoding, found) != ("protobuf", wanted):
        raise expected(path, channel.topic, f"protobuf {wanted}", f"{channel.encoding} {found}")
    try:
        return message_class.FromString(message.data)
    except DecodeError as error:
        raise expected(path, channel.topic, f"a sound {wanted}", error) from error


def _view(path: str, name: str, kinds: dict[str, Message], tf: dict[str, Message]) -> ViewRecord:
    topic = f"/views/{name}"
    for kind in ("image", "camera", "triangles"):
        if kind not in kinds:
            raise expected(path, f"{topic}/{kind}", "one message", "none")
    if f"view_{name}" not in tf:
        raise expected(path, "/tf", f"the pose of view_{name}", "none")
    camera = decode(path, "camera", kinds["camera"])
    if len(camera.K) != 9:
        raise expected(path, f"{topic}/camera", "K with 9 numbers", len(camera.K))
    size = (camera.height, camera.width)
    rgb = _picture(path, f"{topic}/image", decode(path, "image", kinds["image"]), size)
    raw = decode(path, "triangles", kinds["triangles"])
    triangles = _triangles(path, f"{topic}/triangles", raw, size)
    return ViewRecord(name, rgb, triangles, kinds["image"], kinds["camera"], tf[f"view_{name}"])


def _picture(path: str, place: str, message: Any, size: tuple[int, int]) -> np.ndarray:
    if message.format != "png":
        raise expected(path, place, "format png", repr(message.format))
    try:
        with Image.open(BytesIO(message.data), formats=["PNG"]) as picture:
            if (picture.height, picture.width) != size:
                wanted = f"the camera's {size[1]}×{size[0]} pixels"
                raise expected(path, place, wanted, f"{picture.width}×{picture.height}")
            if picture.mode != "RGB":
                raise expected(path, place, "8-bit RGB", f"mode {picture.mode}")
            return np.asarray(picture)
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        raise expected(path, place, "a sound PNG", error) from error


def _triangles(path: str, place: str, raw: Any, size: tuple[int, int]) -> np.ndarray:
    """Triangle of every pixel (height × width) int32, −1 on the background."""
    height, width = size
    if raw.encoding != "32SC1":
        raise expected(path, place, "encoding 32SC1", repr(raw.encoding))
    if (raw.height, raw.width) != size:
        raise expected(path, place, f"{width}×{height} pixels", f"{raw.width}×{raw.height}")
    if raw.step < 4 * width or raw.step % 4 or len(raw.data) != raw.step * height:
        found = f"step {raw.step} and {len(raw.data)} bytes"
        raise expected(path, place, f"{height} rows of at least {4 * width} bytes", found)
    return np.frombuffer(raw.data, "<i4").reshape(height, raw.step // 4)[:, :width]
