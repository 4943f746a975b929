"""Writes a ``*.emb.mcap`` file, whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from mcap.writer import CompressionType, Writer

from . import schemas
from .encoder import Grid
from .mcap_records import Message
from .replacing import replacing
from .views_file import METADATA_NAME, ViewRecord

#: The ``format`` entry of an embeddings file's metadata.
EMBEDDINGS_FORMAT = "semfm.embeddings/1"

#: Numbers per dtype name, little-endian as the schema says.
DTYPES = {"f16": "<f2", "f32": "<f4"}


@dataclass(frozen=True)
class EmbeddedView:
    """One view with its embeddings: data (rows × cols × d), coverage and valid (rows × cols)."""

    view: ViewRecord
    grid: Grid
    data: np.ndarray
    coverage: np.ndarray
    valid: np.ndarray


def write_embeddings(
    path: str | os.PathLike[str],
    views: Iterable[EmbeddedView],
    metadata: dict[str, str],
    dtype: str = "f16",
) -> None:
    """Write an embeddings file; nothing is left behind if anything fails on the way.

    The bytes depend on the arguments only: times are the views' own.

    Parameters
    ----------
    path
        Where to; an existing file is replaced at the end.
    views
        In order; may be a generator that does the work meanwhile.
    metadata
        Of the record ``semfm``.
    dtype
        ``f16`` or ``f32``.
    """
    with replacing(path) as file:
        # Such tensors do not compress: lz4 saves nothing, zstd 8 % at a third of the speed.
        writer = Writer(file, compression=CompressionType.NONE, enable_data_crcs=True)
        writer.start(profile="", library="semfm-embed")
        writer.add_metadata(METADATA_NAME, metadata)
        copies = _Copies(writer)
        schema_id = writer.register_schema(
            schemas.PATCH_EMBEDDINGS, "protobuf", schemas.patch_embeddings_schema()
        )
        for embedded in views:
            view = embedded.view
            copies.add(view.camera)
            copies.add(view.tf)
            channel_id = writer.register_channel(
                f"/views/{view.name}/embeddings", "protobuf", schema_id
            )
            writer.add_message(
                channel_id,
                log_time=view.image.log_time,
                publish_time=view.image.publish_time,
                data=_encode(embedded, dtype),
            )
        writer.finish()


def _encode(embedded: EmbeddedView, dtype: str) -> bytes:
    rows, cols, dim = embedded.data.shape
    x0, y0, x1, y1 = embedded.grid.rect
    message = schemas.PatchEmbeddings(
        frame_id=embedded.view.frame_id,
        rows=rows,
        cols=cols,
        dim=dim,
        dtype=dtype,
        data=embedded.data.astype(DTYPES[dtype]).tobytes(),
        x0=x0,
        y0=y0,
        x1=x1,
        y1=y1,
        coverage=embedded.coverage.tobytes(),
        valid=embedded.valid.astype(np.uint8).tobytes(),
    )
    image = schemas.CompressedImage.FromString(embedded.view.image.data)
    message.timestamp.CopyFrom(image.timestamp)
    return message.SerializeToString(deterministic=True)


class _Copies:
    """Copies messages as they are, with their channels and schemas."""

    def __init__(self, writer: Writer) -> None:
        self.writer = writer
        self.schemas: dict[int, int] = {}
        self.channels: dict[int, int] = {}

    def add(self, message: Message) -> None:
        channel, schema = message.channel, message.channel.schema
        assert schema is not None, "read_views checked the schema's name"
        if schema.id not in self.schemas:
            self.schemas[schema.id] = self.writer.register_schema(
                schema.name, schema.encoding, schema.data
            )
        if channel.id not in self.channels:
            self.channels[channel.id] = self.writer.register_channel(
                channel.topic, channel.encoding, self.schemas[schema.id], channel.metadata
            )
        self.writer.add_message(
            self.channels[channel.id],
            log_time=message.log_time,
            publish_time=message.publish_time,
            sequence=message.sequence,
            data=message.data,
        )
