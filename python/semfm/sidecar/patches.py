"""From raw tokens to patch embeddings: rolls, outlier tokens, unit length, average.

An encoder's features contain the position in the image besides the content, so a long object would
match its own mirror image end for end. Showing every picture rolled by quarter turns and averaging
the grids, rolled back, cancels that.

Some vision transformers put a few tokens of huge norm at places that hold no local information
(Darcet, Oquab, Mairal & Bojanowski, "Vision Transformers Need Registers", 2024; in the SigLIP
family at fixed positions, up to 15 times the median norm). They are told by their raw norm, before
it is divided away.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .encoder import Encoder, Grid
from .errors import SidecarError, expected

#: Quarter turns, counter-clockwise, for each allowed number of rolls.
ROLLS = {1: (0,), 2: (0, 2), 4: (0, 1, 2, 3)}

#: A token is an outlier when its raw norm passes this multiple of its grid's median.
#: Plain tokens of a convolutional network (MobileNetV2, objects on white) reach 3.5 times the
#: median, so 4 is too near; the outliers worth dropping are the ones that reach 15.
OUTLIER_RATIO = 5.0


@dataclass(frozen=True)
class Patches:
    """Embeddings of a batch of pictures.

    ``data`` is (n × rows × cols × d) float32, ``valid`` (n × rows × cols) bool.
    """

    grid: Grid
    data: np.ndarray
    valid: np.ndarray


def embed_pictures(encoder: Encoder, pictures: np.ndarray, rolls: Sequence[int]) -> Patches:
    """Embed a batch of pictures: steps 2 and 3 of :mod:`semfm.sidecar`.

    Parameters
    ----------
    encoder
        Any encoder.
    pictures
        (n × height × width × 3) uint8.
    rolls
        Quarter turns to average over, a value of :data:`ROLLS`.

    Returns
    -------
    Patches
        The average over the rolls in which a patch's token was kept; zero and invalid where it was
        dropped in all of them. Averages are not scaled back to unit length: how much the rolls
        disagree stays visible.
    """
    grid = encoder.grid(*pictures.shape[1:3])
    total: np.ndarray | None = None
    n_valid = np.zeros((len(pictures), grid.rows, grid.cols), np.uint8)
    for turn in rolls:
        rolled = np.ascontiguousarray(np.rot90(pictures, turn, axes=(1, 2)))
        tokens, valid = unit_tokens(encoder.encode(rolled))
        tokens = np.rot90(tokens, -turn, axes=(1, 2))
        valid = np.rot90(valid, -turn, axes=(1, 2))
        if valid.shape != n_valid.shape:
            found = f"{valid.shape[1]}×{valid.shape[2]} after a roll of {90 * turn}°"
            raise expected(encoder.name, "token grid", f"{grid.rows}×{grid.cols}", found)
        total = tokens.copy() if total is None else np.add(total, tokens, out=total)
        n_valid += valid
    assert total is not None, "ROLLS has no empty entry"
    total /= np.maximum(n_valid, 1)[..., None]
    return Patches(grid, total, n_valid > 0)


def unit_tokens(outputs: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Drop outliers, scale every output's token to unit length, concatenate.

    Parameters
    ----------
    outputs
        Raw tokens, (n × rows × cols × d_i) each.

    Returns
    -------
    tokens : numpy.ndarray
        (n × rows × cols × Σd_i) float32, zero where dropped.
    valid : numpy.ndarray
        (n × rows × cols) bool, false where the token of any output is an outlier or zero.
    """
    norms = [np.sqrt(np.einsum("...d,...d->...", tokens, tokens)) for tokens in outputs]
    if not all(np.isfinite(norm).all() for norm in norms):
        raise SidecarError("encoder: tokens: expected finite numbers, found NaN or infinity")
    valid = np.logical_and.reduce([~is_outlier(norm) & (norm > 0) for norm in norms])
    scales = [valid / np.where(norm > 0, norm, 1) for norm in norms]
    scaled = [tokens * scale[..., None] for tokens, scale in zip(outputs, scales)]
    return np.concatenate(scaled, axis=-1).astype(np.float32, copy=False), valid


def is_outlier(norms: np.ndarray) -> np.ndarray:
    """Which raw norms (n × rows × cols) pass :data:`OUTLIER_RATIO` times their grid's median."""
    return norms > OUTLIER_RATIO * np.median(norms, axis=(1, 2), keepdims=True)
