"""Reads the flight log: complete, cut or damaged. What is damaged is left out, never passed on."""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Callable, Container, Iterator, Mapping
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import TypedDict

from foxglove_schemas_protobuf.Log_pb2 import Log
from google.protobuf.message import DecodeError
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Schema
from mcap.writer import MCAP0_MAGIC as MAGIC

from dslam_mav.errors import BadInputError
from dslam_mav.log import codec
from dslam_mav.log.scan import Chunk, Scan
from dslam_mav.log.schemas import flight_pb2 as pb
from dslam_mav.log.topics import (
    CHANNEL_IDS,
    ESTIMATE,
    MISSION,
    PRODUCER,
    RAW,
    TEXT,
    THERMAL,
    TOPICS,
    TRUTH,
)
from dslam_mav.observations import Progress, Reading
from dslam_mav.records import Estimate, Truth

_RECORD = struct.Struct("<BQ")
_MESSAGE = struct.Struct("<BQHIQQ")  # opcode, length, channel, sequence, log time, publish time

_Use = Callable[[int, bytes], None]  # what to do with a message: (log time, protobuf)


@dataclass(frozen=True, slots=True)
class LoggedEstimate:
    """An estimate as it was logged: when, and after how many legs; `final` is the flight's answer."""

    received_ns: int
    legs_flown: int
    final: bool
    estimate: Estimate


@dataclass(frozen=True, slots=True)
class FlightLog:
    """All that a log holds of a flight, each in the order written; times are nanoseconds since 1970.

    `frames` (time, MAVLink packet), `readings` (time, reading), `progress` (time, progress), `texts` (time,
    Python's logging level, text), `attachments` by name. `topics` counts the messages of every topic, also of
    foreign ones. `complete`: the log was closed, and nothing in it is missing or damaged.
    """

    frames: tuple[tuple[int, bytes], ...]
    readings: tuple[tuple[int, Reading], ...]
    progress: tuple[tuple[int, Progress], ...]
    estimates: tuple[LoggedEstimate, ...]
    texts: tuple[tuple[int, int, str], ...]
    truth: Truth | None
    attachments: dict[str, bytes]
    topics: dict[str, int]
    duration_s: float
    complete: bool


class LogInfo(TypedDict):
    """What `info` tells of a log, ready for JSON."""

    topics: dict[str, int]
    duration_s: float
    complete: bool


def read_log(path: Path, topics: Container[str] = tuple(TOPICS)) -> FlightLog:
    """The log with the messages of `topics` (all are counted); BadInputError in one line for what cannot be read or is
    no MCAP file.
    """
    frames: list[tuple[int, bytes]] = []
    readings: list[tuple[int, Reading]] = []
    progress: list[tuple[int, Progress]] = []
    estimates: list[LoggedEstimate] = []
    texts: list[tuple[int, int, str]] = []
    truth: list[Truth] = []
    raw_frame, thermal, mission = (
        pb.RawFrame.FromString,
        pb.ThermalReading.FromString,
        pb.MissionProgress.FromString,
    )

    def use_estimate(time_ns: int, data: bytes) -> None:
        update = pb.EstimateUpdate.FromString(data)
        estimate = codec.decode_estimate(update.estimate)
        estimates.append(LoggedEstimate(time_ns, update.legs_flown, update.final, estimate))

    uses: dict[str, _Use] = {
        RAW: lambda time_ns, data: frames.append((time_ns, raw_frame(data).raw)),
        THERMAL: lambda time_ns, data: readings.append((time_ns, codec.decode_reading(thermal(data)))),
        MISSION: lambda time_ns, data: progress.append((time_ns, codec.decode_progress(mission(data)))),
        ESTIMATE: use_estimate,
        TEXT: lambda time_ns, data: texts.append((time_ns, *codec.decode_text(Log.FromString(data)))),
        TRUTH: lambda _, data: truth.append(codec.decode_truth(pb.Truth.FromString(data))),
    }
    contents = _Contents({topic: use for topic, use in uses.items() if topic in topics})
    info = contents.read(path)
    return FlightLog(
        frames=tuple(frames),
        readings=tuple(readings),
        progress=tuple(progress),
        estimates=tuple(estimates),
        texts=tuple(texts),
        truth=truth[-1] if truth else None,
        attachments=contents.attachments,
        **info,
    )


def log_info(path: Path) -> LogInfo:
    """Message counts by topic, duration and completeness; decodes no message. Errors as `read_log`."""
    return _Contents({}).read(path)


class _Contents:
    """One pass over a log: counts everything, hands our topics' messages to `uses`, keeps the attachments."""

    def __init__(self, uses: Mapping[str, _Use]) -> None:
        self.attachments: dict[str, bytes] = {}
        self._uses = uses
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        self._use: dict[int, _Use | None] = {}  # by channel
        self._counts: Counter[int] = Counter()
        self._first_ns: int | None = None
        self._last_ns = 0
        self._unreadable = 0

    def read(self, path: Path) -> LogInfo:
        scan = Scan(_bytes_of(Path(path)))
        for piece in scan:
            if isinstance(piece, Attachment):
                self.attachments[piece.name] = piece.data
                continue
            try:
                self._chunk(piece, ours=scan.library.startswith(PRODUCER))
            except (struct.error, ValueError, McapError):
                self._unreadable += 1
        topics: Counter[str] = Counter()
        for channel, count in sorted(self._counts.items()):
            topics[self._channels[channel].topic] += count
        return LogInfo(
            topics=dict(topics),
            duration_s=0.0 if self._first_ns is None else (self._last_ns - self._first_ns) / 1e9,
            complete=scan.complete and not self._unreadable,
        )

    def _chunk(self, chunk: Chunk, *, ours: bool) -> None:
        counts, use = self._counts, self._use
        for channel, time_ns, start, end in self._messages(chunk.records):
            if channel not in use:
                self._learn(channel, ours=ours)
            counts[channel] += 1
            if self._first_ns is None or time_ns < self._first_ns:
                self._first_ns = time_ns
            self._last_ns = max(self._last_ns, time_ns)
            do = use[channel]
            if do is not None:
                try:
                    do(time_ns, chunk.records[start:end])
                except (
                    DecodeError,
                    ValueError,
                    TypeError,
                    RecursionError,
                ):  # whole, but not what the topic promises
                    self._unreadable += 1

    def _messages(self, records: bytes) -> Iterator[tuple[int, int, int, int]]:
        """(channel, log time, begin and end of its protobuf) of a chunk's messages; schemas and channels are kept."""
        at, unpack, size, last = 0, _MESSAGE.unpack_from, len(records), len(records) - _MESSAGE.size
        while at < size:
            if at <= last and records[at] == Opcode.MESSAGE:
                _, length, channel, _, time_ns, _ = unpack(records, at)
                end = at + _RECORD.size + length
                if end > size:
                    raise ValueError("a record ends behind its chunk")
                yield channel, time_ns, at + _MESSAGE.size, end
                at = end
                continue
            opcode, length = _RECORD.unpack_from(records, at)
            end = at + _RECORD.size + length
            if end > size or opcode == Opcode.MESSAGE:
                raise ValueError("a record ends behind its chunk")
            if opcode == Opcode.SCHEMA:
                schema = Schema.read(_stream(records, at, end))
                self._schemas[schema.id] = schema
            elif opcode == Opcode.CHANNEL:
                declared = Channel.read(_stream(records, at, end))
                self._channels[declared.id] = declared
            at = end

    def _learn(self, channel: int, *, ours: bool) -> None:
        """Who uses a channel's messages: as the log declares or, where that is lost, by our own order."""
        declared = self._channels.get(channel)
        if declared is None:
            topic = next((t for t, n in CHANNEL_IDS.items() if n == channel), None) if ours else None
            if topic is None:
                raise ValueError("a message of an unknown channel")
            self._channels[channel] = Channel(channel, topic, "protobuf", {}, 0)
            self._use[channel] = self._uses.get(topic)
            return
        schema = self._schemas.get(declared.schema_id)
        kind = TOPICS.get(declared.topic)
        as_ours = kind is not None and schema is not None and schema.name == kind.DESCRIPTOR.full_name
        protobuf = declared.message_encoding == "protobuf"
        self._use[channel] = self._uses.get(declared.topic) if as_ours and protobuf else None


def _stream(records: bytes, at: int, end: int) -> ReadDataStream:
    return ReadDataStream(BytesIO(records[at + _RECORD.size : end]))


def _bytes_of(path: Path) -> bytes:
    """The file's bytes; BadInputError where it cannot be read, or does not begin as MCAP does."""
    try:
        if path.exists() and not path.is_file():
            raise BadInputError(f"{path}: is no file; expected an MCAP log")
        with path.open("rb") as file:
            magic = file.read(len(MAGIC))
            if magic != MAGIC:
                seen = f"it begins with {magic!r}" if magic else "it is empty"
                raise BadInputError(f"{path}: is no MCAP log, {seen}; expected {MAGIC!r}")
            return magic + file.read()
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise BadInputError(f"{path}: cannot be read: {reason}") from None
