"""The command ``semfm-reconstruct``: stdout says where it wrote, everything else goes to stderr."""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from .._command import complain, finish
from .._identity import file_identity
from .._semfm import printable, read_mesh
from ..sidecar.errors import expected
from ..sidecar.progress import Progress, add_message_options, open_progress
from .fit import draw, measure, metres_per_unit, overlay
from .observation import Seen, read_seen
from .output import Reconstruction, SeenFiles, check_folder, next_commands, write_folder
from .placed_mesh import PlacedMesh, place_mesh
from .poses import check_mesh, read_pose
from .tools import TOOLS, open_tool, reconstruct

_PROGRAM = "semfm-reconstruct"

_EPILOG = """\
The tool is SAM 3D Objects where it is installed (--sam3d names its checkout, or $SAM3D_OBJECTS), or
a class of your own. What another tool, or SAM 3D on another machine, has made is brought in by
--mesh and --pose.

examples:
  semfm-reconstruct photo.jpg --mask mug.png --hand-mask hand.png \\
      --depth depth.png --intrinsics K.json -o out
  semfm-reconstruct photo.jpg --mask mug.png --hand-mask hand.png --longest 0.12 -o out
  semfm-reconstruct --mesh mug.glb --pose mug.json --hand-mesh hand.glb --hand-pose hand.json \\
      --metric -o out

exit code: 0 written, 2 bad input, no tool or a failure of it, 130 interrupted; report.json is
written last
"""


def parser() -> argparse.ArgumentParser:
    """The command's arguments."""
    p = argparse.ArgumentParser(
        prog=_PROGRAM,
        description="From a picture and masks to meshes of object and hand in one camera's frame.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    p.add_argument("picture", nargs="?", metavar="IMAGE", help="PNG or JPEG")
    p.add_argument("-o", "--output", metavar="FOLDER", required=True, help="where to write")
    seen = p.add_argument_group("what the camera saw")
    seen.add_argument(
        "--mask", metavar="MASK[#LABEL]", help="of the object: any form that semfm-cli reads"
    )
    seen.add_argument("--hand-mask", metavar="MASK[#LABEL]", help="of the hand")
    seen.add_argument(
        "--depth", metavar="DEPTH", help="registered to the picture: PNG of 16 bits or .npy"
    )
    seen.add_argument(
        "--depth-scale",
        type=float,
        metavar="N",
        help="units of the depth to the metre (1000 for whole numbers, 1 for floats)",
    )
    seen.add_argument("--intrinsics", metavar="K.json", help="the camera; needed with --depth")
    seen.add_argument(
        "--longest",
        type=float,
        metavar="METRES",
        help="longest side of the object's box, where there is no depth to measure it",
    )
    tool = p.add_argument_group("tool")
    tool.add_argument(
        "--tool",
        default="sam3d",
        metavar="NAME",
        help=f"{', '.join(TOOLS)} or package.module:Class (%(default)s)",
    )
    tool.add_argument("--sam3d", metavar="FOLDER", help="checkout of sam-3d-objects")
    tool.add_argument("--sam3d-config", metavar="FILE", help="pipeline.yaml of its weights")
    tool.add_argument("--seed", type=int, default=0, metavar="N", help="of the tool (%(default)s)")
    made = p.add_argument_group("made elsewhere, in place of a tool")
    made.add_argument("--mesh", metavar="MESH", help="the object, in any frame and unit")
    made.add_argument(
        "--pose",
        metavar="POSE.json",
        help="of --mesh: camera_from_object (4 x 4, metres), or rotation, translation and scale as "
        "SAM 3D Objects returned them for its GLB",
    )
    made.add_argument("--hand-mesh", metavar="MESH", help="the hand, likewise")
    made.add_argument("--hand-pose", metavar="POSE.json", help="of --hand-mesh")
    made.add_argument(
        "--metric",
        action="store_true",
        help="SAM 3D Objects had a point map in metres",
    )
    add_message_options(p, "the report as JSON on stdout")
    return p


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; returns the exit code."""
    return finish(
        _PROGRAM, lambda: _run(argv), "interrupted; without report.json the folder is unfinished"
    )


def _run(argv: Sequence[str] | None) -> int:
    args = parser().parse_args(argv)
    _check_arguments(args)
    folder, inputs = Path(args.output), _inputs(args)
    check_folder(folder, list(inputs.values()))
    progress = open_progress("none" if args.quiet else args.progress, "stages")
    stages = _Stages(progress, 3 if args.mesh else 5 if args.hand_mask else 4)
    try:
        made, tool = _make(args, stages)
    finally:
        progress.close()
    report = {
        "tool": tool,
        "seed": None if args.mesh else args.seed,
        "inputs": {name: file_identity(path) for name, path in inputs.items()},
        "longest_m": args.longest,
        "next": next_commands(folder, made, _seen_files(args)),
        "stages_ms": stages.ms,
    }
    report = write_folder(folder, made, report)
    _tell(args, report)
    print(printable(json.dumps(report) if args.json else args.output))
    return 0


def _check_arguments(args: argparse.Namespace) -> None:
    if args.mesh:
        if not args.pose:
            raise expected("--mesh", "pose", "--pose beside it", "none")
        if bool(args.hand_mesh) != bool(args.hand_pose):
            raise expected("--hand-mesh", "pose", "--hand-pose beside it", "one of the two")
    else:
        if args.pose or args.hand_mesh or args.hand_pose or args.metric:
            raise expected("settings", "--mesh", "a mesh beside the other's pose", "none")
        if not (args.picture and args.mask):
            raise expected("settings", "input", "IMAGE with --mask, or --mesh with --pose", "less")
    if (args.mask or args.hand_mask or args.depth or args.intrinsics) and not args.picture:
        raise expected(
            "settings", "IMAGE", "the picture of the masks, the depth and the camera", "none"
        )
    if args.mesh and args.hand_mask and not args.mask:
        raise expected("--hand-mask", "mask", "--mask beside it", "none")
    if args.longest is not None:
        if not 0 < args.longest < 100:
            raise expected("settings", "--longest", "0 to 100 metres", args.longest)
        if args.depth or args.metric:
            raise expected(
                "settings", "--longest", "no depth beside it: that tells the size", "both"
            )


def _inputs(args: argparse.Namespace) -> dict[str, str]:
    """The files that are read, by what they are."""
    names = ["picture", "mask", "hand_mask", "depth", "intrinsics"]
    names += ["mesh", "pose", "hand_mesh", "hand_pose"]
    found = {name: getattr(args, name) for name in names if getattr(args, name)}
    # FILE#LABEL is a label of a picture of labels.
    for name in ("mask", "hand_mask"):
        if name in found and not Path(found[name]).exists():
            found[name] = found[name].rpartition("#")[0] or found[name]
    return found


def _seen_files(args: argparse.Namespace) -> SeenFiles:
    return SeenFiles(args.mask, args.hand_mask, args.depth, args.intrinsics, args.depth_scale)


class _Stages:
    """Times the stages and shows how many are done."""

    def __init__(self, progress: Progress, total: int) -> None:
        self.ms: dict[str, float] = {}
        self._progress, self._total, self._start = progress, total, time.perf_counter()

    def done(self, name: str) -> None:
        now = time.perf_counter()
        self.ms[name] = round(1000 * (now - self._start), 1)
        self._start = now
        self._progress(len(self.ms), self._total)


def _make(args: argparse.Namespace, stages: _Stages) -> tuple[Reconstruction, dict[str, Any]]:
    """The meshes, and who made them."""
    seen = _seen(args)
    stages.done("read")
    if args.mesh:
        made, tool = _made_elsewhere(args), {"name": "files"}
        stages.done("object")
    else:
        assert seen is not None, "checked with the arguments"
        made, tool = _made_by_tool(args, seen, stages)
    made = _compared(_in_metres(args, made, seen), seen)
    stages.done("compare")
    return made, tool


def _in_metres(args: argparse.Namespace, made: Reconstruction, seen: Seen | None) -> Reconstruction:
    """With metres, where something tells them."""
    if args.longest is not None:
        if made.is_metric:
            raise expected(args.pose, "--longest", "a pose that is not in metres already", "metres")
        return made.rescaled(args.longest / float(made.object.size.max()), "longest")
    if made.is_metric or seen is None or seen.camera is None or not seen.masks:
        return made
    factor = metres_per_unit(draw(made.object, seen.camera), seen.masks[0], seen)
    return made.rescaled(factor, "depth") if factor else made


def _made_by_tool(
    args: argparse.Namespace, seen: Seen, stages: _Stages
) -> tuple[Reconstruction, dict[str, Any]]:
    for file, mask in zip((args.mask, args.hand_mask), seen.masks):
        seen.check_returns(mask, file)
    options = {"checkout": args.sam3d, "config": args.sam3d_config}
    tool = open_tool(args.tool, **(options if args.tool in TOOLS else {}))
    stages.done("load")
    point_map, meshes = seen.point_map(), []
    for name, mask in zip(("object", "hand"), seen.masks):
        meshes.append(reconstruct(tool, seen.picture, mask, point_map, args.seed))
        stages.done(name)
    hand = meshes[1] if len(meshes) > 1 else None
    metres_from = None if point_map is None else "depth"
    return Reconstruction(meshes[0], hand, metres_from), tool.describe()


def _made_elsewhere(args: argparse.Namespace) -> Reconstruction:
    item, is_metric = _stored(args.mesh, args.pose, args.metric)
    metres_from = "pose" if is_metric else None
    if not args.hand_mesh:
        return Reconstruction(item, None, metres_from)
    hand, hand_is_metric = _stored(args.hand_mesh, args.hand_pose, args.metric)
    if hand_is_metric != is_metric:
        wanted = "a pose in the unit of the object's (--metric: all are metres)"
        raise expected(args.hand_pose, "pose", wanted, "metres for one of the two only")
    return Reconstruction(item, hand, metres_from)


def _seen(args: argparse.Namespace) -> Seen | None:
    if not args.picture:
        return None
    masks = [mask for mask in (args.mask, args.hand_mask) if mask]
    seen = read_seen(args.picture, masks, args.intrinsics, args.depth, args.depth_scale)
    for note in seen.notes:
        _say(args, note)
    return seen


def _stored(mesh: str, pose: str, sam3d_is_metric: bool) -> tuple[PlacedMesh, bool]:
    """A mesh that another program made, and whether its pose is in metres."""
    file, stored = read_mesh(mesh), read_pose(pose)
    check_mesh(stored, file.mesh, pose)
    placed = place_mesh(file.mesh, stored.camera_from_mesh, file.vertex_colors, pose)
    return placed, stored.is_metric or sam3d_is_metric


def _compared(made: Reconstruction, seen: Seen | None) -> Reconstruction:
    """With how it agrees with the picture, where the camera and the masks are known."""
    if seen is None or seen.camera is None or not seen.masks:
        return made
    item = draw(made.object, seen.camera)
    hand = draw(made.hand, seen.camera) if made.hand else None
    hand_mask = seen.masks[1] if len(seen.masks) > 1 else None
    object_fit = measure(item, seen.masks[0], hand_mask, seen)
    hand_fit = None
    if hand is not None and hand_mask is not None:
        hand_fit = measure(hand, hand_mask, seen.masks[0], seen)
    picture = overlay(seen, item, hand)
    return replace(made, object_fit=object_fit, hand_fit=hand_fit, overlay=picture)


def _tell(args: argparse.Namespace, report: dict[str, Any]) -> None:
    unit = "m" if report["unit"] == "metre" else "units of the point map"
    sides = " x ".join(f"{side:.3g}" for side in report["object"]["size"])
    _say(args, f"object: {report['object']['mesh']['n_vertices']} vertices, {sides} {unit}")
    for name in ("object", "hand"):
        if report[name] and (fit := report[name]["fit"]):
            words = f"{name}: silhouette and mask overlap by {100 * fit['silhouette_iou']:.0f} %"
            if fit["depth_error_m"] is not None:
                off = round(1000 * fit["depth_error_m"], 1) + 0.0  # no "-0.0"
                words += f", depth off by {off:+.1f} mm in the median"
            _say(args, words)
    for reason in report["reasons"]:
        _say(args, reason)
    for command in report["next"]:
        _say(args, f"next: {command}")


def _say(args: argparse.Namespace, text: str) -> None:
    if not args.quiet and args.progress != "json":
        complain(_PROGRAM, text)
