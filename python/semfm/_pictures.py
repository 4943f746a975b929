"""Pictures as bytes of a file."""

from __future__ import annotations

from io import BytesIO

from PIL import Image


def png_bytes(picture: Image.Image) -> bytes:
    """A picture as the bytes of a PNG file."""
    buffer = BytesIO()
    picture.save(buffer, "PNG")
    return buffer.getvalue()
