"""Reads the weights in a file of ``torch.save``, without torch and without running its code.

Before version 1.6 torch wrote one pickle after the other: a magic number, a protocol, facts about
the machine, the object, the keys of its storages; then the storages, each a count and its numbers.
The object is unpickled with four names allowed and nothing else: a pickle that asks for another
name is refused before anything of it runs.
"""

from __future__ import annotations

import io
import math
import os
import pickle
from collections import OrderedDict
from dataclasses import dataclass
from typing import Any

import numpy as np

from .errors import SidecarError, expected

_MAGIC = 0x1950A86A20F9469CFC6C
_PROTOCOL = 1001


@dataclass(frozen=True)
class _Storage:
    """A row of numbers that stands behind the pickles."""

    key: str
    dtype: str
    n: int


@dataclass(frozen=True)
class _Tensor:
    storage: _Storage
    offset: int
    shape: tuple[int, ...]
    strides: tuple[int, ...]


def read_state_dict(path: str | os.PathLike[str]) -> dict[str, np.ndarray]:
    """The tensors of a ``state_dict`` by name, as ``torch.save`` wrote them before version 1.6.

    Raises
    ------
    SidecarError
        If the file cannot be read, is of another kind, holds anything but tensors of float32 and
        int64, or is shorter or longer than it says.
    """
    path = os.fspath(path)
    try:
        with open(path, "rb") as file:
            content = file.read()
    except OSError as error:
        raise SidecarError(f"{path}: {error.strerror or error}") from error
    file = io.BytesIO(content)
    try:
        header = [_Unpickler(file).load() for _ in range(2)]
        if header != [_MAGIC, _PROTOCOL]:
            raise ValueError("no magic number")
        _machine, named, keys = (_Unpickler(file).load() for _ in range(3))
        if not isinstance(named, dict) or not isinstance(keys, list):
            raise ValueError("no state_dict")
        tensors = {name: tensor for name, tensor in named.items() if isinstance(tensor, _Tensor)}
        if len(tensors) != len(named):
            raise ValueError("other things than tensors in the state_dict")
        storages = _read_storages(content, file.tell(), keys, tensors)
    except Exception as error:  # broken pickles raise whatever they run into
        wanted = "a state_dict by torch.save of version 1.5 or older"
        raise expected(path, "weights", wanted, error) from error
    return {name: _array(storages[t.storage.key], t) for name, t in tensors.items()}


class _Unpickler(pickle.Unpickler):
    """Knows tensors, their storages and ordered dictionaries."""

    _ALLOWED = {
        ("collections", "OrderedDict"): OrderedDict,
        ("torch", "FloatStorage"): "<f4",
        ("torch", "LongStorage"): "<i8",
    }

    def find_class(self, module: str, name: str) -> Any:
        if (module, name) == ("torch._utils", "_rebuild_tensor_v2"):
            return _tensor
        if (module, name) not in self._ALLOWED:
            raise ValueError(f"it asks for {module}.{name}")
        return self._ALLOWED[module, name]

    def persistent_load(self, pid: Any) -> _Storage:
        kind, dtype, key, _device, n, view = pid
        if kind != "storage" or view is not None:
            raise ValueError("a view of a storage")
        return _Storage(str(key), dtype, int(n))


def _tensor(storage: Any, offset: int, shape: Any, strides: Any, *_: Any) -> _Tensor:
    """``torch._utils._rebuild_tensor_v2``; every number must lie in the storage."""
    found = _Tensor(storage, offset, tuple(shape), tuple(strides))
    if not isinstance(storage, _Storage) or len(found.shape) != len(found.strides):
        raise ValueError("a tensor without storage or strides")
    if any(n < 0 for n in (offset, *shape, *strides)) or math.prod(shape) > storage.n:
        raise ValueError("a tensor larger than its storage")
    last = offset + sum((n - 1) * stride for n, stride in zip(shape, strides))
    if math.prod(shape) > 0 and last >= storage.n:
        raise ValueError("a tensor that reaches beyond its storage")
    return found


def _read_storages(
    content: bytes, at: int, keys: list[str], tensors: dict[str, _Tensor]
) -> dict[str, np.ndarray]:
    """The storages in the order of their keys; they fill the rest of the file."""
    known = {tensor.storage.key: tensor.storage for tensor in tensors.values()}
    if sorted(keys) != sorted(known):
        raise ValueError("storages that no tensor uses, or missing ones")
    found = {}
    for key in keys:
        storage = known[key]
        n = int.from_bytes(content[at : at + 8], "little")
        if n != storage.n:
            raise ValueError(f"{n} numbers in a storage of {storage.n}")
        found[key] = np.frombuffer(content, storage.dtype, n, at + 8)
        at += 8 + found[key].nbytes
    if at != len(content):
        raise ValueError(f"{len(content) - at} bytes after the last storage")
    return found


def _array(numbers: np.ndarray, tensor: _Tensor) -> np.ndarray:
    """The tensor, row by row; convolutions that came from TensorFlow lie otherwise in the file."""
    strides = [stride * numbers.itemsize for stride in tensor.strides]
    view = np.lib.stride_tricks.as_strided(numbers[tensor.offset :], tensor.shape, strides)
    return np.ascontiguousarray(view).reshape(tensor.shape)
