"""The summary at the end of a closed MCAP file: what the file should hold. Pure; bytes in.

It counts only if its own checksum holds. So it still tells, where the data before it is damaged, what is lost.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import AttachmentIndex, Channel, MetadataIndex, Schema, Statistics
from mcap.writer import MCAP0_MAGIC as MAGIC

RECORD = struct.Struct("<BQ")  # opcode, length of what follows
FOOTER = struct.Struct("<BQQQI")

_DATA_END = RECORD.pack(Opcode.DATA_END, 4)

_NO_SUMMARY = FOOTER.pack(Opcode.FOOTER, FOOTER.size - RECORD.size, 0, 0, 0) + MAGIC


def early_end(checksum: int) -> bytes:
    """The shortest end of a file: the checksum of its data, no summary. Our recorder ends so where a disk is full."""
    return _DATA_END + struct.pack("<I", checksum) + _NO_SUMMARY


def ends_early(data: bytes, at: int) -> bool:
    """Whether behind the data's end nothing follows but that."""
    return data[at:] == _NO_SUMMARY


@dataclass(slots=True)
class Summary:
    """What a closed file says of itself. `counts`: messages by channel, None where it has no statistics."""

    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    counts: dict[int, int] | None = None
    attachments: list[str] = field(default_factory=list)
    metadata: list[str] = field(default_factory=list)


def read_summary(data: bytes) -> Summary | None:
    """The summary of a file's bytes, also behind insertions or before garbage; None where none is whole."""
    footer = data.rfind(MAGIC) - FOOTER.size
    if footer < len(MAGIC):
        return None
    opcode, length, stated, _, checksum = FOOTER.unpack_from(data, footer)
    if (opcode, length) != (Opcode.FOOTER, FOOTER.size - RECORD.size) or not stated or not checksum:
        return None
    found = data.rfind(_DATA_END, 0, footer) + len(_DATA_END) + 4
    for start in (stated, found):
        if len(MAGIC) <= start <= footer and checksum == zlib.crc32(memoryview(data)[start : footer + FOOTER.size - 4]):
            try:
                return _parsed(data, start, footer)
            except (struct.error, ValueError, McapError):
                return None
    return None


def _records(data: bytes, start: int, end: int) -> Iterator[tuple[int, int, int]]:
    """(opcode, start, end) of the contents of each record; ValueError where one ends behind the end."""
    while start < end:
        opcode, length = RECORD.unpack_from(data, start)
        start += RECORD.size
        if start + length > end:
            raise ValueError("a record ends behind what holds it")
        yield opcode, start, start + length
        start += length


def stream(data: bytes, start: int, end: int) -> ReadDataStream:
    """A piece of the data as the library reads records."""
    return ReadDataStream(BytesIO(data[start:end]))


def _parsed(data: bytes, start: int, end: int) -> Summary:
    summary = Summary()
    for opcode, at, until in _records(data, start, end):
        piece = stream(data, at, until)
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(piece)
            summary.schemas[schema.id] = schema
        elif opcode == Opcode.CHANNEL:
            channel = Channel.read(piece)
            summary.channels[channel.id] = channel
        elif opcode == Opcode.STATISTICS:
            summary.counts = dict(Statistics.read(piece).channel_message_counts)
        elif opcode == Opcode.ATTACHMENT_INDEX:
            summary.attachments.append(AttachmentIndex.read(piece).name)
        elif opcode == Opcode.METADATA_INDEX:
            summary.metadata.append(MetadataIndex.read(piece).name)
    return summary
