"""One surface in one pair of axes: plain, painted, or with a region."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any, Optional, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._paint import Colors, PathLike, colors_of, per_vertex, weight_colors, weights_of
from .._semfm import Pinhole, Mesh, MeshFile, PreparedObject, Region, Shape, View, render, rig
from ..errors import InvalidInput, InvalidType

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Side of a picture, and of the small ones that a viewpoint is chosen by, in pixels.
SIDE = 640
SCOUT = 96
# Viewpoints to choose from, as for `transfer.png`.
N_SCOUTS = 24


def as_mesh(thing: Any) -> Mesh:
    """The mesh as given of anything that has one: file, trimesh, `Shape`, `PreparedObject`."""
    if isinstance(thing, Mesh):
        return thing
    if isinstance(thing, (PreparedObject, MeshFile)):
        return thing.mesh
    if isinstance(thing, Shape):
        return thing.original
    if hasattr(thing, "faces") or hasattr(thing, "geometry"):
        return Mesh.from_trimesh(thing)
    if hasattr(thing, "triangles"):
        return Mesh.from_open3d(thing)
    if isinstance(thing, (str, os.PathLike)):
        return Mesh.read(thing)
    wanted = "a mesh, a path or what has a mesh"
    raise InvalidType(f"mesh: expected {wanted}, found {type(thing).__name__}", "type", "mesh")


def best_camera(
    mesh: Any, weights: Optional[Union[Region, PathLike, ArrayLike]] = None, *, size: int = SIDE
) -> Pinhole:
    """From where a region shows the most pixels, and then the object the most of its surface.

    Parameters
    ----------
    mesh : mesh_like, Shape or PreparedObject
    weights : Region, path or (n,) array_like, optional
        What is to be seen; a vertex counts from one half on. Everything where none is given.
    size : int, default 640
        Side of the square image, in pixels.

    Returns
    -------
    Pinhole
    """
    found = as_mesh(mesh)
    faces = np.asarray(found.faces)
    inside = np.zeros(found.n_vertices)
    if weights is not None:
        inside = weights_of(weights, found)
    marked: NDArray[np.bool_] = np.any(inside[faces] >= 0.5, axis=1)
    areas = face_areas(found)
    shown = []
    for view in render(found, rig(found, count=N_SCOUTS, size=SCOUT), supersampling=1):
        seen = view.triangles[view.triangles >= 0]
        # A region hidden from everywhere still deserves the fullest view of the object. Surface
        # seen, not pixels: those favour the round side, from which a kettle has no spout.
        shown.append(int(marked[seen].sum()) + areas[np.unique(seen)].sum() / areas.sum())
    return rig(found, count=N_SCOUTS, size=size)[int(np.argmax(shown))]


def face_areas(mesh: Mesh) -> NDArray[np.float64]:
    """(m,) areas of the triangles."""
    corners = mesh.vertices[mesh.faces]
    sides = corners[:, 1:] - corners[:, :1]
    normals = np.cross(sides[:, 0], sides[:, 1])
    areas: NDArray[np.float64] = np.linalg.norm(normals, axis=1) / 2
    return areas


def mesh(
    mesh: Any,
    values: Optional[ArrayLike] = None,
    *,
    colors: Optional[ArrayLike] = None,
    cmap: str = "viridis",
    vmin: Optional[float] = None,
    vmax: Optional[float] = None,
    colorbar: bool = True,
    camera: Optional[Pinhole] = None,
    title: Optional[str] = None,
    ax: Optional[Axes] = None,
    size: int = SIDE,
) -> Axes:
    """A surface, painted by a function on its vertices, by colours, or in grey.

    Parameters
    ----------
    mesh : mesh_like, MeshFile, Shape or PreparedObject
        A `MeshFile` shows its own colours where no others are given.
    values : (n,) array_like, optional
        A function on the vertices. Vertices without a finite value stay grey.
    colors : (n, 3) or (n, 4) array_like, optional
        sRGB in place of `values`: uint8, or fractions of one.
    cmap : str, default "viridis"
        A colour map of matplotlib.
    vmin : float, optional
        The value at the lower end of the colour map; the smallest where none is given.
    vmax : float, optional
        The value at its upper end.
    colorbar : bool, default True
        Whether `values` get a colour bar.
    camera : Pinhole, optional
        The best view where none is given.
    title : str, optional
    ax : matplotlib.axes.Axes, optional
        Where to draw; new axes where none are given.
    size : int, default 640
        Side of the picture in pixels, where no camera says it.

    Returns
    -------
    matplotlib.axes.Axes
    """
    if values is not None and colors is not None:
        raise InvalidInput("values and colors: expected one of them, found both", place="values")
    found = as_mesh(mesh)
    scale = None
    if values is not None:
        paint, scale = mapped(values, found.n_vertices, cmap, vmin, vmax)
    elif colors is not None:
        paint = colors_of(colors, found.n_vertices)
    elif isinstance(mesh, MeshFile) and mesh.vertex_colors is not None:
        paint = colors_of(mesh.vertex_colors, found.n_vertices)
    else:
        paint = weight_colors(np.zeros(found.n_vertices))
    axes = show(found, paint, camera or best_camera(found, size=size), title=title, ax=ax)
    if scale is not None and colorbar:
        axes.figure.colorbar(scale, ax=axes, shrink=0.7, pad=0.02)
    return axes


def region(
    mesh: Any,
    region: Union[Region, PathLike, ArrayLike],
    *,
    camera: Optional[Pinhole] = None,
    title: Optional[str] = None,
    ax: Optional[Axes] = None,
    size: int = SIDE,
) -> Axes:
    """A region on its surface, grey to red by weight, from where it is seen best.

    Parameters
    ----------
    mesh : mesh_like, Shape or PreparedObject
    region : Region, path or (n,) array_like
        A region of that mesh, or weights in [0, 1].
    camera : Pinhole, optional
    title : str, optional
    ax : matplotlib.axes.Axes, optional
    size : int, default 640
        Side of the picture in pixels, where no camera says it.

    Returns
    -------
    matplotlib.axes.Axes
    """
    found = as_mesh(mesh)
    weights = weights_of(region, found)
    seen = camera or best_camera(found, weights, size=size)
    return show(found, weight_colors(weights), seen, title=title, ax=ax)


def show(
    mesh: Mesh, paint: Colors, camera: Pinhole, *, title: Optional[str], ax: Optional[Axes]
) -> Axes:
    """Renders one view, without the empty margin that its silhouette leaves, into axes."""
    axes = new_axes() if ax is None else ax
    axes.imshow(trimmed(render(mesh, [camera], colors=paint, supersampling=3)[0]))
    axes.set_axis_off()
    if title:
        axes.set_title(title)
    return axes


def trimmed(view: View) -> NDArray[np.uint8]:
    """The picture without its empty rows and columns, but for a margin."""
    object_rows, object_columns = np.nonzero(view.triangles >= 0)
    if len(object_rows) == 0:
        return view.rgb
    margin = view.rgb.shape[0] // 32
    (top, bottom), (left, right) = (
        (max(int(ids.min()) - margin, 0), int(ids.max()) + margin + 1)
        for ids in (object_rows, object_columns)
    )
    return view.rgb[top:bottom, left:right]


def mapped(
    values: ArrayLike, n_vertices: int, cmap: str, vmin: Optional[float], vmax: Optional[float]
) -> tuple[Colors, Any]:
    """Values through a colour map: the colours, and what a colour bar needs."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    numbers = per_vertex(values, n_vertices, "values", columns=None).astype(np.float64)
    finite = np.isfinite(numbers)
    if not finite.any():
        raise InvalidInput("values: expected a finite number, found none", place="values")
    low = float(numbers[finite].min()) if vmin is None else vmin
    high = float(numbers[finite].max()) if vmax is None else vmax
    scale = ScalarMappable(Normalize(low, high), cmap)
    paint = weight_colors(np.zeros(n_vertices))
    paint[finite] = scale.to_rgba(numbers[finite])[:, :3]
    return paint, scale


def new_axes() -> Axes:
    """Axes in a figure of their own."""
    import matplotlib.pyplot as plt

    return plt.subplots(layout="constrained")[1]
