"""Writes the flight log. A process killed, or a machine losing power, loses at most the last second.

The caller's thread only turns records into bytes and queues them; one thread of the recorder writes them,
closes the chunk and syncs the disk twice a second. So no caller waits for a disk, and Ctrl-C, which Python
delivers to the main thread, cannot interrupt a half-written record.
"""

from __future__ import annotations

import threading
import time
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import TracebackType
from typing import IO, Any, Self, cast

from google.protobuf.message import Message
from mcap.writer import CompressionType, Writer

from dslam_mav.errors import BadInputError, LogError, unwritable, why
from dslam_mav.log import codec
from dslam_mav.log.declared import our_schemas
from dslam_mav.log.disk import Disk
from dslam_mav.log.packets import encode_frame
from dslam_mav.log.pictures import pictures
from dslam_mav.log.summary import early_end
from dslam_mav.log.topics import (
    CHANNEL_IDS,
    ESTIMATE,
    MISSION,
    PREDICTION,
    PRODUCER,
    RAW,
    TEXT,
    THERMAL,
    TRUTH,
)
from dslam_mav.observations import Progress, Reading
from dslam_mav.records import Estimate, Flight, Prediction, Truth

_SYNC_PERIOD_S = 0.5  # half of what may be lost, the other half is for a slow disk
LOG_ENDS = "; the log ends here"
Also = Callable[[int, str, bytes], None]
"""Told of a message: log time in ns, topic, protobuf."""

CHUNK_BYTES = 64 * 1024  # what one damaged byte can cost


@dataclass(frozen=True, slots=True)
class _Attachment:
    time_ns: int
    name: str
    media_type: str
    data: bytes


@dataclass(frozen=True, slots=True)
class _Message:
    time_ns: int
    channel: int
    data: bytes


class Recorder:
    """One log, from its creation to `close` (or the end of a `with` block). Any thread may call any method.

    The file must not exist yet: a log is never overwritten. Times are nanoseconds since 1970, given by the
    caller. If writing fails (a full disk), the next call raises one LogError, and every call after it does nothing;
    what was written before stays, closed without an index, which `recover` adds. Without `close` the log is
    finished when the main thread ends.
    """

    def __init__(self, path: Path, also: Also | None = None) -> None:
        """`also` is told every message logged, and must neither wait nor fail. One line where the file exists
        already or cannot be created: see `files.unwritable`.
        """
        self.path = Path(path)
        self._also = also
        self.dropped_frames = 0
        self._queue: deque[_Message | _Attachment] = deque()
        self._lock = threading.RLock()
        self._stop = threading.Event()
        self._closed = False
        self._failure: Exception | None = None
        self._reported = False
        self._sequence: Counter[int] = Counter()
        self._disk, self._writer = self._start()
        self._thread = threading.Thread(target=self._run, name="flight log")
        self._thread.start()

    def frame(self, received_ns: int, raw: bytes) -> None:
        """One MAVLink packet: SETUP_SIGNING is never stored, signatures are taken off (see `packets`).

        SETUP_SIGNING, and bytes that are not exactly one packet, are counted in `dropped_frames`.
        """
        message = encode_frame(raw)
        if message is None:
            self.dropped_frames += 1
        else:
            self._put(received_ns, RAW, message)

    def reading(self, received_ns: int, reading: Reading) -> None:
        """A value of the sensor."""
        self._put(received_ns, THERMAL, codec.encode_reading(reading))

    def progress(self, received_ns: int, progress: Progress) -> None:
        """A mission item reached or begun."""
        self._put(received_ns, MISSION, codec.encode_progress(progress))

    def estimate(
        self, received_ns: int, estimate: Estimate, legs_flown: int, final: bool, flight: Flight | None = None
    ) -> None:
        """An estimate with its alternatives, and the pictures of it; of the readings too, where it says of which."""
        self._put(received_ns, ESTIMATE, codec.encode_update(estimate, legs_flown, final))
        for topic, message in pictures(received_ns, estimate, flight):
            self._put(received_ns, topic, message)

    def text(self, received_ns: int, level: int, text: str) -> None:
        """A line for the reader of the log; `level` is one of Python's logging levels."""
        self._put(received_ns, TEXT, codec.encode_text(received_ns, level, text))

    def truth(self, received_ns: int, truth: Truth) -> None:
        """The truth of the flight, where somebody knows it."""
        self._put(received_ns, TRUTH, codec.encode_truth(truth))

    def prediction(self, received_ns: int, prediction: Prediction) -> None:
        """What the mission is expected to see, as far as is known before it is flown."""
        self._put(received_ns, PREDICTION, codec.encode_prediction(prediction))

    def attach(self, name: str, media_type: str, data: bytes) -> None:
        """A whole file: the plan, the configuration, the scene."""
        self._enqueue(_Attachment(time.time_ns(), name, media_type, bytes(data)))

    def close(self) -> None:
        """Finish the log; LogError if it could not be written and nobody was told. Harmless when repeated."""
        with self._lock:
            self._closed = True
        self._stop.set()
        self._thread.join()
        self._raise_failure()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self.close()
        except LogError:
            if error is None:  # the error on its way out comes first
                raise

    def _put(self, received_ns: int, topic: str, message: Message) -> None:
        if not 0 <= received_ns < 2**63:
            raise ValueError(f"received_ns: expected nanoseconds since 1970, got {received_ns}")
        data = message.SerializeToString()
        if self._also is not None:
            self._also(received_ns, topic, data)
        self._enqueue(_Message(received_ns, CHANNEL_IDS[topic], data))

    def _enqueue(self, item: _Message | _Attachment) -> None:
        with self._lock:
            if self._failure is not None:
                self._raise_failure()
            elif self._closed:
                raise LogError(f"{self.path}: is closed, nothing more can be logged")
            else:
                self._queue.append(item)

    def _raise_failure(self) -> None:
        """The first to ask is told, nobody after."""
        with self._lock:
            if self._failure is None or self._reported:
                return
            self._reported = True
        raise LogError(f"{self.path}: cannot be written: {why(self._failure)}{LOG_ENDS}")

    def _start(self) -> tuple[Disk, Any]:  # the writer's methods carry no types
        """The open file with its header, on disk, and every channel declared (in the first chunk)."""
        try:
            disk = Disk(self.path)
        except FileExistsError:
            raise BadInputError(f"{self.path}: exists already, and a log is never overwritten") from None
        except (OSError, ValueError) as error:
            raise unwritable(self.path, error, "cannot be created") from None
        try:
            writer = Writer(
                cast(IO[Any], disk),
                chunk_size=CHUNK_BYTES,
                compression=CompressionType.ZSTD,
                enable_data_crcs=True,
            )
            writer.start(profile="", library=f"{PRODUCER} {_version()}")
            for topic, schema in our_schemas().items():
                number = writer.register_schema(schema.name, schema.encoding, schema.data)
                writer.register_channel(topic, "protobuf", number)
            disk.sync()
        except OSError as error:
            disk.discard()
            raise unwritable(self.path, error) from None
        return disk, writer

    def _run(self) -> None:
        """The writing thread: everything queued goes to disk twice a second until the recorder is closed."""
        try:
            wait_s = _SYNC_PERIOD_S
            while not self._stop.wait(wait_s) and threading.main_thread().is_alive():
                started_s = time.monotonic()
                if self._queue:
                    self._write_queue()
                    self._writer.flush()
                    self._disk.sync()
                wait_s = max(0.0, _SYNC_PERIOD_S - (time.monotonic() - started_s))
            with self._lock:
                self._closed = True
            self._write_queue()
            self._writer.flush()
            self._disk.hold()
            self._writer.finish()
            self._disk.sync()
        except Exception as error:  # told to the next caller: nobody sees this thread
            with self._lock:
                self._failure = error
                self._queue.clear()
            self._disk.end_early(early_end)
        finally:
            self._disk.close()

    def _write_queue(self) -> None:
        for _ in range(len(self._queue)):
            item = self._queue.popleft()
            if isinstance(item, _Attachment):
                self._writer.add_attachment(item.time_ns, item.time_ns, item.name, item.media_type, item.data)
            else:
                self._writer.add_message(
                    item.channel, item.time_ns, item.data, item.time_ns, self._sequence[item.channel]
                )
                self._sequence[item.channel] += 1


def _version() -> str:
    try:
        return version("dslam-mav")
    except PackageNotFoundError:
        return "unknown"
