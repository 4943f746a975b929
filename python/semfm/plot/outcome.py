"""What came of a transfer: the regions side by side, how sure it is, which parts were paired."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .._paint import PLAIN, Colors, position_colors, weight_colors
from .._semfm import Anchors, Clusters, Mesh, SemanticCloud, Transfer, spectral_clusters
from .surface import SIDE, best_camera, show

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Apart from each other, from the grey of the rest, and for colour-blind eyes (Okabe & Ito 2008).
PART_COLORS = np.array(
    [
        [0, 114, 178],
        [230, 159, 0],
        [0, 158, 115],
        [204, 121, 167],
        [86, 180, 233],
        [213, 94, 0],
        [240, 228, 66],
    ]
) / 255.0  # fmt: skip


def transfer(transfer: Transfer, *, size: int = SIDE) -> Figure:
    """The demonstrated region, the region that arrived, and the map between the two.

    Parameters
    ----------
    transfer : Transfer
    size : int, default 640
        Side of each picture in pixels.

    Returns
    -------
    matplotlib.figure.Figure
        Source on the left and target on the right; regions above, the map as colours below.
    """
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(2, 2, figsize=(8, 8), layout="constrained")
    figure.suptitle(f"{transfer.verdict}, confidence {transfer.confidence:.2f}")
    places = position_colors(transfer.source.mesh.vertices)
    sides = (
        ("demonstrated", transfer.source.mesh, transfer.source_region.weights, places),
        (
            "transferred",
            transfer.target.mesh,
            transfer.weights,
            transfer.point_map.pull_back(places),
        ),
    )
    for column, (name, mesh, weights, paint) in enumerate(sides):
        camera = best_camera(mesh, weights, size=size)
        show(mesh, weight_colors(weights), camera, title=name, ax=axes[0, column])
        matched = "places" if column == 0 else "matched places"
        show(mesh, paint, camera, title=matched, ax=axes[1, column])
    return figure


def confidence(transfer: Transfer, *, size: int = SIDE) -> Figure:
    """How sure a transfer is: the weights it came from, and the places the region may belong to.

    Parameters
    ----------
    transfer : Transfer
    size : int, default 640
        Side of each picture in pixels.

    Returns
    -------
    matplotlib.figure.Figure
        The target by weight, the target with one colour for each hypothesis, and bars of the
        confidence and of each hypothesis's probability.
    """
    import matplotlib.pyplot as plt

    mesh, hypotheses = transfer.target.mesh, transfer.hypotheses
    figure, axes = plt.subplots(
        1, 3, figsize=(11, 4), layout="constrained", width_ratios=(1, 1, 0.8)
    )
    camera = best_camera(mesh, transfer.weights, size=size)
    show(mesh, weight_colors(transfer.weights), camera, title="weights", ax=axes[0])
    paint = np.tile(PLAIN, (mesh.n_vertices, 1))
    # The likeliest last, so that it is never painted over.
    for number in reversed(range(len(hypotheses))):
        paint[hypotheses[number].region.mask] = part_color(number)
    show(mesh, paint, camera, title="hypotheses", ax=axes[1])
    names = ["confidence"] + [f"place {number + 1}" for number in range(len(hypotheses))]
    lengths = [transfer.confidence] + [each.probability for each in hypotheses]
    colors = [(0.35, 0.35, 0.35)] + [tuple(part_color(i)) for i in range(len(hypotheses))]
    bars = axes[2].barh(names, lengths, color=colors)
    axes[2].bar_label(bars, fmt="%.2f", padding=3)
    axes[2].set_xlim(0, 1.15)
    axes[2].set_xticks([0, 0.5, 1])
    axes[2].invert_yaxis()
    axes[2].spines[["top", "right"]].set_visible(False)
    axes[2].set_title(f"verdict: {transfer.verdict}")
    axes[2].set_box_aspect(0.8)
    return figure


def anchors(transfer: Transfer, *, size: int = SIDE) -> Figure:
    """The semantic parts of both objects, those that were paired in one colour, and all cosines.

    Parameters
    ----------
    transfer : Transfer
        Its clouds are cut again with its own settings, which gives the same parts.
    size : int, default 640
        Side of each picture in pixels.

    Returns
    -------
    matplotlib.figure.Figure
    """
    import matplotlib.pyplot as plt
    from matplotlib.patches import Patch

    objects = transfer.source, transfer.target
    settings = transfer.settings.to_dict()
    clusters = [spectral_clusters(each.cloud, **settings["clusters"]) for each in objects]
    paired = Anchors.select(
        objects[0].cloud, clusters[0], objects[1].cloud, clusters[1], alpha=settings["n_anchors"]
    )
    figure, axes = plt.subplots(1, 3, figsize=(12, 4.4), layout="constrained")
    for side, (ax, each, parts) in enumerate(zip(axes, objects, clusters)):
        paint = part_paint(each.mesh, each.cloud, parts, paired.pairs[:, side])
        title = f"{('source', 'target')[side]}, {parts.n_clusters} parts"
        show(each.mesh, paint, best_camera(each.mesh, size=size), title=title, ax=ax)
    image = axes[2].imshow(paired.cosines, cmap="Greys", interpolation="nearest")
    figure.colorbar(image, ax=axes[2], shrink=0.7, pad=0.02, label="cosine")
    handles = []
    for number, ((source, target), score) in enumerate(zip(paired.pairs, paired.scores)):
        color = tuple(part_color(number))
        axes[2].plot(target, source, "s", ms=14, mfc="none", mec=color, mew=3)
        handles.append(Patch(color=color, label=f"{source} ~ {target}: cosine {score:.2f}"))
    axes[2].set(xlabel="target part", ylabel="source part", title="paired parts")
    axes[2].set_xticks(range(paired.cosines.shape[1]))
    axes[2].set_yticks(range(paired.cosines.shape[0]))
    figure.legend(handles=handles, loc="outside lower center", ncols=4, frameon=False)
    return figure


def part_color(number: int) -> NDArray[np.float64]:
    """A colour for each number, over again after seven."""
    color: NDArray[np.float64] = PART_COLORS[number % len(PART_COLORS)]
    return color


def part_paint(
    mesh: Mesh, cloud: SemanticCloud, clusters: Clusters, chosen: NDArray[np.uint32]
) -> Colors:
    """Vertices by the part of the nearest point of the cloud: those not chosen stay grey."""
    label_colors = PLAIN * np.linspace(1.0, 0.75, clusters.n_clusters)[:, None]
    for number, label in enumerate(chosen):
        label_colors[label] = part_color(number)
    return label_colors[clusters.labels[nearest(mesh.vertices, cloud.points)]]


def nearest(queries: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.intp]:
    """Index of the point nearest to each query, in blocks of bounded memory."""
    found = np.empty(len(queries), dtype=np.intp)
    norms = (points**2).sum(axis=1)
    for start in range(0, len(queries), 4096):
        block = queries[start : start + 4096]
        found[start : start + 4096] = (norms - 2.0 * block @ points.T).argmin(axis=1)
    return found
