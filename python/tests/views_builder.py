"""Writes small views files as FORMATS asks, with other people's schema classes."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path

import numpy as np
from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage
from mcap.writer import CompressionType
from mcap_protobuf.writer import Writer
from PIL import Image

METADATA = {
    "format": "semfm.views/1",
    "mesh_hash": f"blake3:{0:064}",
    "n_vertices": "8",
    "n_triangles": "24",
    "rig": "by hand",
    "seed": "7",
}


def png(rgb: np.ndarray) -> bytes:
    buffer = BytesIO()
    Image.fromarray(rgb).save(buffer, "PNG")
    return buffer.getvalue()


def view_messages(name: str, rgb: np.ndarray, on_object: np.ndarray) -> dict:
    """Topic -> message of one view."""
    height, width = on_object.shape
    frame = f"view_{name}"
    camera = CameraCalibration(frame_id=frame, width=width, height=height)
    camera.K.extend([width, 0, width / 2, 0, width, height / 2, 0, 0, 1])
    camera.R.extend([1, 0, 0, 0, 1, 0, 0, 0, 1])
    camera.P.extend([width, 0, width / 2, 0, 0, width, height / 2, 0, 0, 0, 1, 0])
    tf = FrameTransform(parent_frame_id="object", child_frame_id=frame)
    tf.translation.z, tf.rotation.w = -3.0 - int(name), 1.0
    image = CompressedImage(frame_id=frame, format="png", data=png(rgb))
    image.timestamp.seconds = 5
    triangles = np.where(on_object, 17, -1).astype("<i4")
    depth = np.where(on_object, 3.0, np.inf).astype("<f4")
    raw = {"frame_id": frame, "width": width, "height": height, "step": 4 * width}
    return {
        f"/views/{name}/image": image,
        f"/views/{name}/camera": camera,
        f"/views/{name}/depth": RawImage(encoding="32FC1", data=depth.tobytes(), **raw),
        f"/views/{name}/triangles": RawImage(encoding="32SC1", data=triangles.tobytes(), **raw),
        "/tf": tf,
    }


def write_views(
    path: Path,
    pictures: list[np.ndarray],
    masks: list[np.ndarray],
    change=lambda messages: messages,
    metadata: dict[str, str] | None = METADATA,
    compression: CompressionType = CompressionType.LZ4,
) -> Path:
    """A views file of pictures (height × width × 3) and masks (height × width).

    ``change`` may edit the list of (topic, message) before it is written. Number and size of the
    views are added to ``metadata`` where it does not say otherwise.
    """
    messages = []
    for i, (rgb, mask) in enumerate(zip(pictures, masks)):
        messages += view_messages(f"{i:03}", rgb, mask).items()
    with path.open("wb") as file, Writer(file, compression=compression) as writer:
        for n, (topic, message) in enumerate(change(messages)):
            writer.write_message(topic, message, log_time=1000 + n, publish_time=2000 + n)
        if metadata is not None:
            height, width = masks[0].shape
            counts = {"n_views": str(len(masks)), "width": str(width), "height": str(height)}
            writer._writer.add_metadata("semfm", {**counts, **metadata})
    return path


def asymmetric_picture(height: int, width: int, patch: int, seed: int = 3) -> np.ndarray:
    """Each patch has a colour of its own, so any mix-up of patches shows."""
    colours = np.random.default_rng(seed).integers(30, 255, (height // patch, width // patch, 3))
    return np.repeat(np.repeat(colours, patch, 0), patch, 1).astype(np.uint8)


def disc(height: int, width: int) -> np.ndarray:
    """An object a little off the middle."""
    y, x = np.mgrid[:height, :width]
    return (x - 0.45 * width) ** 2 + (y - 0.6 * height) ** 2 < (0.3 * height) ** 2
