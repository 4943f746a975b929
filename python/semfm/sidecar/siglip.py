"""SigLIP and SigLIP 2 as encoders: the last hidden state of the vision tower.

Zhai, Mustafa, Kolesnikov & Beyer, "Sigmoid Loss for Language Image Pre-Training", 2023;
Tschannen et al., "SigLIP 2: Multilingual Vision-Language Encoders", 2025.

Fixed-resolution checkpoints of both generations say ``model_type: siglip`` and squeeze every
picture to one size. The NaFlex ones say ``siglip2``: they keep the aspect ratio within a number of
patches and pad the list of patches up to it.
"""

from __future__ import annotations

import numpy as np

from .checkpoint import Checkpoint, describe_processor
from .encoder import Grid
from .errors import expected
from .token_grid import processed_grid


class SiglipEncoder:
    """Fixed resolution (``siglip``): an :class:`.encoder.Encoder`."""

    def __init__(self, checkpoint: Checkpoint) -> None:
        self.name, self.revision = checkpoint.name, checkpoint.revision
        self._checkpoint = checkpoint
        self._processor = checkpoint.processor()
        self._model = checkpoint.model("SiglipVisionModel")
        self.preprocessing = describe_processor(self._processor)

    def grid(self, height: int, width: int) -> Grid:
        """The fixed grid, stretched over the picture."""
        patch = self._model.config.patch_size
        return processed_grid(self.name, self._processor, patch, height, width)

    def encode(self, pictures: np.ndarray) -> list[np.ndarray]:
        """Tokens (n × rows × cols × d)."""
        inputs = self._checkpoint.preprocess(self._processor, pictures)
        tokens = self._checkpoint.last_hidden_state(self._model, inputs)
        grid = self.grid(*pictures.shape[1:3])
        if tokens.shape[1] != grid.rows * grid.cols:
            wanted = f"{grid.rows}×{grid.cols} tokens"
            raise expected(self.name, "last hidden state", wanted, tokens.shape[1])
        return [tokens.reshape(len(tokens), grid.rows, grid.cols, -1)]


class Siglip2NaflexEncoder:
    """Native aspect ratio (``siglip2``): an :class:`.encoder.Encoder`."""

    def __init__(self, checkpoint: Checkpoint) -> None:
        self.name, self.revision = checkpoint.name, checkpoint.revision
        self._checkpoint = checkpoint
        self._processor = checkpoint.processor()
        self._model = checkpoint.model("Siglip2VisionModel")
        self.preprocessing = describe_processor(self._processor)

    def grid(self, height: int, width: int) -> Grid:
        """As many patches as the processor chooses for the size; they tile the whole picture."""
        blank = np.zeros((1, height, width, 3), np.uint8)
        shapes = self._checkpoint.preprocess(self._processor, blank)["spatial_shapes"]
        rows, cols = (int(n) for n in shapes[0])
        return Grid(rows, cols, (0.0, 0.0, float(width), float(height)))

    def encode(self, pictures: np.ndarray) -> list[np.ndarray]:
        """Tokens (n × rows × cols × d), the padding dropped."""
        inputs = self._checkpoint.preprocess(self._processor, pictures)
        rows, cols = (int(n) for n in inputs["spatial_shapes"][0])  # one size, so one shape
        tokens = self._checkpoint.last_hidden_state(self._model, inputs)[:, : rows * cols]
        return [tokens.reshape(len(tokens), rows, cols, -1)]
