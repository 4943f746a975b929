"""The upper bound of the VLM baseline: what is left of the truth after drawing, answering, lifting.

Labelled objects of an evaluation folder are asked about with a stand-in for the model that answers
with the true region (`semfm-vlm --true-masks`); `semfm-cli eval --vlm` scores the rows. One pair for
each target is enough, for the source does not matter to this answer.

    python bench/vlm_upper_bound.py ../shared/data/objects --views VIEWS --cli target/release/semfm-cli

DATA needs a pairs.json. Views that are missing in VIEWS are rendered with the program. Prints mean
IoU over vertices of each category and the mean of those, per mode and number of views.
"""

from __future__ import annotations

import argparse
import json
import subprocess
from pathlib import Path

MODES = ("polygons", "marks")


def main() -> None:
    p = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    p.add_argument("data", type=Path, help="CATEGORY/NAME.{obj,ply,json} and pairs.json")
    p.add_argument("--views", type=Path, required=True, metavar="DIR", help="NAME.views.mcap")
    p.add_argument("--cli", default="semfm-cli", help="renders missing views, scores the rows")
    p.add_argument("--size", type=int, default=224, help="of rendered views, in pixels")
    p.add_argument("--counts", default="1,3,6", help="numbers of views")
    p.add_argument("--per-category", type=int, help="only the first so many targets of each")
    p.add_argument("-o", "--output", type=Path, default=Path("vlm-upper-bound"))
    args = p.parse_args()
    args.output.mkdir(parents=True, exist_ok=True)
    pairs = args.output / "pairs.json"
    pairs.write_text(json.dumps(one_pair_per_target(args)))
    columns: dict[str, dict[str, float]] = {}
    for mode in MODES:
        for summary in score(args, pairs, mode):
            if summary["scope"] in ("category", "mean_of_categories") and summary["mean"]:
                column = columns.setdefault(summary["method"], {})
                column[summary.get("name", "mean")] = summary["mean"]
    print("category".ljust(24), *(name.rjust(24) for name in columns))
    for category in next(iter(columns.values())):
        numbers = (f"{column[category]:.3f}".rjust(24) for column in columns.values())
        print(category.ljust(24), *numbers)


def one_pair_per_target(args: argparse.Namespace) -> list[dict]:
    """The first pair of each target, with the files that `semfm-vlm --pairs` wants."""
    labels = {path.stem: path for path in sorted(args.data.glob("*/*.json"))}
    chosen, counts = {}, {}
    for group, pairs in json.loads((args.data / "pairs.json").read_text()).items():
        for source, target in pairs:
            source_label, target_label = (labels[Path(name).name] for name in (source, target))
            category = target_label.parent.name
            limit = args.per_category or len(labels)
            if target_label in chosen or counts.get(category, 0) >= limit:
                continue
            counts[category] = counts.get(category, 0) + 1
            chosen[target_label] = {
                "group": group,
                "source": source_label.stem,
                "target": target_label.stem,
                "source_views": str(views_of(source_label, args).resolve()),
                "target_views": str(views_of(target_label, args).resolve()),
                "region": str(source_label.resolve()),
                "truth": str(target_label.resolve()),
            }
    return list(chosen.values())


def views_of(label: Path, args: argparse.Namespace) -> Path:
    """The object's views file, rendered where it is missing."""
    path = args.views / f"{label.stem}.views.mcap"
    if not path.exists():
        args.views.mkdir(parents=True, exist_ok=True)
        meshes = [label.with_suffix(suffix) for suffix in (".obj", ".ply", ".stl", ".off", ".glb")]
        mesh = next(mesh for mesh in meshes if mesh.exists())
        run([args.cli, "views", mesh, "-o", path, "--size", args.size, "-q"])
    return path


def score(args: argparse.Namespace, pairs: Path, mode: str) -> list[dict]:
    """Summaries of the stand-in's rows."""
    rows, report = args.output / f"{mode}.json", args.output / mode
    run(["semfm-vlm", "--pairs", pairs, "--true-masks", "--mode", mode, "--views", args.counts]
        + ["-o", rows, "--quiet"])
    run([args.cli, "eval", args.data, "--vlm", rows, "--methods", "whole", "--no-predictions"]
        + ["--gallery", 0, "--fresh", "--quiet", "-o", report])
    results = json.loads((report / "results.json").read_text())
    return [one for one in results["summaries"] if one["method"].startswith("vlm-")]


def run(command: list) -> None:
    subprocess.run([str(word) for word in command], check=True, stdout=subprocess.DEVNULL)


if __name__ == "__main__":
    main()
