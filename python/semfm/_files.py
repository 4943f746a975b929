"""Files of others, read the way the Rust side reads them: regular files only, named in errors."""

from __future__ import annotations

import json
import os
from io import BytesIO
from typing import Any, Union

import numpy as np

from ._semfm import read_file
from .errors import FileError, FormatError

_Path = Union[str, "os.PathLike[str]"]

#: Read in errors where a file begins with something else than JSON.
_START = 40


def read_text(path: _Path) -> str:
    """The text of a file in UTF-8, without a byte-order mark; raises FileError or FormatError."""
    name = os.fspath(path)
    try:
        return read_file(name).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise FormatError(f"{name}: byte {error.start}: expected text in UTF-8", place=name) from error
    except ValueError as error:
        if isinstance(error, FormatError):
            raise
        # A zero byte in the name, or text that no name can have.
        raise FileError(f"{name!r}: {error}", code="io", place=name) from error


def read_json(path: _Path) -> Any:
    """The value in a JSON file; raises FileError or FormatError with file and place."""
    name, text = os.fspath(path), read_text(path)
    try:
        return json.loads(text)
    except json.JSONDecodeError as error:
        place = f"line {error.lineno}"
        found = f"{error.msg} at column {error.colno}"
        if error.pos == 0:
            found = f"{text[:_START]!r}" if text.strip() else "an empty file"
        raise FormatError(f"{name}: {place}: expected JSON, found {found}", place=place) from error
    except (ValueError, RecursionError) as error:
        raise FormatError(f"{name}: expected JSON, found {error}", place=name) from error


def load_arrays(path: _Path) -> Any:
    """What `numpy.load` makes of a ``.npy`` or ``.npz`` file; raises FileError or FormatError."""
    name = os.fspath(path)
    content = read_file(name)
    try:
        return np.load(BytesIO(content), allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise FormatError(f"{name}: not a NumPy file: {error}", place=name) from error
