"""One connection to a vehicle (or to whoever listens): MAVLink 2 frames out and in.

A background thread does nothing but empty the socket into memory, so that an owner who computes for a second
or two loses no packet; packets are taken apart only when the owner asks for them.
"""

from __future__ import annotations

import os
import queue
import select
import socket
import threading
import time
from collections import deque
from types import TracebackType
from typing import Any, Self

from dslam_mav.errors import LinkError, why
from dslam_mav.mav.frames import COMPONENT_AUTOPILOT, Encoder, Frame, Parser, heartbeat, messages
from dslam_mav.mav.ports import Port
from dslam_mav.mav.profile import Profile
from dslam_mav.mav.signing import Signing, Verifier, refusals_in_words
from dslam_mav.mav.sockets import connected_socket, listening_socket, serial_descriptor
from dslam_mav.mav.url import parse_url

_HEARTBEAT_S = 1.0
_MAX_PEERS = 32
_CHUNK_BYTES = 65536
_CLOSED = b""  # what a stream gives at its end

Address = Any  # of a datagram's sender; None on connected sockets


class Link:
    """One connection: "udpin:HOST:PORT" | "udpout:HOST:PORT" | "tcp:HOST:PORT" | "/dev/ttyX,baud".

    A malformed URL is a BadInputError; a port in use, an unknown host or a refused connection a LinkError.
    `send` may be called from any thread, `receive` from one. `system` may be set once the vehicle's is known.
    A `udpin` link sends to everybody it has heard; what is sent before that is lost, as on a radio.
    `autopilots` is what `wait_for_vehicle` learnt: vehicle's system id -> (MAV_AUTOPILOT, MAV_TYPE).
    `profile` is how the pilot says it behaves; None: as its HEARTBEAT says.
    With `signing` all that is sent is signed, and nothing else is heard than what is signed with the same key.
    """

    def __init__(self, url: str, *, system: int, component: int, signing: Signing | None = None) -> None:
        parsed = parse_url(url)
        self._stream = parsed.kind in ("tcp", "serial")
        self._sock: socket.socket | None = None
        if parsed.kind == "serial":
            self._descriptor = serial_descriptor(parsed)
        else:
            self._sock = listening_socket(parsed) if parsed.kind == "udpin" else connected_socket(parsed)
            self._descriptor = self._sock.fileno()
        self._listens = parsed.kind == "udpin"
        if self._listens and self._sock is not None:
            self.url = f"udpin:{parsed.host}:{self._sock.getsockname()[1]}"
        else:
            self.url = str(parsed)
        self.component = component
        self.autopilots: dict[int, tuple[int, int]] = {}
        self.profile: Profile | None = None
        self._signing = signing
        self._verifier = None if signing is None else Verifier(signing)
        self._encoder = Encoder(system, component, signing)
        self._lock = threading.Lock()
        self._peers: dict[Address, float] = {}
        self._parsers: dict[Address, Parser] = {}
        self._dropped_bad_bytes = 0
        self._frames: deque[Frame] = deque()
        self._chunks: queue.SimpleQueue[tuple[Address, bytes, int]] = queue.SimpleQueue()
        self._wake_in, self._wake_out = socket.socketpair()
        self._ended = False
        self._thread = threading.Thread(target=self._drain, name=f"drain {self.url}", daemon=True)
        self._thread.start()

    @property
    def system(self) -> int:
        """The system id we send as."""
        return self._encoder.system

    @system.setter
    def system(self, value: int) -> None:
        with self._lock:
            self._encoder = Encoder(value, self.component, self._signing)

    @property
    def bad_bytes(self) -> int:
        """Bytes received that were no MAVLink 2 packet."""
        return self._dropped_bad_bytes + sum(parser.bad_bytes for parser in self._parsers.values())

    @property
    def refusals(self) -> str:
        """What was refused for its signature, to be put behind a sentence; "" if nothing was."""
        return "" if self._verifier is None else refusals_in_words(self._verifier.refused)

    def send(self, message: Any) -> None:
        """Pack as (system, component) and send; LinkError if the connection is gone."""
        with self._lock:
            raw = self._encoder.pack(message)
            self._write(raw)

    def send_packed(self, raw: bytes) -> None:
        """Send a packet that somebody else packed; LinkError if the connection is gone."""
        with self._lock:
            self._write(raw)

    def send_heartbeat(self) -> None:
        """This end's HEARTBEAT, due once a second: vehicles forward only to those they have heard."""
        self.send(heartbeat(self.component))

    def receive(self, timeout_s: float) -> Frame | None:
        """The next frame, oldest first; None after `timeout_s`; LinkError once a TCP or serial end left."""
        deadline_s = time.monotonic() + timeout_s
        while not self._frames:
            if self._ended:
                raise LinkError(f"{self.url}: the other end closed the connection")
            try:
                address, data, received_ns = self._chunks.get(timeout=max(0.0, deadline_s - time.monotonic()))
            except queue.Empty:
                return None
            self._take(address, data, received_ns)
        return self._frames.popleft()

    def close(self) -> None:
        """Close the connection; a second call does nothing."""
        if self._descriptor < 0:
            return
        self._wake_in.send(b"x")
        self._thread.join()
        with self._lock:
            if self._sock is not None:
                self._sock.close()
            else:
                os.close(self._descriptor)
            self._descriptor = -1
        self._wake_in.close()
        self._wake_out.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _take(self, address: Address, data: bytes, received_ns: int) -> None:
        if data == _CLOSED and self._stream:
            self._ended = True
            return
        parser = self._parsers.get(address)
        if parser is None:
            if len(self._parsers) >= _MAX_PEERS:
                self._dropped_bad_bytes += self._parsers.pop(next(iter(self._parsers))).bad_bytes
            parser = self._parsers[address] = Parser(self._verifier)
        frames = parser.feed(data, received_ns)
        if frames and self._listens and self._verifier is not None:
            self._remember(address)  # whoever holds no key is not sent to either
        self._frames.extend(frames)

    def _write(self, raw: bytes) -> None:
        if self._descriptor < 0:
            raise LinkError(f"{self.url}: the connection is closed")
        try:
            if self._sock is None:
                _write_all(self._descriptor, raw)
            elif self._listens:
                for address in tuple(self._peers):
                    self._sock.sendto(raw, address)
            else:
                self._sock.sendall(raw)
        except OSError as problem:
            # a datagram to nobody is refused later, by ICMP: whoever is to listen may still be starting
            if self._stream or not isinstance(problem, (ConnectionRefusedError, BlockingIOError)):
                raise LinkError(f"{self.url}: cannot send: {why(problem)}") from None

    def _drain(self) -> None:
        wake = self._wake_out.fileno()
        while True:
            readable, _, _ = select.select([self._descriptor, wake], [], [])
            if wake in readable:
                return
            try:
                address, data = self._read()
            except (ConnectionRefusedError, BlockingIOError, InterruptedError):
                continue
            except OSError:
                address, data = None, _CLOSED
            if self._listens and self._verifier is None:
                self._remember(address)
            self._chunks.put((address, data, time.time_ns()))
            if self._stream and data == _CLOSED:
                return

    def _read(self) -> tuple[Address, bytes]:
        if self._sock is None:
            return None, os.read(self._descriptor, _CHUNK_BYTES)
        if self._listens:
            data, address = self._sock.recvfrom(_CHUNK_BYTES, socket.MSG_DONTWAIT)
            return address, data
        return None, self._sock.recv(_CHUNK_BYTES, socket.MSG_DONTWAIT)

    def _remember(self, address: Address) -> None:
        if address not in self._peers and len(self._peers) >= _MAX_PEERS:
            with self._lock:
                del self._peers[min(self._peers, key=self._peers.__getitem__)]
        self._peers[address] = time.monotonic()


def wait_for_vehicle(link: Port, timeout_s: float) -> int:
    """The system id of the first autopilot heard (HEARTBEAT from component 1, no ground station).

    Sends our own HEARTBEAT meanwhile. Frames before it are dropped. LinkError after `timeout_s`.
    """
    dialect = messages()
    deadline_s = time.monotonic() + timeout_s
    beat_s = -1e9
    while (now_s := time.monotonic()) < deadline_s:
        if now_s - beat_s >= _HEARTBEAT_S:
            link.send_heartbeat()
            beat_s = now_s
        frame = link.receive(min(beat_s + _HEARTBEAT_S, deadline_s) - now_s)
        if frame is None or frame.message.get_type() != "HEARTBEAT":
            continue
        message = frame.message
        if (
            message.get_srcComponent() == COMPONENT_AUTOPILOT
            and message.type != dialect.MAV_TYPE_GCS
            and message.autopilot != dialect.MAV_AUTOPILOT_INVALID
        ):
            system = int(message.get_srcSystem())
            link.autopilots[system] = (int(message.autopilot), int(message.type))
            return system
    taken = "; a simulator's TCP port serves one at a time" if link.url.startswith("tcp:") else ""
    raise LinkError(f"no vehicle answered on {link.url} within {timeout_s:g} s{link.refusals}{taken}")


def _write_all(descriptor: int, raw: bytes) -> None:
    view = memoryview(raw)
    while view:
        try:
            view = view[os.write(descriptor, view) :]
        except BlockingIOError:
            select.select([], [descriptor], [], 1.0)
