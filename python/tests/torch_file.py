"""Writes what ``torch.save`` wrote before version 1.6, opcode by opcode, without torch."""

from __future__ import annotations

import pickle
import struct
from pathlib import Path

import numpy as np

_STORAGES = {"float32": b"ctorch\nFloatStorage\n", "int64": b"ctorch\nLongStorage\n"}
_ORDERED = b"ccollections\nOrderedDict\n)R"


def write_state_dict(path: Path, tensors: dict[str, np.ndarray], **changes) -> Path:
    """The file; an array whose numbers lie in another order than row by row keeps that order.

    ``changes`` spoil it: ``shape`` replaces every shape, ``names`` the pickle's function.
    """
    path.write_bytes(state_dict_bytes(tensors, **changes))
    return path


def state_dict_bytes(
    tensors: dict[str, np.ndarray],
    shape=None,
    function: bytes = b"torch._utils\n_rebuild_tensor_v2",
) -> bytes:
    items, keys = b"", [str(1000 + i) for i in range(len(tensors))]
    for key, (name, array) in zip(keys, tensors.items()):
        storage = _tuple(
            _text("storage"),
            _STORAGES[array.dtype.name],
            _text(key),
            _text("cpu"),
            _whole(array.size),
            b"N",
        )
        strides = [stride // array.itemsize for stride in array.strides]
        arguments = _tuple(
            storage + b"Q",
            _whole(0),
            _tuple(*map(_whole, array.shape if shape is None else shape)),
            _tuple(*map(_whole, strides)),
            b"\x89",
            _ORDERED,
        )
        items += _text(name) + b"c" + function + b"\n" + arguments + b"R"
    pickles = [
        pickle.dumps(0x1950A86A20F9469CFC6C, 2),
        pickle.dumps(1001, 2),
        pickle.dumps({"protocol_version": 1001, "little_endian": True}, 2),
        b"\x80\x02" + _ORDERED + b"(" + items + b"u.",
        pickle.dumps(keys, 2),
    ]
    storages = [
        struct.pack("<q", array.size) + array.ravel(order="K").tobytes()
        for array in tensors.values()
    ]
    return b"".join(pickles + storages)


def _text(text: str) -> bytes:
    return b"X" + struct.pack("<I", len(text)) + text.encode()


def _whole(number: int) -> bytes:
    return b"J" + struct.pack("<i", number)


def _tuple(*items: bytes) -> bytes:
    return b"(" + b"".join(items) + b"t"
