#!/usr/bin/env python3
"""What an encoder should be shown: one protocol of views after the other, judged by the regions.

    python bench/views_study.py DATA --encoder ENCODER.json [--binary target/release/semfm-cli]
                                [--only PROTOCOL …] [-o views-study]

DATA is a folder as `semfm-cli eval` takes it. For every protocol below, each labelled object is
drawn (`semfm-cli views`), embedded (`semfm.sidecar`, so the package must be installed) and every
pair is evaluated (`semfm-cli eval --methods fused`), compared with `default`. What is finished is
kept in the output folder and not done again; `table.md` there holds all protocols so far.

Objects are halved by turns within each group, in alphabetical order. A -> A are the pairs inside
the half that choices may be made on, B -> B those inside the other. Differences are to `default`,
pair by pair, with a 95 % interval from resampling the objects (`semfm-cli eval --compare`).
"""

import argparse
import json
import shutil
import statistics
import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

#: Objects of which DATA/coloured/NAME.ply holds a painted copy are drawn in its colours. No group
#: has two of them, so every pair that they are in sees colour on one side only.
ONE_SIDE = "colours"

#: The protocol that the others are compared with.
DEFAULT = "default"

#: Name -> (options of `semfm-cli views`, rolls of each picture).
PROTOCOLS = {
    DEFAULT: ("", 4),
    "1 roll": ("", 1),
    "2 rolls": ("", 2),
    "6 views": ("--count 6", 4),
    "10 views": ("--count 10", 4),
    "20 views": ("--count 20", 4),
    "28 views, 2 rolls": ("--count 28", 2),
    "14 views, 448 px": ("--size 448", 4),
    "10 views, 2 rolls": ("--count 10", 2),
    "320 px": ("--size 320", 4),
    "angle of view 12°": ("--fov 12", 4),
    "angle of view 50°": ("--fov 50", 4),
    "fill .65": ("--fill 0.65", 4),
    "fill .95": ("--fill 0.95", 4),
    "zoom up to 1": ("--max-zoom 1", 4),
    "zoom up to 3": ("--max-zoom 3", 4),
    "z of the file upright": ("--upright z", 4),
    "black background": ("--background 0", 4),
    "black background, 12°, fill .65": ("--background 0 --fov 12 --fill 0.65", 4),
    "black background, 12°": ("--background 0 --fov 12", 4),
    "grey background": ("--background 0.5", 4),
    "occlusion 1": ("--occlusion 1", 4),
    "edges .5": ("--edges 0.5", 4),
    "normals as colour": ("--normals", 4),
    "ambient .6": ("--ambient 0.6", 4),
    "colours on one side": (ONE_SIDE, 4),
    "2 close-ups": ("--close-ups 2", 4),
    "7 views, 2 close-ups, 2 rolls": ("--count 7 --close-ups 2", 2),
}

_ENCODER = None


def open_worker(model: str, threads: int) -> None:
    global _ENCODER
    from semfm.sidecar import open_encoder

    _ENCODER = open_encoder(model, "cpu", threads)


def draw(binary: str, mesh: Path, options: str, views: Path) -> None:
    painted = mesh.parent.parent / "coloured" / f"{mesh.stem}.ply"
    if options == ONE_SIDE and painted.is_file():
        import semfm

        plain, colors = semfm.Mesh.read(mesh), semfm.read_mesh(painted).vertex_colors
        semfm.ViewsFile(plain, semfm.render(plain, colors=colors[:, :3] / 255)).write(views)
        return
    options = "" if options == ONE_SIDE else options
    colours = [] if "--normals" in options else ["--grey"]
    command = [binary, "views", mesh, "-o", views, *options.split(), *colours]
    command += ["--renderer", "cpu", "--threads", "1", "--quiet"]
    subprocess.run([str(word) for word in command], check=True, stdout=subprocess.DEVNULL)


def embed(binary: str, mesh: Path, options: str, rolls: int, output: Path) -> None:
    """Draws and embeds one object."""
    from semfm.sidecar import EmbedSettings, embed_file

    views = output.with_suffix(".views.mcap")
    draw(binary, mesh, options, views)
    embed_file(views, output, _ENCODER, EmbedSettings(rolls=rolls))
    views.unlink()


def measure(args: argparse.Namespace, name: str, objects: list[Path], pool) -> None:
    """One protocol: draws, embeds and evaluates it into its folder."""
    options, rolls = PROTOCOLS[name]
    embedded, report = args.output / "embedded", folder_of(args, name)
    shutil.rmtree(embedded, ignore_errors=True)
    embedded.mkdir(parents=True)
    outputs = [embedded / f"{mesh.stem}.emb.mcap" for mesh in objects]
    n = len(objects)
    list(pool.map(embed, [args.binary] * n, objects, [options] * n, [rolls] * n, outputs))
    command = [args.binary, "eval", args.data, "--embeddings", embedded, "-o", report]
    command += ["--methods", "fused", "--gallery", 0, "--no-predictions", "--fresh", "--quiet"]
    if name != DEFAULT:
        command += ["--compare", folder_of(args, DEFAULT) / "results.json"]
    subprocess.run([str(word) for word in command], check=True, stdout=subprocess.DEVNULL)
    shutil.rmtree(embedded)


def folder_of(args: argparse.Namespace, name: str) -> Path:
    return args.output / name


def read(folder: Path, name: str) -> dict:
    return json.loads((folder / name).read_text())


def halves(rows: list[dict]) -> dict[str, str]:
    half: dict[str, str] = {}
    for group in dict.fromkeys(row["group"] for row in rows):
        names = {row[end] for row in rows if row["group"] == group for end in ("source", "target")}
        for turn, name in enumerate(sorted(names)):
            half.setdefault(name, "AB"[turn % 2])
    return half


def summary(results: dict, scope: str) -> dict:
    return next(one for one in results["summaries"] if one["scope"] == scope)


def difference(folder: Path) -> str:
    """Mean of the paired differences to `default` and its interval."""
    if not (folder / "compare.json").is_file():
        return "–"
    change = read(folder, "compare.json")["methods"][0]
    low, high = change["interval"]
    return f"{change['now'] - change['before']:+.3f} ({low:+.3f} … {high:+.3f})"


def table(measured: dict[str, Path]) -> str:
    half = halves(read(measured[DEFAULT], "results.json")["rows"])
    heads = "protocol | pictures | all | categories | < .3 | A → A | B → B | against the default"
    lines = [f"| {heads} |", "| --- " * 8 + "|"]
    for name, folder in measured.items():
        results = read(folder, "results.json")
        options, rolls = PROTOCOLS[name]
        words = dict(zip(options.split()[::2], options.split()[1::2]))
        shots = int(words.get("--count", 14)) * (1 + int(words.get("--close-ups", 0)))
        over_all = summary(results, "all")
        numbers = [over_all["mean"], summary(results, "mean_of_categories")["mean"]]
        numbers.append(over_all["below_poor"])
        for letter in "AB":
            inside = [
                row["iou"]
                for row in results["rows"]
                if half[row["source"]] == half[row["target"]] == letter
            ]
            numbers.append(statistics.mean(inside))
        cells = [name, str(shots * rolls), *(f"{number:.3f}" for number in numbers)]
        lines.append("| " + " | ".join([*cells, difference(folder)]) + " |")
    return "\n".join(lines) + "\n"


def find(data: Path, name: str) -> Path:
    """The mesh of an object; painted and textured copies lie in folders without a number."""
    files = sorted(data.glob(f"[0-9]*/{name}.*"))
    return next(path for path in files if path.suffix != ".json")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", type=Path)
    parser.add_argument("--encoder", required=True)
    parser.add_argument("--binary", default="target/release/semfm-cli")
    parser.add_argument("--only", action="append", metavar="PROTOCOL", help="(repeatable)")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("-o", "--output", type=Path, default=Path("views-study"))
    args = parser.parse_args()
    pairs = json.loads((args.data / "pairs.json").read_text())
    names = sorted({name for group in pairs.values() for pair in group for name in pair})
    objects = [find(args.data, name) for name in names]
    args.output.mkdir(parents=True, exist_ok=True)
    wanted = {DEFAULT, *(args.only or PROTOCOLS)}
    measured = {}
    with ProcessPoolExecutor(args.jobs, None, open_worker, (args.encoder, 1)) as pool:
        for name in PROTOCOLS:
            folder = folder_of(args, name)
            if not (folder / "results.json").is_file() and name in wanted:
                measure(args, name, objects, pool)
            if (folder / "results.json").is_file():
                measured[name] = folder
                text = table(measured)
                (args.output / "table.md").write_text(text)
                print(text.splitlines()[-1], file=sys.stderr, flush=True)
    print(args.output / "table.md")


if __name__ == "__main__":
    main()
