"""Missions and stations that the tests of the mission protocol share."""

from __future__ import annotations

from dslam_mav.mav.mission.protocol import ACCEPTED, Message
from dslam_mav.mav.mission.server import Server, step_server
from dslam_mav.mission import MissionItem

GROUND = "ground"
OTHER = "another station"
OLD = tuple(MissionItem(16, 3, (9.0, 0, 0, 0), 9, 9, float(k)) for k in range(2))


def items(n: int) -> tuple[MissionItem, ...]:
    return tuple(MissionItem(16, 3, (0.0, 0, 0, 0), 100 + k, 200 + k, 10.0) for k in range(n))


def accept(seq: int, item: MissionItem) -> int:
    return ACCEPTED


def tell(server: Server, message: Message | None, now_s: float = 0.0, peer: str = GROUND, judge=accept):
    server, replies = step_server(server, peer, message, now_s, judge)
    return server, [reply for _, reply in replies]
