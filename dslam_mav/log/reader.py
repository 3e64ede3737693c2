"""Reads the flight log: complete, cut or damaged. What is damaged is left out, never passed on."""

from __future__ import annotations

import contextlib
import struct
from collections import Counter
from collections.abc import Callable, Container, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NotRequired, TypedDict

import numpy as np
from foxglove_schemas_protobuf.Log_pb2 import Log
from google.protobuf.message import DecodeError
from mcap.exceptions import McapError
from mcap.records import Attachment, Channel, Metadata, Schema
from mcap.writer import MCAP0_MAGIC as MAGIC

from dslam_mav.errors import BadInputError, unreadable
from dslam_mav.log import codec
from dslam_mav.log.declared import Declared, is_ours
from dslam_mav.log.packets import Raw
from dslam_mav.log.recovered import Recovered, recovered_from
from dslam_mav.log.scan import Chunk, Scan
from dslam_mav.log.schemas import flight_pb2 as pb
from dslam_mav.log.topics import ESTIMATE, MISSION, PREDICTION, RAW, TEXT, THERMAL, TOPICS, TRUTH
from dslam_mav.observations import Progress, Reading
from dslam_mav.records import Estimate, Prediction, Truth

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
    Python's logging level, text), `attachments` by name. `prediction`: what the mission was expected to see, None
    where nobody said. `topics` counts the messages of every topic, also of foreign ones. `complete`: the log was
    closed, and nothing in it is missing or damaged. `recovered`: what `recover` could not bring into it, where it is
    the work of that; None where it is as it was recorded.
    """

    frames: tuple[tuple[int, bytes], ...]
    readings: tuple[tuple[int, Reading], ...]
    progress: tuple[tuple[int, Progress], ...]
    estimates: tuple[LoggedEstimate, ...]
    texts: tuple[tuple[int, int, str], ...]
    truth: Truth | None
    prediction: Prediction | None
    attachments: dict[str, bytes]
    topics: dict[str, int]
    duration_s: float
    complete: bool
    recovered: Recovered | None


class LogInfo(TypedDict):
    """What `info` tells of a log, ready for JSON."""

    topics: dict[str, int]
    duration_s: float
    complete: bool
    recovered: NotRequired[Recovered]


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
    predictions: list[Prediction] = []
    raw, thermal, mission = Raw(), pb.ThermalReading.FromString, pb.MissionProgress.FromString

    def use_estimate(time_ns: int, data: bytes) -> None:
        update = pb.EstimateUpdate.FromString(data)
        estimate = codec.decode_estimate(update.estimate)
        estimates.append(LoggedEstimate(time_ns, update.legs_flown, update.final, estimate))

    uses: dict[str, _Use] = {
        RAW: lambda time_ns, data: frames.append((time_ns, raw(data))),
        THERMAL: lambda time_ns, data: readings.append((time_ns, codec.decode_reading(thermal(data)))),
        MISSION: lambda time_ns, data: progress.append((time_ns, codec.decode_progress(mission(data)))),
        ESTIMATE: use_estimate,
        TEXT: lambda time_ns, data: texts.append((time_ns, *codec.decode_text(Log.FromString(data)))),
        TRUTH: lambda _, data: truth.append(codec.decode_truth(pb.Truth.FromString(data))),
        PREDICTION: lambda _, data: predictions.append(codec.decode_prediction(pb.Prediction.FromString(data))),
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
        prediction=predictions[0] if predictions else None,
        attachments=contents.attachments,
        topics=info["topics"],
        duration_s=info["duration_s"],
        complete=info["complete"],
        recovered=info.get("recovered"),
    )


def read_messages(path: Path) -> list[tuple[int, str, bytes]]:
    """The messages of our topics as they lie in a log: (log time, topic, protobuf), by time. Errors as `read_log`."""
    found: list[tuple[int, str, bytes]] = []

    def keep(topic: str) -> _Use:
        return lambda time_ns, data: found.append((time_ns, topic, data))

    _Contents({topic: keep(topic) for topic in TOPICS}).read(path)
    return sorted(found, key=lambda message: message[0])


def log_info(path: Path) -> LogInfo:
    """Message counts by topic, duration and completeness; decodes no message. Errors as `read_log`."""
    return _Contents({}).read(path)


class _Contents:
    """One pass over a log: counts everything, hands our topics' messages to `uses`, keeps the attachments."""

    def __init__(self, uses: Mapping[str, _Use]) -> None:
        self.attachments: dict[str, bytes] = {}
        self._uses = uses
        self._declared = Declared(None, ours=False)
        self._recovered: Recovered | None = None
        self._use: dict[int, _Use | None] = {}  # by channel
        self._counts: Counter[int] = Counter()
        self._first_ns: int | None = None
        self._last_ns = 0
        self._unreadable = 0

    def read(self, path: Path) -> LogInfo:
        data = _log_bytes(Path(path))
        scan = Scan(data)
        self._declared = Declared(scan.summary, ours=is_ours(scan.library, data))
        for piece in scan:
            if isinstance(piece, Attachment):
                self.attachments[piece.name] = piece.data
            elif isinstance(piece, Metadata):
                self._recovered = recovered_from(piece) or self._recovered
            else:
                self._chunk(piece)
        info = LogInfo(
            topics=self._topics(),
            duration_s=0.0 if self._first_ns is None else (self._last_ns - self._first_ns) / 1e9,
            complete=scan.complete and not self._unreadable,
        )
        if self._recovered is not None:
            info["recovered"] = self._recovered
        return info

    def _topics(self) -> dict[str, int]:
        topics: Counter[str] = Counter()
        for channel, count in sorted(self._counts.items()):
            topics[self._declared.channel(channel)[0].topic] += count
        return dict(topics)

    def _chunk(self, chunk: Chunk) -> None:
        rows = self._declared.rows(chunk.records)
        if rows is None:
            self._one_by_one(chunk)
        elif rows.channel.size:
            self._seen(int(rows.time_ns.min()), int(rows.time_ns.max()))
            for channel in np.unique(rows.channel).tolist():
                own = np.flatnonzero(rows.channel == channel)
                self._counts[channel] += own.size
                do = self._used(channel)
                if do is not None:
                    begin, end = rows.begin[own].tolist(), rows.end[own].tolist()
                    contents = [chunk.records[a:b] for a, b in zip(begin, end, strict=True)]
                    self._decode(do, rows.time_ns[own].tolist(), contents)

    def _one_by_one(self, chunk: Chunk) -> None:
        """Of a chunk in which something is wrong, what is before that."""
        try:
            for channel, _, time_ns, _, data in self._declared.messages(chunk.records):
                do = self._used(channel)
                self._counts[channel] += 1
                self._seen(time_ns, time_ns)
                if do is not None:
                    self._decode(do, (time_ns,), (data,))
        except (struct.error, ValueError, McapError):
            self._unreadable += 1

    def _seen(self, first_ns: int, last_ns: int) -> None:
        self._first_ns = first_ns if self._first_ns is None else min(self._first_ns, first_ns)
        self._last_ns = max(self._last_ns, last_ns)

    def _used(self, channel: int) -> _Use | None:
        if channel not in self._use:
            self._use[channel] = self._use_of(*self._declared.channel(channel))
        return self._use[channel]

    def _decode(self, do: _Use, times_ns: Iterable[int], contents: Iterable[bytes]) -> None:
        for time_ns, data in zip(times_ns, contents, strict=True):
            try:
                do(time_ns, data)
            except (DecodeError, ValueError, TypeError, RecursionError):  # whole, but not what the topic promises
                self._unreadable += 1

    def _use_of(self, channel: Channel, schema: Schema | None) -> _Use | None:
        """Who uses a channel's messages: one of ours by topic, encoding and schema."""
        kind = TOPICS.get(channel.topic)
        as_ours = kind is not None and schema is not None and schema.name == kind.DESCRIPTOR.full_name
        return self._uses.get(channel.topic) if as_ours and channel.message_encoding == "protobuf" else None


def file_bytes(path: Path) -> bytes:
    """A file's bytes; BadInputError in one line where it cannot be read."""
    try:
        if path.exists() and not path.is_file():
            raise BadInputError(f"{path}: is no file; expected an MCAP log")
        return path.read_bytes()
    except (OSError, ValueError) as error:
        raise unreadable(path, error) from None


def _log_bytes(path: Path) -> bytes:
    """The bytes of a file that begins as MCAP does; BadInputError for any other, before it is read as a whole."""
    with contextlib.suppress(OSError, ValueError):  # file_bytes says what is wrong
        if path.is_file():
            with path.open("rb") as file:
                magic = file.read(len(MAGIC))
            if magic != MAGIC:
                seen = f"it begins with {magic!r}" if magic else "it is empty"
                raise BadInputError(f"{path}: is no MCAP log, {seen}; expected {MAGIC!r}")
    return file_bytes(path)
