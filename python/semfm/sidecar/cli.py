"""The command ``semfm-embed``: stdout says where it wrote, everything else goes to stderr."""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections.abc import Sequence

from .._command import finish
from .._semfm import check_output, printable
from .embed import DTYPES, EmbedSettings, embed_file
from .errors import SidecarError, expected
from .inputs import encoder_inputs
from .models import DEVICES, open_encoder
from .patches import ROLLS
from .progress import add_message_options, open_progress

_VIEWS = ".views.mcap"

_EPILOG = """\
examples:
  semfm-embed mug.views.mcap -o mug.emb.mcap --model google/siglip2-base-patch16-224
  semfm-embed mug.views.mcap -o mug.emb.mcap --model mobilenet_v2.json --threads 2
  semfm-embed mug.views.mcap -o mug.emb.mcap --model lite0
  semfm-embed *.views.mcap --output-folder embedded --model mobilenet_v2.json

exit code: 0 written, 2 bad input or failure, 130 interrupted; a file is written whole or not at all
"""


def parser() -> argparse.ArgumentParser:
    """The command's arguments."""
    settings = EmbedSettings()
    p = argparse.ArgumentParser(
        prog="semfm-embed",
        description="Patch embeddings of rendered views by a pretrained image encoder.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    p.add_argument("views", nargs="*", metavar="V.views.mcap", help="views, from `semfm-cli views`")
    to = p.add_mutually_exclusive_group()
    to.add_argument("-o", "--output", metavar="V.emb.mcap", help="file to write, for one V")
    to.add_argument(
        "--output-folder",
        metavar="FOLDER",
        help="where NAME.views.mcap becomes NAME.emb.mcap, for any number of them",
    )
    p.add_argument(
        "--model",
        required=True,
        metavar="lite0|NAME|DIR|ENCODER.json|package.module:Class",
        help="lite0 (EfficientNet-Lite0), SigLIP, SigLIP 2 or DINOv2 by its name on the Hugging "
        "Face hub or by folder, an ONNX encoder by its JSON, or a class of your own",
    )
    to.add_argument(
        "--list-inputs",
        action="store_true",
        help="print what embeddings by the model depend on (files, versions) as JSON, and stop",
    )
    p.add_argument(
        "--rolls",
        type=int,
        choices=list(ROLLS),
        default=settings.rolls,
        help="average over this many rolls of each picture (default %(default)s)",
    )
    run = p.add_argument_group("how it runs")
    run.add_argument("--device", choices=DEVICES, default="auto", help="default %(default)s")
    run.add_argument(
        "--batch",
        type=int,
        default=settings.batch,
        metavar="N",
        help="pictures at once (%(default)s)",
    )
    run.add_argument("--threads", type=int, metavar="N", help="CPU threads (default: all)")
    run.add_argument(
        "--dtype", choices=list(DTYPES), default=settings.dtype, help="in the file (%(default)s)"
    )
    add_message_options(p)
    return p


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; returns the exit code."""
    return finish("semfm-embed", lambda: _main(argv), "interrupted; only whole files are written")


def _main(argv: Sequence[str] | None) -> int:
    arguments = parser()
    args = arguments.parse_args(argv)
    if args.list_inputs:
        print(json.dumps(encoder_inputs(args.model)))
        return 0
    if not args.views:
        arguments.error("the following arguments are required: V.views.mcap")
    if args.output is None and args.output_folder is None:
        arguments.error("one of the arguments -o/--output --output-folder is required")
    return _run(args)


def _run(args: argparse.Namespace) -> int:
    settings = EmbedSettings(args.rolls, args.batch, args.dtype)
    outputs = _outputs(args)
    inputs = [*args.views, args.model]
    for path in args.views:  # before minutes go into loading a model
        if not os.path.exists(path):
            raise SidecarError(f"{path}: No such file or directory")
    for path in outputs:
        check_output(path, inputs)
    encoder = open_encoder(args.model, args.device, args.threads)
    for views, output in zip(args.views, outputs):
        start = time.perf_counter()
        progress = open_progress("none" if args.quiet else args.progress)
        try:
            embed_file(views, output, encoder, settings, progress)
        finally:
            progress.close()
        if not args.quiet and args.progress != "json":
            took = time.perf_counter() - start
            print(f"semfm-embed: {encoder.name}, {took:.1f} s", file=sys.stderr)
        print(printable(output), flush=True)
    return 0


def _outputs(args: argparse.Namespace) -> list[str]:
    """One file for each views file."""
    if args.output_folder is None:
        if len(args.views) != 1:
            raise expected("-o", "views", "one file (--output-folder takes more)", len(args.views))
        return [args.output]
    names = [os.path.basename(path) for path in args.views]
    for name in names:
        if not name.endswith(_VIEWS):
            raise expected(name, "name", f"NAME{_VIEWS}", repr(name))
        if names.count(name) > 1:
            raise expected(name, "name", "another name for each file of a folder", repr(name))
    folder = args.output_folder
    try:
        os.makedirs(folder, exist_ok=True)
    except OSError as error:
        raise SidecarError(f"{folder}: {error.strerror}") from error
    return [os.path.join(folder, name[: -len(_VIEWS)] + ".emb.mcap") for name in names]
