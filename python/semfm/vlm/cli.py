"""The command ``semfm-vlm``: stdout says where it wrote, everything else goes to stderr."""

from __future__ import annotations

import argparse
import json
import threading
from collections.abc import Sequence
from typing import Any

from .._command import complain, finish
from .._semfm import check_output, printable, write_file
from ..sidecar.errors import expected
from ..sidecar.progress import add_message_options, open_progress
from .baseline import BaselineSettings, outcome_row, total_tokens, transfer
from .cache import CachedEndpoint
from .client_options import add_client_options, patience
from .endpoint import RESPONSE_FORMATS, ChatEndpoint, Endpoint, EndpointSettings, from_environment
from .object_views import ObjectViews, read_object
from .pairs import Pair, read_pairs
from .pictures import write_pictures
from .question import MODES, Drawing
from .region import REGION_FORMAT, read_region
from .rows import RowsFile
from .run import EndpointOf, row_names, run_pairs
from .true_masks import TrueMasks

_EPILOG = """\
The endpoint is $SEMFM_VLM_BASE_URL, $SEMFM_VLM_MODEL, $SEMFM_VLM_API_KEY (or OPENAI_… in their
place). The key is read from the environment only, and written nowhere.

examples:
  semfm-vlm mug.views.mcap jug.views.mcap --region handle.json -o region.json --views 6
  semfm-vlm --pairs data/pairs.json --views-dir views -o rows.json --views 1,3,6 --cache replies

exit code: 0 a region (with --pairs: at least one), 1 replies without any, 2 bad input or failure
(with --pairs also a row without a reply), 130 interrupted; rows that are done are kept
"""


def parser() -> argparse.ArgumentParser:
    """The command's arguments."""
    p = argparse.ArgumentParser(
        prog="semfm-vlm",
        description="Transfer a region from one object to another by asking a vision-language model.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    p.add_argument(
        "source", nargs="?", metavar="SOURCE.views.mcap", help="of the demonstrated object"
    )
    p.add_argument("target", nargs="?", metavar="TARGET.views.mcap", help="of the new object")
    p.add_argument("--region", metavar="R.json", help="the region on the source")
    p.add_argument("-o", "--output", metavar="FILE", required=True, help="region.json or rows.json")
    p.add_argument(
        "--truth", metavar="R.json", help="ask no model: answer with this region of the target"
    )
    many = p.add_argument_group("many pairs")
    many.add_argument(
        "--pairs", metavar="PAIRS.json", help="instead of SOURCE, TARGET and --region"
    )
    many.add_argument(
        "--views-dir", metavar="DIR", help="where NAME.views.mcap are (beside the labels)"
    )
    many.add_argument(
        "--jobs", type=int, default=1, metavar="N", help="questions at once (%(default)s)"
    )
    many.add_argument(
        "--true-masks", action="store_true", help="ask no model: answer with the targets' labels"
    )
    _add_question(p)
    _add_endpoint(p)
    add_message_options(p, "the row, or totals, as JSON on stdout")
    return p


def _add_question(p: argparse.ArgumentParser) -> None:
    default = BaselineSettings()
    ask = p.add_argument_group("question")
    ask.add_argument(
        "--views",
        default="6",
        metavar="N",
        help="of each object (%(default)s); with --pairs also 1,3,6",
    )
    ask.add_argument(
        "--mode", choices=MODES, default=default.mode, help="of answering (%(default)s)"
    )
    ask.add_argument(
        "--threshold",
        type=float,
        default=default.threshold,
        metavar="T",
        help="share of the views that see a vertex which must mark it (%(default)s)",
    )
    ask.add_argument(
        "--marks", type=int, default=default.n_segments, metavar="N", help="patches (%(default)s)"
    )
    ask.add_argument("--hint", default="", metavar="TEXT", help="what the region is for")
    ask.add_argument(
        "--side",
        type=int,
        default=default.drawing.side,
        metavar="PIXELS",
        help="of pictures (%(default)s)",
    )
    ask.add_argument(
        "--no-ruler", action="store_true", help="no coordinate lines on target pictures"
    )
    ask.add_argument("--pictures", metavar="DIR", help="keep what was shown and answered")


def _add_endpoint(p: argparse.ArgumentParser) -> None:
    default = EndpointSettings("")
    end = p.add_argument_group("endpoint")
    add_client_options(end, default, "replies")
    end.add_argument(
        "--temperature", default=f"{default.temperature:g}", metavar="T|none", help="(%(default)s)"
    )
    end.add_argument(
        "--max-tokens", type=int, metavar="N", help="of a reply (the endpoint's limit)"
    )
    end.add_argument(
        "--response-format",
        choices=RESPONSE_FORMATS,
        default=default.response_format,
        help="how JSON is asked for (%(default)s); `text` where the endpoint knows no other",
    )


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; returns the exit code."""
    return finish("semfm-vlm", lambda: _run(argv), "interrupted")


def _run(argv: Sequence[str] | None) -> int:
    args = parser().parse_args(argv)
    inputs = [args.source, args.target, args.region, args.truth, args.pairs]
    check_output(args.output, [path for path in inputs if path])
    stop = threading.Event()
    try:
        return _run_pairs(args, stop) if args.pairs else _run_one(args, stop)
    except KeyboardInterrupt:
        stop.set()
        raise


def _settings(args: argparse.Namespace) -> BaselineSettings:
    drawing = Drawing(args.side, not args.no_ruler)
    return BaselineSettings(args.mode, args.threshold, args.marks, drawing, args.hint)


def _views(args: argparse.Namespace) -> list[int]:
    try:
        views = [int(n) for n in args.views.split(",")]
    except ValueError:
        raise expected("settings", "--views", "numbers, as 6 or 1,3,6", repr(args.views)) from None
    if min(views) < 1 or len(set(views)) < len(views):
        raise expected("settings", "--views", "numbers from 1, each once", repr(args.views))
    return views


def _chat(args: argparse.Namespace, stop: threading.Event) -> Endpoint:
    temperature = None
    if args.temperature != "none":
        try:
            temperature = float(args.temperature)
        except ValueError:
            found = repr(args.temperature)
            raise expected("settings", "--temperature", "a number or none", found) from None
    settings = from_environment(
        args.model,
        args.base_url,
        **patience(args),
        temperature=temperature,
        max_tokens=args.max_tokens,
        response_format=args.response_format,
    )
    endpoint = ChatEndpoint(settings, stop)
    return CachedEndpoint(endpoint, args.cache) if args.cache else endpoint


def _run_one(args: argparse.Namespace, stop: threading.Event) -> int:
    if not (args.source and args.target and args.region):
        raise expected("settings", "input", "SOURCE, TARGET and --region, or --pairs", "less")
    settings, views = _settings(args), _views(args)
    if len(views) > 1:
        raise expected("settings", "--views", "one number for one pair", repr(args.views))
    source, target = read_object(args.source), read_object(args.target)
    region = read_region(args.region, source)
    if args.truth:
        endpoint: Endpoint = TrueMasks(read_region(args.truth, target))
    else:
        endpoint = _chat(args, stop)
    _say(args, f"asking {endpoint.describe()['model']} about {views[0]} + {views[0]} pictures")
    outcome = transfer(source, target, region, views[0], endpoint, settings)
    if args.pictures:
        write_pictures(args.pictures, outcome, settings.drawing)
    row = {"n_views": views[0], **outcome_row(outcome, target, settings)}
    if args.json:
        print(json.dumps(row))
    if failure := outcome.failure:
        complain("semfm-vlm", f"{failure.kind}: {failure.reason}: {failure.text}")
        return 2 if failure.of_endpoint else 1
    extra = {key: row[key] for key in ("model", "real_model", "mode", "n_views", "inconsistency")}
    head = {"format": REGION_FORMAT, "mesh": row["mesh"], **row["region"], "method": "vlm"}
    write_file(args.output, (json.dumps({**head, **extra}) + "\n").encode())
    tokens = row["tokens"] or {"prompt": "?", "completion": "?"}
    took = sum(outcome.stages_ms.values()) / 1000
    _say(args, f"{took:.1f} s, {tokens['prompt']} + {tokens['completion']} tokens")
    if not args.json:
        print(printable(args.output))
    return 0


def _run_pairs(args: argparse.Namespace, stop: threading.Event) -> int:
    if args.source or args.region or args.truth:
        raise expected("settings", "input", "--pairs or SOURCE, TARGET and --region", "both")
    if args.jobs < 1:
        raise expected("settings", "--jobs", "at least 1", args.jobs)
    settings, views = _settings(args), _views(args)
    pairs = read_pairs(args.pairs, args.views_dir)
    endpoint_of, described = _who_answers(args, pairs, stop)
    described = {"endpoint": described, "baseline": settings.describe()}
    file = RowsFile(args.output, described, row_names(pairs, views))
    _say(args, f"{len(file.missing)} of {len(pairs) * len(views)} rows to do")
    progress = open_progress("none" if args.quiet else args.progress, "pairs")
    try:
        run_pairs(pairs, file, endpoint_of, settings, args.jobs, args.pictures, stop, progress)
    finally:
        progress.close()
    return _report(args, file)


def _who_answers(
    args: argparse.Namespace, pairs: Sequence[Pair], stop: threading.Event
) -> tuple[EndpointOf, dict[str, Any]]:
    if not args.true_masks:
        chat = _chat(args, stop)
        return (lambda pair, target: chat), chat.describe()
    if unlabelled := [pair.target for pair in pairs if pair.truth is None]:
        raise expected(args.pairs, unlabelled[0], "its true region under `truth`", "none")

    def knowing(pair: Pair, target: ObjectViews) -> Endpoint:
        assert pair.truth is not None, "checked above"
        return TrueMasks(read_region(pair.truth, target))

    return knowing, TrueMasks.described()


def _report(args: argparse.Namespace, file: RowsFile) -> int:
    rows = file.rows
    failures = [row["failure"] for row in rows if row["failure"]]
    kinds = {
        kind: sum(f["kind"] == kind for f in failures) for kind in {f["kind"] for f in failures}
    }
    totals = {
        "rows": len(rows),
        "regions": len(rows) - len(failures),
        "failures": dict(sorted(kinds.items())),
        "tokens": total_tokens(rows),
    }
    print(printable(json.dumps(totals) if args.json else args.output))
    counts = ", ".join(f"{n} {kind}" for kind, n in totals["failures"].items()) or "none"  # type: ignore[attr-defined]
    _say(args, f"{totals['regions']} regions, failures: {counts}, tokens: {totals['tokens']}")
    if unanswered := sum(failure["of_endpoint"] for failure in failures):
        complain("semfm-vlm", f"{unanswered} rows without a reply; run again to ask for them")
        return 2
    return 0 if totals["regions"] else 1


def _say(args: argparse.Namespace, text: str) -> None:
    if not args.quiet and args.progress != "json":
        complain("semfm-vlm", text)
