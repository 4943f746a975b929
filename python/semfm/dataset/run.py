"""All objects of a plan, one after the other; one that fails does not stop the others."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Callable

from .. import __version__
from .._semfm import write_file
from ..errors import SemfmError
from ..vlm.client import EndpointError
from .plan import PlannedObject
from .stages import Makers, ObjectWork, StageFailed

SUMMARY_FORMAT = "semfm.dataset/1"


@dataclass(frozen=True)
class Row:
    """What became of one object.

    Attributes
    ----------
    category, name
        Which.
    status
        ``done`` (has a label), ``failed``, or ``waiting`` (not reached).
    made
        The stages that this run made; the others were there.
    stage, error
        Of a failure: which stage, and why.
    """

    category: str
    name: str
    status: str
    made: list[str]
    stage: str | None = None
    error: str | None = None


def run_plan(
    plan: Sequence[PlannedObject],
    root: Path,
    makers: Makers,
    on_progress: Callable[[int, int], None],
    on_message: Callable[[str], None],
) -> list[Row]:
    """Makes a dataset, or what is missing of it, and writes ``dataset.json`` after each object.

    Parameters
    ----------
    plan
        The objects.
    root
        Folder of the dataset.
    makers
        What the stages are made with.
    on_progress
        Called with objects done and objects in all.
    on_message
        Called with a line for each stage and failure.

    Raises
    ------
    SemfmError
        Where nothing can be expected of the next object either: an endpoint that denies access, or
        a folder that cannot be written. What is done stays. Before anything is done, where a label
        is there that no run made.
    """
    for item in plan:
        ObjectWork(item, root, makers).check_label()
    rows = [Row(item.category, item.name, "waiting", []) for item in plan]
    for i, item in enumerate(plan):
        on_progress(i, len(plan))
        fatal: SemfmError | None = None
        try:
            made = ObjectWork(item, root, makers).run(
                lambda stage, item=item: on_message(f"{item.title}: {stage}")  # type: ignore[misc]
            )
            rows[i] = Row(item.category, item.name, "done", made)
        except StageFailed as failed:
            rows[i] = Row(item.category, item.name, "failed", [], failed.stage, str(failed.reason))
            on_message(f"{item.title}: {failed}")
            if isinstance(failed.reason, EndpointError) and failed.reason.kind == "access":
                fatal = failed.reason
        _write(root, rows)
        if fatal:
            raise fatal
    on_progress(len(plan), len(plan))
    return rows


def labels_beside(plan: Sequence[PlannedObject], root: Path) -> list[str]:
    """Labels in the dataset's folder, as CATEGORY/NAME, of objects that the plan does not name (any
    more). `semfm-cli eval` reads them all the same.
    """
    there = (root / "objects").glob("*/*.json")
    found = {f"{path.parent.name}/{path.stem}" for path in there}
    return sorted(found - {item.title for item in plan})


def summary(rows: Sequence[Row]) -> dict[str, Any]:
    """The content of ``dataset.json``."""
    counts = {
        status: sum(row.status == status for row in rows)
        for status in ("done", "failed", "waiting")
    }
    head = {"format": SUMMARY_FORMAT, "program": f"semfm {__version__}", **counts}
    return {**head, "objects": [asdict(row) for row in rows]}


def _write(root: Path, rows: Sequence[Row]) -> None:
    text = json.dumps(summary(rows), indent=1) + "\n"
    write_file(root / "dataset.json", text.encode())
