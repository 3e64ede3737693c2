"""The log's messages as they come, over Foxglove's WebSocket protocol (extra `live`: the foxglove-sdk).

The same bytes, schemas and log times as in the file. The flight only queues; one thread of this server hands the queue
to the SDK, which keeps a bounded backlog for every viewer and drops the oldest of one that is too slow.
"""

from __future__ import annotations

import importlib.util
import logging
import threading
import time
from collections import deque
from typing import Any, Self, cast

from dslam_mav.errors import BadInputError
from dslam_mav.log.declared import our_schemas
from dslam_mav.log.topics import PRODUCER, RAW, THERMAL, TOPICS

MISSING = "--live needs foxglove-sdk; install it with: pip install 'dslam-mav[live]'"

_PERIOD_S = 0.02
_QUEUE = 100_000  # what may wait here should the SDK stand still: minutes of a flight
_BACKLOG = 8192  # messages that may wait for one viewer
_TIME_STEP_NS = 50_000_000
_LAST_WORDS_S = 0.5
_STREAMS = (RAW, THERMAL)  # of these only what comes is of interest; of all others a viewer is told the latest

_Message = tuple[int, str, bytes]
_Joined = tuple[int, str]  # client, topic


def available() -> bool:
    """Whether there is something to serve with."""
    return importlib.util.find_spec("foxglove") is not None


class Live:
    """A server for Foxglove, from its creation to `close` (or the end of a `with` block). Read-only for its viewers.

    `url` is where it is. A viewer that subscribes is told the latest message of every topic but those of readings and
    packets. Server time is the log time of the messages, so that a replay's plots carry the flight's time.
    """

    def __init__(self, host: str, port: int) -> None:
        """Port 0: any free one. BadInputError in one line where the SDK is missing or the port cannot be had."""
        if not available():
            raise BadInputError(MISSING)
        # what becomes of viewers is not the pilot's affair, and without a level every lost packet is a line
        logging.getLogger("foxglove").setLevel(logging.CRITICAL + 1)
        self.watched = threading.Event()
        self._queue: deque[_Message | _Joined] = deque(maxlen=_QUEUE)
        self._latest: dict[str, tuple[int, bytes]] = {}
        self._time_ns = -_TIME_STEP_NS
        self._told_ns = -_TIME_STEP_NS
        self._context, self._server, self._channels = _serve(host, port, _Listener(self._join))
        self.url = f"ws://{f'[{host}]' if ':' in host else host}:{self._server.port}"
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="live", daemon=True)
        self._thread.start()

    @property
    def waiting(self) -> int:
        """How many messages are not yet handed to the SDK."""
        return len(self._queue)

    def send(self, time_ns: int, topic: str, data: bytes) -> None:
        """One message of `TOPICS`, as it goes into the log. Never waits, never fails."""
        self._queue.append((time_ns, topic, data))

    def close(self) -> None:
        """End; viewers get half a second for what is still on its way to them. Harmless when repeated."""
        if self._stop.is_set():
            return
        self._stop.set()
        self._thread.join(5.0)
        if self.watched.is_set():
            time.sleep(_LAST_WORDS_S)
        self._server.stop()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _join(self, client: int, topic: str) -> None:
        """Called by the SDK, which may hold locks: only noted here."""
        self._queue.append((client, topic))
        self.watched.set()

    def _run(self) -> None:
        while not self._stop.wait(_PERIOD_S):
            self._hand_on()
        self._hand_on()

    def _hand_on(self) -> None:
        for _ in range(len(self._queue)):
            item = self._queue.popleft()
            if len(item) == 2:
                self._welcome(*item)
            else:
                self._log(*item)

    def _log(self, time_ns: int, topic: str, data: bytes) -> None:
        self._time_ns = max(self._time_ns, time_ns)  # a viewer takes a step back for a seek, and clears its plots
        if self._time_ns - self._told_ns >= _TIME_STEP_NS:
            self._tell_time()
        if topic not in _STREAMS:
            self._latest[topic] = time_ns, data
        self._channels[topic].log(data, log_time=time_ns)

    def _welcome(self, client: int, topic: str) -> None:
        if self._time_ns >= 0:
            self._tell_time()
        if topic in self._latest:
            time_ns, data = self._latest[topic]
            self._channels[topic].log(data, log_time=time_ns, sink_id=client)

    def _tell_time(self) -> None:
        self._told_ns = self._time_ns
        self._server.broadcast_time(self._time_ns)


class _Listener:
    """What the SDK calls when a viewer subscribes."""

    def __init__(self, join: Any) -> None:
        self._join = join

    def on_subscribe(self, client: Any, channel: Any) -> None:
        self._join(client.id, channel.topic)

    def on_unsubscribe(self, client: Any, channel: Any) -> None:
        """Nothing is kept of a viewer."""


def _serve(host: str, port: int, listener: _Listener) -> tuple[Any, Any, dict[str, Any]]:
    """The server, a channel for every topic, and what holds both: without it no channel is advertised."""
    import foxglove
    from foxglove.websocket import Capability

    context = foxglove.Context()
    channels = {}
    for topic in TOPICS:
        schema = our_schemas()[topic]
        described = foxglove.Schema(name=schema.name, encoding=schema.encoding, data=schema.data)
        channels[topic] = foxglove.Channel(topic, message_encoding="protobuf", schema=described, context=context)
    try:
        server = foxglove.start_server(
            name=PRODUCER, host=host, port=port, context=context, capabilities=[Capability.Time],
            server_listener=cast(Any, listener), message_backlog_size=_BACKLOG,
        )  # fmt: skip
    except RuntimeError as error:
        reason = str(error).rpartition("Failed to bind port: ")[2].partition(" (os error")[0]
        if "in use" in reason:
            raise BadInputError(f"--live {host}:{port}: port {port} is in use already; choose another") from None
        raise BadInputError(f"--live {host}:{port}: cannot be served there: {reason}") from None
    return context, server, channels
