"""How much of a part one camera sees, and how much of it `Region.grown` gives back.

Reads a folder of labelled meshes: ``FOLDER/CATEGORY/NAME.obj`` (or .ply, .stl, .off, .glb) beside
``NAME.json`` with ``region.vertices``::

    pip install .
    python bench/grow.py OBJECTS [--views 6]

For each camera that sees a part of the true region: the area IoU of what it sees with the whole region,
and of what is completed with the camera known and unknown. `whole` is the true region itself, completed
without a camera: it should stay as it is.
"""

from __future__ import annotations

import argparse
import json
from collections import defaultdict
from pathlib import Path

import numpy as np

import semfm

SUFFIXES = (".obj", ".ply", ".stl", ".off", ".glb")
#: A camera that sees less of the region than this share of its vertices demonstrates nothing.
LEAST_SEEN = 0.03


def labelled(folder: Path):
    """Category, mesh and true region of each labelled object."""
    for label in sorted(folder.glob("*/*.json")):
        content = json.loads(label.read_text())
        if not isinstance(content, dict) or "region" not in content:
            continue
        meshes = [label.with_suffix(suffix) for suffix in SUFFIXES]
        path = next((mesh for mesh in meshes if mesh.is_file()), None)
        if path is not None:
            mesh = semfm.Mesh.read(path)
            vertices = content["region"]["vertices"]
            yield label.parent.name, mesh, semfm.Region.from_vertices(mesh.n_vertices, vertices)


def seen_by(mesh: semfm.Mesh, truth: semfm.Region, n_views: int):
    """Cameras, and what each sees of the true region through the mask that a person would draw."""
    inside = truth.mask[np.asarray(mesh.faces)].sum(axis=1) >= 2
    cameras = semfm.rig(mesh, count=n_views)
    for camera, view in zip(cameras, semfm.render(mesh, cameras)):
        triangles = np.asarray(view.triangles)
        mask = (triangles >= 0) & inside[np.maximum(triangles, 0)]
        try:
            seen = semfm.Region.masked(mesh, camera, mask)
        except semfm.InvalidInput:
            continue
        if (seen.mask & truth.mask).sum() >= LEAST_SEEN * truth.mask.sum():
            yield camera, seen


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("objects", type=Path)
    parser.add_argument("--views", type=int, default=6)
    arguments = parser.parse_args()
    rows, whole = defaultdict(list), defaultdict(list)
    for category, mesh, truth in labelled(arguments.objects):
        areas = mesh.vertex_areas()
        for camera, seen in seen_by(mesh, truth, arguments.views):
            regions = (seen, seen.grown(mesh, camera=camera), seen.grown(mesh))
            rows[category].append([region.iou(truth, areas) for region in regions])
        whole[category].append(truth.grown(mesh).iou(truth, areas))
    print("| category | views | seen | camera known | worst tenth | camera unknown | whole |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    rows["all"] = [row for category in list(rows) for row in rows[category]]
    whole["all"] = [value for category in list(whole) for value in whole[category]]
    for category, values in rows.items():
        seen, known, unknown = np.mean(values, axis=0)
        tenth = np.quantile([row[1] for row in values], 0.1)
        print(
            f"| {category} | {len(values)} | {seen:.2f} | {known:.2f} | {tenth:.2f} | {unknown:.2f} "
            f"| {np.mean(whole[category]):.2f} |"
        )


if __name__ == "__main__":
    main()
