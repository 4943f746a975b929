"""Keeps replies, so that no question is paid for twice."""

from __future__ import annotations

import json
import os
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import Any

from .._identity import content_name
from .._semfm import write_file
from ..sidecar.errors import SidecarError
from .endpoint import Endpoint, Reply
from .question import Question

_FORMAT = "semfm.vlm-reply/1"


class CachedEndpoint:
    """An endpoint that looks into a folder first: an :class:`.endpoint.Endpoint`.

    A reply's file is named by the SHA-256 of all that decides it: the prompt, the pixels of the
    pictures, the form asked for, the model, its URL and settings. Every reply is kept, unusable
    ones too, since the same question has the same answer. Failures of the endpoint are not.
    """

    def __init__(self, endpoint: Endpoint, folder: str | os.PathLike[str]) -> None:
        self._endpoint, self._folder = endpoint, Path(folder)
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise SidecarError(f"{self._folder}: {error.strerror or error}") from error

    def describe(self) -> dict[str, Any]:
        """As the endpoint behind the cache."""
        return self._endpoint.describe()

    def ask(self, question: Question) -> Reply:
        """The kept reply, or a new one, which is then kept."""
        path = self._folder / f"{self._name(question)}.json"
        if (kept := _read(path)) is not None:
            return kept
        reply = self._endpoint.ask(question)
        entry = {"format": _FORMAT, **asdict(reply)}
        write_file(path, (json.dumps(entry, indent=1) + "\n").encode())
        return reply

    def _name(self, question: Question) -> str:
        decides = {"question": question.content(), "endpoint": self.describe()}
        return content_name(decides)


def _read(path: Path) -> Reply | None:
    """A kept reply; None where there is none or the file is broken, which asks anew."""
    try:
        entry = json.loads(path.read_text("utf-8"))
        if entry.pop("format") != _FORMAT or set(entry) != {f.name for f in fields(Reply)}:
            return None
        return replace(Reply(**entry), cached=True)
    except (OSError, ValueError, AttributeError, KeyError, TypeError):
        return None
