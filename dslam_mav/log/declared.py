"""What a log declares of its messages, and the messages of its chunks by that."""

from __future__ import annotations

import contextlib
import struct
from collections.abc import Iterator
from functools import cache

from google.protobuf.message import DecodeError
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Schema
from mcap_protobuf.schema import build_file_descriptor_set

from dslam_mav.log.packets import encode_frame
from dslam_mav.log.scan import Chunk, Scan
from dslam_mav.log.schemas.flight_pb2 import RawFrame
from dslam_mav.log.summary import RECORD, Summary, stream
from dslam_mav.log.topics import CHANNEL_IDS, PRODUCER, RAW, TOPICS

_MESSAGE = struct.Struct("<BQHIQQ")  # opcode, length, channel, sequence, log time, publish time

Message = tuple[int, int, int, int, bytes]
"""Channel, sequence, log time, publish time, content."""


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
