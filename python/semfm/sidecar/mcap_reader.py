"""A strict, linear MCAP reader for files that fit in memory.

The stock readers are made to get something out of a damaged recording; here a damaged file must be
refused, so this one checks what they pass over: every CRC that the writer set, every length before
it is believed, decompressed sizes, conflicting channels, and that each index and statistic agrees
with the records it speaks of. Format: the MCAP specification, version 0.
"""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Iterator
from io import BytesIO

from .errors import SidecarError, expected
from .mcap_records import (
    ATTACHMENT,
    ATTACHMENT_INDEX,
    CHANNEL,
    CHUNK,
    CHUNK_INDEX,
    DATA_END,
    FOOTER,
    HEADER,
    MESSAGE,
    MESSAGE_INDEX,
    METADATA,
    METADATA_INDEX,
    SCHEMA,
    STATISTICS,
    SUMMARY_OFFSET,
    Body,
    Channel,
    McapFile,
    Message,
    Schema,
)

MAGIC = b"\x89MCAP0\r\n"
#: Views files hold a few MB; nothing sound of ours comes near these.
MAX_FILE_BYTES = 4 << 30
MAX_CHUNK_BYTES = 256 << 20

_IN_DATA = {SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, ATTACHMENT, METADATA, DATA_END}
_IN_CHUNK = {SCHEMA, CHANNEL, MESSAGE}
_IN_SUMMARY = {
    SCHEMA,
    CHANNEL,
    CHUNK_INDEX,
    ATTACHMENT_INDEX,
    STATISTICS,
    METADATA_INDEX,
    SUMMARY_OFFSET,
    FOOTER,
}


def read_mcap(path: str | os.PathLike[str]) -> McapFile:
    """Read a whole MCAP file.

    Parameters
    ----------
    path
        The file.

    Raises
    ------
    SidecarError
        If it cannot be read, is no MCAP file, is truncated, fails a CRC, or contradicts itself.
    """
    try:
        size = os.path.getsize(path)
        if size > MAX_FILE_BYTES:
            raise expected(path, "size", f"at most {MAX_FILE_BYTES} bytes", size)
        with open(path, "rb") as file:
            data = file.read()
    except OSError as error:
        raise SidecarError(f"{os.fspath(path)}: {error.strerror or error}") from error
    return _Reader(os.fspath(path), data).read()


class _Reader:
    """One pass over a file, then the checks of what its summary says about it."""

    def __init__(self, path: str, data: bytes) -> None:
        self.path, self.data = path, memoryview(data)
        self.file = McapFile()
        # Top-level records: offset -> (opcode, length with its prefix).
        self.records: dict[int, tuple[int, int]] = {}
        # Messages of the last chunk: offset in it -> (channel, log time).
        self.chunk_messages: dict[int, tuple[int, int]] = {}
        # Chunks not yet indexed: offset -> (compression, compressed size, size).
        self.chunk_sizes: dict[int, tuple[str, int, int]] = {}
        # Messages by channel.
        self.counts: dict[int, int] = {}

    def _wrong(self, place: str, wanted: object, found: object) -> SidecarError:
        return expected(self.path, place, wanted, found)

    def read(self) -> McapFile:
        data, n = self.data, len(self.data)
        if bytes(data[:8]) != MAGIC:
            found = "an empty file" if n == 0 else repr(bytes(data[:8]))
            raise self._wrong("byte 0", "the MCAP magic", found)
        if n < 16 or bytes(data[-8:]) != MAGIC:
            found = "something else (truncated?)"
            raise self._wrong("end of file", "the MCAP magic", found)
        records = self._records(data, 8, n - 8, "")
        offset, opcode, body = next(records, (8, 0, Body(data[:0], self.path, "byte 8")))
        if opcode != HEADER:
            raise self._wrong("byte 8", "a header record", f"opcode {opcode:#04x}")
        self.file.profile = body.text()
        body.text()
        data_end = self._data_section(records)
        self._summary(records, data_end)
        return self.file

    def _records(
        self, data: memoryview, start: int, end: int, within: str
    ) -> Iterator[tuple[int, int, Body]]:
        """Offset, opcode and body of each record in data[start:end]."""
        at = start
        while at < end:
            place = f"{within}record at byte {at}"
            if end - at < 9:
                raise self._wrong(place, "a whole record", f"{end - at} bytes (truncated?)")
            opcode, length = struct.unpack_from("<BQ", data, at)
            if length > end - at - 9:
                raise self._wrong(
                    place, f"{length} bytes of opcode {opcode:#04x}", f"{end - at - 9} left"
                )
            if opcode == 0:
                raise self._wrong(place, "an opcode from 1", 0)
            if not within:
                self.records[at] = (opcode, 9 + length)
            yield at, opcode, Body(data[at + 9 : at + 9 + length], self.path, place)
            at += 9 + length

    def _data_section(self, records: Iterator[tuple[int, int, Body]]) -> int:
        """Read up to DataEnd; its offset's end, where the summary begins."""
        for offset, opcode, body in records:
            if opcode == DATA_END:
                self._crc(body.place, body.u32(), self.data[:offset])
                return offset + self.records[offset][1]
            if opcode in (SCHEMA, CHANNEL, MESSAGE):
                self._content(opcode, body)
            elif opcode == CHUNK:
                self._chunk(offset, body)
            elif opcode == MESSAGE_INDEX:
                self._message_index(body)
            elif opcode == ATTACHMENT:
                self._attachment(body)
            elif opcode == METADATA:
                self.file.metadata.append((body.text(), body.pairs()))
            else:
                self._foreign(opcode, body.place, _IN_DATA)
        raise self._wrong("data section", "a DataEnd record", "none (truncated?)")

    def _foreign(self, opcode: int, place: str, allowed: set[int]) -> None:
        """The specification asks readers to pass over opcodes that they do not know."""
        if opcode <= DATA_END:
            names = ", ".join(f"{o:#04x}" for o in sorted(allowed))
            raise self._wrong(place, f"one of the opcodes {names} here", f"{opcode:#04x}")

    def _crc(self, place: str, saved: int, data: memoryview) -> None:
        """Zero means that the writer made none."""
        if saved and saved != (found := zlib.crc32(data)):
            raise self._wrong(place, f"CRC {saved:#010x}", f"{found:#010x}")

    def _content(self, opcode: int, body: Body) -> None:
        if opcode == SCHEMA:
            schema = Schema(body.u16(), body.text(), body.text(), bytes(body.take(body.u32())))
            if schema.id == 0:
                raise self._wrong(body.place, "a schema id from 1", 0)
            self._once(self.file.schemas, schema, body.place, "schema")
        elif opcode == CHANNEL:
            id, schema_id = body.u16(), body.u16()
            if schema_id and schema_id not in self.file.schemas:
                raise self._wrong(body.place, f"schema {schema_id} before its channel", "none")
            schema_or_none = self.file.schemas.get(schema_id)
            channel = Channel(id, body.text(), body.text(), schema_or_none, body.pairs())
            self._once(self.file.channels, channel, body.place, "channel")
        else:
            id, sequence = body.u16(), body.u32()
            if id not in self.file.channels:
                raise self._wrong(body.place, f"channel {id} before its message", "none")
            channel, log_time, publish_time = self.file.channels[id], body.u64(), body.u64()
            self.counts[id] = self.counts.get(id, 0) + 1
            data = bytes(body.rest())
            self.file.messages.append(Message(channel, sequence, log_time, publish_time, data))

    def _once(self, known: dict, item: Schema | Channel, place: str, kind: str) -> None:
        """A schema or channel may be repeated, not redefined."""
        if known.setdefault(item.id, item) != item:
            raise self._wrong(place, f"{kind} {item.id} as declared before", "another one")

    def _chunk(self, offset: int, body: Body) -> None:
        body.u64(), body.u64()  # first and last log time
        size, crc, compression = body.u64(), body.u32(), body.text()
        packed = body.take(body.u64())
        if size > MAX_CHUNK_BYTES:
            raise self._wrong(body.place, f"a chunk of at most {MAX_CHUNK_BYTES} bytes", size)
        data = self._unpack(compression, packed, size, body.place)
        if len(data) != size:
            raise self._wrong(body.place, f"{size} bytes when unpacked", len(data))
        self._crc(body.place, crc, data)
        self.file.n_chunks += 1
        self.chunk_sizes[offset] = (compression, len(packed), size)
        self.chunk_messages = {}
        for at, opcode, inner in self._records(data, 0, size, f"chunk at byte {offset}, "):
            if opcode in _IN_CHUNK:
                self._content(opcode, inner)
                if opcode == MESSAGE:
                    message = self.file.messages[-1]
                    self.chunk_messages[at] = (message.channel.id, message.log_time)
            else:
                self._foreign(opcode, inner.place, _IN_CHUNK)

    def _unpack(self, compression: str, packed: memoryview, size: int, place: str) -> memoryview:
        """Decompress to at most one byte more than declared, so that a bomb stays small."""
        try:
            if compression == "":
                return packed
            if compression == "lz4":
                import lz4.frame

                lz4_unpacker = lz4.frame.LZ4FrameDecompressor()
                return memoryview(lz4_unpacker.decompress(bytes(packed), max_length=size + 1))
            if compression == "zstd":
                import zstandard

                with zstandard.ZstdDecompressor().stream_reader(BytesIO(packed)) as reader:
                    return memoryview(reader.read(size + 1))
        except Exception as error:  # each library has its own exceptions
            raise self._wrong(place, f"sound {compression} data", error) from error
        raise self._wrong(place, "compression lz4, zstd or none", repr(compression))

    def _message_index(self, body: Body) -> None:
        id, part = body.u16(), body.part()
        while part.at < len(part.data):
            time, at = part.u64(), part.u64()
            if self.chunk_messages.get(at) != (id, time):
                wanted = f"a message of channel {id} at byte {at} of the chunk before"
                raise self._wrong(body.place, wanted, "none")

    def _attachment(self, body: Body) -> None:
        body.u64(), body.u64(), body.text(), body.text()
        body.take(body.u64())
        covered = body.data[: body.at]
        self._crc(body.place, body.u32(), covered)
        self.file.n_attachments += 1

    def _summary(self, records: Iterator[tuple[int, int, Body]], start: int) -> None:
        footer_at, has_more = start, False
        offset_start = None
        for offset, opcode, body in records:
            if opcode == FOOTER:
                footer_at = offset
                self._footer(offset, start, has_more, offset_start, body)
                break
            has_more = True
            if opcode == SUMMARY_OFFSET and offset_start is None:
                offset_start = offset
            if opcode in (SCHEMA, CHANNEL):
                self._content(opcode, body)  # repeats what the data section declared
            elif opcode == STATISTICS:
                self._statistics(body)
            elif opcode in _IN_SUMMARY:
                self._index(opcode, body)
            else:
                self._foreign(opcode, body.place, _IN_SUMMARY)
        else:
            raise self._wrong("end of file", "a footer record", "none (truncated?)")
        if (extra := next(records, None)) is not None:
            raise self._wrong(f"byte {footer_at}", "the footer last", f"more at byte {extra[0]}")

    def _footer(
        self, at: int, start: int, has_more: bool, offset_start: int | None, body: Body
    ) -> None:
        summary_start, summary_offset_start, crc = body.u64(), body.u64(), body.u32()
        if summary_start != (start if has_more else 0):
            raise self._wrong(body.place, f"summary at byte {start}", summary_start)
        if summary_offset_start and not start <= summary_offset_start <= at:
            raise self._wrong(body.place, "the summary offsets' start", summary_offset_start)
        if offset_start is not None and summary_offset_start not in (0, offset_start):
            raise self._wrong(body.place, f"offsets at {offset_start}", summary_offset_start)
        # The CRC covers the summary and the footer up to the CRC itself.
        self._crc(body.place, crc, self.data[start : at + 9 + 16])

    def _statistics(self, body: Body) -> None:
        found = (body.u64(), body.u16(), body.u32(), body.u32(), body.u32(), body.u32())
        file = self.file
        wanted = (
            len(file.messages),
            len(file.schemas),
            len(file.channels),
            file.n_attachments,
            len(file.metadata),
            file.n_chunks,
        )
        if found != wanted:
            names = "messages, schemas, channels, attachments, metadata, chunks"
            raise self._wrong(body.place, f"the counts ({names}) {wanted}", found)
        body.u64(), body.u64()
        part = body.part()
        while part.at < len(part.data):
            id, count = part.u16(), part.u64()
            if count != self.counts.get(id, 0):
                wanted_count = f"{self.counts.get(id, 0)} messages on channel {id}"
                raise self._wrong(body.place, wanted_count, count)

    def _index(self, opcode: int, body: Body) -> None:
        """An index must point at a record of its kind, with its length."""
        if opcode == SUMMARY_OFFSET:
            group, at, length = body.take(1)[0], body.u64(), body.u64()
            record = self.records.get(at)
            if length and (record is None or record[0] != group):
                raise self._wrong(body.place, f"opcode {group:#04x} at byte {at}", record)
            if at + length > len(self.data):
                raise self._wrong(body.place, "a group inside the file", (at, length))
            return
        if opcode == CHUNK_INDEX:
            body.u64(), body.u64()
        at, length = body.u64(), body.u64()
        kind = {CHUNK_INDEX: CHUNK, ATTACHMENT_INDEX: ATTACHMENT, METADATA_INDEX: METADATA}[opcode]
        if self.records.get(at) != (kind, length):
            wanted = f"a record of opcode {kind:#04x} and {length} bytes at byte {at}"
            raise self._wrong(body.place, wanted, self.records.get(at))
        if opcode == CHUNK_INDEX:
            self._chunk_index(at, body)

    def _chunk_index(self, at: int, body: Body) -> None:
        part = body.part()
        while part.at < len(part.data):
            id, index_at = part.u16(), part.u64()
            if self.records.get(index_at, (0, 0))[0] != MESSAGE_INDEX:
                wanted = f"channel {id}'s message index at byte {index_at}"
                raise self._wrong(body.place, wanted, "none")
        body.u64()  # length of the message indexes
        found = (body.text(), body.u64(), body.u64())
        if (wanted_sizes := self.chunk_sizes.pop(at, None)) != found:
            raise self._wrong(body.place, f"chunk {wanted_sizes}, indexed once", found)
