"""The student: a small convolutional net from one grey picture to a grid of tokens.

    picture (n, 1, 224, 224)
      → 4×4/4, 32 → 3×3/2, 64 → residual → 2×2/2, 104 → 4 residuals → 1×1, 64 →
    tokens (n, 64, 14, 14), one for each patch of 16 × 16 pixels

Residual blocks are two 3×3 convolutions; the last four have dilations 1, 2, 1, 2, so that a token
sees the whole object. At first every convolution but the last is followed by a batch norm; later
pieces of training, and the exported net, have convolutions, ReLU and additions alone:
`without_norms` merges each norm into its convolution.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import torch
from torch import nn

SIZE, PATCH = 224, 16
N_TOKENS = SIZE // PATCH
DIM = 64
_WIDTHS = (32, 64, 104)
_DILATIONS = (1, 2, 1, 2)


class ConvNorm(nn.Module):
    """A convolution and its batch norm, or one with a bias in its place."""

    def __init__(
        self, n_in: int, n_out: int, kernel: int, stride=1, padding=0, dilation=1, normed=True
    ) -> None:
        super().__init__()
        self.conv = nn.Conv2d(n_in, n_out, kernel, stride, padding, dilation, bias=not normed)
        self.norm = nn.BatchNorm2d(n_out) if normed else nn.Identity()
        nn.init.kaiming_normal_(self.conv.weight, nonlinearity="relu")

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return self.norm(self.conv(x))


class Residual(nn.Module):
    """relu(x + conv(relu(conv(x)))), of 3×3 convolutions; the first one is dilated."""

    def __init__(self, width: int, dilation: int, normed=True) -> None:
        super().__init__()
        self.first = ConvNorm(width, width, 3, padding=dilation, dilation=dilation, normed=normed)
        self.second = ConvNorm(width, width, 3, padding=1, normed=normed)
        if normed:
            nn.init.zeros_(self.second.norm.weight)  # starts as the identity

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return torch.relu(x + self.second(torch.relu(self.first(x))))


class Student(nn.Module):
    """See the module."""

    def __init__(self, normed: bool = True) -> None:
        super().__init__()
        a, b, c = _WIDTHS
        self.normed = normed
        self.stem = ConvNorm(1, a, 4, stride=4, normed=normed)
        self.down = ConvNorm(a, b, 3, stride=2, padding=1, normed=normed)
        self.fine = Residual(b, 1, normed)
        self.patch = ConvNorm(b, c, 2, stride=2, normed=normed)
        self.coarse = nn.ModuleList(Residual(c, dilation, normed) for dilation in _DILATIONS)
        self.head = nn.Conv2d(c, DIM, 1)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        x = torch.relu(self.stem(x))
        x = self.fine(torch.relu(self.down(x)))
        x = torch.relu(self.patch(x))
        for block in self.coarse:
            x = block(x)
        return self.head(x)


@dataclass(frozen=True)
class Conv:
    """One convolution of the exported net, its batch norm folded in.

    `weight` is (out, in / groups, kernel, kernel), `bias` (out,).
    """

    weight: torch.Tensor
    bias: torch.Tensor
    stride: int
    padding: int
    dilation: int
    relu: bool


@dataclass(frozen=True)
class Save:
    """Remember the current activation."""


@dataclass(frozen=True)
class Add:
    """Add the remembered activation, then ReLU."""

    relu: bool = True


Layer = Conv | Save | Add


def folded(student: Student) -> list[Layer]:
    """The same function as a list of plain layers, in float32."""
    with torch.no_grad():
        return [_detached(layer) for layer in _layers(student)]


def without_norms(student: Student) -> Student:
    """The same function with norms merged into their convolutions, to be trained on."""
    return student_of(folded(student))


def student_of(layers: list[Layer]) -> Student:
    """The net without norms that computes these layers; further outputs of the head are dropped."""
    merged = Student(normed=False)
    convs = [layer for layer in layers if isinstance(layer, Conv)]
    with torch.no_grad():
        # modules are made in the order in which they run, so parameters come in the layers' order
        modules = [m for m in merged.modules() if isinstance(m, nn.Conv2d)]
        for module, conv in zip(modules, convs, strict=True):
            module.weight.copy_(conv.weight[: module.out_channels])
            module.bias.copy_(conv.bias[: module.out_channels])
    return merged


def _layers(student: Student) -> Iterator[Layer]:
    yield _fold(student.stem, relu=True)
    yield _fold(student.down, relu=True)
    yield from _fold_residual(student.fine)
    yield _fold(student.patch, relu=True)
    for block in student.coarse:
        yield from _fold_residual(block)
    head = student.head
    yield Conv(head.weight, head.bias, 1, 0, 1, relu=False)


def _fold_residual(block: Residual) -> Iterator[Layer]:
    yield Save()
    yield _fold(block.first, relu=True)
    yield _fold(block.second, relu=False)
    yield Add()


def _fold(unit: ConvNorm, relu: bool) -> Conv:
    """norm(conv(x)) = γ (w∗x − μ) / √(σ² + ε) + β = (s w)∗x + (β − s μ) with s = γ / √(σ² + ε)."""
    conv, norm = unit.conv, unit.norm
    if isinstance(norm, nn.Identity):
        return Conv(conv.weight, conv.bias, conv.stride[0], conv.padding[0], conv.dilation[0], relu)
    s = norm.weight / torch.sqrt(norm.running_var + norm.eps)
    return Conv(
        conv.weight * s[:, None, None, None],
        norm.bias - s * norm.running_mean,
        conv.stride[0],
        conv.padding[0],
        conv.dilation[0],
        relu,
    )


def _detached(layer: Layer) -> Layer:
    if not isinstance(layer, Conv):
        return layer
    weight, bias = layer.weight.detach().clone(), layer.bias.detach().clone()
    return Conv(weight, bias, layer.stride, layer.padding, layer.dilation, layer.relu)


class Folded(nn.Module):
    """Runs plain layers: what the exported net computes."""

    def __init__(self, layers: list[Layer]) -> None:
        super().__init__()
        self.layers = layers

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        remembered = x
        for layer in self.layers:
            if isinstance(layer, Save):
                remembered = x
            elif isinstance(layer, Add):
                x = x + remembered
                x = torch.relu(x) if layer.relu else x
            else:
                x = nn.functional.conv2d(
                    x, layer.weight, layer.bias, layer.stride, layer.padding, layer.dilation
                )
                x = torch.relu(x) if layer.relu else x
        return x
