"""Many pairs, several at a time, with what was done kept after each."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from functools import lru_cache
from pathlib import Path
from typing import Any, Callable

from ..errors import SemfmError
from ..sidecar.errors import SidecarError
from .baseline import BaselineSettings, Outcome, outcome_row, transfer
from .endpoint import Endpoint
from .object_views import ObjectViews, read_object
from .pairs import Pair
from .pictures import write_pictures
from .region import read_region
from .rows import RowName, RowsFile

#: Called with (rows done, rows in all).
OnProgress = Callable[[int, int], None]
#: From a pair and its target to who answers.
EndpointOf = Callable[[Pair, ObjectViews], Endpoint]
#: Objects kept in memory; pairs that follow each other share them.
_OBJECTS_KEPT = 16


def row_names(pairs: Sequence[Pair], views: Sequence[int]) -> list[RowName]:
    """All rows of a run: every pair with every number of views, in the order of the pairs."""
    return [(p.group, p.source, p.target, n) for p in pairs for n in views]


def run_pairs(
    pairs: Sequence[Pair],
    file: RowsFile,
    endpoint_of: EndpointOf,
    settings: BaselineSettings,
    jobs: int = 1,
    pictures: str | None = None,
    stop: threading.Event | None = None,
    on_progress: OnProgress | None = None,
) -> None:
    """Ask about every row that the file lacks.

    Parameters
    ----------
    pairs
        Those that the file's rows speak of.
    file
        Takes the rows.
    endpoint_of
        Who answers.
    settings
        How.
    jobs
        Questions under way at once.
    pictures
        Folder for pictures of each row, or None.
    stop
        Set when the run ends early, so that pauses in it end too.
    on_progress
        Called after every row.

    Raises
    ------
    SemfmError
        For input that is not as it must be, or an endpoint that denies access: what is done is in
        the file.
    """
    stop, report = stop or threading.Event(), on_progress or (lambda done, total: None)
    missing, total = file.missing, len(file.rows) + len(file.missing)
    by_name = {(p.group, p.source, p.target): p for p in pairs}
    read = lru_cache(maxsize=_OBJECTS_KEPT)(read_object)

    def one(name: RowName) -> dict[str, Any]:
        pair = by_name[name[:3]]
        source, target = read(str(pair.source_views)), read(str(pair.target_views))
        region = read_region(pair.region, source)
        outcome = transfer(source, target, region, name[3], endpoint_of(pair, target), settings)
        if pictures:
            write_pictures(_folder(pictures, name), outcome, settings.drawing)
        _check_access(outcome)
        return outcome_row(outcome, target, settings)

    file.write()
    report(total - len(missing), total)
    waiting, names = iter(missing), {}
    error: SemfmError | None = None
    under_way: set[Future] = set()
    with ThreadPoolExecutor(max_workers=jobs) as pool:
        try:
            while True:
                while error is None and len(under_way) < jobs and (name := next(waiting, None)):
                    names[(future := pool.submit(one, name))] = name
                    under_way.add(future)
                if not under_way:
                    break
                done, under_way = wait(under_way, return_when=FIRST_COMPLETED)
                for future in done:
                    try:
                        file.add(names.pop(future), future.result())
                    except SemfmError as failed:
                        error = error or failed  # what is under way is still worth keeping
                    report(len(file.rows), total)
        finally:
            stop.set()
    if error:
        raise error


def _check_access(outcome: Outcome) -> None:
    if outcome.failure and outcome.failure.kind == "access":
        raise SidecarError(outcome.failure.text)


def _folder(pictures: str, name: RowName) -> Path:
    group, source, target, n_views = name
    safe = "".join(c if c.isalnum() or c in "-_. " else "_" for c in group)
    return Path(pictures) / safe / f"{source}--{target}--{n_views}"
