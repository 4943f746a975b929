"""The pool: rows spread over worker processes of this machine.

One thread per worker hands it a row and waits. A worker that dies costs nothing but the row it had,
and that one is tried again. At most twice as many records as workers wait to be taken.
"""

from __future__ import annotations

import os
import pickle
import queue
import threading
from collections.abc import Iterable, Iterator
from typing import Optional, Union

from ..errors import SemfmError
from .manifest import Row
from .record import Record, failure
from .task import Demonstration
from .worker import Worker, WorkerDied

#: Seconds that a worker gets beyond its limit, to stop by itself before it is killed.
GRACE_S = 3.0


def cores() -> int:
    """Cores that this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:
        return os.cpu_count() or 1


def run(
    demonstration: Demonstration,
    rows: Iterable[Row],
    *,
    workers: Optional[int] = None,
    threads: Optional[int] = None,
    attempts: int = 2,
) -> Iterator[Record]:
    """Records in the order in which they are done; closing the iterator ends the workers.

    Parameters
    ----------
    demonstration : Demonstration
    rows : iterable of Row
        Taken as they are needed.
    workers : int, optional
        Processes; one per core where none are given.
    threads : int, optional
        Threads of each; the cores are shared out where none are given.
    attempts : int, default 2
        How often a row may be tried whose worker dies.

    Yields
    ------
    dict
    """
    pool = _Pool(demonstration, rows, workers or cores(), threads, attempts)
    try:
        yield from pool.records()
    finally:
        pool.close()


class _Pool:
    def __init__(
        self,
        demonstration: Demonstration,
        rows: Iterable[Row],
        workers: int,
        threads: Optional[int],
        attempts: int,
    ) -> None:
        self._body = pickle.dumps(demonstration)
        self._timeout_s = demonstration.timeout_s
        self._per_worker = threads or max(1, cores() // workers)
        self._attempts = attempts
        self._rows = iter(rows)
        self._lock = threading.Lock()
        self._stop = threading.Event()
        self._room = threading.Semaphore(2 * workers)
        #: A record, an error that ends the run, or None from a thread that is through.
        self._found: queue.Queue[Union[Record, BaseException, None]] = queue.Queue()
        self._workers: dict[int, Worker] = {}
        self._threads = [
            threading.Thread(target=self._serve, args=(slot,), daemon=True)
            for slot in range(workers)
        ]

    def records(self) -> Iterator[Record]:
        for thread in self._threads:
            thread.start()
        running = len(self._threads)
        while running:
            found = self._found.get()
            if found is None:
                running -= 1
            elif isinstance(found, BaseException):
                raise found
            else:
                self._room.release()
                yield found

    def close(self) -> None:
        self._stop.set()
        for thread in self._threads:
            self._room.release()
        with self._lock:
            for worker in self._workers.values():
                worker.kill()
        for thread in self._threads:
            if thread.ident is not None:
                thread.join()

    def _serve(self, slot: int) -> None:
        try:
            while True:
                self._room.acquire()
                if self._stop.is_set():
                    break
                with self._lock:
                    row = next(self._rows, None)
                if row is None:
                    break
                record = self._answer(slot, row)
                if record is None:
                    break
                self._found.put(record)
            self._found.put(None)
        except BaseException as error:
            self._found.put(error)
        finally:
            self._drop(slot)

    def _answer(self, slot: int, row: Row) -> Optional[Record]:
        """The record of a row, or None where the pool is closing."""
        limit = None if self._timeout_s is None else self._timeout_s + GRACE_S
        for attempt in range(1, self._attempts + 1):
            worker = self._worker(slot)
            if worker is None:
                return None
            try:
                record = worker.ask(row, limit)
            except WorkerDied as error:
                self._drop(slot)
                if self._stop.is_set():
                    return None
                if worker.timed_out:
                    late = TimeoutError(f"not done after {self._timeout_s:g} s, and killed")
                    return failure(row, late, code="timeout", seconds=limit or 0, attempts=attempt)
                died = error
            else:
                record["attempts"] = attempt
                return record
        lost = SemfmError(f"the worker died: {died}", code="worker-died")
        return failure(row, lost, attempts=self._attempts)

    def _worker(self, slot: int) -> Optional[Worker]:
        worker = self._workers.get(slot)
        if worker is None:
            worker = Worker(self._body, self._per_worker)
            with self._lock:
                if self._stop.is_set():
                    worker.close()
                    return None
                self._workers[slot] = worker
        return worker

    def _drop(self, slot: int) -> None:
        with self._lock:
            worker = self._workers.pop(slot, None)
        if worker is not None:
            worker.close()
