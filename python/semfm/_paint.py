"""Numbers as colours, the same in figures, viewers and the pictures that Rust writes."""

from __future__ import annotations

import os
from typing import Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._semfm import Mesh, Region
from .errors import InvalidInput

Colors = NDArray[np.float64]
PathLike = Union[str, "os.PathLike[str]"]

# Colour without and with full weight, as sRGB in 0..1: those of `transfer.png`.
PLAIN = np.array([0.78, 0.78, 0.78])
MARKED = np.array([0.86, 0.16, 0.16])


def weight_colors(weights: ArrayLike) -> Colors:
    """The colour of each weight in [0, 1]: grey to red, as an (n, 3) array of sRGB in 0..1."""
    share = np.clip(np.asarray(weights, dtype=np.float64), 0.0, 1.0)
    return PLAIN + share[:, None] * (MARKED - PLAIN)


def position_colors(points: ArrayLike) -> Colors:
    """Positions as colours: x, y, z over the bounding box, as an (n, 3) array of sRGB in 0..1."""
    points = np.asarray(points, dtype=np.float64)
    low, high = points.min(axis=0), points.max(axis=0)
    extent = np.maximum(high - low, np.finfo(np.float64).tiny)
    return (points - low) / extent * 0.8 + 0.15


def weights_of(region: Union[Region, PathLike, ArrayLike], mesh: Mesh) -> Colors:
    """The (n,) weights of a region, of a region file or of an array.

    `InvalidInput` where their number is not that of the mesh's vertices.
    """
    if isinstance(region, (str, os.PathLike)):
        region = Region.read(region, mesh)
    weights = region.weights if isinstance(region, Region) else np.asarray(region)
    return per_vertex(weights, mesh.n_vertices, "region", columns=None).astype(np.float64)


def colors_of(colors: ArrayLike, n_vertices: int) -> Colors:
    """(n, 3) sRGB in 0..1 of bytes or fractions with three or four columns; alpha is dropped."""
    found = np.asarray(colors)
    if found.ndim != 2 or found.shape[1:] not in ((3,), (4,)) or len(found) != n_vertices:
        raise InvalidInput(
            f"colors: expected shape ({n_vertices}, 3) or ({n_vertices}, 4), found {found.shape}",
            place="colors",
        )
    scale = 255.0 if found.dtype == np.uint8 else 1.0
    fractions = found[:, :3].astype(np.float64) / scale
    if not (np.isfinite(fractions).all() and (fractions >= 0).all() and (fractions <= 1).all()):
        raise InvalidInput("colors: expected uint8 or numbers from 0 to 1", place="colors")
    return fractions


def per_vertex(
    values: ArrayLike, n_vertices: int, name: str, *, columns: Union[int, None]
) -> NDArray[np.generic]:
    """One entry (or row of so many columns) per vertex, or `InvalidInput` that says what came."""
    found: NDArray[np.generic] = np.asarray(values)
    wanted = (n_vertices,) if columns is None else (n_vertices, columns)
    if found.shape != wanted:
        raise InvalidInput(f"{name}: expected shape {wanted}, found {found.shape}", place=name)
    return found
