"""The stages of one object; each keeps what it made until something that decides it changes.

::

    work/CATEGORY/NAME/picture.png               a hand on the object
    work/CATEGORY/NAME/mask.png, hand_mask.png   where both are seen
    work/CATEGORY/NAME/reconstruction/…          what `semfm-reconstruct` writes
    work/CATEGORY/NAME/region.json, contact.json what the hand touches, and how sure that is
    work/CATEGORY/NAME/stages.json               what each stage was made from, and its hashes
    objects/CATEGORY/NAME.ply, NAME.json         for `semfm-cli eval`
"""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from string import Template
from typing import Any, Callable

import numpy as np
from PIL import Image, ImageOps

from .. import __version__
from .._cli import run_semfm_cli
from .._files import read_json
from .._identity import content_name, file_identity, picture_identity
from .._semfm import write_file
from ..errors import SemfmError
from ..reconstruct.observation import read_seen
from ..sidecar.errors import SidecarError, expected
from .commands import CommandTemplate, run_command
from .image_endpoint import ImageEndpoint
from .masks import masks_of_change, on_white
from .plan import PlannedObject

_RECORD_FORMAT = "semfm.dataset-stages/1"
#: What a reconstruction must leave behind.
_RECONSTRUCTED = ("mesh.ply", "hand.ply", "camera_from_object.json")


@dataclass(frozen=True)
class Makers:
    """What the stages are made with.

    Attributes
    ----------
    endpoint
        Opens the image endpoint; called when the first picture is asked for.
    words
        What is sent to it, with ``$object`` and ``$region``.
    mask_command
        Makes one mask: places ``{picture}``, ``{what}`` and ``{output}``. None: from the change.
    reconstruct_command
        Places ``{picture}``, ``{mask}``, ``{hand_mask}``, ``{longest}`` and ``{output}``. None:
        `semfm-reconstruct`.
    reconstruct_options
        Further options of `semfm-reconstruct`.
    """

    endpoint: Callable[[], ImageEndpoint]
    words: str
    mask_command: CommandTemplate | None = None
    reconstruct_command: CommandTemplate | None = None
    reconstruct_options: tuple[str, ...] = ()


@dataclass(frozen=True)
class Stage:
    """One stage: its files in the object's folder, what decides them, and how they are made."""

    name: str
    outputs: tuple[str, ...]
    decides: Callable[[ObjectWork], dict[str, Any]]
    make: Callable[[ObjectWork], dict[str, Any]]


class StageFailed(Exception):
    """A stage that could not be made: its name, and why (``__cause__`` is a SemfmError)."""

    def __init__(self, stage: str, reason: SemfmError) -> None:
        super().__init__(f"{stage}: {reason}")
        self.stage, self.reason = stage, reason


class ObjectWork:
    """The work on one object."""

    def __init__(self, item: PlannedObject, root: Path, makers: Makers) -> None:
        self.item, self.makers = item, makers
        self.folder = root / "work" / item.category / item.name
        self.label = root / "objects" / item.category / f"{item.name}.json"
        self._records = self._read_records()

    @property
    def label_mesh(self) -> Path:
        """The mesh beside the label."""
        return self.label.with_suffix(".ply")

    def check_label(self) -> None:
        """Refuses a label that is there without a record of ours, which would be replaced; raises
        SidecarError.
        """
        for path in (self.label, self.label_mesh):
            if not self._records and path.exists():
                wanted = "no label, or the records of the run that made it: move it elsewhere"
                raise expected(path, self.item.title, wanted, f"none in {self.at('stages.json')}")

    def at(self, name: str) -> Path:
        """A file of the object's folder."""
        return self.folder / name

    def hash_of(self, *names: str) -> dict[str, str]:
        """SHA-256 of files of the object's folder, by name."""
        return {name: file_identity(self.at(name))["hash"] for name in names}

    def made(self, stage: str) -> dict[str, Any]:
        """What a finished stage said of itself."""
        return self._records[stage]["made"]

    def run(self, on_stage: Callable[[str], None]) -> list[str]:
        """Makes what is missing, stage by stage; returns the names of those that were made.

        Raises
        ------
        StageFailed
            With what is there kept, and without a label: a label is always that of its picture.
        """
        made = []
        for stage in STAGES:
            try:
                if not self._is_current(stage):
                    on_stage(stage.name)
                    self._make(stage)
                    made.append(stage.name)
            except SemfmError as error:
                self._withdraw()
                raise StageFailed(stage.name, error) from error
        return made

    def _is_current(self, stage: Stage) -> bool:
        record = self._records.get(stage.name)
        if record is None or record["key"] != _key(stage, self):
            return False
        try:
            return record["outputs"] == self.hash_of(*stage.outputs)
        except SemfmError:
            return False

    def _make(self, stage: Stage) -> None:
        self.folder.mkdir(parents=True, exist_ok=True)
        self._withdraw()
        made = stage.make(self)
        outputs = self.hash_of(*stage.outputs)
        self._records[stage.name] = {"key": _key(stage, self), "outputs": outputs, "made": made}
        value = {"format": _RECORD_FORMAT, "stages": self._records}
        write_file(self.at("stages.json"), (json.dumps(value, indent=1) + "\n").encode())

    def _withdraw(self) -> None:
        self.label.unlink(missing_ok=True)
        self.label_mesh.unlink(missing_ok=True)

    def _read_records(self) -> dict[str, Any]:
        """What is recorded; nothing where the file is missing or broken: all is made anew."""
        try:
            value = read_json(self.at("stages.json"))
            stages = value["stages"] if value["format"] == _RECORD_FORMAT else {}
            return {
                name: stages[name]
                for name in stages
                if {"key", "outputs", "made"} == set(stages[name])
            }
        except (SemfmError, KeyError, TypeError):
            return {}


def _key(stage: Stage, work: ObjectWork) -> str:
    return content_name({"stage": stage.name, "decides": stage.decides(work)})


# --- A hand on the object ---------------------------------------------------------------------


def _prompt(work: ObjectWork) -> str:
    item = work.item
    words = item.prompt or work.makers.words
    return Template(words).safe_substitute(object=item.object, region=item.region).strip()


def _reference(work: ObjectWork) -> Image.Image:
    assert work.item.reference is not None, "a plan names a reference or a picture"
    return opened(work.item.reference)


def opened(path: Path) -> Image.Image:
    """A picture from a file; raises SidecarError where it is none."""
    try:
        image = Image.open(path)
        # As viewers show it, and as masks are drawn on it.
        return ImageOps.exif_transpose(image)
    except (OSError, ValueError, Image.DecompressionBombError) as error:
        raise SidecarError(f"{path}: not a picture: {error}") from error


def _picture_decides(work: ObjectWork) -> dict[str, Any]:
    if work.item.picture:
        return {"given": file_identity(work.item.picture)["hash"]}
    reference = picture_identity(on_white(_reference(work)))
    endpoint = work.makers.endpoint().describe()
    asked = {"prompt": _prompt(work), "attempt": work.item.attempt}
    return {"reference": reference, **asked, "endpoint": endpoint}


def _make_picture(work: ObjectWork) -> dict[str, Any]:
    if work.item.picture:
        on_white(opened(work.item.picture)).save(work.at("picture.png"))
        return {"source": "given", **file_identity(work.item.picture)}
    assert work.item.reference is not None
    endpoint, prompt = work.makers.endpoint(), _prompt(work)
    reply = endpoint.edit(on_white(_reference(work)), prompt, work.item.attempt)
    reply.image().save(work.at("picture.png"))
    return {
        "source": "endpoint",
        "endpoint": endpoint.describe(),
        "model": reply.model,
        "seed": reply.seed,
        "attempt": work.item.attempt,
        "prompt": prompt,
        "revised_prompt": reply.revised_prompt,
        "reference": file_identity(work.item.reference),
        "tokens": reply.tokens,
        "requests": reply.attempts,
        "cached": reply.cached,
    }


# --- Masks ------------------------------------------------------------------------------------


def _masks_decides(work: ObjectWork) -> dict[str, Any]:
    item, command = work.item, work.makers.mask_command
    how: dict[str, Any] = {"method": _mask_method(work)}
    if item.mask and item.hand_mask:
        how["given"] = [file_identity(path)["hash"] for path in (item.mask, item.hand_mask)]
    elif command:
        how["command"] = [*command.words, item.object]
    elif item.reference:
        how["reference"] = file_identity(item.reference)["hash"]
    return {"picture": work.hash_of("picture.png"), **how}


def _mask_method(work: ObjectWork) -> str:
    if work.item.mask:
        return "given"
    return "command" if work.makers.mask_command else "change"


def _make_masks(work: ObjectWork) -> dict[str, Any]:
    item, method = work.item, _mask_method(work)
    about: dict[str, Any] = {"method": method}
    if method == "change":
        if item.reference is None:
            wanted = "`mask` and `hand_mask` beside `picture`, or --mask-command"
            raise expected(item.title, "masks", wanted, "neither")
        found = masks_of_change(_reference(work), opened(work.at("picture.png")))
        masks = [found.object, found.hand]
        about["changed_share"] = found.changed_share
    else:
        named = [str(item.mask), str(item.hand_mask)]
        if method == "command":
            named = _masks_by_command(work)
            about["command"] = list(work.makers.mask_command.words)  # type: ignore[union-attr]
        masks = read_seen(work.at("picture.png"), named).masks
        masks[0] = masks[0] & ~masks[1]
        if not masks[0].any():
            raise expected(item.title, "masks", "an object beside the hand", "none outside of it")
    for name, mask in zip(("mask.png", "hand_mask.png"), masks):
        Image.fromarray(np.where(mask, 255, 0).astype(np.uint8)).save(work.at(name))
    return about


def _masks_by_command(work: ObjectWork) -> list[str]:
    """One call for the object, one for the hand; returns the files."""
    command = work.makers.mask_command
    assert command is not None
    files = []
    for name, what in (("object", work.item.object), ("hand", "hand")):
        path = work.at(f"segmented_{name}.png")
        path.unlink(missing_ok=True)
        command.run({"picture": work.at("picture.png"), "what": what, "output": path})
        if not path.is_file():
            raise expected(command.option, "output", "a mask", f"none at {path}")
        files.append(str(path))
    return files


# --- Meshes -----------------------------------------------------------------------------------


def _reconstruction_decides(work: ObjectWork) -> dict[str, Any]:
    makers = work.makers
    command = makers.reconstruct_command
    return {
        "files": work.hash_of("picture.png", "mask.png", "hand_mask.png"),
        "longest_m": work.item.longest_m,
        "command": command.words if command else ["semfm-reconstruct", *makers.reconstruct_options],
    }


def _make_reconstruction(work: ObjectWork) -> dict[str, Any]:
    folder, command = work.at("reconstruction"), work.makers.reconstruct_command
    shutil.rmtree(folder, ignore_errors=True)
    names = {"picture": "picture.png", "mask": "mask.png", "hand_mask": "hand_mask.png"}
    files = {name: str(work.at(file)) for name, file in names.items()}
    longest = f"{work.item.longest_m:g}"
    if command:
        folder.mkdir()
        command.run({**files, "longest": longest, "output": folder})
    else:
        program = [sys.executable, "-m", "semfm.reconstruct", files["picture"]]
        masks = ["--mask", files["mask"], "--hand-mask", files["hand_mask"]]
        options = ["--longest", longest, "-o", str(folder), "--quiet"]
        words = [*program, *masks, *options, *work.makers.reconstruct_options]
        run_command(words, "semfm-reconstruct")
    for name in _RECONSTRUCTED:
        if not (folder / name).is_file():
            option = command.option if command else "semfm-reconstruct"
            raise expected(option, "output", name, f"none in {folder}")
    report = folder / "report.json"
    tool = read_json(report).get("tool") if report.is_file() else None
    return {"tool": tool or {"command": list(command.words) if command else None}}


# --- What the hand touches --------------------------------------------------------------------


def _region_decides(work: ObjectWork) -> dict[str, Any]:
    return {"files": work.hash_of(*(f"reconstruction/{name}" for name in _RECONSTRUCTED))}


def _make_region(work: ObjectWork) -> dict[str, Any]:
    mesh, hand, pose = (work.at(f"reconstruction/{name}") for name in _RECONSTRUCTED)
    words: list[str | Path] = ["region", mesh, "--hand", hand, "--aligned", pose, "--json", "-o"]
    answer = run_semfm_cli([*words, work.at("region.json")])
    # The report of the contact, then where the region was written.
    report = json.loads(answer.data.splitlines()[0])
    write_file(work.at("contact.json"), (json.dumps(report, indent=1) + "\n").encode())
    [frame] = report["frames"]
    told = {key: frame[key] for key in ("area_mm2", "confidence", "doubts")}
    return {"command": "semfm-cli region --hand", **told}


# --- What `semfm-cli eval` reads --------------------------------------------------------------


def _label_decides(work: ObjectWork) -> dict[str, Any]:
    item = work.item
    words = [item.category, item.name, item.object, item.region]
    is_there = work.label.is_file() and work.label_mesh.is_file()
    return {"files": work.hash_of("region.json"), "words": words, "is_there": is_there}


def _make_label(work: ObjectWork) -> dict[str, Any]:
    item = work.item
    region = read_json(work.at("region.json"))
    stages = ("picture", "masks", "reconstruction", "region")
    provenance = {name: work.made(name) for name in stages}
    label = {
        "object": item.name,
        "category": item.category,
        "mesh": work.label_mesh.name,
        "n_vertices": region["mesh"]["n_vertices"],
        "region": {"name": item.region, "origin": "hand in a picture", **region},
        "provenance": {
            "program": f"semfm {__version__}",
            "description": {"object": item.object, "region": item.region},
            "longest_m": item.longest_m,
            **provenance,
            "files": work.hash_of("picture.png", "mask.png", "hand_mask.png", "region.json"),
        },
    }
    work.label.parent.mkdir(parents=True, exist_ok=True)
    write_file(work.label_mesh, work.at("reconstruction/mesh.ply").read_bytes())
    write_file(work.label, (json.dumps(label) + "\n").encode())
    return {}


#: In order. Adding one is one line here.
STAGES: Sequence[Stage] = (
    Stage("picture", ("picture.png",), _picture_decides, _make_picture),
    Stage("masks", ("mask.png", "hand_mask.png"), _masks_decides, _make_masks),
    Stage(
        "reconstruction",
        tuple(f"reconstruction/{name}" for name in _RECONSTRUCTED),
        _reconstruction_decides,
        _make_reconstruction,
    ),
    Stage("region", ("region.json", "contact.json"), _region_decides, _make_region),
    Stage("label", (), _label_decides, _make_label),
)
