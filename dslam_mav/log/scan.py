"""Finds what is whole in an MCAP file, complete, cut or damaged (https://mcap.dev/spec). Pure; bytes in.

The library's readers stop at the first damage or pass it on silently. Here a chunk or attachment counts only
if its own checksum holds, and after damage the search goes on at the next one that does. Chunks without a
checksum or in lz4, and messages outside of chunks, are not read (our logs have none). Metadata have no checksum
of their own: they count where their lengths agree.
"""

from __future__ import annotations

import re
import struct
import zlib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Header, Metadata
from mcap.writer import MCAP0_MAGIC as MAGIC

from dslam_mav.log.summary import FOOTER, RECORD, Summary, ends_early, read_summary
from dslam_mav.log.topics import PRODUCER

_CHUNK = struct.Struct("<QQQII")  # start, end, uncompressed size, its checksum, length of the compression's name
_MAX_CHUNK_BYTES = 2**30  # a damaged size must not exhaust the memory

# what a chunk (in zstd) or an attachment looks like from its first byte on: sizes below 4 GiB
_CANDIDATE = re.compile(rb"[\x06\x09][\s\S]{4}\x00{4}")


@dataclass(frozen=True, slots=True)
class Chunk:
    """The records of a chunk, uncompressed; its checksum holds."""

    records: bytes


Piece = Chunk | Attachment | Metadata


class Scan:
    """Iterates over the whole chunks, attachments and metadata of a file's bytes, in their order.

    From the start: `profile` and `library` of the header, empty where it is damaged, and the `summary`, where it
    is whole. Afterwards:

    - `complete`: the file is finished and nothing in it is missing or damaged;
    - `unbroken`: the data follow record on record to their end, which no full disk brought about: none is missing;
    - `damaged_messages`: messages by channel in chunks that are damaged, as far as the indexes behind them tell;
    - `unread`: chunks that may be whole, but have no checksum, or are compressed with lz4.
    """

    def __init__(self, data: bytes) -> None:
        self.complete = False
        self.unbroken = False
        self.damaged_messages: Counter[int] = Counter()
        self.unread = 0
        self.summary: Summary | None = read_summary(data)
        self._data = data
        self._zstd = zstandard.ZstdDecompressor()
        self.profile, self.library, self._first = _header(data)

    def __iter__(self) -> Iterator[Piece]:
        data, at, broken = self._data, self._first, False
        if not at:
            at, broken = self._next_candidate(0), True
        while at + RECORD.size <= len(data):
            opcode, length = RECORD.unpack_from(data, at)
            end = at + RECORD.size + length
            piece = self._read(opcode, memoryview(data)[at + RECORD.size : end]) if end <= len(data) else None
            if piece is None:
                broken = True
                if opcode == Opcode.CHUNK:
                    self._count_damaged(at, end)
                at = self._next_candidate(at + 1)
                continue
            if not isinstance(piece, bool):
                yield piece
            if opcode == Opcode.DATA_END:
                self.unbroken = not (broken or (self.library.startswith(PRODUCER) and ends_early(data, end)))
                self.complete = self.unbroken and self._closed_well(at, end)
                if self.complete:
                    return
            at = end

    def _read(self, opcode: int, body: memoryview) -> Piece | bool | None:
        """A chunk, attachment or metadata; True for any other record that looks sound; None for what is damaged."""
        try:
            if opcode == Opcode.CHUNK:
                return self._chunk(body)
            if opcode == Opcode.ATTACHMENT:
                return _attachment(body)
            if opcode == Opcode.METADATA:
                return _metadata(body)
            return _sound(opcode, body) or None
        except (struct.error, ValueError, McapError, MemoryError, zstandard.ZstdError):
            return None

    def _chunk(self, body: memoryview) -> Chunk | None:
        _, _, size, checksum, name_length = _CHUNK.unpack_from(body)
        at = _CHUNK.size + name_length
        compression = bytes(body[_CHUNK.size : at])
        (length,) = struct.unpack_from("<Q", body, at)
        packed = body[at + 8 :]
        if len(packed) != length:
            return None
        if not checksum or compression == b"lz4":
            self.unread += 1
            return None
        if size > _MAX_CHUNK_BYTES:
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

    def _count_damaged(self, at: int, end: int) -> None:
        """The messages of a damaged chunk, by the indexes behind it if they span the times that it states."""
        data, found, times_ns = self._data, Counter[int](), set[int]()
        while end + RECORD.size + 6 <= len(data):
            opcode, length = RECORD.unpack_from(data, end)
            channel, index_bytes = struct.unpack_from("<HI", data, end + RECORD.size)
            entries = end + RECORD.size + 6
            end += RECORD.size + length
            if opcode != Opcode.MESSAGE_INDEX or length != 6 + index_bytes or index_bytes % 16 or end > len(data):
                break
            indexed = [time_ns for time_ns, _ in struct.iter_unpack("<QQ", memoryview(data)[entries:end])]
            found[channel] += len(indexed)
            times_ns.update(indexed)
        if times_ns and (min(times_ns), max(times_ns)) == _CHUNK.unpack_from(data, at + RECORD.size)[:2]:
            self.damaged_messages += found

    def _next_candidate(self, start: int) -> int:
        found = _CANDIDATE.search(self._data, start)
        return found.start() if found else len(self._data)

    def _closed_well(self, data_end: int, summary: int) -> bool:
        """Whether the checksums of data and summary hold and the footer is in its place."""
        data = self._data
        footer = len(data) - len(MAGIC) - FOOTER.size
        if footer < summary or not data.endswith(MAGIC):
            return False
        (data_crc,) = struct.unpack_from("<I", data, data_end + RECORD.size)
        opcode, length, summary_start, _, summary_crc = FOOTER.unpack_from(data, footer)
        return (
            (opcode, length) == (Opcode.FOOTER, FOOTER.size - RECORD.size)
            and summary_start == (summary if summary < footer else 0)
            and data_crc in (0, zlib.crc32(memoryview(data)[:data_end]))
            and summary_crc in (0, zlib.crc32(memoryview(data)[summary : footer + FOOTER.size - 4]))
        )


def _header(data: bytes) -> tuple[str, str, int]:
    """Profile, library and the place behind the header; that place is 0 where the header is damaged."""
    try:
        opcode, length = RECORD.unpack_from(data, len(MAGIC))
        end = len(MAGIC) + RECORD.size + length
        body = memoryview(data)[len(MAGIC) + RECORD.size : end]
        if opcode != Opcode.HEADER or end > len(data) or len(body) != _after_strings(body, 0, 2):
            return "", "", 0
        header = Header.read(ReadDataStream(BytesIO(body)))
    except (struct.error, ValueError, McapError):
        return "", "", 0
    return header.profile, header.library, end


def _sound(opcode: int, body: memoryview) -> bool:
    """Whether a record may be stepped over: it says its length twice, or damage could hide what follows."""
    if opcode == Opcode.MESSAGE_INDEX:
        return len(body) == _after_strings(body, 2, 1)
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


def _metadata(body: memoryview) -> Metadata | None:
    """Metadata whose lengths agree to the byte: the library alone would pass on less than was written."""
    at = _after_strings(body, 0, 1) + 4
    if len(body) != _after_strings(body, 0, 2):
        return None
    while at < len(body):
        at = _after_strings(body, at, 2)
    return Metadata.read(ReadDataStream(BytesIO(body))) if at == len(body) else None


def _after_strings(body: memoryview, at: int, count: int) -> int:
    """The place behind `count` strings (or maps) that carry their length in 4 bytes."""
    for _ in range(count):
        at += 4 + struct.unpack_from("<I", body, at)[0]
    return at
