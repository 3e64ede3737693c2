"""Finds what is whole in an MCAP file, complete, cut or damaged (https://mcap.dev/spec). Pure; bytes in.

The library's readers stop at the first damage or pass it on silently. Here a chunk or attachment counts only
if its own checksum holds, and after damage the search goes on at the next chunk that does. Chunks without a
checksum, in another compression than zstd or none, and messages outside of chunks are not read (our logs have
none).
"""

from __future__ import annotations

import re
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Header
from mcap.writer import MCAP0_MAGIC as MAGIC

_RECORD = struct.Struct("<BQ")
_CHUNK = struct.Struct("<QQQII")  # start, end, uncompressed size, its checksum, length of the compression's name
_FOOTER = struct.Struct("<BQQQI")
_MAX_CHUNK_BYTES = 2**30  # a damaged size must not exhaust the memory

# what a chunk (in zstd) or an attachment looks like from its first byte on: sizes below 4 GiB
_CANDIDATE = re.compile(rb"[\x06\x09][\s\S]{4}\x00{4}")


@dataclass(frozen=True, slots=True)
class Chunk:
    """The records of a chunk, uncompressed; its checksum holds."""

    records: bytes


class Scan:
    """Iterates over the whole chunks and attachments of a file's bytes, in their order.

    Afterwards `complete` says whether the file is finished and nothing in it is missing or damaged.
    """

    def __init__(self, data: bytes) -> None:
        self.complete = False
        self.library = ""
        self._data = data
        self._zstd = zstandard.ZstdDecompressor()

    def __iter__(self) -> Iterator[Chunk | Attachment]:
        data, at, damaged = self._data, len(MAGIC), False
        while at + _RECORD.size <= len(data):
            opcode, length = _RECORD.unpack_from(data, at)
            end = at + _RECORD.size + length
            body = memoryview(data)[at + _RECORD.size : end] if end <= len(data) else None
            piece = self._read(opcode, body) if body is not None else None
            if piece is None:
                damaged = True
                at = self._next_candidate(at + 1)
                continue
            if not isinstance(piece, bool):
                yield piece
            if opcode == Opcode.DATA_END:
                self.complete = not damaged and self._closed_well(at, end)
                return
            at = end

    def _read(self, opcode: int, body: memoryview) -> Chunk | Attachment | bool | None:
        """A chunk or attachment; True for any other record that looks sound; None for what is damaged."""
        try:
            if opcode == Opcode.CHUNK:
                return self._chunk(body)
            if opcode == Opcode.ATTACHMENT:
                return _attachment(body)
            if opcode == Opcode.HEADER:
                self.library = Header.read(ReadDataStream(BytesIO(body))).library
            return _sound(opcode, body) or None
        except (struct.error, ValueError, McapError, MemoryError, zstandard.ZstdError):
            return None

    def _chunk(self, body: memoryview) -> Chunk | None:
        _, _, size, checksum, name_length = _CHUNK.unpack_from(body)
        at = _CHUNK.size + name_length
        compression = bytes(body[_CHUNK.size : at])
        (length,) = struct.unpack_from("<Q", body, at)
        packed = body[at + 8 :]
        if len(packed) != length or not checksum or size > _MAX_CHUNK_BYTES:
            return None
        if compression == b"zstd":
            if zstandard.frame_content_size(packed) not in (size, -1):
                return None
            records = self._zstd.decompress(packed, max_output_size=size)
        elif compression == b"":
            records = bytes(packed)
        else:
            return None
        return Chunk(records) if len(records) == size and zlib.crc32(records) == checksum else None

    def _next_candidate(self, start: int) -> int:
        found = _CANDIDATE.search(self._data, start)
        return found.start() if found else len(self._data)

    def _closed_well(self, data_end: int, summary: int) -> bool:
        """Whether the checksums of data and summary hold and the footer is in its place."""
        data = self._data
        footer = len(data) - len(MAGIC) - _FOOTER.size
        if footer < summary or not data.endswith(MAGIC):
            return False
        (data_crc,) = struct.unpack_from("<I", data, data_end + _RECORD.size)
        opcode, length, summary_start, _, summary_crc = _FOOTER.unpack_from(data, footer)
        return (
            (opcode, length) == (Opcode.FOOTER, _FOOTER.size - _RECORD.size)
            and summary_start == (summary if summary < footer else 0)
            and data_crc in (0, zlib.crc32(memoryview(data)[:data_end]))
            and summary_crc in (0, zlib.crc32(memoryview(data)[summary : footer + _FOOTER.size - 4]))
        )


def _sound(opcode: int, body: memoryview) -> bool:
    """Whether a record may be stepped over: it says its length twice, or damage could hide what follows."""
    if opcode == Opcode.MESSAGE_INDEX:
        return len(body) == _after_strings(body, 2, 1)
    if opcode in (Opcode.HEADER, Opcode.METADATA):
        return len(body) == _after_strings(body, 0, 2)
    if opcode == Opcode.DATA_END:
        return len(body) == 4
    return False


def _attachment(body: memoryview) -> Attachment | None:
    """An attachment whose checksum, over all of it but the checksum itself, holds."""
    at = _after_strings(body, 16, 2)
    (length,) = struct.unpack_from("<Q", body, at)
    if len(body) != at + 8 + length + 4:
        return None
    if zlib.crc32(body[:-4]) != struct.unpack_from("<I", body, len(body) - 4)[0]:
        return None
    # read by hand: the library reports an empty attachment as the end of the file
    name_end = 20 + struct.unpack_from("<I", body, 16)[0]
    return Attachment(
        log_time=struct.unpack_from("<Q", body, 0)[0],
        create_time=struct.unpack_from("<Q", body, 8)[0],
        name=str(body[20:name_end], "utf-8"),
        media_type=str(body[name_end + 4 : at], "utf-8"),
        data=bytes(body[at + 8 : -4]),
    )


def _after_strings(body: memoryview, at: int, count: int) -> int:
    """The place behind `count` strings (or maps) that carry their length in 4 bytes."""
    for _ in range(count):
        at += 4 + struct.unpack_from("<I", body, at)[0]
    return at
