"""Patches of surface with numbers, for set-of-mark prompting.

Yang et al., "Set-of-Mark Prompting Unleashes Extraordinary Visual Grounding in GPT-4V", 2023: a
model names regions better by numbers drawn on them than by coordinates. There the regions come
from a segmentation network; here the surface itself is cut into patches of even size: k-means on
the points behind the pixels and the directions in which the surface faces, then a cut wherever a
patch falls apart, as between a handle and the body beside it. A patch has the same number in every
view that shows it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .object_views import ObjectView, ObjectViews

#: Weight of the direction (a unit vector) beside the position (in sides of a patch): two faces at
#: a right angle are 1.4 times this many patches apart. On 24 real objects, six views, 48 patches,
#: true regions came back with IoU .867 at 0.5, .856 at 1 and .840 at 2; without the cut into pieces
#: below, .849 at 1.
FACING = 0.5
#: Fragments below this share of the object's pixels in a view are given to their neighbours: no
#: number would fit on them.
FRAGMENT = 0.004
#: Pieces of a patch that are this many pixels apart are patches of their own. Below 2, surfaces
#: seen at a slant fall to dust.
GAP_PIXELS = 3.0
_SAMPLES, _ROUNDS = 12_000, 12


def segment(of: ObjectViews, views: Sequence[ObjectView], n_segments: int) -> list[np.ndarray]:
    """Cut what the views show into patches.

    Parameters
    ----------
    of
        The object.
    views
        Those that the model will be shown.
    n_segments
        How many patches, before those that fall apart are cut.

    Returns
    -------
    list of numpy.ndarray
        (height × width) int per view: the patch's number from 1, 0 on the background.
    """
    points = np.concatenate([view.surface.points for view in views])
    if not len(points):
        return [np.zeros(view.on_object.shape, int) for view in views]
    facing = np.concatenate([_facing(of, view) for view in views])
    # A pixel of one view covers about as much surface as any other's, so the side of a patch
    # follows from the area that the samples spread over.
    side = np.sqrt(_area_seen(of, views) / n_segments)
    features = np.concatenate([points / max(side, 1e-300), FACING * facing], 1)
    labels = _pieces(points, _cluster(features, n_segments), GAP_PIXELS * _pixel(views)) + 1
    cuts = np.cumsum([len(view.surface.rows) for view in views])[:-1]
    images = [_tidy(view.image(part)) for view, part in zip(views, np.split(labels, cuts))]
    numbers = np.unique(np.concatenate([[0], *(image.ravel() for image in images)]))
    return [np.searchsorted(numbers, image) for image in images]


def _facing(of: ObjectViews, view: ObjectView) -> np.ndarray:
    """Unit normals (p × 3) of the triangles in the pixels, turned towards the camera."""
    a, b, c = (of.vertices[view.surface.corners[:, i]] for i in range(3))
    normals = np.cross(b - a, c - a)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0)
    towards = ((view.camera.eye - view.surface.points) * normals).sum(1, keepdims=True)
    return np.where(towards < 0, -normals, normals)


def _area_seen(of: ObjectViews, views: Sequence[ObjectView]) -> float:
    """Area of the triangles that some view names."""
    corners = np.unique(np.concatenate([view.surface.corners for view in views]), axis=0)
    a, b, c = (of.vertices[corners[:, i]] for i in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def _pixel(views: Sequence[ObjectView]) -> float:
    """Width of a pixel on the object, in its units."""
    widths = [
        np.linalg.norm(view.surface.points - view.camera.eye, axis=1)
        / min(view.camera.fx, view.camera.fy)
        for view in views
    ]
    return float(np.median(np.concatenate(widths)))


def _pieces(points: np.ndarray, labels: np.ndarray, gap: float) -> np.ndarray:
    """Labels (n) from 0 of connected pieces: points (n × 3) of one label, in cells of side ``gap``
    of a grid that touch, if only in a corner."""
    cells = np.floor((points - points.min(0)) / max(gap, 1e-300)).astype(np.int64) + 1
    x, y, z = cells.max(0) + 2
    strides = np.array([y * z, z, 1])
    keys, of_point = np.unique(labels * (x * y * z) + cells @ strides, return_inverse=True)
    steps = np.stack(np.meshgrid(*[[-1, 0, 1]] * 3), -1).reshape(-1, 3) @ strides
    edges = []
    for step in steps[steps > 0]:
        at = np.searchsorted(keys, keys + step).clip(max=len(keys) - 1)
        near = np.flatnonzero(keys[at] == keys + step)
        edges.append(np.stack([near, at[near]]))
    a, b = np.concatenate(edges, 1)
    piece = np.arange(len(keys))
    while True:
        lowest = piece.copy()
        np.minimum.at(lowest, a, piece[b])
        np.minimum.at(lowest, b, piece[a])
        lowest = lowest[lowest]  # follow the lower piece to its own lower one
        if (lowest == piece).all():
            return np.unique(piece, return_inverse=True)[1].reshape(-1)[of_point.reshape(-1)]
        piece = lowest


def _cluster(features: np.ndarray, k: int) -> np.ndarray:
    """Lloyd's k-means from farthest points; labels (n) without gaps, deterministic."""
    sample = features[:: max(1, len(features) // _SAMPLES)]
    centres = [sample[np.argmin(((sample - sample.mean(0)) ** 2).sum(1))]]
    apart = ((sample - centres[0]) ** 2).sum(1)
    while len(centres) < min(k, len(sample)):
        centres.append(sample[np.argmax(apart)])
        apart = np.minimum(apart, ((sample - centres[-1]) ** 2).sum(1))
    means = np.array(centres)
    for _ in range(_ROUNDS):
        labels = _nearest(sample, means)
        counts = np.bincount(labels, minlength=len(means))
        for d in range(means.shape[1]):
            sums = np.bincount(labels, sample[:, d], minlength=len(means))
            means[:, d] = np.where(counts > 0, sums / np.maximum(counts, 1), means[:, d])
    return np.unique(_nearest(features, means), return_inverse=True)[1].reshape(-1)


def _nearest(points: np.ndarray, centres: np.ndarray) -> np.ndarray:
    return np.argmin((centres**2).sum(1) - 2 * points @ centres.T, axis=1)


def _tidy(labels: np.ndarray) -> np.ndarray:
    """Give fragments too small for a number to their neighbours on the object."""
    on_object = labels > 0
    parts = components(labels)
    sizes = np.bincount(parts.ravel())
    small = on_object & (sizes[parts] < FRAGMENT * on_object.sum())
    kept = np.where(small, 0, labels)
    while True:
        spread = np.maximum.reduce(list(neighbours(kept, 0)))
        fresh = small & (kept == 0) & (spread > 0)
        if not fresh.any():
            break
        kept[fresh] = spread[fresh]
    return np.where(on_object & (kept == 0), labels, kept)  # islands keep their own


def components(labels: np.ndarray) -> np.ndarray:
    """Connected parts (4 neighbours) of equal label, (height × width) int from 0.

    Each part is a tree of pixels that leads to its lowest one. In every round the roots of
    neighbours that are still apart are joined, the higher under the lower, and all trees are made
    flat, so that the rounds are few however winding the parts are.
    """
    height, width = labels.shape
    pixels = np.arange(labels.size).reshape(height, width)
    across, down = labels[:, 1:] == labels[:, :-1], labels[1:] == labels[:-1]
    left = np.concatenate([pixels[:, :-1][across], pixels[:-1][down]])
    right = np.concatenate([pixels[:, 1:][across], pixels[1:][down]])
    root = pixels.ravel().copy()
    while len(left):
        a, b = root[left], root[right]
        root[np.maximum(a, b)] = np.minimum(a, b)
        while True:
            above = root[root]
            if (above == root).all():
                break
            root = above
        apart = root[left] != root[right]
        left, right = left[apart], right[apart]
    number = np.cumsum(root == pixels.ravel()) - 1
    return number[root].reshape(height, width)


def neighbours(image: np.ndarray, fill: int) -> list[np.ndarray]:
    """The image moved by one pixel up, down, left and right."""
    padded = np.pad(image, 1, constant_values=fill)
    return [padded[2:, 1:-1], padded[:-2, 1:-1], padded[1:-1, 2:], padded[1:-1, :-2]]


def depth_inside(labels: np.ndarray) -> np.ndarray:
    """Steps (4 neighbours) from each pixel to the border of its patch, from 1; 0 outside."""
    inside, depth = labels > 0, np.zeros(labels.shape, int)
    for near in neighbours(labels, 0):
        inside = inside & (near == labels)
    depth += labels > 0
    while inside.any():
        depth += inside
        for near in neighbours(inside.astype(int), 0):
            inside = inside & (near > 0)
    return depth
