"""What a log declares of its messages, and the messages of its chunks by that."""

from __future__ import annotations

import contextlib
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np
from google.protobuf.message import DecodeError
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Schema
from mcap_protobuf.schema import build_file_descriptor_set
from numpy.typing import NDArray

from dslam_mav.log.packets import encode_frame
from dslam_mav.log.scan import Chunk, Scan
from dslam_mav.log.schemas.flight_pb2 import RawFrame
from dslam_mav.log.summary import RECORD, Summary, stream
from dslam_mav.log.topics import CHANNEL_IDS, PRODUCER, RAW, TOPICS

_MESSAGE = struct.Struct("<BQHIQQ")  # opcode, length, channel, sequence, log time, publish time

Message = tuple[int, int, int, int, bytes]
"""Channel, sequence, log time, publish time, content."""


_FIELDS = np.dtype([("length", "<u8"), ("channel", "<u2"), ("sequence", "<u4"), ("time_ns", "<u8"), ("_", "<u8")])


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """The messages of a chunk in columns, (N,) each: channel, log time, and where in the chunk the content lies."""

    channel: NDArray[np.uint16]
    time_ns: NDArray[np.uint64]
    begin: NDArray[np.int64]
    end: NDArray[np.int64]


class Declared:
    """The schemas and channels of a log: of its chunks, of its summary, and of our own logs even without either.

    `ours`: the log is one of our recorder's, which numbers its channels as `topics` does and counts each channel's
    messages from 0 without a gap. `numbered` is how many messages each channel had, by the last number seen.
    """

    def __init__(self, summary: Summary | None, *, ours: bool) -> None:
        self.ours = ours
        self.numbered: dict[int, int] = {}
        self._schemas: dict[int, Schema] = dict(summary.schemas) if summary else {}
        self._channels: dict[int, Channel] = dict(summary.channels) if summary else {}

    def messages(self, chunk: bytes) -> Iterator[Message]:
        """The messages of a chunk; what it declares is kept on the way.

        ValueError where it contradicts what was read before: then the rest of the chunk belongs to another log, or
        was there already.
        """
        unpack, numbered, ours = _MESSAGE.unpack_from, self.numbered, self.ours
        at = 0
        while at < len(chunk):
            opcode, length = RECORD.unpack_from(chunk, at)
            end = at + RECORD.size + length
            if end > len(chunk):
                raise ValueError("a record ends behind its chunk")
            if opcode == Opcode.MESSAGE:
                _, _, channel, sequence, time_ns, publish_ns = unpack(chunk, at)
                if ours:
                    if sequence < numbered.get(channel, 0):
                        raise ValueError(f"message {sequence} of channel {channel} comes again")
                    numbered[channel] = sequence + 1
                yield channel, sequence, time_ns, publish_ns, chunk[at + _MESSAGE.size : end]
            elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                self._declare(opcode, stream(chunk, at + RECORD.size, end))
            at = end

    def rows(self, chunk: bytes) -> Rows | None:
        """What `messages` gives of a chunk that is as it should be, much faster: declared before it is used, numbered
        on. None of any other, and nothing is kept of it.
        """
        at, starts = 0, list[int]()
        unpack, step = RECORD.unpack_from, RECORD.size
        try:
            while at < len(chunk):
                opcode, length = unpack(chunk, at)
                if opcode == Opcode.MESSAGE:
                    starts.append(at)
                elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                    if starts:
                        return None
                    self._declare(opcode, stream(chunk, at + step, at + step + length))
                at += step + length
        except (struct.error, ValueError, McapError):
            return None
        start = np.array(starts, dtype=np.int64)
        if at != len(chunk) or len(chunk) < _MESSAGE.size:
            return None
        fields = np.frombuffer(chunk, np.uint8)[start[:, None] + np.arange(1, _MESSAGE.size)].view(_FIELDS).ravel()
        end = start + step + fields["length"].astype(np.int64)
        if (end < start + _MESSAGE.size).any() or not self._number(fields["channel"], fields["sequence"]):
            return None
        return Rows(fields["channel"], fields["time_ns"], start + _MESSAGE.size, end)

    def _number(self, channel: NDArray[np.uint16], sequence: NDArray[np.uint32]) -> bool:
        """Whether all channels are known and, in a log of ours, their messages numbered on; then it is kept."""
        last: dict[int, int] = {}
        for number in np.unique(channel).tolist():
            own = sequence[channel == number].astype(np.int64)
            if self.ours and (own[0] < self.numbered.get(number, 0) or (np.diff(own) <= 0).any()):
                return False
            try:
                self.channel(number)
            except ValueError:
                return False
            last[number] = int(own[-1]) + 1
        if self.ours:
            self.numbered.update(last)
        return True

    def _declare(self, opcode: int, piece: ReadDataStream) -> None:
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(piece)
            if self._schemas.setdefault(schema.id, schema) != schema:
                raise ValueError(f"schema {schema.id} is declared anew")
        else:
            channel = Channel.read(piece)
            if self._channels.setdefault(channel.id, channel) != channel:
                raise ValueError(f"channel {channel.id} is declared anew")

    def channel(self, number: int) -> tuple[Channel, Schema | None]:
        """A channel with its schema (None: it has none); ValueError where the log no longer tells."""
        channel = self._channels.get(number)
        if channel is None:
            if not self.ours or not 0 < number <= len(TOPICS):
                raise ValueError(f"channel {number} is not declared")
            return _our_channel(number)
        schema = self._schemas.get(channel.schema_id)
        if schema is None and channel.schema_id:
            raise ValueError(f"schema {channel.schema_id} is not declared")
        return channel, schema

    def numbers(self) -> list[int]:
        """The numbers of all channels that `channel` knows, in ascending order."""
        known = []
        for number in sorted({*self._channels, *(CHANNEL_IDS.values() if self.ours else ())}):
            with contextlib.suppress(ValueError):
                self.channel(number)
                known.append(number)
        return known


def is_ours(library: str, data: bytes) -> bool:
    """Whether our recorder wrote a log: by its header's library or, where that is lost, by how packets are stored."""
    if library:
        return library.startswith(PRODUCER)
    for piece in Scan(data):
        if isinstance(piece, Chunk):
            with contextlib.suppress(struct.error, ValueError, McapError, DecodeError):
                for channel, _, _, _, content in Declared(None, ours=False).messages(piece.records):
                    if channel == CHANNEL_IDS[RAW]:
                        return _is_our_frame(RawFrame.FromString(content))
    return False


def _is_our_frame(stored: RawFrame) -> bool:
    again = encode_frame(stored.raw)
    if again is not None:
        again.signature_removed = stored.signature_removed  # no longer seen in the packet
    return again == stored


@cache
def our_schemas() -> dict[str, Schema]:
    """The schema of each of our topics, numbered as its channel."""
    return {
        topic: Schema(
            id=CHANNEL_IDS[topic],
            name=kind.DESCRIPTOR.full_name,
            encoding="protobuf",
            data=build_file_descriptor_set(kind).SerializeToString(),
        )
        for topic, kind in TOPICS.items()
    }


def _our_channel(number: int) -> tuple[Channel, Schema]:
    topic = list(TOPICS)[number - 1]
    return Channel(number, topic, "protobuf", {}, number), our_schemas()[topic]
