"""Measures an encoder on labelled objects: mean IoU of carried regions, by group.

    python -m train.judge DATA ENCODER.json -o FOLDER --rolls 1

DATA is a folder as `semfm-cli eval` takes it, with `pairs.json`. The same as `semfm-cli eval DATA
--encoder ENCODER.json --methods fused,nearest` but for the number of turns, which this lets choose.
"""

from __future__ import annotations

import argparse
import json
import statistics
from pathlib import Path

import semfm
from semfm.__main__ import main as run_command
from semfm.sidecar.embed import EmbedSettings, embed_file
from semfm.sidecar.onnx_encoder import OnnxEncoder


def embed_objects(data: Path, encoder_json: str, folder: Path, rolls: int, count: int) -> None:
    """Writes `NAME.emb.mcap` of every labelled object; views are kept for the next encoder."""
    pairs = json.loads((data / "pairs.json").read_text())
    names = sorted({name for group in pairs.values() for pair in group for name in pair})
    encoder = OnnxEncoder(encoder_json, "cpu", 1)
    views_folder = folder.parent / f"views{count}"
    views_folder.mkdir(parents=True, exist_ok=True)
    (folder / "embeddings").mkdir(parents=True, exist_ok=True)
    for name in names:
        views = views_folder / f"{name}.views.mcap"
        if not views.exists():
            mesh = semfm.read_mesh(next(data.glob(f"*/{name}.obj"))).mesh
            drawn = semfm.render(mesh, semfm.rig(mesh, count=count))
            semfm.ViewsFile(mesh, drawn).write(views)
        output = folder / "embeddings" / f"{name}.emb.mcap"
        embed_file(views, output, encoder, EmbedSettings(rolls=rolls))


def table(rows: list[dict], methods: list[str]) -> str:
    """Mean IoU of each method over all pairs and by group, one line a method."""
    lines = []
    for method in methods:
        mine = [row for row in rows if row["method"] == method]
        groups: dict[str, list[float]] = {}
        for row in mine:
            groups.setdefault(row["group"], []).append(row["iou"])
        mean = statistics.mean(row["iou"] for row in mine)
        failed = sum(row["iou"] < 0.3 for row in mine) / len(mine)
        by_group = ", ".join(f"{g} {statistics.mean(v):.3f}" for g, v in sorted(groups.items()))
        lines.append(f"{method}: all {mean:.3f}, below .3 {failed:.3f}; {by_group}")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", type=Path)
    parser.add_argument("encoder", metavar="ENCODER.json")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="FOLDER")
    parser.add_argument("--rolls", type=int, choices=(1, 2, 4), default=1)
    parser.add_argument("--views", type=int, default=14)
    parser.add_argument("--methods", default="fused,nearest")
    parser.add_argument("--threads", type=int, default=2)
    arguments = parser.parse_args()
    embed_objects(
        arguments.data, arguments.encoder, arguments.output, arguments.rolls, arguments.views
    )
    report = arguments.output / "report"
    run_command(
        [
            "eval",
            str(arguments.data),
            "--embeddings",
            str(arguments.output / "embeddings"),
            "--methods",
            arguments.methods,
            "--gallery",
            "0",
            "--no-predictions",
            "--fresh",
            "--quiet",
            "--threads",
            str(arguments.threads),
            "-o",
            str(report),
        ]
    )
    print(
        table(
            json.loads((report / "results.json").read_text())["rows"], arguments.methods.split(",")
        )
    )


if __name__ == "__main__":
    main()
