"""Pictures of meshes, regions, maps and transfers with matplotlib: ``pip install matplotlib``.

Surfaces are drawn by `semfm.render`, which hides what is hidden and shades what is curved, and
shown in axes of matplotlib, so that titles, legends, colour bars and ``savefig`` work as ever::

    import semfm.plot

    figure = semfm.plot.transfer(result)
    figure.savefig("transfer.png", dpi=150)

Functions about one surface draw into the axes they are given and return them; functions about a
pair make a figure and return it. Nothing is shown on a screen until the caller says so.
"""

from ..errors import MissingPackage

try:
    import matplotlib as _matplotlib  # noqa: F401
except ImportError as error:
    raise MissingPackage(
        "semfm.plot needs matplotlib, which is not installed: pip install matplotlib",
        "missing-package",
        "matplotlib",
    ) from error

from .maps import functional_map, point_map, spectra
from .outcome import anchors, confidence, transfer
from .surface import best_camera, mesh, region

__all__ = [
    "anchors",
    "best_camera",
    "confidence",
    "functional_map",
    "mesh",
    "point_map",
    "region",
    "spectra",
    "transfer",
]
