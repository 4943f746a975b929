"""The real MobileNetV2 features, where the shared data are at hand."""

from __future__ import annotations

import numpy as np
import pytest
from semfm.sidecar import open_encoder
from semfm.sidecar.patches import ROLLS, embed_pictures
from views_builder import disc

pytest.importorskip("onnxruntime")


@pytest.fixture(scope="module")
def encoder(shared):
    path = shared / "encoder" / "mobilenet_v2_features.json"
    if not path.is_file():
        pytest.skip(f"no {path}")
    return open_encoder(str(path))


def shaded_disc(shift: int = 0) -> np.ndarray:
    """A grey ball on white (224 × 224 × 3), moved to the right by ``shift`` pixels."""
    mask = np.roll(disc(224, 224), shift, axis=1)
    picture = np.full((224, 224, 3), 255, np.uint8)
    picture[mask] = np.linspace(60, 200, 224)[np.nonzero(mask)[0], None]
    return picture


def test_grid_and_tokens(encoder):
    result = embed_pictures(encoder, shaded_disc()[None], ROLLS[4])
    assert result.data.shape == (1, 14, 14, 96 + 320) and result.valid.all()
    norms = np.linalg.norm(result.data, axis=-1)
    assert (norms > 0.9).all() and (norms <= np.sqrt(2) + 1e-6).all()


def test_tokens_follow_the_object_by_whole_patches(encoder):
    here, there = (encoder.encode(shaded_disc(shift)[None]) for shift in (0, 32))
    for a, b in zip(here, there):
        a, b = a[0, 3:-3, 2:-5].reshape(-1, a.shape[-1]), b[0, 3:-3, 4:-3].reshape(-1, b.shape[-1])
        cosines = (a * b).sum(1) / np.linalg.norm(a, axis=1) / np.linalg.norm(b, axis=1)
        assert np.median(cosines) > 0.97
