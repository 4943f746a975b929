"""What every encoder promises; each one lives in a file of its own.

``semfm-embed --model package.module:Class`` imports a class with these members, from the installed
packages or the working folder, and calls it with the keywords ``device`` (``auto``, ``cpu`` or
``cuda``) and ``threads``. An encoder that comes with the package has one row in :mod:`.models`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np


@dataclass(frozen=True)
class Grid:
    """Where an encoder's tokens lie in a picture.

    Attributes
    ----------
    rows, cols
        Patches down and across.
    rect
        The rectangle they tile, in pixels of the picture as given to the encoder (before any
        resizing or cropping of its own): left, top, right, bottom; edges, not centres.
    """

    rows: int
    cols: int
    rect: tuple[float, float, float, float]


class Encoder(Protocol):
    """Turns pictures into grids of raw tokens; knows nothing of rolls, norms or files."""

    #: Hub name, folder or file name: what the embeddings file calls it.
    name: str
    #: Commit on the hub, or a hash of the files that hold the weights.
    revision: str
    #: What happens to the pixels before the first layer, as one line of JSON.
    preprocessing: str

    # A class that is named on the command line may also list, as a literal, the files that it reads
    # beside its code: ``files = ["weights.npz"]``. Only then are its embeddings kept.

    def grid(self, height: int, width: int) -> Grid:
        """The grid for pictures of this size; raises SidecarError if there is none."""
        ...

    def encode(self, pictures: np.ndarray) -> list[np.ndarray]:
        """Raw tokens of a batch of pictures.

        Parameters
        ----------
        pictures
            (n × height × width × 3) uint8, sRGB.

        Returns
        -------
        list of numpy.ndarray
            One array (n × rows × cols × d) float32 per output of the encoder, top-left token
            first, class, register and padding tokens already dropped. Every call with pictures of
            one size returns the same rows × cols, those of :meth:`grid`.
        """
        ...
