"""Rows spread over a Ray cluster, by Ray Data.

Each row is a block of its own and each block a stateless task. Ray runs a task again whose process
or machine dies; a block that is lost for good is skipped, and its row recorded.
"""

from __future__ import annotations

import json
import pickle
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict
from typing import Any, Optional

import numpy as np

from ..errors import MissingPackage, SemfmError
from .manifest import Row
from .record import Record, failure
from .task import Demonstration

#: Rows per data set. Ray keeps a little for every block of a data set: this bounds it.
WINDOW = 2000


def run(
    demonstration: Demonstration,
    rows: Iterable[Row],
    *,
    workers: Optional[int] = None,
    threads: Optional[int] = None,
    attempts: int = 2,
    address: Optional[str] = None,
) -> Iterator[Record]:
    """Records in the order in which they come in.

    Every node must see the files of the rows under the same paths, and have `semfm` installed.
    A Ray that is connected is used as it is; otherwise one is joined or started, and left at the
    end.

    Parameters
    ----------
    demonstration : Demonstration
        Put into Ray's object store once.
    rows : iterable of Row
    workers : int, optional
        Tasks at a time, and the size of a Ray that is started here; what the cluster holds where
        none are given.
    threads : int, optional
        Threads, and CPUs, of a task; 1 where none are given.
    attempts : int, default 2
        How often a row may be tried whose worker dies.
    address : str, optional
        Of a cluster, such as ``"auto"``; one is started on this machine where none is given.

    Yields
    ------
    dict

    Raises
    ------
    ImportError
        `ray` is not installed.
    """
    ray = _ray()
    with _connected(ray, address, workers, threads or 1), _settled(ray):
        held = ray.put(demonstration)
        for window in _windows(iter(rows)):
            yield from _window(ray, held, window, workers, threads or 1, attempts)


def _window(
    ray: Any, held: Any, rows: list[Row], workers: Optional[int], threads: int, attempts: int
) -> Iterator[Record]:
    missing = {row.name: row for row in rows}
    # A list hides the reference: Ray Data would otherwise send the object along with every task.
    box = [held]

    def transfer(batch: dict[str, Any]) -> dict[str, Any]:
        return {"record": np.array([_carry(box[0], text, threads) for text in batch["item"]], "O")}

    blocks = ray.data.from_items(
        [json.dumps(asdict(row)) for row in rows], override_num_blocks=len(rows)
    ).map_batches(
        transfer,
        batch_size=None,
        num_cpus=threads,
        concurrency=workers,
        max_retries=attempts - 1,
    )
    for batch in blocks.iter_batches(batch_size=None, prefetch_batches=0, batch_format="numpy"):
        for body in batch["record"]:
            record = pickle.loads(body)
            if missing.pop(record["name"], None) is not None:
                yield record
    for row in missing.values():
        lost = SemfmError("the worker died; Ray's log tells more", code="worker-died")
        yield failure(row, lost, attempts=attempts)


#: The demonstration that this process fetched last, by its reference.
_fetched: dict[Any, Demonstration] = {}


def _carry(held: Any, text: str, threads: int) -> bytes:
    import ray

    from .. import set_num_threads

    if held not in _fetched:
        set_num_threads(threads)
        _fetched.clear()
        _fetched[held] = ray.get(held)
    return pickle.dumps(_fetched[held].transfer(Row(**json.loads(text))))


def _windows(rows: Iterator[Row]) -> Iterator[list[Row]]:
    while True:
        window = [row for row, _ in zip(rows, range(WINDOW))]
        if not window:
            return
        yield window


def _ray() -> Any:
    try:
        import ray
        import ray.data
    except ImportError as error:
        message = "runner='ray' needs Ray Data: pip install 'ray[data]' pyarrow"
        raise MissingPackage(message, "missing-package", "ray") from error
    return ray


@contextmanager
def _connected(
    ray: Any, address: Optional[str], workers: Optional[int], threads: int
) -> Iterator[None]:
    if ray.is_initialized():
        yield
        return
    options: dict[str, Any] = {"log_to_driver": False, "logging_level": "WARNING"}
    if address is not None:
        options["address"] = address
    else:
        options["include_dashboard"] = False
        if workers is not None:
            options["num_cpus"] = workers * threads
    try:
        ray.init(**options)
    except (ConnectionError, ValueError, RuntimeError) as error:
        where = address or "this machine"
        raise SemfmError(f"no Ray on {where}: {error}", code="ray", place=address) from error
    try:
        yield
    finally:
        ray.shutdown()


@contextmanager
def _settled(ray: Any) -> Iterator[None]:
    """Ray Data's settings as we need them, and back as they were."""
    context = ray.data.DataContext.get_current()
    ours = {
        # Blocks that are lost are counted by us.
        "max_errored_blocks": -1,
        # A slow object must not hold back the others' records.
        "preserve_order": False,
        "enable_progress_bars": False,
        "print_on_execution_start": False,
    }
    before: list[tuple[Any, str, Any]] = []
    for name, value in ours.items():
        owner = context.execution_options if name == "preserve_order" else context
        if hasattr(owner, name):
            before.append((owner, name, getattr(owner, name)))
            setattr(owner, name, value)
    try:
        yield
    finally:
        for owner, name, value in before:
            with suppress(AttributeError):
                setattr(owner, name, value)
