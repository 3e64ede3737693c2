"""A viewer of a live flight, as Foxglove is one: it knows the protocol, and of messages what the server advertises."""

from __future__ import annotations

import base64
import json
import re
import struct
import subprocess
import threading
import time
from collections.abc import Callable, Container, Sequence
from types import TracebackType
from typing import Any, Self

from google.protobuf import descriptor_pb2, descriptor_pool, message_factory, unknown_fields
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

SUBPROTOCOL = "foxglove.sdk.v1"
_MESSAGE, _TIME = 1, 2


class Viewer:
    """Subscribes to `topics` (None: all), and keeps all it gets until the server ends or the `with` block does.

    `messages`: (log time, topic, content) in the order received. `channels` by topic, as advertised.
    """

    def __init__(self, url: str, topics: Container[str] | None = None) -> None:
        self.messages: list[tuple[int, str, bytes]] = []
        self.times_ns: list[int] = []
        self.channels: dict[str, dict[str, Any]] = {}
        self.info: dict[str, Any] = {}
        self._socket = connect(url, subprotocols=[SUBPROTOCOL], max_size=None).__enter__()
        assert self._socket.subprotocol == SUBPROTOCOL
        self._topics = topics
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()
        self.until(lambda: bool(self.channels))

    def of(self, topic: str) -> list[bytes]:
        return [data for _, found, data in list(self.messages) if found == topic]

    def until(self, done: Callable[[], bool], timeout_s: float = 60.0) -> None:
        end_s = time.monotonic() + timeout_s
        while not done():
            assert time.monotonic() < end_s, f"nothing more after {len(self.messages)} messages"
            time.sleep(0.01)

    def to_the_end(self) -> None:
        """Until the server is gone."""
        self._thread.join(60.0)
        assert not self._thread.is_alive()

    def decode(self, topic: str, data: bytes) -> Any:
        """A message by the advertised schema; no field of it may be unknown to that."""
        channel = self.channels[topic]
        assert (channel["encoding"], channel["schemaEncoding"]) == ("protobuf", "protobuf")
        described = descriptor_pb2.FileDescriptorSet.FromString(base64.b64decode(channel["schema"]))
        pool, waiting, known = descriptor_pool.DescriptorPool(), list(described.file), set()
        while waiting:
            file = next(file for file in waiting if set(file.dependency) <= known)
            pool.Add(file)
            known.add(file.name)
            waiting.remove(file)
        kind = message_factory.GetMessageClass(pool.FindMessageTypeByName(channel["schemaName"]))
        message = kind.FromString(data)
        assert not len(unknown_fields.UnknownFieldSet(message))
        return message

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._socket.close()
        self._thread.join(10.0)

    def _listen(self) -> None:
        topics: dict[int, str] = {}
        try:
            for frame in self._socket:
                if isinstance(frame, str):
                    self._told(json.loads(frame), topics)
                elif frame[0] == _MESSAGE:
                    channel, time_ns = struct.unpack_from("<IQ", frame, 1)
                    self.messages.append((time_ns, topics[channel], frame[13:]))
                elif frame[0] == _TIME:
                    self.times_ns.append(struct.unpack_from("<Q", frame, 1)[0])
        except ConnectionClosed:
            pass

    def _told(self, body: dict[str, Any], topics: dict[int, str]) -> None:
        if body["op"] == "serverInfo":
            self.info = body
        elif body["op"] == "advertise":
            wanted = [one for one in body["channels"] if self._topics is None or one["topic"] in self._topics]
            topics.update((one["id"], one["topic"]) for one in wanted)
            asked = [{"id": one["id"], "channelId": one["id"]} for one in wanted]
            self._socket.send(json.dumps({"op": "subscribe", "subscriptions": asked}))
            self.channels = {one["topic"]: one for one in body["channels"]}


def live_url(process: subprocess.Popen[str]) -> str:
    """Where a command that was just started says it can be watched."""
    assert process.stdout is not None
    line = process.stdout.readline()
    found = re.match(r"Live  +(ws://127\.0\.0\.1:\d+), in Foxglove", line)
    assert found, line or process.communicate()[1]
    return found[1]


def by_topic(messages: Sequence[tuple[int, str, bytes]]) -> dict[str, list[tuple[int, bytes]]]:
    """(time, content) of each topic, in order."""
    told: dict[str, list[tuple[int, bytes]]] = {}
    for time_ns, topic, data in messages:
        told.setdefault(topic, []).append((time_ns, data))
    return told
