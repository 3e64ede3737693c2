"""The loopback vehicle's autopilot: modes, arming, the flight through simulated time. No sockets, no clock.

Time moves from event to event (a message due, a corner), never millisecond by millisecond. A flight begins on
the next full second of simulated time and all streams begin anew with it, so that it repeats bit for bit
relative to its start.
"""

from __future__ import annotations

import math
from collections.abc import Hashable

from dslam_mav.mav.frames import messages
from dslam_mav.mission import CMD_LAND, CMD_RETURN_TO_LAUNCH, Home, MissionItem
from sim_bridge.loopback.body import Body
from sim_bridge.loopback.flight import NEVER_MS, Flight, Outgoing
from sim_bridge.loopback.flight_model import Segment, Timeline, lay_out
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

_START_GRID_MS = 1000
_INFO = 6

Peer = Hashable
Refusal = str  # why not; "" when done


class Autopilot:
    """State of the vehicle at `time_ms` of simulated time; `advance` moves it on."""

    def __init__(
        self, home: Home, *, cruise_speed_m_s: float = 5.0, position_rate_hz: float = 50.0, seed: int = 0
    ) -> None:
        self.home = home
        self.cruise_speed_m_s = cruise_speed_m_s
        self.time_ms = 0
        self.armed = False
        self.mode = Mode.HOLD
        self.mission_state = MissionState.NO_MISSION
        self.first_seq = 0
        self.streams = Streams({LOCAL_POSITION_NED: round(1000 / position_rate_hz), **DEFAULT_INTERVAL_MS})
        self._body = Body(seed)
        self._items: tuple[MissionItem, ...] = ()
        self._seq = 0
        self._flight: Flight | None = None
        self._corner_ms = -1  # of the last corner reported
        self._out: list[Outgoing] = []

    @property
    def in_mission(self) -> bool:
        """Whether a mission is being flown, or paused: it cannot be cleared under way."""
        return self._flight is not None and self._flight.is_mission

    @property
    def next_event_ms(self) -> int:
        """When `advance` will next have something to send."""
        return min(self._flight_event_ms(), self.streams.next_ms)

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
        )

    def advance(self, to_ms: int) -> list[Outgoing]:
        """Let simulated time pass up to and including `to_ms`: what is sent meanwhile, in order."""
        while (event_ms := self.next_event_ms) <= to_ms:
            self._move(event_ms)
            while self._flight_event_ms() == event_ms:
                self._cross()
            for kind, peer in self.streams.pop(event_ms):
                self._stream(kind, peer)
        self._move(max(to_ms, self.time_ms))
        out, self._out = self._out, []
        return out

    def set_items(self, items: tuple[MissionItem, ...]) -> None:
        """A new mission, not begun; one under way goes on at the same item, as PX4 and ArduPilot have it."""
        self._items = items
        if self._flight is not None and self._flight.is_mission:
            first = self.first_seq = min(self.first_seq, len(items) - 1)
            origin_m, yaw_rad = self._flight.timeline.origin_m, self._flight.timeline.yaw_rad
            whole = lay_out(items, self.home, origin_m, speed_m_s=self.cruise_speed_m_s, yaw_rad=yaw_rad, first=first)
            if not self._flight.redirect(whole):
                self._turn_to(self._seq)
            self._tell(MISSION_CURRENT)
            return
        self._seq = self.first_seq = 0
        self.mission_state = MissionState.NOT_STARTED if items else MissionState.NO_MISSION
        self._tell(MISSION_CURRENT)

    def say(self, text: str, severity: int = _INFO) -> None:
        """STATUSTEXT to everybody."""
        self._out.append(Outgoing(messages().MAVLink_statustext_message(severity, text.encode()[:50])))

    def arm(self) -> Refusal:
        """Arm; in mission mode the flight begins."""
        if not self.armed:
            self.armed = True
            self.say("armed")
            self._tell(HEARTBEAT)
            if self.mode is Mode.MISSION:
                return self._begin_mission()
        return ""

    def disarm(self, *, force: bool) -> Refusal:
        """Disarm; in the air only by force (the vehicle then lies on the ground below)."""
        if self.snapshot().flying and not force:
            return "disarm refused: flying"
        if self.armed:
            self._body.drop()
            self._end_flight(MissionState.NOT_STARTED if self.in_mission else self.mission_state)
        return ""

    def start_mission(self) -> Refusal:
        """Mission mode, and the flight begins (or goes on)."""
        if not self.armed:
            return "mission start refused: not armed"
        return self.set_mode(Mode.MISSION)

    def set_mode(self, mode: Mode) -> Refusal:
        """Change mode: MISSION begins the mission when armed or goes on with a paused one; HOLD pauses."""
        if mode is Mode.MISSION:
            if not self._items:
                return "mission mode refused: no mission"
            refusal = self._begin_mission() if self.armed else ""
            if refusal:
                return refusal
        elif mode is Mode.HOLD:
            self._pause()
        elif self.armed:
            self._go_home(mode)
        self._set_mode(mode)
        return ""

    def choose_first(self, seq: int) -> Refusal:
        """The item the next mission begins with."""
        if not 0 <= seq < len(self._items):
            return f"item {seq} refused: {len(self._items)} items here"
        if self.in_mission:
            if seq != self._seq:
                self._turn_to(seq)
            return ""
        self.first_seq = self._seq = seq
        return ""

    def _set_mode(self, mode: Mode) -> None:
        if mode is not self.mode:
            self.mode = mode
            self._tell(HEARTBEAT)

    def _begin_mission(self) -> Refusal:
        flight = self._flight
        if flight is not None and flight.is_mission:
            if flight.held_ms is not None:
                flight.go_on(self.time_ms)
                self._body.follow(flight.timeline.segments[flight.index])
                self._set_state(MissionState.ACTIVE)
            return ""
        timeline = self._lay_out(self._items, first=self.first_seq)
        if not timeline.segments:
            return "mission start refused: nothing to fly"
        start_ms = -(-(self.time_ms + 1) // _START_GRID_MS) * _START_GRID_MS
        self._flight = Flight(timeline, start_ms, is_mission=True)
        return ""

    def _turn_to(self, seq: int) -> None:
        """Fly to another item from here on; the flight goes on in time."""
        flight = self._flight
        assert flight is not None
        timeline = lay_out(
            self._items, self.home, self._body.place_m, speed_m_s=flight.speed_m_s(self.cruise_speed_m_s),
            yaw_rad=self._body.yaw_rad, first=min(seq, len(self._items) - 1),
        )  # fmt: skip
        self._flight = flight.turned(timeline, self.time_ms)
        if self._flight.index == 0:
            self._seq = timeline.segments[0].seq
            if self._flight.held_ms is None:
                self._body.follow(timeline.segments[0])
            self._tell(MISSION_CURRENT)

    def _go_home(self, mode: Mode) -> None:
        command = CMD_RETURN_TO_LAUNCH if mode is Mode.RETURN else CMD_LAND
        item = MissionItem(command, 3, (math.nan,) * 4, 0, 0, 0.0)
        timeline = self._lay_out((item,))
        if self.in_mission:
            self._set_state(MissionState.PAUSED)
        self._flight = Flight(timeline, self.time_ms + 1, is_mission=False)

    def _lay_out(self, items: tuple[MissionItem, ...], first: int = 0) -> Timeline:
        place_m, yaw_rad = self._body.place_m, self._body.yaw_rad
        return lay_out(items, self.home, place_m, speed_m_s=self.cruise_speed_m_s, yaw_rad=yaw_rad, first=first)

    def _pause(self) -> None:
        flight = self._flight
        if flight is None or flight.held_ms is not None:
            return
        if not flight.is_mission or flight.index < 0:
            self._flight = None
        else:
            flight.held_ms = self.time_ms - flight.start_ms
            self._set_state(MissionState.PAUSED)
        self._body.stop()

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
            self._out.append(Outgoing(messages().MAVLink_mission_item_reached_message(segment.seq)))

    def _finish(self, flight: Flight) -> None:
        if flight.is_mission:
            self.mission_state = MissionState.COMPLETE
            self.say("mission complete")
        if flight.timeline.lands:
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
        self._out.append(Outgoing(build(kind, self.snapshot())))
