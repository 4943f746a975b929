"""The training set in memory: pictures as bytes, targets as the tokens a patch should get.

The target of a patch is the mean of the fused field over the points seen in it, on the first 64
principal axes of all fused fields; its weight is the share of the patch that the object covers,
doubled and cut at one. Pictures are given a target in every turn: the fused field does not turn.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from .net import DIM, N_TOKENS

#: Grey of the picture that becomes 0 in the net's input, and that becomes 1 (of 0 to 1).
MEAN, STD = 0.5, 0.5


@dataclass(frozen=True)
class Axes:
    """Principal axes of the teacher's fused fields: z = (f − mean) · axes / scale.

    `mean` (d,), `axes` (d, 64) orthonormal, `scale`: root mean square length of the projected
    features, so that z has length 1 on average; `kept` is the share of variance that is kept.
    """

    mean: torch.Tensor
    axes: torch.Tensor
    scale: float
    kept: float

    @staticmethod
    def fit(features: np.ndarray) -> Axes:
        """Of features (n, d)."""
        mean = features.mean(0)
        variances, vectors = np.linalg.eigh(np.cov((features - mean).T))
        kept = variances[::-1][:DIM].sum()
        return Axes(
            torch.from_numpy(mean.astype(np.float32)),
            torch.from_numpy(vectors[:, ::-1][:, :DIM].astype(np.float32).copy()),
            float(np.sqrt(kept)),
            float(kept / variances.sum()),
        )

    def project(self, features: np.ndarray) -> np.ndarray:
        """Features (k, d) on the axes, (k, 64) float32."""
        return (features.astype(np.float32) - self.mean.numpy()) @ self.axes.numpy() / self.scale


@dataclass
class Examples:
    """Pictures (n, 224, 224) uint8, targets (n, 14, 14, 64) float16, weights (n, 14, 14) uint8.

    Kept as one array per object: objects are added while training goes on.
    """

    pictures: list[np.ndarray]
    targets: list[np.ndarray]
    weights: list[np.ndarray]
    files: set[str]

    @staticmethod
    def empty() -> Examples:
        return Examples([], [], [], set())

    def __len__(self) -> int:
        return sum(len(pictures) for pictures in self.pictures)

    def load_new(self, paths: list[Path], axes: Axes, limit: int | None = None) -> int:
        """Adds files that were not among those of earlier calls, at most `limit`; how many."""
        new = [path for path in paths if path.name not in self.files][:limit]
        for path in new:
            with np.load(path) as arrays:
                field = axes.project(arrays["features"])
                targets, weights = patch_targets(arrays["sample"], field)
                self.pictures.append(arrays["grey"])
            self.targets.append(targets)
            self.weights.append(weights)
            self.files.add(path.name)
        return len(new)

    def shuffled(self, rng: np.random.Generator) -> np.ndarray:
        """Every (object, picture) once, in random order, (n, 2)."""
        pairs = [(i, j) for i, pictures in enumerate(self.pictures) for j in range(len(pictures))]
        return rng.permutation(np.array(pairs))

    def batch(self, pairs: np.ndarray) -> Batch:
        """The pictures of pairs (object, picture), as tensors."""
        return Batch(
            torch.from_numpy(np.stack([self.pictures[i][j] for i, j in pairs]))[:, None],
            torch.from_numpy(np.stack([self.targets[i][j] for i, j in pairs])),
            torch.from_numpy(np.stack([self.weights[i][j] for i, j in pairs])),
        )


@dataclass(frozen=True)
class Batch:
    """`pictures` (n, 1, 224, 224) uint8, `targets` (n, 14, 14, 64), `weights` (n, 14, 14) uint8."""

    pictures: torch.Tensor
    targets: torch.Tensor
    weights: torch.Tensor


def patch_targets(sample: np.ndarray, field: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Targets (v, 14, 14, 64) float16 and weights (v, 14, 14) uint8 of an object's pictures.

    `sample` is (v, 56, 56), the point of the field (k, 64) under every fourth pixel.
    """
    v, side = sample.shape[0], sample.shape[1] // N_TOKENS
    inside = sample >= 0
    blocks = (v, N_TOKENS, side, N_TOKENS, side)
    count = inside.reshape(blocks).sum((2, 4))
    patch = np.arange(v * N_TOKENS**2).reshape(v, N_TOKENS, 1, N_TOKENS, 1)
    patch = np.broadcast_to(patch, blocks).reshape(sample.shape)
    order = patch[inside].argsort(kind="stable")
    patches, starts = np.unique(patch[inside][order], return_index=True)
    targets = np.zeros((v * N_TOKENS**2, DIM), np.float32)
    if len(patches):
        targets[patches] = np.add.reduceat(field[sample[inside][order]], starts, axis=0)
    targets = targets.reshape(v, N_TOKENS, N_TOKENS, DIM) / np.maximum(count, 1)[..., None]
    weights = np.minimum(2 * 255 * count // side**2, 255)
    return targets.astype(np.float16), weights.astype(np.uint8)


def fit_axes(folder: Path, pattern: str, per_object: int = 150) -> Axes:
    """Principal axes of the fused fields that lie in a folder."""
    chosen = []
    for path in sorted(folder.glob(pattern)):
        with np.load(path) as arrays:
            features = arrays["features"]
        chosen.append(features[:: max(1, len(features) // per_object)].astype(np.float32))
    if not chosen:
        raise SystemExit(
            f"{folder}: expected training objects {pattern}, found none: run train.dataset"
        )
    return Axes.fit(np.concatenate(chosen))
