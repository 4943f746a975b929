"""Views files of real meshes, rendered here by a small z-buffer: independent of the renderer.

The object is a mallet: a thin handle and a head across its end, each a box cut into small squares.
Its region is the handle.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from semfm import Mesh
from views_builder import METADATA, view_messages, write_views


def box(low, high, step: float) -> tuple[np.ndarray, np.ndarray]:
    """A closed box of small squares, two triangles each; faces do not share vertices."""
    low, high = np.array(low, float), np.array(high, float)
    vertices, triangles = [], []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for side in (low, high):
            nu, nv = (max(1, round((high - low)[d] / step)) for d in (u, v))
            grid = np.zeros(((nu + 1) * (nv + 1), 3))
            a, b = np.meshgrid(
                np.linspace(low[u], high[u], nu + 1),
                np.linspace(low[v], high[v], nv + 1),
                indexing="ij",
            )
            grid[:, axis], grid[:, u], grid[:, v] = side[axis], a.ravel(), b.ravel()
            start = sum(map(len, vertices))
            at = lambda i, j: start + i * (nv + 1) + j  # noqa: E731, B023
            for i in range(nu):
                for j in range(nv):
                    triangles += [
                        (at(i, j), at(i + 1, j), at(i, j + 1)),
                        (at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)),
                    ]
            vertices.append(grid)
    return np.concatenate(vertices), np.array(triangles)


def mallet(length: float = 2.0, step: float = 0.1) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices, triangles, and which vertices are the handle's."""
    handle, handle_triangles = box((-0.12, -0.12, 0), (0.12, 0.12, length), step)
    head, head_triangles = box((-0.5, -0.25, length), (0.5, 0.25, length + 0.5), step)
    vertices = np.concatenate([handle, head])
    triangles = np.concatenate([handle_triangles, head_triangles + len(handle)])
    return vertices, triangles, np.arange(len(vertices)) < len(handle)


def look_at(eye: np.ndarray, middle: np.ndarray) -> np.ndarray:
    """Rotation (3 × 3) camera_from_object; x right, y down, z towards the middle."""
    z = (middle - eye) / np.linalg.norm(middle - eye)
    x = np.cross(z, [0.1, 0.2, 1.0])
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z])


def quaternion(rotation: np.ndarray) -> np.ndarray:
    """xyzw of a rotation, by the eigenvector of its 4 × 4 matrix (Bar-Itzhack 2000)."""
    m = rotation
    k = np.array(
        [
            [m[0, 0] - m[1, 1] - m[2, 2], 0, 0, 0],
            [m[0, 1] + m[1, 0], m[1, 1] - m[0, 0] - m[2, 2], 0, 0],
            [m[0, 2] + m[2, 0], m[1, 2] + m[2, 1], m[2, 2] - m[0, 0] - m[1, 1], 0],
            [m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1], m.trace()],
        ]
    )
    return np.linalg.eigh(k, "L")[1][:, -1]


def render(vertices, triangles, rotation, eye, focal, size) -> tuple[np.ndarray, np.ndarray]:
    """Triangle ids (size × size), −1 outside, and a picture shaded by depth."""
    points = (vertices - eye) @ rotation.T
    pixels = focal * points[:, :2] / points[:, 2:] + size / 2
    ids, nearest = np.full((size, size), -1), np.full((size, size), np.inf)
    for id, corners in enumerate(triangles):
        p, z = pixels[corners], points[corners, 2]
        x0, y0 = np.maximum(np.floor(p.min(0)).astype(int), 0)
        x1, y1 = np.minimum(np.ceil(p.max(0)).astype(int), size)
        area = np.linalg.det(np.stack([p[1] - p[0], p[2] - p[0]]))
        if area == 0 or x0 >= x1 or y0 >= y1:
            continue
        y, x = np.mgrid[y0:y1, x0:x1] + 0.5
        w = []
        for i in range(3):
            a, b = p[(i + 1) % 3], p[(i + 2) % 3]
            w.append(((b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])) / area)
        depth = 1 / sum(wi / zi for wi, zi in zip(w, z))
        inside = (np.minimum.reduce(w) >= 0) & (depth < nearest[y0:y1, x0:x1])
        ids[y0:y1, x0:x1][inside] = id
        nearest[y0:y1, x0:x1][inside] = depth[inside]
    shade = np.where(ids >= 0, 90 + 37 * (ids % 4), 255).astype(np.uint8)
    return ids, np.repeat(shade[..., None], 3, 2)


def directions(count: int) -> np.ndarray:
    """Points (count × 3) spread over the sphere: the spiral of Saff & Kuijlaars (1997)."""
    i = np.arange(count) + 0.5
    z, phi = 1 - 2 * i / count, i * np.pi * (1 + 5**0.5)
    r = np.sqrt(1 - z**2)
    return np.stack([r * np.cos(phi), r * np.sin(phi), z], 1)


def write_mesh_views(
    path: Path, vertices, triangles, count: int = 8, size: int = 72, change=lambda m: m
) -> Path:
    """A views file of a mesh, seen from around it."""
    middle = (vertices.min(0) + vertices.max(0)) / 2
    radius = np.linalg.norm(vertices - middle, axis=1).max()
    focal = 1.8 * size
    messages, pictures, masks = {}, [], []
    for n, direction in enumerate(directions(count)):
        eye = middle + 4.2 * radius * direction
        rotation = look_at(eye, middle)
        ids, picture = render(vertices, triangles, rotation, eye, focal, size)
        view = view_messages(f"{n:03}", picture, ids >= 0)
        view[f"/views/{n:03}/triangles"].data = ids.astype("<i4").tobytes()
        view[f"/views/{n:03}/camera"].K[:] = [focal, 0, size / 2, 0, focal, size / 2, 0, 0, 1]
        tf = view["/tf"]
        tf.translation.x, tf.translation.y, tf.translation.z = eye
        tf.rotation.x, tf.rotation.y, tf.rotation.z, tf.rotation.w = quaternion(rotation.T)
        messages[n] = view
        pictures.append(picture)
        masks.append(ids >= 0)
    scene = SceneUpdate()
    triangle_list = scene.entities.add(frame_id="object", id="mesh").triangles.add()
    for x, y, z in vertices:
        triangle_list.points.add(x=x, y=y, z=z)
    triangle_list.indices.extend(triangles.ravel().tolist())
    built = [("/mesh", scene)] + [item for view in messages.values() for item in view.items()]
    identity = {
        "n_vertices": str(len(vertices)),
        "n_triangles": str(len(triangles)),
        "mesh_hash": Mesh(vertices, triangles).hash,
    }
    return write_views(
        path, pictures, masks, lambda _: change(built), metadata={**METADATA, **identity}
    )


def write_region(path: Path, inside: np.ndarray) -> Path:
    """A region file of the vertices inside."""
    region = {"format": "semfm.region/1", "vertices": np.flatnonzero(inside).tolist()}
    path.write_text(json.dumps(region))
    return path


def iou(a: np.ndarray, b: np.ndarray) -> float:
    """Intersection over union of two sets of vertices."""
    return float((a & b).sum() / (a | b).sum())
