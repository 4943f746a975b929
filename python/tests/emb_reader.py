"""Reads an embeddings file back with other people's reader, by the schema inside the file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory


def read_embeddings(path: Path) -> tuple[dict, dict[str, str]]:
    """Topic -> list of decoded messages, and the metadata ``semfm``."""
    topics: dict[str, list] = {}
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        for _, channel, _, message in reader.iter_decoded_messages():
            topics.setdefault(channel.topic, []).append(message)
        metadata = [record.metadata for record in reader.iter_metadata() if record.name == "semfm"]
    assert len(metadata) == 1
    return topics, metadata[0]


def tokens(message) -> np.ndarray:
    """(rows × cols × d) of a PatchEmbeddings message."""
    dtype = {"f16": "<f2", "f32": "<f4"}[message.dtype]
    flat = np.frombuffer(message.data, dtype)
    return flat.reshape(message.rows, message.cols, message.dim).astype(np.float64)


def per_patch(message, name: str) -> np.ndarray:
    """``coverage`` or ``valid`` (rows × cols)."""
    return np.frombuffer(getattr(message, name), np.uint8).reshape(message.rows, message.cols)
