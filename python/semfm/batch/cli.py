"""``python -m semfm.batch``: the same from the shell."""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any, Optional

from .._command import finish
from .._files import read_json
from .._semfm import TransferSettings, printable
from ..errors import FormatError
from . import shards
from .library import Summary, transfer


def main(arguments: Optional[Sequence[str]] = None) -> int:
    """Runs one command line and returns its exit code.

    Parameters
    ----------
    arguments : sequence of str, optional
        Without the program's name; those of the process where none are given.

    Returns
    -------
    int
        0 every object has an answer, 1 some failed in this run, 2 bad input or failure, 130 Ctrl-C.
    """
    return finish(
        "error", lambda: _run(arguments), "stopped; the same command goes on from here"
    )


def _run(arguments: Optional[Sequence[str]]) -> int:
    options = vars(_parser().parse_args(arguments))
    as_json = options.pop("json")
    quiet = options.pop("quiet")
    chosen = options.pop("settings")
    summary = transfer(
        **options,
        settings=None if chosen is None else _settings(chosen),
        progress=None if quiet else True,
    )
    print(printable(json.dumps(asdict(summary)) if as_json else _words(summary)))
    return 1 if summary.n_failed else 0


def _words(summary: Summary) -> str:
    verdicts = ", ".join(f"{count} {name}" for name, count in sorted(summary.verdicts.items()))
    errors = ", ".join(f"{count} {name}" for name, count in sorted(summary.errors.items()))
    lines = [
        f"{summary.n_done} done" + (f" ({verdicts})" if verdicts else ""),
        f"{summary.n_failed} failed" + (f" ({errors})" if errors else ""),
        f"{summary.n_skipped} skipped, of {summary.n_rows}; {summary.seconds:.1f} s",
        summary.out,
    ]
    return "\n".join(lines)


def _settings(path: str) -> TransferSettings:
    found: Any = read_json(path)
    if not isinstance(found, dict):
        raise FormatError(f"{path}: expected an object of settings", place=path)
    return TransferSettings(**found)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m semfm.batch",
        description="Transfer one demonstrated region to every object of a manifest. "
        "The same command again goes on where the last one stopped.",
    )
    add = parser.add_argument
    add("source", help="mesh of the demonstrated object")
    add("region", help="its region file")
    add(
        "manifest",
        help=".csv, .jsonl or .parquet: mesh, name, and embeddings, features, cloud or none of them",
    )
    add("-o", "--out", required=True, help="folder of answers")
    add("--source-embeddings", metavar="FILE", help=".emb.mcap of the source")
    add(
        "--encoder",
        metavar="NAME",
        help="makes the features of objects without any, the source among them (builtin)",
    )
    how = parser.add_argument_group("what is computed")
    add = how.add_argument
    add("--method", help="fused (default), semfm, anchored, sinkhorn, nearest or wks")
    add("--rule", choices=("preimage", "image"))
    add("--settings", metavar="JSON", help="a file of settings, in place of method and rule")
    add("--seed", type=int, default=0)
    add("--k", type=int, help="eigenpairs of each shape")
    add("--working-vertices", type=int, metavar="N", help="simplify above N vertices; 0 never")
    add("--n-samples", type=int, metavar="N", help="points of each cloud")
    add("--point-maps", action="store_true", help="keep whole point maps")
    where = parser.add_argument_group("where and how fast")
    add = where.add_argument
    add("--runner", choices=("local", "ray"), default="local")
    add("--address", help="of a Ray cluster, such as auto")
    add("--workers", type=int, metavar="N", help="objects at a time")
    add("--threads", type=int, metavar="N", help="threads of each worker")
    add("--timeout", dest="timeout_s", type=float, metavar="S", help="seconds for one object")
    add("--attempts", type=int, default=2, help="tries of an object whose worker dies")
    files = parser.add_argument_group("files and messages")
    add = files.add_argument
    cache = files.add_mutually_exclusive_group()
    cache.add_argument(
        "--cache", metavar="FOLDER", help="of prepared shapes; OUT/shapes if not given"
    )
    cache.add_argument("--no-cache", dest="cache", action="store_false", default=None)
    add("--format", choices=shards.FORMATS)
    add("--shard-size", type=int, default=256, metavar="N", help="records in a file")
    add("--retry-failed", action="store_true", help="try again what failed before")
    add("--json", action="store_true", help="summary as JSON")
    add("--quiet", action="store_true", help="no progress")
    return parser
