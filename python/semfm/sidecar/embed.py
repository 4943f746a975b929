"""One views file in, one embeddings file out."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Callable

import numpy as np

from .coverage import patch_coverage
from .embeddings_file import DTYPES, EMBEDDINGS_FORMAT, EmbeddedView, write_embeddings
from .encoder import Encoder
from .errors import SidecarError, expected
from .patches import OUTLIER_RATIO, ROLLS, embed_pictures
from .views_file import ViewsFile, read_views

#: Called with (pictures encoded, pictures in all).
OnProgress = Callable[[int, int], None]


@dataclass(frozen=True)
class EmbedSettings:
    """How to embed.

    Attributes
    ----------
    rolls
        Average over this many rolls of each picture: 1, 2 or 4.
    batch
        Pictures per call of the encoder.
    dtype
        ``f16`` or ``f32``, of the numbers in the file.
    """

    rolls: int = 4
    batch: int = 14
    dtype: str = "f16"

    def __post_init__(self) -> None:
        if self.rolls not in ROLLS:
            raise expected("settings", "rolls", "1, 2 or 4", self.rolls)
        if self.batch < 1:
            raise expected("settings", "batch", "at least 1", self.batch)
        if self.dtype not in DTYPES:
            raise expected("settings", "dtype", " or ".join(DTYPES), repr(self.dtype))


def embed_file(
    views_path: str | os.PathLike[str],
    output: str | os.PathLike[str],
    encoder: Encoder,
    settings: EmbedSettings = EmbedSettings(),
    on_progress: OnProgress | None = None,
) -> None:
    """Embed every view of a views file.

    Parameters
    ----------
    views_path
        A ``*.views.mcap`` file.
    output
        The ``*.emb.mcap`` file to write; written whole or not at all.
    encoder
        From :func:`.open_encoder`, or your own.
    settings
        Rolls, batch, dtype.
    on_progress
        Called after every batch.

    Raises
    ------
    SidecarError
        If the views file is damaged or foreign, or the encoder cannot take its pictures.
    """
    if os.path.exists(output) and os.path.samefile(views_path, output):
        raise SidecarError(f"{os.fspath(output)}: the output would replace the views file")
    views = read_views(views_path)
    embedded = _embed(views, encoder, settings, on_progress or (lambda done, total: None))
    write_embeddings(output, embedded, _metadata(views, encoder, settings), settings.dtype)


def _embed(
    file: ViewsFile, encoder: Encoder, settings: EmbedSettings, on_progress: OnProgress
) -> Iterator[EmbeddedView]:
    views, rolls = file.views, ROLLS[settings.rolls]
    on_progress(0, len(views) * len(rolls))
    for start in range(0, len(views), settings.batch):
        batch = views[start : start + settings.batch]
        patches = embed_pictures(encoder, np.stack([view.rgb for view in batch]), rolls)
        for view, data, valid in zip(batch, patches.data, patches.valid):
            coverage = patch_coverage(view.on_object, patches.grid)
            yield EmbeddedView(view, patches.grid, data, coverage, valid)
        on_progress((start + len(batch)) * len(rolls), len(views) * len(rolls))


def _metadata(file: ViewsFile, encoder: Encoder, settings: EmbedSettings) -> dict[str, str]:
    """The views' own metadata and how the embeddings were made."""
    return {
        **file.metadata,
        "format": EMBEDDINGS_FORMAT,
        "encoder": encoder.name,
        "revision": encoder.revision,
        "preprocessing": encoder.preprocessing,
        "rolls": str(settings.rolls),
        "outliers": f"dropped per roll where raw norm > {OUTLIER_RATIO:g} x the grid's median",
        "normalisation": "L2 per output and roll, concatenated, mean of the valid rolls",
        "dtype": settings.dtype,
    }
