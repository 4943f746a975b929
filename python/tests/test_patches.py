"""Rolls, outliers, unit length, coverage, grids: properties on encoders made for the purpose."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from semfm.sidecar.coverage import patch_coverage
from semfm.sidecar.encoder import Grid
from semfm.sidecar.errors import SidecarError
from semfm.sidecar.patches import OUTLIER_RATIO, ROLLS, embed_pictures, is_outlier, unit_tokens
from semfm.sidecar.token_grid import processed_grid
from views_builder import asymmetric_picture, disc


class ColourEncoder:
    """The colour of every 4-pixel patch, plus what ``extra`` adds at each grid position."""

    name, revision, preprocessing = "colour", "0", "{}"

    def __init__(self, extra=None):
        self.extra, self.calls = extra, []

    def grid(self, height, width):
        return Grid(height // 4, width // 4, (0.0, 0.0, float(width), float(height)))

    def encode(self, pictures):
        self.calls.append(pictures.shape)
        tokens = pictures[:, ::4, ::4].astype(np.float32)
        return [tokens if self.extra is None else self.extra(tokens)]


def unit(x):
    return x / np.linalg.norm(x, axis=-1, keepdims=True)


def test_grids_are_rolled_back_so_an_equivariant_encoder_does_not_see_rolls():
    pictures = np.stack([asymmetric_picture(24, 32, 4, seed) for seed in (1, 2)])
    encoder = ColourEncoder()
    result = embed_pictures(encoder, pictures, ROLLS[4])
    assert encoder.calls == [(2, 24, 32, 3), (2, 32, 24, 3)] * 2
    assert result.valid.all() and result.data.shape == (2, 6, 8, 3)
    np.testing.assert_allclose(result.data, unit(pictures[:, ::4, ::4].astype(float)), atol=1e-6)


def test_rolls_cancel_what_the_encoder_says_about_position():
    def position(tokens):
        tokens = np.zeros_like(tokens)
        tokens[..., 0] = np.linspace(-1, 1, tokens.shape[1])[:, None]  # "how far down I am"
        tokens[..., 1] = np.sqrt(1 - tokens[..., 0] ** 2)
        return tokens

    picture = asymmetric_picture(32, 32, 4)[None]
    once = embed_pictures(ColourEncoder(position), picture, ROLLS[1]).data
    four = embed_pictures(ColourEncoder(position), picture, ROLLS[4]).data
    assert np.ptp(once[..., 0]) == pytest.approx(2)
    np.testing.assert_allclose(four[..., 0], 0, atol=1e-6)


def test_an_outlier_at_a_fixed_position_is_dropped_in_its_roll_and_mended_by_the_others():
    def outlier(tokens):
        tokens = tokens.copy()
        tokens[:, 1, 2] = 15 * np.linalg.norm(tokens, axis=-1).max()
        return tokens

    picture = asymmetric_picture(32, 32, 4)[None]
    one = embed_pictures(ColourEncoder(outlier), picture, ROLLS[1])
    assert np.argwhere(~one.valid[0]).tolist() == [[1, 2]]
    assert not one.data[0, 1, 2].any(), "an invalid cell holds zeros"
    four = embed_pictures(ColourEncoder(outlier), picture, ROLLS[4])
    clean = embed_pictures(ColourEncoder(), picture, ROLLS[4])
    assert four.valid.all()
    np.testing.assert_allclose(four.data, clean.data, atol=1e-6)


def test_a_patch_dropped_in_every_roll_is_invalid():
    def centre(tokens):
        tokens = tokens.copy()
        tokens[:, 2, 2] *= 1000
        return tokens

    result = embed_pictures(ColourEncoder(centre), asymmetric_picture(20, 20, 4)[None], ROLLS[4])
    assert np.argwhere(~result.valid[0]).tolist() == [[2, 2]]
    assert not result.data[0, 2, 2].any()


def test_the_outlier_rule_is_relative_to_the_median_of_its_own_grid():
    norms = np.ones((2, 3, 3))
    norms[0, 0, 0], norms[0, 0, 1] = 1.01 * OUTLIER_RATIO, 0.99 * OUTLIER_RATIO
    norms[1] *= 100
    assert np.argwhere(is_outlier(norms)).tolist() == [[0, 0, 0]]


def test_each_output_has_unit_length_before_they_are_joined():
    rng = np.random.default_rng(0)
    outputs = [rng.normal(size=(2, 3, 4, 5)), 100 * rng.normal(size=(2, 3, 4, 2))]
    outputs = [o.astype(np.float32) for o in outputs]
    outputs[1][0, 0, 0] = 0  # no direction
    tokens, valid = unit_tokens(outputs)
    assert tokens.shape == (2, 3, 4, 7) and tokens.dtype == np.float32
    assert np.argwhere(~valid).tolist() == [[0, 0, 0]]
    for part in (tokens[..., :5], tokens[..., 5:]):
        np.testing.assert_allclose(np.linalg.norm(part, axis=-1)[valid], 1, rtol=1e-6)


def test_nan_from_the_encoder_is_an_error():
    bad = np.ones((1, 2, 2, 3), np.float32)
    bad[0, 1, 1, 1] = np.nan
    with pytest.raises(SidecarError, match="finite"):
        unit_tokens([bad])


def test_coverage_is_the_exact_share_of_each_patch():
    mask = disc(24, 32)
    coverage = patch_coverage(mask, Grid(6, 8, (0, 0, 32, 24)))
    by_hand = mask.reshape(6, 4, 8, 4).mean((1, 3))
    np.testing.assert_array_equal(coverage, np.rint(255 * by_hand))
    # Three patches across 32 pixels: edges at 32/3 and 64/3 cut pixels.
    left_half = np.zeros((8, 32), bool)
    left_half[:, :16] = True
    assert patch_coverage(left_half, Grid(1, 3, (0, 0, 32, 8))).tolist() == [[255, 128, 0]]
    # What hangs over the edge of the picture is background.
    full = np.ones((8, 8), bool)
    assert patch_coverage(full, Grid(1, 2, (4, 0, 12, 8))).tolist() == [[255, 0]]


@pytest.mark.parametrize(
    "settings, patch, size, grid",
    [
        # squeezed to a square: the whole picture
        ({"size": {"height": 32, "width": 32}}, 8, (48, 96), Grid(4, 4, (0, 0, 96, 48))),
        # 27 patches of 14 pixels leave 6 of 384 without a token
        (
            {"size": {"height": 384, "width": 384}},
            14,
            (384, 192),
            Grid(27, 27, (0, 0, 189, 378)),
        ),
        # shortest edge 256, middle 224: 1/16 is cut off each side
        (
            {
                "size": {"shortest_edge": 256},
                "do_center_crop": True,
                "crop_size": {"height": 224, "width": 224},
            },
            14,
            (448, 448),
            Grid(16, 16, (28, 28, 420, 420)),
        ),
        ({"size": {}, "do_resize": False}, 16, (64, 32), Grid(4, 2, (0, 0, 32, 64))),
    ],
)
def test_grids_see_through_the_processor(settings, patch, size, grid):
    found = processed_grid("x", SimpleNamespace(**settings), patch, *size)
    assert (found.rows, found.cols) == (grid.rows, grid.cols)
    assert found.rect == pytest.approx(grid.rect)
