"""What a piece of training leaves behind, and the next one starts from."""

from __future__ import annotations

import os
from dataclasses import asdict, dataclass
from pathlib import Path

import torch

from .examples import Axes
from .net import Student


@dataclass
class Checkpoint:
    """Weights in training, their running mean (the ones to export), the optimiser and the axes.

    `provenance` goes into the exported file: teacher's axes, objects, pictures, seeds, time.
    """

    weights: dict
    mean_weights: dict
    optimiser: dict
    axes: Axes
    provenance: dict

    def student(self) -> Student:
        """The net with its averaged weights, ready to use."""
        return self._load(self.mean_weights).eval()

    def student_in_training(self) -> Student:
        """The net with the weights that the optimiser has reached."""
        return self._load(self.weights)

    @staticmethod
    def _load(weights: dict) -> Student:
        student = Student(normed="stem.norm.weight" in weights)
        student.load_state_dict(weights)
        return student

    def write(self, path: Path) -> None:
        """Whole or not at all."""
        partial = path.with_suffix(".partial")
        content = {name: getattr(self, name) for name in self.__dataclass_fields__}
        torch.save(content | {"axes": asdict(self.axes)}, partial)
        os.replace(partial, path)

    @staticmethod
    def read(path: Path) -> Checkpoint:
        content = torch.load(path, map_location="cpu", weights_only=True)
        return Checkpoint(**(content | {"axes": Axes(**content["axes"])}))
