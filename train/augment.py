"""Pictures as the net may meet them: turned, mirrored, of other contrast, on other grounds.

Turns are by quarters, so that patches stay patches. Mirrored pictures keep their target: the
teacher's features tell left from right too weakly to be worth keeping.
"""

from __future__ import annotations

import numpy as np
import torch

from .examples import MEAN, STD, Batch

#: Share of pictures whose white background becomes another grey.
_OTHER_GROUND = 0.15
_CONTRAST, _BRIGHTNESS = 0.12, 0.05


def augmented(batch: Batch, generator: torch.Generator) -> Batch:
    """Another batch of the same objects; pictures become float32 inputs of the net."""
    turned = [_turned(batch, i, generator) for i in range(len(batch.pictures))]
    pictures, targets, weights = (torch.stack(parts) for parts in zip(*turned))
    return Batch(_relit(pictures, generator), targets, weights)


def as_input(pictures: torch.Tensor) -> torch.Tensor:
    """uint8 pictures as inputs of the net: (grey / 255 − mean) / std."""
    return (pictures.float() / 255 - MEAN) / STD


def _turned(batch: Batch, i: int, generator: torch.Generator) -> list[torch.Tensor]:
    turns = int(torch.randint(4, (), generator=generator))
    mirror = bool(torch.randint(2, (), generator=generator))
    parts = []
    for tensor, rows in ((batch.pictures[i], 1), (batch.targets[i], 0), (batch.weights[i], 0)):
        tensor = torch.rot90(tensor, turns, (rows, rows + 1))
        parts.append(tensor.flip(rows + 1) if mirror else tensor)
    return parts


def _relit(pictures: torch.Tensor, generator: torch.Generator) -> torch.Tensor:
    """Each picture through a table of its own: 256 greys to inputs, (n, 256)."""
    n = len(pictures)

    def uniform() -> torch.Tensor:
        return torch.rand(n, 1, generator=generator)

    def normal(std: float) -> torch.Tensor:
        return std * torch.randn(n, 1, generator=generator)

    tables = as_input(torch.arange(256)) * torch.exp(normal(_CONTRAST)) + normal(_BRIGHTNESS)
    other, grey = uniform() < _OTHER_GROUND, 2 * uniform() - 1
    white = as_input(torch.tensor(255.0))
    tables[:, 255:] = torch.where(other, grey, white)  # the background
    # numpy looks bytes up without widening them to indices of 8 bytes
    looked_up = [table[picture] for table, picture in zip(tables.numpy(), pictures.numpy())]
    return torch.from_numpy(np.stack(looked_up))
