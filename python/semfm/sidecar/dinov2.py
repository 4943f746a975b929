"""DINOv2, with and without register tokens, as an encoder: the last hidden state.

Oquab et al., "DINOv2: Learning Robust Visual Features without Supervision", 2023;
Darcet, Oquab, Mairal & Bojanowski, "Vision Transformers Need Registers", 2024.

The usual processor resizes to 256 pixels and crops the central 224, so the grid covers the middle
seven eighths of the picture; its rectangle says so.
"""

from __future__ import annotations

import numpy as np

from .checkpoint import Checkpoint, describe_processor
from .encoder import Grid
from .errors import expected
from .token_grid import processed_grid


class Dinov2Encoder:
    """An :class:`.encoder.Encoder`; drops the class token and the registers."""

    def __init__(self, checkpoint: Checkpoint) -> None:
        self.name, self.revision = checkpoint.name, checkpoint.revision
        self._checkpoint = checkpoint
        self._processor = checkpoint.processor()
        self._model = checkpoint.model("AutoModel")
        self.preprocessing = describe_processor(self._processor)
        self._n_extra = 1 + getattr(self._model.config, "num_register_tokens", 0)

    def grid(self, height: int, width: int) -> Grid:
        """Patches of the cropped picture."""
        patch = self._model.config.patch_size
        return processed_grid(self.name, self._processor, patch, height, width)

    def encode(self, pictures: np.ndarray) -> list[np.ndarray]:
        """Tokens (n × rows × cols × d)."""
        inputs = self._checkpoint.preprocess(self._processor, pictures)
        tokens = self._checkpoint.last_hidden_state(self._model, inputs)[:, self._n_extra :]
        grid = self.grid(*pictures.shape[1:3])
        if tokens.shape[1] != grid.rows * grid.cols:
            wanted = f"{grid.rows}×{grid.cols} patch tokens"
            raise expected(self.name, "last hidden state", wanted, tokens.shape[1])
        return [tokens.reshape(len(tokens), grid.rows, grid.cols, -1)]
