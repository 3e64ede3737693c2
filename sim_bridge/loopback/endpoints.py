"""The loopback vehicle's sockets: several UDP peers on one port, TCP connections, one thread serves all."""

from __future__ import annotations

import contextlib
import select
import socket
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from dslam_mav.mav.frames import Frame, Parser
from dslam_mav.mav.signing import Verifier
from dslam_mav.mav.sockets import enlarge_receive_buffer, listening_socket
from dslam_mav.mav.url import KINDS_LISTEN, parse_url
from sim_bridge.loopback.link_faults import Air

MAX_PEERS = 32
FORGET_S = 60.0  # every role sends a HEARTBEAT each second
_CHUNK_BYTES = 65536
_DATAGRAMS_AT_ONCE = 8192  # all that waits, so that simulated time does not run away from a busy host
_IN, _OUT = "in", "out"


@dataclass(eq=False, slots=True)
class Peer:
    """Somebody who has sent something: an address on a UDP socket, or a TCP connection (`address` None)."""

    sock: socket.socket
    address: Any
    heard_s: float
    parser: Parser
    listener: socket.socket | None = None


class Endpoints:
    """Listens on every URL: BadInputError on a malformed one, LinkError on a port in use.

    With a `verifier` only what it accepts comes through, and who has sent nothing of the kind is no peer. With an `air`
    what is sent and received goes through it. `alone`: a TCP port serves one at a time, and who comes meanwhile waits
    unheard, as on ArduPilot's simulator.
    """

    def __init__(
        self, urls: Sequence[str], verifier: Verifier | None = None, air: Air | None = None, *, alone: bool = False
    ) -> None:
        self._verifier = verifier
        self._air = air
        self._alone = alone
        self._bound: list[tuple[str, socket.socket]] = []
        self._udp: dict[tuple[socket.socket, Any], Peer] = {}
        self._tcp: dict[socket.socket, Peer] = {}
        self.lost: list[Peer] = []  # gone since the owner last looked
        parsed = [parse_url(url, KINDS_LISTEN) for url in urls]
        try:
            for url in parsed:
                sock = listening_socket(url)
                sock.setblocking(False)
                self._bound.append((f"{url.kind}:{url.host}:{sock.getsockname()[1]}", sock))
        except BaseException:
            self.close()
            raise

    @property
    def urls(self) -> tuple[str, ...]:
        """The URLs with the ports really bound."""
        return tuple(url for url, _ in self._bound)

    @property
    def peers(self) -> list[Peer]:
        """All who have sent something and are not gone."""
        return [*self._udp.values(), *(p for p in self._tcp.values() if p.heard_s > 0.0)]

    def poll(self, timeout_s: float) -> list[tuple[Peer, Frame]]:
        """The frames that came within `timeout_s`, at once if there are some."""
        taken = {peer.listener for peer in self._tcp.values()} if self._alone else set()
        watched = [sock for _, sock in self._bound if sock not in taken] + list(self._tcp)
        readable, _, _ = select.select(watched, [], [], max(0.0, timeout_s))
        frames: list[tuple[Peer, Frame]] = []
        for sock in readable:
            if sock in self._tcp:
                frames += self._read_stream(self._tcp[sock])
            elif sock.type == socket.SOCK_STREAM:
                self._accept(sock)
            else:
                frames += self._read_datagrams(sock)
        frames += self._late()
        self._forget_silent()
        return frames

    def send(self, peer: Peer, raw: bytes) -> None:
        """Send to one peer; what cannot be sent is lost as on a radio; a broken TCP connection is dropped."""
        for piece in [raw] if self._air is None else self._air.carry((peer, _OUT), raw, time.monotonic()):
            self._send(peer, piece)

    def _send(self, peer: Peer, raw: bytes) -> None:
        if peer.address is not None:
            with contextlib.suppress(OSError):
                peer.sock.sendto(raw, peer.address)
            return
        try:
            peer.sock.settimeout(0.2)
            peer.sock.sendall(raw)
        except OSError:
            self._drop_stream(peer)
        else:
            peer.sock.setblocking(False)

    def close(self) -> None:
        """Close everything."""
        for sock in (*self._tcp, *(sock for _, sock in self._bound)):
            sock.close()
        self._tcp.clear()
        self._udp.clear()
        self._bound.clear()

    def _read_datagrams(self, sock: socket.socket) -> list[tuple[Peer, Frame]]:
        frames: list[tuple[Peer, Frame]] = []
        for _ in range(_DATAGRAMS_AT_ONCE):
            try:
                data, address = sock.recvfrom(_CHUNK_BYTES)
            except OSError:  # empty, or news of a peer that closed
                break
            peer = self._udp.get((sock, address))
            if peer is None:
                if len(self._udp) >= MAX_PEERS:
                    continue
                peer = Peer(sock, address, 0.0, Parser(self._verifier))
            frames += self._receive(peer, data)
            if peer.heard_s > 0.0:
                self._udp[sock, address] = peer
        return frames

    def _receive(self, peer: Peer, data: bytes) -> list[tuple[Peer, Frame]]:
        pieces = [data] if self._air is None else self._air.carry((peer, _IN), data, time.monotonic())
        return [frame for piece in pieces for frame in self._feed(peer, piece)]

    def _late(self) -> list[tuple[Peer, Frame]]:
        """What the air held back for so long that nothing overtook it."""
        frames: list[tuple[Peer, Frame]] = []
        for (peer, direction), data in () if self._air is None else self._air.due(time.monotonic()):
            if direction is _IN:
                frames += self._feed(peer, data)
            else:
                self._send(peer, data)
        return frames

    def _feed(self, peer: Peer, data: bytes) -> list[tuple[Peer, Frame]]:
        frames = [(peer, frame) for frame in peer.parser.feed(data, time.time_ns())]
        if frames or self._verifier is None:
            peer.heard_s = time.monotonic()
        return frames

    def _accept(self, listener: socket.socket) -> None:
        with contextlib.suppress(OSError):
            sock, _ = listener.accept()
            enlarge_receive_buffer(sock)
            sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            sock.setblocking(False)
            self._tcp[sock] = Peer(sock, None, 0.0, Parser(self._verifier), listener)

    def _read_stream(self, peer: Peer) -> list[tuple[Peer, Frame]]:
        try:
            data = peer.sock.recv(_CHUNK_BYTES)
        except BlockingIOError:
            return []
        except OSError:
            data = b""
        if not data:
            self._drop_stream(peer)
            return []
        return self._receive(peer, data)

    def _drop_stream(self, peer: Peer) -> None:
        if self._tcp.pop(peer.sock, None) is not None:
            peer.sock.close()
            self.lost.append(peer)

    def _forget_silent(self) -> None:
        oldest_s = time.monotonic() - FORGET_S
        for key in [key for key, peer in self._udp.items() if peer.heard_s < oldest_s]:
            self.lost.append(self._udp.pop(key))
