#!/usr/bin/env python3
"""Carry labelled regions between real objects and score them: a table of methods and groups.

    bench/real_pairs.py DATA --encoder ENCODER.json [--binary target/release/semfm-cli]
                        [--pairs-per-group 6] [--methods fused,semfm,sinkhorn,nearest] [-o FOLDER]

DATA is a folder of <category>/<name>.{obj,ply} with <name>.json labels and a pairs.json
(docs/formats.md). Every transfer goes through the command line, so the numbers are those that a
user gets; embeddings and shapes are cached between methods. Times are wall times of the stages
that the report names, medians over the pairs.
"""
import argparse
import json
import statistics
import subprocess
import sys
from pathlib import Path


def find(data: Path, name: str) -> Path:
    meshes = [p for p in data.glob(f"*/{name}.*") if p.suffix in (".obj", ".ply", ".off", ".stl", ".glb")]
    meshes = [p for p in meshes if p.parent.name not in ("coloured", "textured")]
    if not meshes:
        sys.exit(f"{data}: no mesh named {name}")
    return meshes[0]


def truth(mesh: Path) -> set:
    return set(json.loads(mesh.with_suffix(".json").read_text())["region"]["vertices"])


def run(args, source: Path, target: Path, method: str, out: Path):
    command = [args.binary, "transfer", source, target, "--region", source.with_suffix(".json"), "-o", out]
    command += ["--encoder", args.encoder, "--method", method, "--quiet"] + args.more.split()
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True)
    if done.returncode not in (0, 1):
        sys.exit(f"{source.stem} -> {target.stem}, {method}: {done.stderr}")
    region = json.loads((out / "region.json").read_text())
    stages = json.loads((out / "report.json").read_text())["stages_ms"]
    found, right = set(region["vertices"]), truth(target)
    iou = len(found & right) / max(1, len(found | right))
    return {"iou": iou, "confidence": region["confidence"], "verdict": region["verdict"], "stages_ms": stages}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", type=Path)
    parser.add_argument("--encoder", required=True)
    parser.add_argument("--binary", default="target/release/semfm-cli")
    parser.add_argument("--pairs-per-group", type=int, default=6)
    parser.add_argument("--methods", default="fused,semfm,sinkhorn,nearest")
    parser.add_argument("--groups", default="", help="only groups whose name contains one of these words")
    parser.add_argument("--more", default="", help="further options of transfer")
    parser.add_argument("-o", "--output", type=Path, default=Path("real-pairs"))
    args = parser.parse_args()
    methods, rows = args.methods.split(","), []
    for group, pairs in json.loads((args.data / "pairs.json").read_text()).items():
        if args.groups and not any(word in group for word in args.groups.split(",")):
            continue
        # Evenly spread over the list, so that every source has its turn.
        step = max(1, len(pairs) // args.pairs_per_group)
        for source, target in pairs[::step][: args.pairs_per_group]:
            a, b = find(args.data, source), find(args.data, target)
            for method in methods:
                out = args.output / f"{source}--{target}" / method
                rows.append({"group": group, "source": source, "target": target, "method": method}
                            | run(args, a, b, method, out))
            shown = "  ".join(f"{r['method']} {r['iou']:.2f} ({r['verdict']})" for r in rows[-len(methods):])
            print(f"{group:22} {source} -> {target}: {shown}", flush=True)
    (args.output / "results.json").write_text(json.dumps(rows, indent=1))
    print("\n| group | pairs | " + " | ".join(methods) + " |\n" + "| --- " * (len(methods) + 2) + "|")
    groups = list(dict.fromkeys(row["group"] for row in rows))
    for group in groups + ["all"]:
        mine = [row for row in rows if group in (row["group"], "all")]
        means = [statistics.mean(row["iou"] for row in mine if row["method"] == m) for m in methods]
        print(f"| {group} | {len(mine) // len(methods)} | " + " | ".join(f"{mean:.2f}" for mean in means) + " |")
    for method in methods:
        mine = [row for row in rows if row["method"] == method]
        low = sum(row["iou"] < 0.3 for row in mine) / len(mine)
        names = list(dict.fromkeys(name for row in mine for name in row["stages_ms"]))
        medians = {name: statistics.median(row["stages_ms"].get(name, 0.0) for row in mine) for name in names}
        print(f"{method}: share below .3 {low:.2f}; ms " + ", ".join(f"{n} {t:.0f}" for n, t in medians.items()))


if __name__ == "__main__":
    main()
