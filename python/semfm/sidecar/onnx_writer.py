"""Writes ONNX networks of convolutions, so that the package ``onnx`` need not be installed.

An ONNX file is one protobuf message; the numbers of its fields stand in ``onnx.proto``
(https://github.com/onnx/onnx, version 13 of the operators).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

_FLOAT = 1  # TensorProto.DataType
_INT, _INTS = 2, 7  # AttributeProto.AttributeType
_IR_VERSION, _OPSET = 8, 13


class OnnxWriter:
    """A network that is written operator by operator; values are known by name.

    Parameters
    ----------
    image
        Name of the input, (N × 3 × H × W) float32 of any N, H and W.
    """

    def __init__(self, image: str) -> None:
        self._image = image
        self._nodes: list[bytes] = []
        self._constants: list[bytes] = []
        self._n_values = 0

    def conv(
        self,
        value: str,
        weights: np.ndarray,
        bias: np.ndarray,
        *,
        stride: int = 1,
        dilation: int = 1,
        pads: tuple[int, int],
        groups: int = 1,
    ) -> str:
        """A convolution; ``weights`` (out × in / groups × k × k), ``pads`` before and after, in
        both directions of the picture."""
        attributes = [
            _ints("kernel_shape", weights.shape[2:]),
            _ints("strides", (stride, stride)),
            _ints("dilations", (dilation, dilation)),
            _ints("pads", (pads[0], pads[0], pads[1], pads[1])),
            _text(1, "group") + _number(3, groups) + _number(20, _INT),
        ]
        inputs = [value, self._constant(weights), self._constant(bias)]
        return self._node("Conv", inputs, attributes)

    def clip(self, value: str, low: float, high: float) -> str:
        """Every number raised to ``low`` or lowered to ``high`` where it passes them."""
        limits = [self._constant(np.asarray(limit, np.float32)) for limit in (low, high)]
        return self._node("Clip", [value, *limits])

    def add(self, a: str, b: str) -> str:
        """The sum of two values of one shape."""
        return self._node("Add", [a, b])

    def to_bytes(self, outputs: dict[str, str]) -> bytes:
        """The file. ``outputs`` gives the network's outputs the values that they are."""
        nodes = self._nodes + [
            _node("Identity", [value], name, []) for name, value in outputs.items()
        ]
        graph = b"".join(_bytes(1, node) for node in nodes) + _text(2, "network")
        graph += b"".join(_bytes(5, constant) for constant in self._constants)
        graph += _bytes(11, _grid(self._image, ("N", 3, "H", "W")))
        for name in outputs:
            graph += _bytes(12, _grid(name, ("N", f"{name}_d", f"{name}_h", f"{name}_w")))
        opset = _text(1, "") + _number(2, _OPSET)
        return _number(1, _IR_VERSION) + _text(2, "semfm") + _bytes(7, graph) + _bytes(8, opset)

    def _node(self, operator: str, inputs: list[str], attributes: Sequence[bytes] = ()) -> str:
        output = self._new_name()
        self._nodes.append(_node(operator, inputs, output, attributes))
        return output

    def _constant(self, array: np.ndarray) -> str:
        name = self._new_name()
        dims = b"".join(_number(1, n) for n in array.shape)
        raw = _bytes(9, array.astype("<f4").tobytes())
        self._constants.append(dims + _number(2, _FLOAT) + _text(8, name) + raw)
        return name

    def _new_name(self) -> str:
        self._n_values += 1
        return f"v{self._n_values}"


def _node(operator: str, inputs: list[str], output: str, attributes: Sequence[bytes]) -> bytes:
    names = b"".join(_text(1, name) for name in inputs) + _text(2, output)
    return names + _text(4, operator) + b"".join(_bytes(5, a) for a in attributes)


def _ints(name: str, values: Sequence[int]) -> bytes:
    """An attribute of whole numbers."""
    return _text(1, name) + b"".join(_number(8, value) for value in values) + _number(20, _INTS)


def _grid(name: str, dims: Sequence[int | str]) -> bytes:
    """The type of a float32 array whose free dimensions have names."""
    sizes = [_text(2, dim) if isinstance(dim, str) else _number(1, dim) for dim in dims]
    shape = b"".join(_bytes(1, size) for size in sizes)
    tensor = _number(1, _FLOAT) + _bytes(2, shape)
    return _text(1, name) + _bytes(2, _bytes(1, tensor))


def _number(field: int, value: int) -> bytes:
    return _varint(field << 3) + _varint(value)


def _text(field: int, text: str) -> bytes:
    return _bytes(field, text.encode())


def _bytes(field: int, content: bytes) -> bytes:
    return _varint(field << 3 | 2) + _varint(len(content)) + content


def _varint(value: int) -> bytes:
    """Protobuf's whole numbers: seven bits a byte, the lowest first."""
    found = bytearray()
    while value > 0x7F:
        found.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*found, value])
