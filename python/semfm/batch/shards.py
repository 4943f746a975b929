"""Shards: files of records, each written whole or not at all."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator, Sequence
from io import BytesIO
from typing import Any, Optional

from .._semfm import write_file
from ..errors import InvalidInput, MissingPackage
from .record import COLUMNS, Record

#: Formats and their file extensions.
FORMATS = ("parquet", "jsonl")

_NAME = re.compile(r"part-(\d{6,})\.(parquet|jsonl)")


class Unreadable(Exception):
    """A shard that was cut short or is not a shard."""


def arrow() -> Any:
    """`pyarrow` with `pyarrow.parquet`; a `MissingPackage` that names the extra otherwise."""
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError as error:
        message = "Parquet needs pyarrow: pip install pyarrow"
        raise MissingPackage(message, "missing-package", "pyarrow") from error
    return pyarrow


def chosen_format(format: Optional[str]) -> str:
    """The format asked for; Parquet where none is asked for and pyarrow is installed."""
    if format is None:
        try:
            arrow()
        except ImportError:
            return "jsonl"
        return "parquet"
    if format not in FORMATS:
        raise InvalidInput(
            f"format: expected one of {', '.join(FORMATS)}, found {format!r}", place="format"
        )
    if format == "parquet":
        arrow()
    return format


def shards(folder: str) -> list[tuple[int, str]]:
    """Number and path of each shard of a folder, ascending."""
    found = []
    for name in os.listdir(folder):
        match = _NAME.fullmatch(name)
        if match:
            found.append((int(match[1]), os.path.join(folder, name)))
    return sorted(found)


def write(folder: str, number: int, records: Sequence[Record], format: str) -> str:
    """Writes one shard and returns its path; what stood there is replaced at the end."""
    path = os.path.join(folder, f"part-{number:06d}.{format}")
    if format == "parquet":
        pa = arrow()
        table = pa.Table.from_pylist(list(records), schema=schema())
        buffer = BytesIO()
        pa.parquet.write_table(table, buffer, compression="zstd")
        content = buffer.getvalue()
    else:
        lines = (json.dumps(record, ensure_ascii=False) + "\n" for record in records)
        content = "".join(lines).encode()
    write_file(path, content)
    return path


def read(path: str, columns: Optional[Sequence[str]] = None) -> Iterator[Record]:
    """The records of one shard, with the columns asked for; all where none are.

    Raises
    ------
    Unreadable
        At the first record or in between.
    """
    wanted = list(COLUMNS) if columns is None else list(columns)
    if path.endswith(".parquet"):
        pa = arrow()
        try:
            with pa.parquet.ParquetFile(path) as file:
                for batch in file.iter_batches(batch_size=256, columns=wanted):
                    yield from batch.to_pylist()
        except (pa.lib.ArrowException, OSError) as error:
            raise Unreadable(f"{path}: {error}") from error
        return
    with open(path, encoding="utf-8") as lines:
        try:
            for line in lines:
                record = json.loads(line)
                yield {column: record[column] for column in wanted}
        except (ValueError, KeyError, TypeError) as error:
            raise Unreadable(f"{path}: {error}") from error


def schema() -> Any:
    """The Arrow schema of a shard."""
    pa = arrow()
    ids = pa.list_(pa.uint32())
    nested = {
        "list<uint32>": ids,
        "list<double>": pa.list_(pa.float64()),
        COLUMNS["hypotheses"]: pa.list_(
            pa.struct([("probability", pa.float64()), ("vertices", ids)])
        ),
    }
    return pa.schema(
        [
            pa.field(name, nested[kind] if kind in nested else pa.type_for_alias(kind))
            for name, kind in COLUMNS.items()
        ],
        metadata={"format": "semfm.batch/1"},
    )
