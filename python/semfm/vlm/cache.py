"""Keeps replies, so that no question is paid for twice."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import Any

from .._identity import content_name
from .._semfm import write_file
from ..sidecar.errors import SidecarError
from .endpoint import Endpoint, Reply
from .question import Question

_FORMAT = "semfm.vlm-reply/1"


class ReplyFolder:
    """JSON files of replies in one folder, each named by what decides the reply.

    Parameters
    ----------
    folder
        Made where it is not there.
    form
        The files' format.
    kind
        The dataclass whose fields a file has.
    """

    def __init__(self, folder: str | os.PathLike[str], form: str, kind: type) -> None:
        self._folder, self._form = Path(folder), form
        self._fields = {f.name for f in fields(kind)}
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise SidecarError(f"{self._folder}: {error.strerror or error}") from error

    def read(self, decides: Any) -> dict[str, Any] | None:
        """The fields of a kept reply; None where there is none or the file is broken."""
        try:
            entry = json.loads(self._path(decides).read_text("utf-8"))
            if entry.pop("format") != self._form or set(entry) != self._fields:
                return None
        except (OSError, ValueError, AttributeError, KeyError, TypeError):
            return None
        return dict(entry)

    def write(self, decides: Any, reply: Mapping[str, Any]) -> None:
        """Keeps the fields of a reply; raises FileError."""
        entry = {"format": self._form, **reply}
        write_file(self._path(decides), (json.dumps(entry, indent=1) + "\n").encode())

    def _path(self, decides: Any) -> Path:
        return self._folder / f"{content_name(decides)}.json"


class CachedEndpoint:
    """An endpoint that looks into a folder first: an :class:`.endpoint.Endpoint`.

    A reply's file is named by the SHA-256 of all that decides it: the prompt, the pixels of the
    pictures, the form asked for, the model, its URL and settings. Every reply is kept, unusable
    ones too, since the same question has the same answer. Failures of the endpoint are not.
    """

    def __init__(self, endpoint: Endpoint, folder: str | os.PathLike[str]) -> None:
        self._endpoint, self._kept = endpoint, ReplyFolder(folder, _FORMAT, Reply)

    def describe(self) -> dict[str, Any]:
        """As the endpoint behind the cache."""
        return self._endpoint.describe()

    def ask(self, question: Question) -> Reply:
        """The kept reply, or a new one, which is then kept."""
        decides = {"question": question.content(), "endpoint": self.describe()}
        if (kept := self._kept.read(decides)) is not None:
            return replace(Reply(**kept), cached=True)
        reply = self._endpoint.ask(question)
        self._kept.write(decides, asdict(reply))
        return reply
