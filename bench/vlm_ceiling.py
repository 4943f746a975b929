"""The ceiling of the VLM baseline: what is left of the truth after drawing, answering and lifting.

Every labelled object of an evaluation folder is asked about with a stand-in for the model that
answers with the true region, through the whole road of ``semfm.vlm``. Source and target are the
same object, for the source does not matter to this answer.

    python bench/vlm_ceiling.py ../shared/data/objects --views VIEWS --cli target/release/semfm-cli

Views that are missing in VIEWS are rendered with the program. Prints IoU over vertices: the mean
of each category and the mean of those, per mode and number of views.
"""

from __future__ import annotations

import argparse
import subprocess
from pathlib import Path

import numpy as np
from semfm.vlm import BaselineSettings, TrueMasks, read_object, read_region, transfer


def main() -> None:
    p = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    p.add_argument("data", type=Path, help="CATEGORY/NAME.{obj,ply,json}")
    p.add_argument("--views", type=Path, required=True, metavar="DIR", help="NAME.views.mcap")
    p.add_argument("--cli", default="semfm-cli", help="renders the views that are missing")
    p.add_argument("--size", type=int, default=224, help="of rendered views, in pixels")
    p.add_argument("--counts", default="1,3,6", help="numbers of views")
    p.add_argument("--per-category", type=int, help="only the first so many objects of each")
    p.add_argument("--marks", type=int, default=BaselineSettings().n_segments)
    args = p.parse_args()
    counts = [int(n) for n in args.counts.split(",")]
    ways = [(mode, n) for mode in ("polygons", "marks") for n in counts]
    print("category".ljust(24), "objects", *(f"{mode[:5]}/{n}".rjust(9) for mode, n in ways))
    means = []
    for category in sorted({path.parent for path in args.data.glob("*/*.json")}):
        labels = sorted(category.glob("*.json"))[: args.per_category]
        rows = [ceilings(label, views_of(label, args), ways, args.marks) for label in labels]
        means.append(np.mean(rows, 0))
        show(category.name, len(rows), means[-1])
    show("mean", len(means), np.mean(means, 0))


def show(name: str, count: int, numbers: np.ndarray) -> None:
    print(name.ljust(24), str(count).rjust(7), *(f"{x:.3f}".rjust(9) for x in numbers), flush=True)


def views_of(label: Path, args: argparse.Namespace) -> Path:
    """The object's views file, rendered where it is missing."""
    path = args.views / f"{label.stem}.views.mcap"
    if not path.exists():
        args.views.mkdir(parents=True, exist_ok=True)
        meshes = [label.with_suffix(suffix) for suffix in (".obj", ".ply", ".stl", ".off", ".glb")]
        mesh = next(mesh for mesh in meshes if mesh.exists())
        command = [args.cli, "views", str(mesh), "-o", str(path), "--size", str(args.size), "-q"]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return path


def ceilings(label: Path, views: Path, ways: list[tuple[str, int]], n_segments: int) -> list[float]:
    """IoU of the fused region with the label, per way."""
    of = read_object(views)
    weights = read_region(label, of)
    found = []
    for mode, n_views in ways:
        settings = BaselineSettings(mode=mode, n_segments=n_segments)
        outcome = transfer(of, of, weights, n_views, TrueMasks(weights), settings)
        lifted = np.zeros_like(weights) if outcome.weights is None else outcome.weights
        found.append(iou(lifted >= 0.5, weights >= 0.5))
    return found


def iou(a: np.ndarray, b: np.ndarray) -> float:
    return float((a & b).sum() / (a | b).sum())


if __name__ == "__main__":
    main()
