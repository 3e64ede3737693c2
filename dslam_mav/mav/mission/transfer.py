"""Missions to and from a vehicle: the handshake's state machines run over a link.

Every failure is one line: LinkError when the vehicle does not answer or disappears midway, MissionError when
it refuses or when what it holds afterwards is not what was sent. A transfer that loses too many packets is
begun again twice, one that is not answered at all once; each is bounded in time.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace

from dslam_mav.errors import LinkError, MissionError
from dslam_mav.mav.frames import COMPONENT_AUTOPILOT, messages
from dslam_mav.mav.mission.compare import command_name, first_difference
from dslam_mav.mav.mission.messages import from_message, to_message
from dslam_mav.mav.mission.protocol import (
    CANCELLED,
    ERROR,
    Message,
    Phase,
    Step,
    Transfer,
    begin_clear,
    begin_download,
    begin_upload,
    result_in_words,
    step_clear,
    step_download,
    step_upload,
)
from dslam_mav.mav.mission.start import start
from dslam_mav.mav.mission.talk import Talk
from dslam_mav.mav.ports import Port
from dslam_mav.mission import (
    CMD_WAYPOINT,
    DEGREES_E7,
    FRAME_GLOBAL,
    FRAME_GLOBAL_INT,
    Home,
    Mission,
    MissionItem,
    e7_to_enu,
    home_item,
    without_home_item,
)
from dslam_mav.records.words import count

__all__ = ["clear", "download", "start", "upload"]

_ATTEMPTS = 3
_GAVE_UP = (CANCELLED, ERROR)  # the vehicle waited too long for an item, or got one when it did not wait any more
_LIMIT_S = 20.0
_LIMIT_PER_ITEM_S = 1.0
_HOME_WAIT_S = 1.0
_GET_HOME_POSITION = 242
_FLYABLE_WAIT_S = 2.0
_MISSION_CURRENT = 42
_SAME_FIELD_M = 10_000.0
_NO_MISSION = 1
_REJECTED = "mission rejected"
_REQUEST_MESSAGE = 512

Progress = Callable[[int, int], None]
StepFunction = Callable[[Transfer, Message | None, float], Step]


def upload(
    link: Port, vehicle_system: int, mission: Mission, progress: Progress | None = None, *, in_flight: bool = False
) -> Mission:
    """Send the mission, read it back and compare; `progress(items sent, items)`. `in_flight`: no item is marked as the
    one to begin with, and it is not begun again: time is short.

    Returns the mission as the vehicle holds it, rounded as it rounds; an item's index is its sequence number
    on the wire. ArduPilot keeps its home in item 0: it is put in front unless the mission begins with one (a
    waypoint of absolute altitude), so there the mission returned is one item longer. PX4 has no such item: there a home
    item is taken away. PX4 takes missions it will not fly: MissionError says why not.
    """
    talk = Talk(link, vehicle_system)
    items, first = _for_vehicle(talk, mission)
    for left in reversed(range(1 if in_flight else _ATTEMPTS)):
        now_s = time.monotonic()
        end = _run(talk, begin_upload(items, now_s, in_flight=in_flight), step_upload, progress)
        if end.phase is Phase.REFUSED and end.result in _GAVE_UP and end.seq >= 0 and left:
            continue
        if end.phase is Phase.REFUSED:
            raise MissionError(_refusal(talk, end, items))
        if end.phase is Phase.SILENT and (not left or (end.seq < 0 and left < _ATTEMPTS - 1)):
            raise LinkError(_silence(talk, end, "upload"))
        if end.phase is Phase.SILENT:
            continue
        held = _read(talk)
        difference = first_difference(items, held, first, talk.profile())
        if difference is None:
            _check_flyable(talk)
            return _with_home(talk, held, mission.home)
        if end.phase is Phase.DONE or not left:
            raise MissionError(f"vehicle {vehicle_system} holds another mission than was sent: {difference}")
    raise AssertionError("unreachable: the last attempt returns or raises")


def download(link: Port, vehicle_system: int) -> Mission:
    """The vehicle's mission, item index = sequence number; its home where the vehicle tells it."""
    talk = Talk(link, vehicle_system)
    items = _read(talk)
    return Mission(items, _home_item_of(talk, items) or _home(talk))


def clear(link: Port, vehicle_system: int) -> None:
    """Make the vehicle forget its mission, and make sure that it did."""
    talk = Talk(link, vehicle_system)
    end = _run(talk, begin_clear(time.monotonic()), step_clear, None)
    if end.phase is Phase.REFUSED:
        reason = result_in_words(end.result) + talk.last_words()
        raise MissionError(f"vehicle {vehicle_system} refused to clear its mission: {reason}")
    if end.phase is Phase.SILENT:
        raise LinkError(_silence(talk, end, "clearing"))
    left = _read(talk)
    if len(left) > (1 if talk.profile().home_item else 0):  # ArduPilot may keep its home
        raise MissionError(
            f"vehicle {vehicle_system} still holds {count(len(left), 'item')} after clearing its mission"
        )


def _run(talk: Talk, begun: Step, step: StepFunction, progress: Progress | None) -> Transfer:
    state, replies = begun
    limit_s = time.monotonic() + _LIMIT_S + _LIMIT_PER_ITEM_S * state.count
    told = -1
    while True:
        for reply in replies:
            talk.send(to_message(reply, talk.system, COMPONENT_AUTOPILOT))
        if progress is not None and state.seq != told:
            told = state.seq
            progress(told + 1, state.count)
        if state.phase.ended:
            return state
        if time.monotonic() > limit_s:
            return replace(state, phase=Phase.SILENT)
        talk.doing = _place("upload" if step is step_upload else "download", state) if state.seq >= 0 else ""
        message = talk.receive(min(state.deadline_s, limit_s))
        record = None if message is None else from_message(message)
        state, replies = step(state, record, time.monotonic())
        if record is not None and not replies:
            state, replies = step(state, None, time.monotonic())  # a busy link must not hold back timeouts


def _read(talk: Talk) -> tuple[MissionItem, ...]:
    for left in reversed(range(_ATTEMPTS)):
        end = _run(talk, begin_download(time.monotonic()), step_download, None)
        if end.phase is Phase.DONE:
            return end.items
        if end.phase is Phase.REFUSED and not (end.result in _GAVE_UP and left):  # a straggler of the upload before
            reason = result_in_words(end.result) + talk.last_words()
            raise MissionError(f"vehicle {talk.system} refused to give its mission: {reason}")
        if end.phase is Phase.SILENT and (not left or (end.seq < 0 and left < _ATTEMPTS - 1)):
            break
    raise LinkError(_silence(talk, end, "download"))


def _refusal(talk: Talk, end: Transfer, items: tuple[MissionItem, ...]) -> str:
    what = "the mission"
    if end.seq >= 0:
        what = f"item {end.seq} ({command_name(items[end.seq].command)})"
    return f"vehicle {talk.system} refused {what}: {result_in_words(end.result)}{talk.last_words()}"


def _silence(talk: Talk, end: Transfer, what: str) -> str:
    if end.seq < 0:
        return f"vehicle {talk.system} on {talk.link.url} does not answer the mission protocol"
    return f"vehicle {talk.system} on {talk.link.url} went silent{_place(what, end)}"


def _place(what: str, state: Transfer) -> str:
    return f" during the {what}, at item {state.seq} of {state.count}"


def _for_vehicle(talk: Talk, mission: Mission) -> tuple[tuple[MissionItem, ...], int]:
    """The items this vehicle wants, and the first that is ours to compare."""
    profile, items = talk.profile(), mission.items
    if not profile.takes_unset:
        items = tuple(_all_set(item) for item in items)
    if not profile.home_item or not items:
        return (without_home_item(mission).items if profile.no_home_item else items), 0
    if _is_home(items[0]):
        return items, 1
    placed = next((item for item in items if item.has_position), items[0])
    x, y, z = placed.x, placed.y, 0.0
    if mission.home is not None:
        x = round(mission.home.latitude_deg * DEGREES_E7)
        y = round(mission.home.longitude_deg * DEGREES_E7)
        z = mission.home.altitude_m
    return (MissionItem(CMD_WAYPOINT, FRAME_GLOBAL, (0.0, 0.0, 0.0, 0.0), x, y, z), *items), 1


def _with_home(talk: Talk, held: tuple[MissionItem, ...], planned: Home | None) -> Mission:
    """The mission as held, measured from the vehicle's own home, unless that is unset or nowhere near the plan's."""
    own = _home_item_of(talk, held)
    if own is None:
        return Mission(held, planned)
    unset = own.latitude_deg == own.longitude_deg == 0.0
    if planned is not None and (unset or math.hypot(*e7_to_enu(held[0].x, held[0].y, planned)) > _SAME_FIELD_M):
        return Mission((home_item(planned), *held[1:]), planned)
    return Mission(held, own)


def _home_item_of(talk: Talk, items: tuple[MissionItem, ...]) -> Home | None:
    """Home, where the vehicle keeps it in item 0: its own, whatever the plan's."""
    if not (talk.profile().home_item and items and _is_home(items[0])):
        return None
    return Home(items[0].x / DEGREES_E7, items[0].y / DEGREES_E7, items[0].z)


def _all_set(item: MissionItem) -> MissionItem:
    """ArduPilot refuses a NaN in most parameters; 0 is its word for "not set"."""
    a, b, c, d = (0.0 if math.isnan(p) else p for p in item.params)
    return replace(item, params=(a, b, c, d))


def _check_flyable(talk: Talk) -> None:
    """PX4 accepts a mission first and looks at it afterwards: what it then says, and whether it holds one."""
    if not talk.profile().checks_later:
        return
    talk.send(
        messages().MAVLink_command_long_message(
            talk.system, COMPONENT_AUTOPILOT, _REQUEST_MESSAGE, 0, _MISSION_CURRENT, 0, 0, 0, 0, 0, 0
        )
    )
    if _REJECTED in talk.text.lower():  # said while it was read back
        raise MissionError(f"vehicle {talk.system} took the mission but will not fly it{talk.words()}")
    until_s = time.monotonic() + _FLYABLE_WAIT_S
    while (message := talk.receive(until_s)) is not None and time.monotonic() < until_s:
        if message.get_type() == "MISSION_CURRENT" and message.mission_state > _NO_MISSION:
            return
        rejected = message.get_type() == "STATUSTEXT" and _REJECTED in message.text.lower()
        if rejected or (message.get_type() == "MISSION_CURRENT" and message.mission_state == _NO_MISSION):
            raise MissionError(f"vehicle {talk.system} took the mission but will not fly it{talk.last_words()}")


def _is_home(item: MissionItem) -> bool:
    return item.command == CMD_WAYPOINT and item.frame in (FRAME_GLOBAL, FRAME_GLOBAL_INT)


def _home(talk: Talk) -> Home | None:
    talk.send(
        messages().MAVLink_command_long_message(
            talk.system, COMPONENT_AUTOPILOT, _REQUEST_MESSAGE, 0, _GET_HOME_POSITION, 0, 0, 0, 0, 0, 0
        )
    )
    until_s = time.monotonic() + _HOME_WAIT_S
    while (message := talk.receive(until_s)) is not None and time.monotonic() < until_s:
        if message.get_type() == "HOME_POSITION" and abs(message.latitude) <= 90 * DEGREES_E7:
            return Home(message.latitude / DEGREES_E7, message.longitude / DEGREES_E7, message.altitude / 1e3)
    return None
