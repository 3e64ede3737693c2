"""The loopback vehicle on its way through simulated time: what it is, where, and what it sends. No sockets, no clock.

Time moves from event to event (a message due, a corner), never millisecond by millisecond. A flight begins on
the next full second of simulated time and all streams begin anew with it, so that it repeats bit for bit
relative to its start.
"""

from __future__ import annotations

from collections.abc import Hashable
from typing import Any

from dslam_mav.mav.frames import messages
from dslam_mav.mission import Home, MissionItem
from sim_bridge.loopback.body import Body
from sim_bridge.loopback.echoes import Echoes
from sim_bridge.loopback.flight import NEVER_MS, Flight, Outgoing
from sim_bridge.loopback.flight_model import Segment, Timeline, lay_out, speed_before
from sim_bridge.loopback.manners import Manners
from sim_bridge.loopback.motion import STILL, with_inertia
from sim_bridge.loopback.navigation import Navigation
from sim_bridge.loopback.parameters import Parameters
from sim_bridge.loopback.streams import Streams
from sim_bridge.loopback.telemetry import (
    DEFAULT_INTERVAL_MS,
    HEARTBEAT,
    LOCAL_POSITION_NED,
    MISSION_CURRENT,
    MissionState,
    Mode,
    Snapshot,
    build,
)

_INFO = 6

Peer = Hashable


class UnderWay:
    """State of the vehicle at `time_ms` of simulated time; `advance` moves it on."""

    def __init__(
        self,
        home: Home,
        *,
        cruise_speed_m_s: float = 5.0,
        position_rate_hz: float = 50.0,
        seed: int = 0,
        manners: Manners | None = None,
    ) -> None:
        self.home = home
        self.manners = manners or Manners("strict")
        self.navigation = Navigation(self.manners, seed)
        self.cruise_speed_m_s = cruise_speed_m_s
        self.time_ms = 0
        self.armed = False
        self.mode = Mode.HOLD
        self.mission_state = MissionState.NO_MISSION
        self.first_seq = 0
        self.guided = False
        unasked = {LOCAL_POSITION_NED: round(1000 / position_rate_hz), **DEFAULT_INTERVAL_MS}
        self.streams = Streams({} if self.manners.quiet else unasked)
        own = {"CRUISE_M_S": cruise_speed_m_s, "POS_MS": round(1000 / position_rate_hz)}
        self.parameters = Parameters(self.manners, own)
        self._body = Body(seed)
        self._items: tuple[MissionItem, ...] = ()
        self._seq = 0
        self._flight: Flight | None = None
        self._corner_ms = -1  # of the last corner reported
        self._echoes = Echoes(wanted=self.manners.echoes)
        self._out: list[Outgoing] = []

    @property
    def in_mission(self) -> bool:
        """Whether a mission is being flown, or paused: it cannot be cleared under way."""
        return self._flight is not None and self._flight.is_mission

    @property
    def next_event_ms(self) -> int:
        """When `advance` will next have something to send."""
        return min(self._flight_event_ms(), self.streams.next_ms, self._failsafe_ms(), self._echoes.due_ms)

    def snapshot(self) -> Snapshot:
        """The vehicle now."""
        return Snapshot(
            self.time_ms,
            self._body.place_m,
            self._body.velocity_m_s,
            self._body.attitude_rad(self.time_ms),
            self.home,
            self.armed,
            self.mode,
            self._seq,
            len(self._items),
            self.mission_state,
            self.manners,
            self.navigation.true_m(self._body.place_m, self.time_ms),
            self.navigation.located(self.time_ms),
            self.guided,
        )

    def advance(self, to_ms: int) -> list[Outgoing]:
        """Let simulated time pass up to and including `to_ms`: what is sent meanwhile, in order."""
        while (event_ms := self.next_event_ms) <= to_ms:
            self._move(event_ms)
            if self._failsafe_ms() <= event_ms:
                self._fail_safe()
            while self._flight_event_ms() == event_ms:
                self._cross()
            if (again := self._echoes.again(event_ms)) is not None:
                self._out.append(Outgoing(again))
            for kind, peer in self.streams.pop(event_ms):
                self._stream(kind, peer)
        self._move(max(to_ms, self.time_ms))
        out, self._out = self._out, []
        return out

    def overhear(self, message: Any) -> None:
        """Somebody's message to everybody."""
        if message.get_type() == "NAMED_VALUE_FLOAT":
            echo = self._echoes.reading(message, self.time_ms)
            self._out += [] if echo is None else [Outgoing(echo)]

    def say(self, text: str, severity: int = _INFO) -> None:
        """STATUSTEXT to everybody."""
        self._out.append(Outgoing(messages().MAVLink_statustext_message(severity, text.encode()[:50])))

    def _set_mode(self, mode: Mode) -> None:
        if mode is not self.mode:
            self.mode = mode
            self._tell(HEARTBEAT)

    def _lay_out(
        self, items: tuple[MissionItem, ...], first: int = 0, begun: Timeline | None = None, *, turning: bool = False
    ) -> Timeline:
        """A flight from here, or from where another has `begun`; `turning` in flight, as fast as items before say."""
        place_m, yaw_rad = (begun.origin_m, begun.yaw_rad) if begun else (self._body.place_m, self._body.yaw_rad)
        speed_m_s = speed_before(items, first, self.cruise_speed_m_s) if turning else self.cruise_speed_m_s
        ideal = lay_out(items, self.home, place_m, speed_m_s=speed_m_s, yaw_rad=yaw_rad, first=first)
        if not self.manners.moves:
            return ideal
        return with_inertia(ideal, self.manners.accept_m, self._body.velocity_m_s if turning else STILL)

    def _flight_event_ms(self) -> int:
        return NEVER_MS if self._flight is None else self._flight.next_ms

    def _move(self, time_ms: int) -> None:
        self.time_ms = time_ms
        flight = self._flight
        if flight is not None and flight.index >= 0 and flight.held_ms is None:
            self._body.place_m = flight.timeline.segments[flight.index].place_m(time_ms - flight.start_ms)

    def _cross(self) -> None:
        """The flight's start, or the end of a segment."""
        flight = self._flight
        assert flight is not None
        segments = flight.timeline.segments
        if flight.index < 0:
            if flight.is_mission:
                self.streams.anchor(self.time_ms)
                self._body.anchor(self.time_ms)
                self.mission_state = MissionState.ACTIVE
        else:
            self._report(segments[flight.index])
        flight.index += 1
        if flight.index == len(segments):
            self._finish(flight)
            return
        segment = segments[flight.index]
        self._body.follow(segment)
        if flight.is_mission and (flight.index == 0 or segment.seq != self._seq):
            self._seq = segment.seq
            self._tell(MISSION_CURRENT)

    def _report(self, segment: Segment) -> None:
        if segment.corner and self._corner_ms != self.time_ms:
            self._corner_ms = self.time_ms
            self._tell(LOCAL_POSITION_NED)
        if segment.reached:
            self._reached(segment.seq)

    def _reached(self, seq: int) -> None:
        self._out.append(Outgoing(messages().MAVLink_mission_item_reached_message(seq)))
        self._echoes.reached(seq, self.time_ms)

    def _finish(self, flight: Flight) -> None:
        if flight.is_mission:
            self.mission_state = MissionState.COMPLETE
            self.say("mission complete")
        if flight.timeline.lands:
            if flight.is_mission and self.manners.echoes:  # PX4 has reached its landing, too
                self._reached(self._seq)
            self._end_flight(self.mission_state)
        else:
            self._flight = None
            self._body.stop()
            self._set_mode(Mode.HOLD)
        self._tell(MISSION_CURRENT)

    def _end_flight(self, state: MissionState) -> None:
        self._flight = None
        self._body.stop()
        self.armed = False
        self.mode = Mode.HOLD
        self._set_state(state)
        self.say("disarmed")
        self._tell(HEARTBEAT)

    def _set_state(self, state: MissionState) -> None:
        if state is not self.mission_state:
            self.mission_state = state
            self._tell(MISSION_CURRENT)

    def _stream(self, kind: int, peer: Peer | None) -> None:
        if kind == LOCAL_POSITION_NED and self._corner_ms == self.time_ms:
            return  # everybody has it already
        self._out.append(Outgoing(build(kind, self.snapshot()), peer, self.streams.without(kind)))

    def _tell(self, kind: int) -> None:
        """Send a message to everybody outside its period, because something happened."""
        if self.manners.quiet and kind != HEARTBEAT:
            return
        self._out.append(Outgoing(build(kind, self.snapshot())))

    def _failsafe_ms(self) -> int:
        landing = self._flight is not None and not self._flight.is_mission
        return NEVER_MS if not self.armed or landing else max(self.navigation.failsafe_ms, self.time_ms)

    def _fail_safe(self) -> None:
        """Navigation is lost."""
        raise NotImplementedError
