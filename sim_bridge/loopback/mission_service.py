"""The loopback vehicle's mission protocol: MAVLink messages to the pure server and back. No sockets."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import replace
from typing import Any

from dslam_mav.mav.frames import messages
from dslam_mav.mav.mission.messages import from_message, to_message
from dslam_mav.mav.mission.protocol import ACCEPTED, UNSUPPORTED, ClearAll, Message
from dslam_mav.mav.mission.server import Reply, Server, step_server
from dslam_mav.mission import MissionItem
from sim_bridge.loopback.autopilot import Autopilot
from sim_bridge.loopback.item_checks import check_item

_ALL_TYPES = 255
_WARNING = 4

Peer = Hashable


class MissionService:
    """Keeps the autopilot's mission; stations are told apart by peer, system and component."""

    def __init__(self, autopilot: Autopilot) -> None:
        self._autopilot = autopilot
        self._server = Server()

    @property
    def deadline_s(self) -> float:
        """When `tick` is due; infinity: never."""
        return self._server.deadline_s

    def handle(self, peer: Peer, message: Any, now_s: float) -> list[tuple[Peer, Any]] | None:
        """Answers as (peer, message); None if the message is none of the mission protocol."""
        kind = message.get_type()
        if not kind.startswith("MISSION_"):
            return None
        station = (peer, message.get_srcSystem(), message.get_srcComponent())
        mission_type = getattr(message, "mission_type", 0)
        if kind == "MISSION_CLEAR_ALL" and mission_type == _ALL_TYPES:
            return self._step(station, ClearAll(), now_s)
        if mission_type != 0:
            return [(peer, answer) for answer in _other_type(message, kind, mission_type)]
        record = from_message(message)
        return None if record is None else self._step(station, record, now_s)

    def tick(self, now_s: float) -> list[tuple[Peer, Any]]:
        """What is due by `now_s`."""
        return self._step(None, None, now_s)

    def _step(self, station: Peer, record: Message | None, now_s: float) -> list[tuple[Peer, Any]]:
        before = replace(self._server, locked=self._autopilot.in_mission)
        self._server, replies = step_server(before, station, record, now_s, self._judge)
        if self._server.items is not before.items:
            self._autopilot.set_items(self._server.items)
        return [_addressed(reply) for reply in replies]

    def _judge(self, seq: int, item: MissionItem) -> int:
        result, why = check_item(item, self._autopilot.home)
        if result != ACCEPTED:
            self._autopilot.say(f"item {seq}: {why}", _WARNING)
        return result


def _addressed(reply: Reply) -> tuple[Peer, Any]:
    station, record = reply
    assert isinstance(station, tuple)
    peer, system, component = station
    return peer, to_message(record, system, component)


def _other_type(message: Any, kind: str, mission_type: int) -> list[Any]:
    """Fences and rally points: none here, none wanted."""
    dialect = messages()
    sender = message.get_srcSystem(), message.get_srcComponent()
    if kind == "MISSION_REQUEST_LIST":
        return [dialect.MAVLink_mission_count_message(*sender, 0, mission_type)]
    if kind == "MISSION_CLEAR_ALL" or (kind == "MISSION_COUNT" and message.count == 0):
        return [dialect.MAVLink_mission_ack_message(*sender, ACCEPTED, mission_type)]
    if kind == "MISSION_COUNT":
        return [dialect.MAVLink_mission_ack_message(*sender, UNSUPPORTED, mission_type)]
    return []
