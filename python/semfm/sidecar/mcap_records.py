"""Names of MCAP's records, what the reader makes of them, and a cursor over a record's bytes.

Format: the MCAP specification, version 0.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, field

from .errors import expected

HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX = range(1, 9)
ATTACHMENT, ATTACHMENT_INDEX, STATISTICS, METADATA, METADATA_INDEX, SUMMARY_OFFSET, DATA_END = (
    range(9, 16)
)


@dataclass(frozen=True)
class Schema:
    """A schema record."""

    id: int
    name: str
    encoding: str
    data: bytes


@dataclass(frozen=True)
class Channel:
    """A channel record with its schema looked up (``None`` for schema id 0)."""

    id: int
    topic: str
    encoding: str
    schema: Schema | None
    metadata: dict[str, str]


@dataclass(frozen=True)
class Message:
    """A message with its channel; times in nanoseconds as recorded."""

    channel: Channel
    sequence: int
    log_time: int
    publish_time: int
    data: bytes


@dataclass
class McapFile:
    """All that a sound file holds, in file order."""

    profile: str = ""
    messages: list[Message] = field(default_factory=list)
    metadata: list[tuple[str, dict[str, str]]] = field(default_factory=list)
    channels: dict[int, Channel] = field(default_factory=dict)
    schemas: dict[int, Schema] = field(default_factory=dict)
    n_attachments: int = 0
    n_chunks: int = 0


class Body:
    """A cursor over one record's bytes that never runs past their end."""

    def __init__(self, data: memoryview, path: str, place: str) -> None:
        self.data, self.path, self.place, self.at = data, path, place, 0

    def take(self, n: int) -> memoryview:
        left = len(self.data) - self.at
        if n > left:
            raise expected(self.path, self.place, f"{n} more bytes in the record", left)
        self.at += n
        return self.data[self.at - n : self.at]

    def _number(self, code: str) -> int:
        return struct.unpack("<" + code, self.take(struct.calcsize("<" + code)))[0]

    def u16(self) -> int:
        return self._number("H")

    def u32(self) -> int:
        return self._number("I")

    def u64(self) -> int:
        return self._number("Q")

    def rest(self) -> memoryview:
        return self.take(len(self.data) - self.at)

    def text(self) -> str:
        try:
            return str(self.take(self.u32()), "utf-8")
        except UnicodeDecodeError as error:
            raise expected(self.path, self.place, "UTF-8 text", error.reason) from error

    def part(self) -> Body:
        """The bytes of a length-prefixed array or map, as a cursor of their own."""
        return Body(self.take(self.u32()), self.path, self.place)

    def pairs(self) -> dict[str, str]:
        part, found = self.part(), {}
        while part.at < len(part.data):
            key = part.text()
            if key in found:
                raise expected(self.path, self.place, "each map key once", f"'{key}' twice")
            found[key] = part.text()
        return found
