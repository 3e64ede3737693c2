"""The loopback vehicle's autopilot: what it does when told to. No sockets, no clock; see `under_way` for the flight."""

from __future__ import annotations

import math
from collections.abc import Hashable

from dslam_mav.mission import CMD_LAND, CMD_RETURN_TO_LAUNCH, MissionItem
from dslam_mav.records.words import count
from sim_bridge.loopback.flight import Flight
from sim_bridge.loopback.telemetry import (
    HEARTBEAT,
    MISSION_CURRENT,
    MissionState,
    Mode,
)
from sim_bridge.loopback.under_way import UnderWay

_START_GRID_MS = 1000
_CRITICAL = 2

Peer = Hashable
Refusal = str  # why not; "" when done


class Autopilot(UnderWay):
    """The vehicle and its orders: missions, modes, arming."""

    def set_items(self, items: tuple[MissionItem, ...], *, flyable: bool = True) -> None:
        """A new mission, not begun; one under way goes on at the same item, as PX4 and ArduPilot have it. One that is
        not `flyable` is held but not flown: a vehicle under way then stays where it is.
        """
        begins = 1 if self.manners.missions == "ardupilot" else 0  # item 0 is home there
        self._items = items if flyable else ()
        if self.in_mission and len(self._items) > begins:
            self._go_on()
        else:
            if self.in_mission:
                self._stay()
            self._seq = self.first_seq = begins
            self.mission_state = MissionState.NOT_STARTED if self._items else MissionState.NO_MISSION
        self._tell(MISSION_CURRENT)

    def arm(self) -> Refusal:
        """Arm; in mission mode the flight begins."""
        if not self.armed and (why := self.navigation.refusal(self.time_ms, guided=self.guided)):
            return why
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
        if not self.armed and self.manners.start_lies:
            return ""
        if self.manners.start_arms and (why := self.arm() if self._items else "no valid mission"):
            return why
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
            return f"item {seq} refused: {count(len(self._items), 'item')} here"
        if self.in_mission:
            if seq != self._seq:
                self._turn_to(seq)
            return ""
        self.first_seq = self._seq = seq
        return ""

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

    def _go_on(self) -> None:
        """After the items changed: as planned if it is the same until the segment under way ends."""
        flight = self._flight
        assert flight is not None
        first = self.first_seq = min(self.first_seq, len(self._items) - 1)
        if not flight.redirect(self._lay_out(self._items, first, flight.timeline)):
            self._turn_to(self._seq)

    def _turn_to(self, seq: int) -> None:
        """Fly to another item from here on; the flight goes on in time."""
        flight, first = self._flight, min(seq, len(self._items) - 1)
        assert flight is not None
        timeline = self._lay_out(self._items, first, turning=True)
        if not timeline.segments:
            self._stay()
            return
        self._flight = flight.turned(timeline, self.time_ms)
        if self._flight.index == 0:
            self._seq = timeline.segments[0].seq
            if self._flight.held_ms is None:
                self._body.follow(timeline.segments[0])
            self._tell(MISSION_CURRENT)

    def _stay(self) -> None:
        """No mission is flown any more."""
        self._flight = None
        self._body.stop()
        self._set_mode(Mode.HOLD)

    def _go_home(self, mode: Mode) -> None:
        command = CMD_RETURN_TO_LAUNCH if mode is Mode.RETURN else CMD_LAND
        item = MissionItem(command, 3, (math.nan,) * 4, 0, 0, 0.0)
        timeline = self._lay_out((item,))
        if self.in_mission:
            self._set_state(MissionState.PAUSED)
        self._flight = Flight(timeline, self.time_ms + 1, is_mission=False)

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

    def _fail_safe(self) -> None:
        self.say("EKF Failsafe: changed to LAND Mode", _CRITICAL)
        self.set_mode(Mode.LAND)
