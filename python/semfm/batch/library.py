"""`transfer`: one demonstration, transferred to every object of a manifest, into a folder of answers."""

from __future__ import annotations

import os
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass, field
from typing import Any, Optional, Union

from .. import _progress
from .._semfm import PreparedObject, Region, TransferSettings, prepare
from ..errors import InvalidInput
from . import pool, ray_runner, shards
from .journal import Journal
from .manifest import Row, read_manifest, rows_of
from .record import Record
from .task import WITHOUT_FEATURES, Demonstration

_Path = Union[str, "os.PathLike[str]"]


#: The encoder where none is named.
_DEFAULT = "builtin"


@dataclass(frozen=True)
class Summary:
    """How a run went.

    Attributes
    ----------
    out : str
        The folder of answers.
    n_rows : int
        Rows of the manifest.
    n_skipped : int
        Of these, answered or failed by an earlier run.
    n_done : int
        Answered by this one.
    n_failed : int
        Failed in this one.
    n_discarded : int
        Shards of an earlier run that were half written.
    verdicts : dict
        Count of each verdict among the answers of this run.
    errors : dict
        Count of each error code among its failures.
    seconds : float
    """

    out: str
    n_rows: int
    n_skipped: int
    n_done: int = 0
    n_failed: int = 0
    n_discarded: int = 0
    verdicts: dict[str, int] = field(default_factory=dict)
    errors: dict[str, int] = field(default_factory=dict)
    seconds: float = 0.0


def transfer(
    source: Any,
    region: Union[Region, _Path],
    manifest: Union[_Path, Iterable[Union[Row, Mapping[str, Any]]]],
    out: _Path,
    *,
    source_features: Any = None,
    source_embeddings: Any = None,
    source_cloud: Any = None,
    encoder: Optional[str] = None,
    method: Optional[str] = None,
    rule: Optional[str] = None,
    settings: Optional[TransferSettings] = None,
    seed: int = 0,
    k: Optional[int] = None,
    working_vertices: Optional[int] = None,
    n_samples: Optional[int] = None,
    cache: Optional[Union[bool, _Path]] = None,
    point_maps: bool = False,
    runner: str = "local",
    workers: Optional[int] = None,
    threads: Optional[int] = None,
    address: Optional[str] = None,
    attempts: int = 2,
    timeout_s: Optional[float] = None,
    shard_size: int = 256,
    format: Optional[str] = None,
    retry_failed: bool = False,
    progress: Union[None, bool, Callable[[str, int, int], object]] = None,
) -> Summary:
    """Transfers one region to every object of a manifest.

    A run that was stopped is taken up again by the same call: rows that have an answer are skipped,
    as long as their files are as they were. An object that fails is recorded and not fatal. The
    answers are those of `semfm.transfer`, whatever the workers; their order and times are not fixed.

    Parameters
    ----------
    source : mesh_like or PreparedObject
        The demonstrated object.
    region : Region or path
        Where the demonstration touched the source.
    manifest : path, or iterable of Row or dict
        See `read_manifest`.
    out : path
        The folder of answers; made if it is not there. It belongs to one demonstration with its
        settings, but manifests may follow one another.
    source_features, source_embeddings, source_cloud : optional
        As in `semfm.prepare`, for a source that is not prepared.
    encoder : str, optional
        Makes the features of the source, where it brings none, and of every object of the manifest
        that brings none: a name as in `semfm.prepare`. ``"builtin"`` where none is named and the
        features of the source are its own; where the source brings others, the encoder that made them
        must be named.
    method, rule, settings : optional
        As in `semfm.transfer`.
    seed : int, default 0
    k, working_vertices, n_samples : int, optional
        As in `semfm.prepare`.
    cache : bool or path, optional
        Where prepared shapes are kept: ``OUT/shapes`` where nothing is given, True for the user's
        own, False for nowhere.
    point_maps : bool, default False
        Whether to keep each whole point map; it takes 4 bytes a vertex.
    runner : str, default "local"
        ``"local"``, processes of this machine, or ``"ray"``, a cluster through Ray Data.
    workers : int, optional
        Objects at a time; one per core where none are given. Each needs the memory of one object.
    threads : int, optional
        Threads of each worker.
    address : str, optional
        Of a Ray cluster.
    attempts : int, default 2
        How often an object may be tried whose worker dies (mostly for want of memory).
    timeout_s : float, optional
        Seconds allowed for one object.
    shard_size : int, default 256
        Records in a file.
    format : str, optional
        ``"parquet"`` (where pyarrow is installed) or ``"jsonl"``.
    retry_failed : bool, default False
        Whether to try again what failed in an earlier run.
    progress : progress, optional
        Gets ``("objects", done, total)``. An error it raises stops the run.

    Returns
    -------
    Summary

    Raises
    ------
    SemfmError
        The source, the region, the manifest or the folder is not what it must be. What is done by
        then, or when Ctrl-C comes, stays.
    """
    start = time.monotonic()
    _check(runner, address, workers, threads, attempts, shard_size, timeout_s)
    format = shards.chosen_format(format)
    rows = (
        read_manifest(manifest) if isinstance(manifest, (str, os.PathLike)) else rows_of(manifest)
    )
    out = os.fspath(out)
    demonstration = _demonstration(
        source,
        region,
        semantics={
            "features": source_features,
            "embeddings": source_embeddings,
            "cloud": source_cloud,
        },
        settings=_settings(method, rule, settings),
        encoder=_absolute(encoder),
        seed=seed,
        k=k,
        working_vertices=working_vertices,
        n_samples=n_samples,
        cache=_cache(cache, out),
        point_maps=point_maps,
        timeout_s=timeout_s,
    )
    _check_features(rows, demonstration)
    with Journal(out, demonstration.identity(), format=format, shard_size=shard_size) as journal:
        todo = [row for row in rows if not _is_done(journal, row, retry_failed)]
        journal.forget(row.name for row in todo)
        options: dict[str, Any] = {"workers": workers, "threads": threads, "attempts": attempts}
        found: Iterator[Record] = (
            ray_runner.run(demonstration, todo, address=address, **options)
            if runner == "ray"
            else pool.run(demonstration, todo, **options)
        )
        verdicts, errors = _drive(found, journal, len(rows) - len(todo), len(rows), progress)
    return Summary(
        out,
        n_rows=len(rows),
        n_skipped=len(rows) - len(todo),
        n_done=sum(verdicts.values()),
        n_failed=sum(errors.values()),
        n_discarded=journal.n_discarded,
        verdicts=dict(verdicts),
        errors=dict(errors),
        seconds=time.monotonic() - start,
    )


def _drive(
    found: Iterator[Record], journal: Journal, done: int, total: int, progress: Any
) -> tuple[Counter[str], Counter[str]]:
    """Puts every record into the journal and tells of it; counts verdicts and error codes."""
    verdicts: Counter[str] = Counter()
    errors: Counter[str] = Counter()
    bar = _progress.Bar() if progress is True else None
    tell = bar or (progress if callable(progress) else None)
    try:
        # Closed here and now, not when the garbage is collected: workers end with their iterator.
        with closing(found):  # type: ignore[type-var]
            if tell is not None:
                tell("objects", done, total)
            for record in found:
                journal.add(record)
                if record["status"] == "done":
                    verdicts[record["verdict"]] += 1
                else:
                    errors[record["error_code"]] += 1
                done += 1
                if tell is not None:
                    tell("objects", done, total)
    finally:
        if bar is not None:
            bar.close()
    return verdicts, errors


def _is_done(journal: Journal, row: Row, retry_failed: bool) -> bool:
    key, status = journal.written.get(row.name, ("", ""))
    return key == row.key and (status == "done" or not retry_failed)


def _demonstration(
    source: Any,
    region: Any,
    *,
    semantics: dict[str, Any],
    encoder: Optional[str],
    **options: Any,
) -> Demonstration:
    if isinstance(source, PreparedObject):
        given = [name for name, value in semantics.items() if value is not None]
        if given:
            raise InvalidInput(
                f"source_{given[0]}: expected none with a prepared source, found one",
                place=f"source_{given[0]}",
            )
    else:
        same = ("settings", "seed", "k", "working_vertices", "n_samples", "cache")
        given_features = any(value is not None for value in semantics.values())
        source = prepare(
            source,
            **semantics,
            encoder=None if given_features else encoder,
            **{name: options[name] for name in same},
        )
    if encoder is None and source.encoder is not None and source.encoder["name"] == _DEFAULT:
        encoder = _DEFAULT
    if not isinstance(region, Region):
        region = Region.read(region, source.mesh)
    if region.n_vertices != source.mesh.n_vertices:
        raise InvalidInput(
            f"region: expected {source.mesh.n_vertices} vertices, those of the source, "
            f"found {region.n_vertices}",
            place="region",
        )
    if region.is_empty:
        raise InvalidInput("region: expected a vertex inside, found none", place="region")
    return Demonstration(source, region, encoder=encoder, **options)


def _check_features(rows: Iterable[Row], demonstration: Demonstration) -> None:
    """Refuses objects without features before any work, where no encoder may make them."""
    if demonstration.encoder is not None or demonstration.settings.method in WITHOUT_FEATURES:
        return
    for row in rows:
        if row.embeddings is None and row.features is None and row.cloud is None:
            raise InvalidInput(
                f"{row.name}: expected one of embeddings, features, cloud, or `encoder` to be the one "
                "that made the source's features, found none",
                place=row.name,
            )


def _absolute(encoder: Optional[str]) -> Optional[str]:
    """An encoder's files by their whole path, since workers may stand elsewhere."""
    if encoder is not None and os.path.exists(encoder):
        return os.path.abspath(encoder)
    return encoder


def _settings(
    method: Optional[str], rule: Optional[str], settings: Optional[TransferSettings]
) -> TransferSettings:
    if settings is None:
        return TransferSettings(method or "fused", **({"rule": rule} if rule else {}))
    if method is not None or rule is not None:
        raise InvalidInput(
            "settings: expected either settings, or method and rule, found both", place="settings"
        )
    return settings


def _cache(cache: Optional[Union[bool, _Path]], out: str) -> Optional[Union[str, bool]]:
    if cache is None:
        cache = os.path.join(out, "shapes")
    if isinstance(cache, bool):
        return True if cache else None
    # Workers may stand elsewhere.
    return os.path.abspath(os.fspath(cache))


def _check(
    runner: str,
    address: Optional[str],
    workers: Optional[int],
    threads: Optional[int],
    attempts: int,
    shard_size: int,
    timeout_s: Optional[float],
) -> None:
    if runner not in ("local", "ray"):
        raise InvalidInput(f"runner: expected local or ray, found {runner!r}", place="runner")
    if address is not None and runner != "ray":
        raise InvalidInput("address: expected none without runner='ray'", place="address")
    counts = {
        "workers": workers,
        "threads": threads,
        "attempts": attempts,
        "shard_size": shard_size,
    }
    for name, count in counts.items():
        if count is not None and count < 1:
            raise InvalidInput(f"{name}: expected at least 1, found {count}", place=name)
    if timeout_s is not None and not timeout_s > 0:
        raise InvalidInput(f"timeout_s: expected more than 0, found {timeout_s}", place="timeout_s")
