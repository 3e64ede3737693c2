"""One connection, several senders: ground station, estimator and bridge share a serial port or a TCP server.

The vehicle does not send back what came over a connection, so the roles on it hear each other here, by the rules a
vehicle forwards by: what is for everybody goes to all the others, what has a target to that one.
"""

from __future__ import annotations

import queue
import threading
import time
from types import TracebackType
from typing import Any, Self

from dslam_mav.errors import LinkError
from dslam_mav.mav.frames import COMPONENT_GROUND, SYSTEM_GROUND, Encoder, Frame, heartbeat, parse_frame
from dslam_mav.mav.link import Link
from dslam_mav.mav.profile import Profile
from dslam_mav.mav.signing import Signing

_POLL_S = 0.1


class Hub:
    """Opens `url` as `Link` does, and raises what that raises; `join` gives each sender its end.

    What comes before the first role has joined waits for it.
    """

    def __init__(self, url: str, *, signing: Signing | None = None) -> None:
        self.link = Link(url, system=SYSTEM_GROUND, component=COMPONENT_GROUND, signing=signing)
        self.signing = signing
        self.problem: LinkError | None = None
        self._roles: tuple[Role, ...] = ()
        self._lock = threading.Lock()
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._pump, name=f"hub {self.link.url}", daemon=True)

    def join(self, system: int, component: int) -> Role:
        """A role of its own on this connection."""
        role = Role(self, system, component)
        with self._lock:
            self._roles = (*self._roles, role)
            if not (self._thread.is_alive() or self._closing.is_set() or self.problem):
                self._thread.start()
        return role

    def leave(self, role: Role) -> None:
        """The role hears nothing any more."""
        with self._lock:
            self._roles = tuple(other for other in self._roles if other is not role)

    def send(self, raw: bytes, sender: Role) -> None:
        """A packet of one role: over the connection, and to the other roles it is for."""
        self.link.send_packed(raw)
        others = [role for role in self._roles if role is not sender]
        frame = parse_frame(raw, time.time_ns()) if others else None
        if frame is not None:
            for role in others:
                if role.is_for(frame.message):
                    role.deliver(frame)

    def close(self) -> None:
        """Close the connection; a second call does nothing."""
        self._closing.set()
        if self._thread.is_alive():
            self._thread.join()
        self.link.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _pump(self) -> None:
        while not self._closing.is_set():
            try:
                frame = self.link.receive(_POLL_S)
            except LinkError as problem:
                self.problem = problem
                for role in self._roles:
                    role.deliver(None)
                return
            if frame is not None:
                for role in self._roles:
                    role.deliver(frame)


class Role:
    """One sender on a shared connection; used as a `Link` is. Leaving it leaves the connection open."""

    def __init__(self, hub: Hub, system: int, component: int) -> None:
        self.component = component
        self.autopilots: dict[int, tuple[int, int]] = hub.link.autopilots
        self.profile: Profile | None = None
        self._hub = hub
        self._encoder = Encoder(system, component, hub.signing)
        self._lock = threading.Lock()
        self._frames: queue.SimpleQueue[Frame | None] = queue.SimpleQueue()

    @property
    def url(self) -> str:
        """Of the connection."""
        return self._hub.link.url

    @property
    def system(self) -> int:
        """The system id we send as."""
        return self._encoder.system

    @property
    def refusals(self) -> str:
        """What the connection refused for its signature; "" if nothing."""
        return self._hub.link.refusals

    def send(self, message: Any) -> None:
        """Pack as (system, component) and send; LinkError if the connection is gone."""
        with self._lock:  # the packets of a sender leave in the order they are numbered in
            self._hub.send(self._encoder.pack(message), self)

    def send_heartbeat(self) -> None:
        """This role's HEARTBEAT, due once a second."""
        self.send(heartbeat(self.component))

    def receive(self, timeout_s: float) -> Frame | None:
        """The next frame, oldest first; None after `timeout_s`; LinkError once the connection is gone."""
        try:
            frame = self._frames.get(timeout=max(0.0, timeout_s)) if timeout_s > 0.0 else self._frames.get_nowait()
        except queue.Empty:
            if self._hub.problem is not None:
                raise self._hub.problem from None
            return None
        if frame is None:
            raise self._hub.problem or LinkError(f"{self.url}: the connection is closed")
        return frame

    def deliver(self, frame: Frame | None) -> None:
        """Put a frame in; None: the connection is gone."""
        self._frames.put(frame)

    def is_for(self, message: Any) -> bool:
        """Whether a message is for everybody, or for this role."""
        system, component = getattr(message, "target_system", 0), getattr(message, "target_component", 0)
        return system in (0, self.system) and component in (0, self.component)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._hub.leave(self)
