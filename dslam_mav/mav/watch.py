"""When is a flight over, and is the vehicle still there? Pure: the host's time is given by the caller.

Nothing seen here reaches an estimate: it only decides when the last one is made.
"""

from __future__ import annotations

from typing import Any

from dslam_mav.legs import LegCollector
from dslam_mav.mav.frames import COMPONENT_AUTOPILOT, Frame, messages

_LONGEST_STEP_S = 0.2


class FlightWatch:
    """Follows one vehicle. The mission ends when the plan's last vertex is passed, when the autopilot calls
    it complete, or when it disarms; the flight ends once the readings of the last leg are there, or none came
    for `quiet_s`. A vehicle unheard for `lost_s` is gone, whoever else is still heard.
    """

    def __init__(self, system: int, now_s: float, *, lost_s: float = 5.0, quiet_s: float = 1.0) -> None:
        self._system = system
        self._lost_s = lost_s
        self._quiet_s = quiet_s
        self._asked_s = self._reading_s = now_s
        self._silent_s = 0.0
        self._ended_s: float | None = None
        self._armed = self._underway = False

    def see(self, frame: Frame, now_s: float) -> None:
        """Take note of a frame of the vehicle's system."""
        message = frame.message
        if message.get_srcSystem() != self._system:
            return
        kind = message.get_type()
        if kind == "NAMED_VALUE_FLOAT":
            self._reading_s = now_s
        if message.get_srcComponent() == COMPONENT_AUTOPILOT:
            self._silent_s = 0.0
            if kind == "HEARTBEAT":
                self._heartbeat(message, now_s)
            elif kind == "MISSION_CURRENT":
                self._mission_state(int(message.mission_state), now_s)

    def over(self, collector: LegCollector, now_s: float) -> bool:
        """Whether the mission has ended and its readings are in."""
        last = collector.last_event
        plan = collector.plan
        if plan is not None and plan.vertices and last is not None and last[0] >= plan.vertices[-1]:
            self._end(now_s)
        if self._ended_s is None:
            return False
        if last is None:  # nothing was begun, so that no reading is awaited
            return now_s - self._ended_s >= self._quiet_s
        return collector.settled or now_s - max(self._ended_s, self._reading_s) >= self._quiet_s

    @property
    def ended(self) -> bool:
        """Whether the mission has ended."""
        return self._ended_s is not None

    def lost(self, now_s: float) -> bool:
        """Whether the autopilot has been silent for too long; to be asked whenever there is a frame or none came.

        Time in which nobody asked counts little: what the vehicle sent meanwhile is still to be read.
        """
        self._silent_s += min(now_s - self._asked_s, _LONGEST_STEP_S)
        self._asked_s = now_s
        return self._silent_s > self._lost_s

    def _heartbeat(self, message: Any, now_s: float) -> None:
        armed = bool(message.base_mode & messages().MAV_MODE_FLAG_SAFETY_ARMED)
        if self._armed and not armed:
            self._end(now_s)
        elif armed and not self._armed:
            self._ended_s = None  # it was not the flight, or there is another
        self._armed = armed

    def _mission_state(self, state: int, now_s: float) -> None:
        dialect = messages()
        if state == dialect.MISSION_STATE_COMPLETE and self._underway:  # not an earlier mission's
            self._end(now_s)
        self._underway = self._underway or state == dialect.MISSION_STATE_ACTIVE

    def _end(self, now_s: float) -> None:
        if self._ended_s is None:
            self._ended_s = now_s
