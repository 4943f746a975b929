"""From ``--tool`` to what reconstructs: the table of tools.

A new tool is one file with a class and one row of :data:`TOOLS`. A tool of your own needs no row:
it is named as ``package.module:Class`` (``docs/observations.md``).
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..errors import SemfmError
from ..sidecar.errors import SidecarError, expected
from ..sidecar.models import is_class_name, open_class
from .placed_mesh import PlacedMesh

#: Tools that come with SemFM, by name.
TOOLS = {"sam3d": "semfm.reconstruct.sam3d:Sam3dObjects"}


class ReconstructionTool(Protocol):
    """Makes a mesh of what a mask marks in a picture.

    Attributes
    ----------
    name
        For messages and reports.
    """

    name: str

    def describe(self) -> dict[str, Any]:
        """What decides its answers beside the picture (version, weights), for reports; JSON."""
        ...

    def reconstruct(
        self,
        picture: NDArray[np.uint8],
        mask: NDArray[np.bool_],
        point_map: NDArray[np.float32] | None,
        seed: int,
    ) -> PlacedMesh:
        """The mesh of one thing (:func:`.placed_mesh.place_mesh` makes it).

        Parameters
        ----------
        picture : (height, width, 3) uint8
        mask : (height, width) bool
        point_map : (height, width, 3) float32 or None
            In the camera's frame (x right, y down, z forward), metres, NaN where nothing came back.
            With it the answer's pose must be in metres; without it in any unit that is the same for
            every mask of this picture.
        seed : int
        """
        ...


def open_tool(name: str, **options: Any) -> ReconstructionTool:
    """Opens a tool.

    Parameters
    ----------
    name
        One of :data:`TOOLS`, or ``package.module:Class``: a class that is called without arguments
        and keeps the protocol :class:`ReconstructionTool`.
    options
        For a tool of :data:`TOOLS`; None is left out. A class of one's own takes none.

    Raises
    ------
    MissingPackage
        If what it needs is not installed; the message says what to do.
    SidecarError
        If there is no such tool, or it does not keep the protocol.
    """
    if name not in TOOLS and not is_class_name(name):
        raise expected("--tool", "name", f"{', '.join(TOOLS)} or package.module:Class", repr(name))
    given = {key: value for key, value in options.items() if value is not None}
    return open_class(TOOLS.get(name, name), ("name",), ("describe", "reconstruct"), **given)


def reconstruct(
    tool: ReconstructionTool,
    picture: NDArray[np.uint8],
    mask: NDArray[np.bool_],
    point_map: NDArray[np.float32] | None,
    seed: int,
) -> PlacedMesh:
    """What a tool makes, with its failures in words; arguments as those of the protocol.

    Raises
    ------
    SidecarError
        If the tool fails, or gives something else than a :class:`.placed_mesh.PlacedMesh`.
    """
    try:
        made = tool.reconstruct(picture, mask, point_map, seed)
    except SemfmError:
        raise
    except Exception as error:  # code of others raises what it likes
        raise SidecarError(f"{tool.name}: {type(error).__name__}: {error}") from error
    if not isinstance(made, PlacedMesh):
        raise expected(tool.name, "answer", "a PlacedMesh", type(made).__name__)
    return made
