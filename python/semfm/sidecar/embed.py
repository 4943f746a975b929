"""One views file in, one embeddings file out."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Callable

import numpy as np

from .. import Embeddings, PatchEmbeddings, ViewsFile
from .coverage import patch_coverage
from .encoder import Encoder
from .errors import SidecarError, expected
from .patches import OUTLIER_RATIO, ROLLS, embed_pictures

#: Called with (pictures encoded, pictures in all).
OnProgress = Callable[[int, int], None]

#: How numbers may be stored in the file.
DTYPES = ("f16", "f32")

_OUTLIERS = f"dropped per roll where raw norm > {OUTLIER_RATIO:g} x the grid's median"
_NORMALISATION = "L2 per output and roll, concatenated, mean of the valid rolls"


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
    FormatError
        If the views file is damaged or foreign.
    FileError
        If a file cannot be read or written.
    SidecarError
        If the encoder cannot take the pictures, or the output would replace the views.
    """
    if os.path.exists(output) and os.path.samefile(views_path, output):
        raise SidecarError(f"{os.fspath(output)}: the output would replace the views file")
    views = ViewsFile.read(views_path)
    patches = list(_embed(views, encoder, settings, on_progress or (lambda done, total: None)))
    embeddings = Embeddings.of_views(
        views,
        patches,
        encoder=encoder.name,
        revision=encoder.revision,
        preprocessing=encoder.preprocessing,
        rolls=settings.rolls,
        outliers=_OUTLIERS,
        more={"normalisation": _NORMALISATION, "dtype": settings.dtype},
    )
    embeddings.write(output, dtype=settings.dtype)


def _embed(
    file: ViewsFile, encoder: Encoder, settings: EmbedSettings, on_progress: OnProgress
) -> Iterator[PatchEmbeddings]:
    views, rolls = file.views, ROLLS[settings.rolls]
    on_progress(0, len(views) * len(rolls))
    for start in range(0, len(views), settings.batch):
        batch = views[start : start + settings.batch]
        patches = embed_pictures(encoder, np.stack([view.rgb for view in batch]), rolls)
        for view, data, valid in zip(batch, patches.data, patches.valid):
            coverage = patch_coverage(view.triangles >= 0, patches.grid)
            yield PatchEmbeddings(data, patches.grid.rect, coverage=coverage, valid=valid)
        on_progress((start + len(batch)) * len(rolls), len(views) * len(rolls))
