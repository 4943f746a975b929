"""The manifest: which targets, and where their meshes and features lie.

A CSV, JSONL or Parquet file with one row per object and these columns; others are ignored.

========== ===================================================================================
mesh       the mesh file
embeddings its ``NAME.emb.mcap``,
features   or a ``.npy`` file, (n, d): a feature vector per vertex,
cloud      or an ``.npz`` file with `points` (m, 3), `features` (m, d) and perhaps `n_views` (m,),
           or none of the three: an encoder makes the features
name       unique; the text of `mesh` where there is no such column
========== ===================================================================================

Relative paths are relative to the manifest's folder.
"""

from __future__ import annotations

import csv
import hashlib
import json
import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from io import BytesIO, StringIO
from typing import Any, Optional, Union

from .._files import read_text
from .._semfm import read_file
from ..errors import FileError, FormatError, InvalidInput, InvalidType

#: The columns that name files.
FILES = ("mesh", "embeddings", "features", "cloud")

_Path = Union[str, "os.PathLike[str]"]


@dataclass(frozen=True)
class Row:
    """One target.

    Attributes
    ----------
    name : str
        Unique within the manifest.
    mesh : str
        Path of the mesh.
    embeddings, features, cloud : str or None
        Paths; one of them at most is given. An object without any is encoded.
    key : str
        A digest of the row as written and of the sizes and dates of its files: an answer is good
        for as long as its key is.
    """

    name: str
    mesh: str
    embeddings: Optional[str] = None
    features: Optional[str] = None
    cloud: Optional[str] = None
    key: str = ""


def read_manifest(path: _Path) -> list[Row]:
    """Reads and checks a manifest; the files it names are not opened.

    Parameters
    ----------
    path : path
        ``.csv``, ``.jsonl`` (or ``.ndjson``) or ``.parquet``.

    Returns
    -------
    list of Row
        In the order of the file.

    Raises
    ------
    FileError
        It cannot be read.
    FormatError
        A row without a mesh or with more than one kind of features, a name that comes twice, a
        broken line.
    """
    path = os.fspath(path)
    kind = os.path.splitext(path)[1].lower()
    try:
        if kind == ".csv":
            entries = list(_csv(path))
        elif kind in (".jsonl", ".ndjson"):
            entries = list(_jsonl(path))
        elif kind in (".parquet", ".pq"):
            entries = list(_parquet(path))
        else:
            raise InvalidInput(
                f"manifest {path}: expected .csv, .jsonl or .parquet, found {kind or 'no'} extension",
                place="manifest",
            )
    except FileError as error:
        raise FileError(f"manifest {error}", code="io", place=path) from error
    return checked(entries, os.path.dirname(os.path.abspath(path)), path)


def rows_of(items: Iterable[Union[Row, Mapping[str, Any]]]) -> list[Row]:
    """Rows of what a program has at hand: `Row` or mappings with the columns of a manifest.

    Parameters
    ----------
    items : iterable of Row or dict
        Relative paths are relative to the current folder.

    Returns
    -------
    list of Row
    """
    entries = []
    for number, item in enumerate(items):
        entry = item.__dict__ if isinstance(item, Row) else item
        if not isinstance(entry, Mapping):
            found = f"{type(item).__name__} at {number}"
            raise InvalidType(
                f"manifest: expected a path, or rows as dicts, found {found}", "type", "manifest"
            )
        entries.append((f"row {number}", entry))
    return checked(entries, os.getcwd(), "manifest")


def checked(
    entries: Iterable[tuple[str, Mapping[str, Any]]], folder: str, manifest: str
) -> list[Row]:
    """Rows of raw entries, each with its place; see `read_manifest` for what is refused."""
    rows: list[Row] = []
    places: dict[str, str] = {}
    for place, entry in entries:
        texts = {column: _text(entry.get(column)) for column in ("name", *FILES)}
        mesh = texts["mesh"]
        if mesh is None:
            raise _wrong(manifest, place, "a mesh", f"the columns {sorted(map(str, entry))}")
        given = [column for column in FILES[1:] if texts[column] is not None]
        if len(given) > 1:
            wanted = "at most one of embeddings, features, cloud"
            raise _wrong(manifest, place, wanted, " and ".join(given))
        if not given and (column := _misspelt(entry)) is not None:
            wanted = "one of embeddings, features, cloud, or none of them"
            raise _wrong(manifest, place, wanted, f"the column {column!r}")
        name = texts["name"] or mesh
        if name in places:
            raise _wrong(manifest, place, "names that differ", f"{name!r} at {places[name]} too")
        places[name] = place
        rows.append(_row(name, {column: texts[column] for column in FILES}, folder))
    if not rows:
        raise FormatError(f"{manifest}: expected at least one row, found none", place=manifest)
    return rows


def _misspelt(entry: Mapping[str, Any]) -> Optional[str]:
    """A column that looks like one of ours: its object would be encoded in silence."""
    others = (str(column) for column in entry if column not in ("name", *FILES))
    return next((c for c in others if get_close_matches(c.lower(), FILES[1:], 1, 0.8)), None)


def _row(name: str, texts: Mapping[str, Optional[str]], folder: str) -> Row:
    digest = hashlib.blake2b(digest_size=16)
    paths: dict[str, Optional[str]] = {}
    for column, text in texts.items():
        paths[column] = None if text is None else os.path.join(folder, text)
        digest.update(f"{column}={text}\n{_stamp(paths[column])}\n".encode())
    return Row(
        name,
        str(paths["mesh"]),
        embeddings=paths["embeddings"],
        features=paths["features"],
        cloud=paths["cloud"],
        key=digest.hexdigest(),
    )


def _stamp(path: Optional[str]) -> str:
    """Size and date of a file: a file that comes or changes makes its row be done again."""
    if path is None:
        return ""
    try:
        found = os.stat(path)
    except OSError:
        return "absent"
    return f"{found.st_size} {found.st_mtime_ns}"


def _text(value: Any) -> Optional[str]:
    text = "" if value is None else str(value).strip()
    return text or None


def _wrong(manifest: str, place: str, expected: str, found: str) -> FormatError:
    return FormatError(f"{manifest}, {place}: expected {expected}, found {found}", place=place)


def _csv(path: str) -> Iterator[tuple[str, Mapping[str, Any]]]:
    reader = csv.DictReader(StringIO(read_text(path), newline=""))
    try:
        for entry in reader:
            yield f"line {reader.line_num}", entry
    except csv.Error as error:
        raise _wrong(path, f"line {reader.line_num}", "CSV", str(error)) from error


def _jsonl(path: str) -> Iterator[tuple[str, Mapping[str, Any]]]:
    for number, line in enumerate(read_text(path).split("\n"), 1):
        if not line.strip():
            continue
        try:
            entry = json.loads(line)
        except (ValueError, RecursionError) as error:
            raise _wrong(path, f"line {number}", "JSON", str(error)) from error
        if not isinstance(entry, dict):
            raise _wrong(path, f"line {number}", "an object", type(entry).__name__)
        yield f"line {number}", entry


def _parquet(path: str) -> Iterator[tuple[str, Mapping[str, Any]]]:
    from .shards import arrow

    try:
        with arrow().parquet.ParquetFile(BytesIO(read_file(path))) as file:
            columns = [c for c in ("name", *FILES) if c in file.schema_arrow.names]
            number = 0
            for batch in file.iter_batches(columns=columns):
                for entry in batch.to_pylist():
                    yield f"row {number}", entry
                    number += 1
    except arrow().lib.ArrowInvalid as error:
        raise FormatError(f"manifest {path}: {error}", place=path) from error
