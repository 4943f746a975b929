"""How much of each patch the object fills."""

from __future__ import annotations

import numpy as np

from .encoder import Grid


def patch_coverage(on_object: np.ndarray, grid: Grid) -> np.ndarray:
    """Share of every patch that lies on the object.

    Patch edges may fall inside pixels (a 14-pixel patch of a picture that the encoder resized), so
    the shares are exact areas: the summed-area table of an image that is constant in each pixel is
    bilinear between pixel corners.

    Parameters
    ----------
    on_object
        (height × width) bool, true where a triangle is seen.
    grid
        Where the patches lie. What hangs over the picture's edge counts as background.

    Returns
    -------
    numpy.ndarray
        (rows × cols) uint8, 0 to 255.
    """
    height, width = on_object.shape
    table = np.zeros((height + 1, width + 1))
    table[1:, 1:] = on_object.cumsum(0, dtype=np.float64).cumsum(1)
    x0, y0, x1, y1 = grid.rect
    ys = np.linspace(y0, y1, grid.rows + 1)
    xs = np.linspace(x0, x1, grid.cols + 1)
    rows = np.stack([np.interp(ys, np.arange(height + 1), column) for column in table.T], axis=1)
    corners = np.stack([np.interp(xs, np.arange(width + 1), row) for row in rows])
    area = np.diff(np.diff(corners, axis=0), axis=1)  # (rows × cols) square pixels
    share = area / ((x1 - x0) / grid.cols * (y1 - y0) / grid.rows)
    return np.rint(255.0 * np.clip(share, 0.0, 1.0)).astype(np.uint8)
