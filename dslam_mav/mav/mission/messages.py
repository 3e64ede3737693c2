"""The mission handshake's records to and from MAVLink messages. Pure; missions only, no fences."""

from __future__ import annotations

from typing import Any

from dslam_mav.mav.frames import messages
from dslam_mav.mav.mission.protocol import Ack, ClearAll, Count, Item, Message, Request, RequestList
from dslam_mav.mission import MissionItem

TYPE_MISSION = 0


def from_message(message: Any) -> Message | None:  # noqa: PLR0911  one return a message
    """The record in a MAVLink message; None if it is none of the mission handshake."""
    if getattr(message, "mission_type", TYPE_MISSION) != TYPE_MISSION:
        return None
    match message.get_type():
        case "MISSION_COUNT":
            return Count(int(message.count))
        case "MISSION_REQUEST_INT" | "MISSION_REQUEST":
            return Request(int(message.seq))
        case "MISSION_ITEM_INT":
            return Item(int(message.seq), _item(message))
        case "MISSION_ACK":
            return Ack(int(message.type))
        case "MISSION_REQUEST_LIST":
            return RequestList()
        case "MISSION_CLEAR_ALL":
            return ClearAll()
    return None


def to_message(record: Message, system: int, component: int) -> Any:
    """The MAVLink message that carries `record` to (system, component)."""
    dialect = messages()
    match record:
        case Count(count):
            return dialect.MAVLink_mission_count_message(system, component, count)
        case Request(seq):
            return dialect.MAVLink_mission_request_int_message(system, component, seq)
        case Item(seq, item, in_flight):
            return dialect.MAVLink_mission_item_int_message(
                system,
                component,
                seq,
                item.frame,
                item.command,
                int(seq == 0 and not in_flight),  # "current": PX4 begins at the flagged item, or jumps there
                int(item.autocontinue),
                *item.params,
                item.x,
                item.y,
                item.z,
            )
        case Ack(result):
            return dialect.MAVLink_mission_ack_message(system, component, result)
        case RequestList():
            return dialect.MAVLink_mission_request_list_message(system, component)
        case ClearAll():
            return dialect.MAVLink_mission_clear_all_message(system, component)


def _item(message: Any) -> MissionItem:
    return MissionItem(
        command=int(message.command),
        frame=int(message.frame),
        params=(message.param1, message.param2, message.param3, message.param4),
        x=int(message.x),
        y=int(message.y),
        z=float(message.z),
        autocontinue=bool(message.autocontinue),
    )
