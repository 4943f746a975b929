"""The journal: the folder of answers, what is in it already, and the records not yet written.

``batch.json`` says what was transferred and how; ``records/`` holds the shards. A name stands in one
shard at most, so that the shards together are one table.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Iterable, Iterator
from typing import IO, Any, Optional, Union

from .._semfm import write_file
from ..errors import FileError, FormatError, InvalidInput
from . import shards
from .record import Record

FORMAT = "semfm.batch/1"
#: How the names of files begin that a killed process left half written.
TEMPORARY = ".semfm-"

#: Records wait no longer than this for their shard to fill: what a crash may cost.
PATIENCE_S = 30.0


class Journal:
    """Opens a folder of answers for writing, alone.

    Parameters
    ----------
    folder : path
        Made if it is not there.
    identity : dict
        What the answers depend on (`Demonstration.identity`).
    format : str
        Of new shards.
    shard_size : int
        Records in a full shard.

    Raises
    ------
    InvalidInput
        The folder holds answers to another question.
    FileError
        Another process writes to it (code ``"busy"``), or it cannot be written.
    """

    def __init__(
        self,
        folder: Union[str, os.PathLike[str]],
        identity: dict[str, Any],
        *,
        format: str,
        shard_size: int,
    ) -> None:
        self.folder = os.fspath(folder)
        self.records_folder = os.path.join(self.folder, "records")
        self.format = format
        self.shard_size = shard_size
        self.n_discarded = 0
        self._waiting: list[Record] = []
        self._since = 0.0
        try:
            os.makedirs(self.records_folder, exist_ok=True)
            self._lock = _lock(os.path.join(self.folder, ".lock"))
        except OSError as error:
            raise FileError(f"{self.folder}: {error}", code="io", place=self.folder) from error
        try:
            _agree(os.path.join(self.folder, "batch.json"), identity)
            self._sweep()
            #: (key, status) by name
            self.written: dict[str, tuple[str, str]] = self._read()
            self._next = 1 + max((n for n, _ in shards.shards(self.records_folder)), default=-1)
        except BaseException:
            self._lock.close()
            raise

    def __enter__(self) -> Journal:
        return self

    def __exit__(self, *_: object) -> None:
        try:
            self.flush()
        finally:
            self._lock.close()

    def add(self, record: Record) -> None:
        """Takes a record; it is safe once its shard is full or `PATIENCE_S` have gone by."""
        if not self._waiting:
            self._since = time.monotonic()
        self._waiting.append(record)
        late = time.monotonic() - self._since > PATIENCE_S
        if len(self._waiting) >= self.shard_size or late:
            self.flush()

    def flush(self) -> None:
        """Writes what waits."""
        if not self._waiting:
            return
        shards.write(self.records_folder, self._next, self._waiting, self.format)
        self._next += 1
        self.written.update((r["name"], (r["key"], r["status"])) for r in self._waiting)
        self._waiting = []

    def forget(self, names: Iterable[str]) -> None:
        """Takes records out of their shards, because they will be made again."""
        gone = {name for name in names if name in self.written}
        if not gone:
            return
        for number, path in shards.shards(self.records_folder):
            if gone.isdisjoint(r["name"] for r in shards.read(path, ["name"])):
                continue
            kept = [r for r in shards.read(path) if r["name"] not in gone]
            if kept:
                shards.write(self.records_folder, number, kept, path.rsplit(".", 1)[1])
            else:
                os.remove(path)
        for name in gone:
            del self.written[name]

    def _sweep(self) -> None:
        """Throws half-written shards away."""
        for name in os.listdir(self.records_folder):
            if name.startswith(TEMPORARY):
                os.remove(os.path.join(self.records_folder, name))
                self.n_discarded += 1

    def _read(self) -> dict[str, tuple[str, str]]:
        """What is written. A shard that cannot be read is set aside, and its rows are done again."""
        written: dict[str, tuple[str, str]] = {}
        for _, path in shards.shards(self.records_folder):
            try:
                found = list(shards.read(path, ["name", "key", "status"]))
            except shards.Unreadable:
                os.replace(path, f"{path}.unreadable")
                self.n_discarded += 1
                continue
            written.update((r["name"], (r["key"], r["status"])) for r in found)
        return written


def records(folder: Union[str, os.PathLike[str]]) -> Iterator[Record]:
    """The records in a folder of answers, shard by shard.

    Parameters
    ----------
    folder : path
        The `out` of `transfer`; it may still be growing.

    Yields
    ------
    dict
        One per object that was answered or failed; `region_of` makes a region of it.

    Raises
    ------
    FormatError
        The folder holds no answers, or a shard cannot be read.
    """
    folder = os.fspath(folder)
    inner = os.path.join(folder, "records")
    if not os.path.isdir(inner):
        raise FormatError(f"{folder}: expected a folder of batch answers", place=folder)
    for _, path in shards.shards(inner):
        try:
            yield from shards.read(path)
        except shards.Unreadable as error:
            raise FormatError(str(error), place=path) from error


def _agree(path: str, identity: dict[str, Any]) -> None:
    """The folder's question must be ours; an empty folder takes ours."""
    try:
        with open(path, encoding="utf-8") as file:
            found = json.load(file)
        if found.get("format") != FORMAT:
            raise ValueError(f"expected format {FORMAT}, found {found.get('format')}")
        asked = found["identity"]
        names = sorted(set(asked) | set(identity))
    except FileNotFoundError:
        text = json.dumps({"format": FORMAT, "identity": identity}, indent=1, sort_keys=True)
        write_file(path, f"{text}\n".encode())
        return
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise FormatError(f"{path}: {error}", place=path) from error
    differ = [name for name in names if asked.get(name) != identity.get(name)]
    if differ:
        raise InvalidInput(
            f"{path}: answers to another question lie here: {', '.join(differ)} differ; "
            "choose another folder",
            code="other-batch",
            place="out",
        )


def _lock(path: str) -> IO[str]:
    """Holds the folder until closed; the system frees it if we die."""
    file = open(path, "a", encoding="utf-8")  # noqa: SIM115
    busy: Optional[OSError] = None
    try:
        import fcntl
    except ImportError:
        import msvcrt

        file.seek(0)
        try:
            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined]
        except OSError as error:
            busy = error
    else:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            busy = error
        except OSError:
            pass  # some network file systems have no locks: keeping alone is then the user's part
    if busy is not None:
        file.close()
        folder = os.path.dirname(path)
        raise FileError(f"{folder}: another batch writes here", code="busy", place=folder) from busy
    return file
