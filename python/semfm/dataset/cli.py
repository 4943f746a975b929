"""The command ``semfm-dataset``: stdout says where it wrote, everything else goes to stderr."""

from __future__ import annotations

import argparse
import json
import threading
from collections.abc import Sequence
from functools import lru_cache
from importlib import resources
from pathlib import Path
from typing import Any

from .._command import complain, finish
from .._files import read_text
from .._semfm import check_output, printable
from ..sidecar.errors import SidecarError, expected
from ..sidecar.progress import add_message_options, open_progress
from ..vlm.client_options import add_client_options, patience
from .commands import CommandTemplate
from .image_endpoint import (
    VARIABLES,
    CachedImages,
    EditEndpoint,
    ImageEndpoint,
    ImageSettings,
    image_settings,
)
from .plan import read_plan
from .run import Row, labels_beside, run_plan, summary
from .stages import Makers

_PROGRAM = "semfm-dataset"

_EPILOG = f"""\
Objects with a `picture` and masks in the plan ask no endpoint. For the others it is
${VARIABLES}_BASE_URL, ${VARIABLES}_MODEL, ${VARIABLES}_API_KEY (or OPENAI_… in their place). The
key is read from the environment only, and written nowhere.

examples:
  semfm-dataset plan.json -o data --set size=1024x1024 --set input_fidelity=high
  semfm-dataset plan.json -o data --mask-command 'segment {{picture}} --text {{what}} -o {{output}}'
  semfm-cli eval data/objects -o report

exit code: 0 every object has a label, 1 some have none, 2 bad input or failure, 130 interrupted;
the same command goes on from there
"""


def parser() -> argparse.ArgumentParser:
    """The command's arguments."""
    p = argparse.ArgumentParser(
        prog=_PROGRAM,
        description="From pictures of objects and a region in words to labelled meshes for eval.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    p.add_argument("plan", metavar="PLAN.json", help="semfm.dataset-plan/1 (docs/dataset.md)")
    p.add_argument("-o", "--output", metavar="FOLDER", required=True, help="of the dataset")
    made = p.add_argument_group("how it is made")
    made.add_argument(
        "--prompt", metavar="FILE", help="words for the endpoint, with $object and $region"
    )
    made.add_argument(
        "--mask-command",
        metavar="COMMAND",
        help="makes a mask: places {picture}, {what} and {output} (default: from what changed)",
    )
    made.add_argument(
        "--reconstruct-command",
        metavar="COMMAND",
        help="in place of semfm-reconstruct: places {picture}, {mask}, {hand_mask}, {longest} and "
        "{output}, a folder for mesh.ply, hand.ply and camera_from_object.json",
    )
    made.add_argument(
        "--tool", metavar="NAME", help="of semfm-reconstruct: sam3d or package.module:Class"
    )
    made.add_argument("--sam3d", metavar="FOLDER", help="of semfm-reconstruct: its checkout")
    end = p.add_argument_group("endpoint")
    add_client_options(end, ImageSettings(""), "pictures")
    end.add_argument(
        "--seed", type=int, metavar="N", help="a field of the request, where it is known"
    )
    end.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="a further field of the request, as size=1024x1024",
    )
    add_message_options(p, "the summary as JSON on stdout")
    return p


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; returns the exit code."""
    return finish(_PROGRAM, lambda: _run(argv), "interrupted; the same command goes on from here")


def _run(argv: Sequence[str] | None) -> int:
    args = parser().parse_args(argv)
    plan, root = read_plan(args.plan), Path(args.output)
    try:
        root.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SidecarError(f"{root}: {error.strerror or error}") from error
    inputs = [args.plan, *(str(path) for item in plan for path in item.files)]
    check_output(root / "dataset.json", inputs)
    _check_inputs(root, inputs)
    stop = threading.Event()
    makers = _makers(args, stop)
    if any(item.reference for item in plan):
        makers.endpoint()  # what is wrong with it is told before anything is done
    progress = open_progress("none" if args.quiet else args.progress, "objects")
    try:
        rows = run_plan(plan, root, makers, progress, lambda text: _say(args, text))
    finally:
        stop.set()
        progress.close()
    for title in labels_beside(plan, root):
        _say(args, f"{title} is there and not in the plan; `semfm-cli eval` reads it all the same")
    return _report(args, rows)


def _check_inputs(root: Path, inputs: Sequence[str]) -> None:
    """Refuses inputs in the folders that are written; raises SidecarError."""
    written = [(root / name).resolve() for name in ("work", "objects")]
    for file in inputs:
        for folder in written:
            if folder in Path(file).resolve().parents:
                raise expected(file, "input", f"a file outside of {folder}, which is written", "it")


def _makers(args: argparse.Namespace, stop: threading.Event) -> Makers:
    words = read_text(args.prompt) if args.prompt else _own_words()
    if "$region" not in words:
        raise expected(args.prompt, "prompt", "$region in it", "none")
    masks = args.mask_command and CommandTemplate.parse(
        "--mask-command", args.mask_command, ("picture", "what", "output")
    )
    places = ("picture", "mask", "hand_mask", "longest", "output")
    meshes = args.reconstruct_command and CommandTemplate.parse(
        "--reconstruct-command", args.reconstruct_command, places
    )
    options: list[str] = []
    for name in ("tool", "sam3d"):
        if value := getattr(args, name):
            options += [f"--{name}", value]
    more = _more(args)

    @lru_cache(maxsize=1)
    def endpoint() -> ImageEndpoint:
        settings = image_settings(args.model, args.base_url, more=more, **patience(args))
        opened = EditEndpoint(settings, stop)
        return CachedImages(opened, args.cache) if args.cache else opened

    return Makers(endpoint, words, masks or None, meshes or None, tuple(options))


def _own_words() -> str:
    return (resources.files(__package__) / "prompts" / "demonstration.md").read_text("utf-8")


def _more(args: argparse.Namespace) -> dict[str, Any]:
    """Further fields of the request."""
    more: dict[str, Any] = {} if args.seed is None else {"seed": args.seed}
    for word in args.set:
        name, equals, value = word.partition("=")
        if not (equals and name.isidentifier() and value) or name in ("model", "prompt", "image"):
            raise expected("settings", "--set", "NAME=VALUE", repr(word))
        if name == "seed":
            raise expected("settings", "--set", "--seed N in place of a field `seed`", repr(word))
        more[name] = value
    return more


def _report(args: argparse.Namespace, rows: Sequence[Row]) -> int:
    told = summary(rows)
    print(printable(json.dumps(told) if args.json else str(Path(args.output, "objects"))))
    kept = sum(row.status == "done" and not row.made for row in rows)
    _say(args, f"{told['done']} labelled ({kept} as before), {told['failed']} failed")
    for row in rows:
        if row.error:
            complain(_PROGRAM, f"{row.category}/{row.name}: {row.stage}: {row.error}")
    return 1 if told["failed"] else 0


def _say(args: argparse.Namespace, text: str) -> None:
    if not args.quiet and args.progress != "json":
        complain(_PROGRAM, text)
