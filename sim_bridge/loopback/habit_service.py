"""The mission protocol of a loopback vehicle with ArduPilot's or PX4's habits: MAVLink in and out. No sockets."""

from __future__ import annotations

import math
from collections.abc import Hashable
from typing import Any

from dslam_mav.mav.frames import messages
from dslam_mav.mav.mission.messages import from_message, to_message
from dslam_mav.mav.mission.protocol import ACCEPTED, INVALID_PARAM1
from dslam_mav.mission import CMD_LAND, CMD_TAKEOFF, CMD_WAYPOINT, MissionItem, home_item
from sim_bridge.loopback.autopilot import Autopilot
from sim_bridge.loopback.item_checks import check_item
from sim_bridge.loopback.mission_habits import ArduPilotHabits, Ask, Px4Habits, Reply, Say

_WARNING = 4
_YAW_MAY_BE_UNSET = frozenset({CMD_WAYPOINT, CMD_LAND, CMD_TAKEOFF})

Peer = Hashable


class HabitService:
    """Keeps the autopilot's mission; the same interface as `MissionService`."""

    def __init__(self, autopilot: Autopilot) -> None:
        self._autopilot = autopilot
        self._ardupilot = autopilot.manners.missions == "ardupilot"
        self._habits = (
            ArduPilotHabits(self._judge, home_item(autopilot.home)) if self._ardupilot else Px4Habits(self._judge)
        )
        self._held: tuple[tuple[MissionItem, ...], bool] = ((), False)
        self._note()

    @property
    def deadline_s(self) -> float:
        """When `tick` is due: at once, or never; it goes by simulated time."""
        return -math.inf if self._autopilot.time_ms >= self._habits.due_ms else math.inf

    def handle(self, peer: Peer, message: Any, now_s: float) -> list[tuple[Peer, Any]] | None:  # noqa: ARG002
        """Answers as (peer, message); None if the message is none of the mission protocol."""
        kind = message.get_type()
        if not kind.startswith("MISSION_") or kind == "MISSION_SET_CURRENT":
            return None
        record = from_message(message)
        if record is None:
            return []
        station = (peer, message.get_srcSystem(), message.get_srcComponent())
        now_ms, locked = self._autopilot.time_ms, self._autopilot.in_mission
        return self._done(self._habits.take(station, record, now_ms, locked=locked))

    def tick(self, now_s: float) -> list[tuple[Peer, Any]]:  # noqa: ARG002
        """What is due by the vehicle's own time."""
        return self._done(self._habits.tick(self._autopilot.time_ms))

    def _done(self, replies: list[Reply]) -> list[tuple[Peer, Any]]:
        self._note()
        out: list[tuple[Peer, Any]] = []
        for station, record in replies:
            assert isinstance(station, tuple)
            peer, system, component = station
            if isinstance(record, Say):
                self._autopilot.say(record.text, _WARNING)
            elif isinstance(record, Ask):
                make = messages().MAVLink_mission_request_message if record.plain else None
                make = make or messages().MAVLink_mission_request_int_message
                out.append((peer, make(system, component, record.seq)))
            else:
                out.append((peer, to_message(record, system, component)))
        return out

    def _note(self) -> None:
        """Tell the autopilot of another mission; one under way goes on with it once all is said."""
        if self._autopilot.in_mission and math.isfinite(self._habits.due_ms):
            return
        held = self._habits.items, self._habits.flyable
        if held[0] is not self._held[0] or held[1] != self._held[1]:
            self._held = held
            self._autopilot.set_items(held[0], flyable=held[1])

    def _judge(self, seq: int, item: MissionItem) -> int:
        if self._ardupilot:
            unset = [math.isnan(p) for p in item.params]
            if any(unset[:3]) or (unset[3] and item.command not in _YAW_MAY_BE_UNSET):
                return INVALID_PARAM1 + unset.index(True)
        result, _ = check_item(item, self._autopilot.home)
        return result if self._ardupilot or result == ACCEPTED else self._complain(seq, result)

    def _complain(self, seq: int, result: int) -> int:
        self._autopilot.say(f"item {seq} refused", _WARNING)
        return result
