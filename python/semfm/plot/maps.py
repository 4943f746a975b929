"""Maps and spectra: colours transferred by a point map, the matrix of a functional map, eigenvalues."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Optional, Union

import numpy as np
from numpy.typing import ArrayLike

from .._paint import colors_of, position_colors
from .._semfm import Eigenbasis, FunctionalMap, PointMap, Shape
from ..errors import InvalidInput
from .surface import SIDE, as_mesh, best_camera, new_axes, show

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def point_map(
    source: Any,
    target: Any,
    map: Union[PointMap, ArrayLike],
    *,
    colors: Optional[ArrayLike] = None,
    size: int = SIDE,
) -> Figure:
    """A map as colours: the source painted by position, the target by what the map looks up there.

    Equal colours are matched places. A good map shows the same gradients on both.

    Parameters
    ----------
    source : mesh_like, Shape or PreparedObject
    target : mesh_like, Shape or PreparedObject
    map : PointMap or (n_target,) array_like
        Target → source, between the meshes as given.
    colors : (n_source, 3) array_like, optional
        sRGB of the source's vertices; by position where none are given.
    size : int, default 640
        Side of each picture in pixels.

    Returns
    -------
    matplotlib.figure.Figure
    """
    import matplotlib.pyplot as plt

    meshes = as_mesh(source), as_mesh(target)
    found = map if isinstance(map, PointMap) else PointMap(map, meshes[0].n_vertices)
    expected = tuple(each.n_vertices for each in meshes)
    if (found.n_source, found.n_target) != expected:
        raise InvalidInput(
            f"map: expected {expected[0]} source and {expected[1]} target vertices, "
            f"found {found.n_source} and {found.n_target}",
            place="map",
        )
    places = position_colors(meshes[0].vertices)
    if colors is not None:
        places = colors_of(colors, meshes[0].n_vertices)
    figure, axes = plt.subplots(1, 2, figsize=(8, 4), layout="constrained")
    paints = places, found.pull_back(places)
    for ax, mesh, paint, title in zip(axes, meshes, paints, ("source", "target, by its matches")):
        show(mesh, paint, best_camera(mesh, size=size), title=title, ax=ax)
    return figure


def functional_map(
    map: Union[FunctionalMap, ArrayLike], *, title: Optional[str] = None, ax: Optional[Axes] = None
) -> Axes:
    """The matrix C: a column for each source eigenfunction, a row for each of the target.

    Parameters
    ----------
    map : FunctionalMap or (k_target, k_source) array_like
    title : str, optional
    ax : matplotlib.axes.Axes, optional

    Returns
    -------
    matplotlib.axes.Axes
    """
    matrix = map.matrix if isinstance(map, FunctionalMap) else np.asarray(map, dtype=np.float64)
    if matrix.ndim != 2:
        raise InvalidInput(f"map: expected a matrix, found shape {matrix.shape}", place="map")
    axes = new_axes() if ax is None else ax
    # An orthogonal map has entries up to one; larger ones stand out at full colour.
    image = axes.imshow(matrix, cmap="RdBu_r", vmin=-1, vmax=1, interpolation="nearest")
    axes.set_xlabel("source eigenfunction")
    axes.set_ylabel("target eigenfunction")
    axes.set_title(title or f"C ({matrix.shape[0]} × {matrix.shape[1]})")
    axes.figure.colorbar(image, ax=axes, shrink=0.8, pad=0.02)
    return axes


def spectra(
    bases: Mapping[str, Union[Eigenbasis, Shape]],
    *,
    title: Optional[str] = None,
    ax: Optional[Axes] = None,
) -> Axes:
    """Eigenvalues over their number, one line for each basis: near each other where a map can hold.

    Parameters
    ----------
    bases : dict
        Names, and an `Eigenbasis` or `Shape` each.
    title : str, optional
    ax : matplotlib.axes.Axes, optional

    Returns
    -------
    matplotlib.axes.Axes
    """
    if not bases:
        raise InvalidInput("bases: expected one or more, found none", place="bases")
    axes = new_axes() if ax is None else ax
    for name, each in bases.items():
        values = (each.basis if isinstance(each, Shape) else each).values
        axes.plot(np.arange(len(values)), values, marker=".", label=name)
    axes.set_xlabel("number of the eigenpair")
    axes.set_ylabel("eigenvalue")
    axes.legend(frameon=False)
    axes.spines[["top", "right"]].set_visible(False)
    if title:
        axes.set_title(title)
    return axes
