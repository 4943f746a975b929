"""The files that an ONNX network keeps its weights in, beside the network itself.

A tensor may lie in another file, which the network names: ``TensorProto.external_data`` with the
key ``location`` (onnx.proto3 of ONNX 1.14). Only the fields on the way to those tensors are read
here; all others, weights among them, are passed over by their length.
"""

from __future__ import annotations

import os
from collections.abc import Iterator

from .errors import expected

#: Field numbers of each message that lead to a tensor, and the message that each holds.
_FIELDS = {
    "Model": {7: "Graph", 25: "Function"},
    "Graph": {1: "Node", 5: "Tensor", 15: "SparseTensor"},
    "Function": {7: "Node", 11: "Attribute"},
    "Node": {5: "Attribute"},
    "Attribute": {
        5: "Tensor",
        6: "Graph",
        10: "Tensor",
        11: "Graph",
        22: "SparseTensor",
        23: "SparseTensor",
    },
    "SparseTensor": {1: "Tensor", 2: "Tensor"},
    "Tensor": {13: "Entry"},
}
_ORT_FORMAT = b"ORTM"
#: Graphs lie in attributes of nodes of graphs; no real network goes as deep.
_DEEPEST = 64


def external_files(network: str | os.PathLike[str], content: bytes) -> list[str]:
    """The paths of the files with weights of a network, in order of their names.

    Parameters
    ----------
    network
        The network's file.
    content
        Its bytes.

    Raises
    ------
    SidecarError
        If the file is no ONNX network, or names weights outside of its folder.
    """
    if content[4:8] == _ORT_FORMAT:
        return []  # onnxruntime's own format keeps its weights inside
    try:
        found = set(_locations(memoryview(content), "Model", 0))
    except (IndexError, ValueError) as error:  # UnicodeDecodeError is a ValueError
        raise expected(os.fspath(network), "model", "an ONNX network", error) from error
    folder = os.path.dirname(network)
    for location in sorted(found):
        parts = location.replace("\\", "/").split("/")
        if os.path.isabs(location) or ".." in parts or "\0" in location:
            wanted = "weights inside the folder of the network"
            raise expected(os.fspath(network), "external data", wanted, repr(location))
    return [os.path.join(folder, location) for location in sorted(found)]


def _locations(message: memoryview, kind: str, depth: int) -> Iterator[str]:
    """The locations that a message and those inside it name."""
    if depth > _DEEPEST:
        raise ValueError(f"messages more than {_DEEPEST} deep")
    for number, value in _messages(message):
        inner = _FIELDS[kind].get(number)
        if inner == "Entry":
            entry = dict(_messages(value))
            if bytes(entry.get(1, b"")) == b"location":
                yield bytes(entry.get(2, b"")).decode()
        elif inner is not None:
            yield from _locations(value, inner, depth + 1)


def _messages(message: memoryview) -> Iterator[tuple[int, memoryview]]:
    """Number and bytes of each field with a length (wire type 2)."""
    at = 0
    while at < len(message):
        tag, at = _varint(message, at)
        wire = tag & 7
        if wire == 0:
            _, at = _varint(message, at)
        elif wire in (1, 5):
            at += 8 if wire == 1 else 4
        elif wire == 2:
            length, at = _varint(message, at)
            if at + length > len(message):
                raise ValueError(f"a field of {length} bytes with {len(message) - at} left")
            yield tag >> 3, message[at : at + length]
            at += length
        else:
            raise ValueError(f"wire type {wire} at byte {at}")


def _varint(message: memoryview, at: int) -> tuple[int, int]:
    """A number of seven bits a byte, and where it ends."""
    value = shift = 0
    while True:
        byte = message[at]
        value |= (byte & 127) << shift
        at += 1
        if byte < 128:
            return value, at
        shift += 7
        if shift > 63:
            raise ValueError(f"a number of more than 64 bits at byte {at}")
