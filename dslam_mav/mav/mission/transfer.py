"""Missions to and from a vehicle: the handshake's state machines run over a link.

Every failure is one line: LinkError when the vehicle does not answer or disappears midway, MissionError when
it refuses or when what it holds afterwards is not what was sent. A transfer that loses too many packets is
begun again twice; each is bounded in time.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

from dslam_mav.errors import LinkError, MissionError
from dslam_mav.mav.frames import COMPONENT_AUTOPILOT, messages
from dslam_mav.mav.link import Link
from dslam_mav.mav.mission.compare import command_name, first_difference
from dslam_mav.mav.mission.messages import from_message, to_message
from dslam_mav.mav.mission.protocol import (
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
from dslam_mav.mav.mission.talk import ARDUPILOT, Talk
from dslam_mav.mission import (
    CMD_WAYPOINT,
    DEGREES_E7,
    FRAME_GLOBAL,
    FRAME_GLOBAL_INT,
    Home,
    Mission,
    MissionItem,
)

__all__ = ["clear", "download", "start", "upload"]

_ATTEMPTS = 3
_LIMIT_S = 20.0
_LIMIT_PER_ITEM_S = 1.0
_HOME_WAIT_S = 1.0
_GET_HOME_POSITION = 242
_REQUEST_MESSAGE = 512

Progress = Callable[[int, int], None]
StepFunction = Callable[[Transfer, Message | None, float], Step]


def upload(
    link: Link, vehicle_system: int, mission: Mission, progress: Progress | None = None, *, in_flight: bool = False
) -> Mission:
    """Send the mission, read it back and compare; `progress(items sent, items)`. `in_flight`: no item is marked as the
    one to begin with.

    Returns the mission as the vehicle holds it, rounded as it rounds; an item's index is its sequence number
    on the wire. ArduPilot keeps its home in item 0: it is put in front unless the mission begins with one (a
    waypoint of absolute altitude), so there the mission returned is one item longer.
    """
    talk = Talk(link, vehicle_system)
    items, first = _for_vehicle(talk, mission)
    for left in reversed(range(_ATTEMPTS)):
        now_s = time.monotonic()
        end = _run(talk, begin_upload(items, now_s, in_flight=in_flight), step_upload, progress)
        if end.phase is Phase.REFUSED:
            raise MissionError(_refusal(talk, end, items))
        if end.phase is Phase.SILENT and (end.seq < 0 or not left):
            raise LinkError(_silence(talk, end, "upload"))
        if end.phase is Phase.SILENT:
            continue
        held = _read(talk)
        difference = first_difference(items, held, first)
        if difference is None:
            return Mission(held, mission.home)
        if end.phase is Phase.DONE or not left:
            raise MissionError(f"vehicle {vehicle_system} holds another mission than was sent: {difference}")
    raise AssertionError("unreachable: the last attempt returns or raises")


def download(link: Link, vehicle_system: int) -> Mission:
    """The vehicle's mission, item index = sequence number; its home where the vehicle tells it."""
    talk = Talk(link, vehicle_system)
    items = _read(talk)
    if talk.autopilot()[0] == ARDUPILOT and items and _is_home(items[0]):
        return Mission(items, Home(items[0].x / DEGREES_E7, items[0].y / DEGREES_E7, items[0].z))
    return Mission(items, _home(talk))


def clear(link: Link, vehicle_system: int) -> None:
    """Make the vehicle forget its mission, and make sure that it did."""
    talk = Talk(link, vehicle_system)
    end = _run(talk, begin_clear(time.monotonic()), step_clear, None)
    if end.phase is Phase.REFUSED:
        reason = result_in_words(end.result) + talk.last_words()
        raise MissionError(f"vehicle {vehicle_system} refused to clear its mission: {reason}")
    if end.phase is Phase.SILENT:
        raise LinkError(_silence(talk, end, "clearing"))
    left = _read(talk)
    if len(left) > (1 if talk.autopilot()[0] == ARDUPILOT else 0):  # ArduPilot may keep its home
        raise MissionError(f"vehicle {vehicle_system} still holds {len(left)} items after clearing its mission")


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
        if end.phase is Phase.REFUSED:
            reason = result_in_words(end.result) + talk.last_words()
            raise MissionError(f"vehicle {talk.system} refused to give its mission: {reason}")
        if end.seq < 0 or not left:
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
    items = mission.items
    if talk.autopilot()[0] != ARDUPILOT or not items:
        return items, 0
    if _is_home(items[0]):
        return items, 1
    placed = next((item for item in items if item.has_position), items[0])
    x, y, z = placed.x, placed.y, 0.0
    if mission.home is not None:
        x = round(mission.home.latitude_deg * DEGREES_E7)
        y = round(mission.home.longitude_deg * DEGREES_E7)
        z = mission.home.altitude_m
    return (MissionItem(CMD_WAYPOINT, FRAME_GLOBAL, (0.0, 0.0, 0.0, 0.0), x, y, z), *items), 1


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
