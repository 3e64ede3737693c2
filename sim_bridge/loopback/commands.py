"""What the loopback vehicle does when told or asked something: commands, parameters, requests. No sockets."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable
from typing import Any

from dslam_mav.mav.frames import messages
from dslam_mav.mission import DEGREES_E7, Home
from sim_bridge.loopback.autopilot import Autopilot
from sim_bridge.loopback.telemetry import AUTOPILOT_VERSION, HOME_POSITION, MISSION_CURRENT, Mode, build

_ACCEPTED = 0
_TEMPORARILY_REJECTED = 1
_DENIED = 2
_UNSUPPORTED = 3
_FORCE = 21196
_CUSTOM_MODE_FLAG = 1
_AUTO_FLAG = 4
_WARNING = 4
_MESSAGE_INTERVAL = 244

Peer = Hashable
Params = tuple[float, ...]
Answer = tuple[int, list[Any]]  # MAV_RESULT, messages to the one who asked
Handler = Callable[[Autopilot, Peer, Params], Answer]


def handle(autopilot: Autopilot, peer: Peer, message: Any) -> list[Any]:
    """The answers to one message for the vehicle; what it does not know it leaves unanswered."""
    kind = message.get_type()
    if kind in ("COMMAND_LONG", "COMMAND_INT"):
        return _command(autopilot, peer, message)
    handler = _REQUESTS.get(kind)
    return [] if handler is None else handler(autopilot, message)


def _command(autopilot: Autopilot, peer: Peer, message: Any) -> list[Any]:
    long = message.get_type() == "COMMAND_LONG"
    places = ("param5", "param6", "param7") if long else ("x", "y", "z")
    params = tuple(float(getattr(message, n)) for n in ("param1", "param2", "param3", "param4", *places))
    handler = _COMMANDS.get(message.command)
    result, answers = (_UNSUPPORTED, []) if handler is None else handler(autopilot, peer, params)
    ack = messages().MAVLink_command_ack_message(
        message.command, result, 0, 0, message.get_srcSystem(), message.get_srcComponent()
    )
    return [ack, *answers]


def _done(autopilot: Autopilot, refusal: str) -> Answer:
    if refusal:
        autopilot.say(refusal, _WARNING)
    failed = _TEMPORARILY_REJECTED if refusal.startswith("PreArm") and autopilot.manners.start_arms else _DENIED
    return (failed if refusal else _ACCEPTED), []


def _arm_disarm(autopilot: Autopilot, _: Peer, params: Params) -> Answer:
    if _whole(params[0]) == 1:
        return _done(autopilot, autopilot.arm())
    return _done(autopilot, autopilot.disarm(force=_whole(params[1]) == _FORCE))


def _set_mode(autopilot: Autopilot, _: Peer, params: Params) -> Answer:
    flags, main, sub = (_whole(p) for p in params[:3])
    if autopilot.manners.guided_first:
        return _done(autopilot, _ardupilot_mode(autopilot, main))
    return _done(autopilot, autopilot.set_mode(_mode(flags, (main & 0xFF) << 16 | (sub & 0xFF) << 24)))


def _ardupilot_mode(autopilot: Autopilot, number: int) -> str:
    modes = {wire: mode for mode, wire in autopilot.manners.modes.items()}
    if number not in modes:
        return "Mode change failed: unknown mode"
    autopilot.guided = modes[number] is Mode.HOLD
    return autopilot.set_mode(modes[number])


def _mission_start(autopilot: Autopilot, _: Peer, params: Params) -> Answer:
    if not autopilot.in_mission and _whole(params[0]) > 0:
        autopilot.first_seq = _whole(params[0])
    return _done(autopilot, autopilot.start_mission())


def _pause_continue(autopilot: Autopilot, _: Peer, params: Params) -> Answer:
    return _done(autopilot, autopilot.set_mode(Mode.HOLD if _whole(params[0]) == 0 else Mode.MISSION))


def _return(autopilot: Autopilot, _: Peer, __: Params) -> Answer:
    return _done(autopilot, autopilot.set_mode(Mode.RETURN))


def _land(autopilot: Autopilot, _: Peer, __: Params) -> Answer:
    return _done(autopilot, autopilot.set_mode(Mode.LAND))


def _set_current(autopilot: Autopilot, _: Peer, params: Params) -> Answer:
    return _done(autopilot, autopilot.choose_first(_whole(params[0])))


def _set_interval(autopilot: Autopilot, peer: Peer, params: Params) -> Answer:
    kind, interval_us = _whole(params[0]), _whole(params[1])
    if build(kind, autopilot.snapshot()) is None:
        return _DENIED, []
    interval_ms = None if interval_us < 0 else 0 if interval_us == 0 else max(1, round(interval_us / 1000))
    autopilot.streams.set_interval(peer, kind, interval_ms, autopilot.time_ms)
    return _ACCEPTED, []


def _get_interval(autopilot: Autopilot, peer: Peer, params: Params) -> Answer:
    kind = _whole(params[0])
    interval_us = autopilot.streams.interval_ms(peer, kind) * 1000 or -1
    return _ACCEPTED, [messages().MAVLink_message_interval_message(kind & 0xFFFF, interval_us)]


def _request_message(autopilot: Autopilot, peer: Peer, params: Params) -> Answer:
    if _whole(params[0]) == _MESSAGE_INTERVAL:
        return _get_interval(autopilot, peer, params[1:])
    wanted = build(_whole(params[0]), autopilot.snapshot())
    return (_UNSUPPORTED, []) if wanted is None else (_ACCEPTED, [wanted])


def _capabilities(autopilot: Autopilot, _: Peer, __: Params) -> Answer:
    return _ACCEPTED, [build(AUTOPILOT_VERSION, autopilot.snapshot())]


def _home_position(autopilot: Autopilot, _: Peer, __: Params) -> Answer:
    return _ACCEPTED, [build(HOME_POSITION, autopilot.snapshot())]


def _whole(value: float) -> int:
    return int(value) if math.isfinite(value) else 0


def _mode(flags: int, custom: int) -> Mode:
    if flags & _CUSTOM_MODE_FLAG:
        return Mode(custom) if custom in set(Mode) else Mode.HOLD
    return Mode.MISSION if flags & _AUTO_FLAG else Mode.HOLD


def _request_set_mode(autopilot: Autopilot, message: Any) -> list[Any]:
    _done(autopilot, autopilot.set_mode(_mode(message.base_mode, message.custom_mode)))
    return []


def _request_set_current(autopilot: Autopilot, message: Any) -> list[Any]:
    _done(autopilot, autopilot.choose_first(int(message.seq)))
    return [build(MISSION_CURRENT, autopilot.snapshot())]


def _timesync(autopilot: Autopilot, message: Any) -> list[Any]:
    if message.tc1 != 0:
        return []
    return [messages().MAVLink_timesync_message(autopilot.time_ms * 1_000_000 or 1, message.ts1)]


def _param_list(autopilot: Autopilot, _: Any) -> list[Any]:
    return autopilot.parameters.all()


def _param_read(autopilot: Autopilot, message: Any) -> list[Any]:
    return autopilot.parameters.read(message.param_id, message.param_index)


def _param_set(autopilot: Autopilot, message: Any) -> list[Any]:
    return autopilot.parameters.set(message)


def _odometry(autopilot: Autopilot, message: Any) -> list[Any]:
    frames, place_m = (message.frame_id, message.child_frame_id), (message.x, message.y, message.z)
    autopilot.navigation.feed(frames, place_m, message.reset_counter, autopilot.time_ms)
    return []


def _origin(autopilot: Autopilot, message: Any) -> list[Any]:
    """Where the vehicle is told to be is where it takes itself to be: its home. The simulator's truth is elsewhere."""
    origin = Home(message.latitude / DEGREES_E7, message.longitude / DEGREES_E7, message.altitude / 1000.0)
    if autopilot.navigation.set_origin(origin, autopilot.time_ms):
        autopilot.say("EKF3 IMU0 origin set")
    return []


_COMMANDS: dict[int, Handler] = {
    20: _return,
    21: _land,
    176: _set_mode,
    193: _pause_continue,
    224: _set_current,
    300: _mission_start,
    400: _arm_disarm,
    410: _home_position,
    510: _get_interval,
    511: _set_interval,
    512: _request_message,
    520: _capabilities,
}

_REQUESTS: dict[str, Callable[[Autopilot, Any], list[Any]]] = {
    "SET_MODE": _request_set_mode,
    "MISSION_SET_CURRENT": _request_set_current,
    "TIMESYNC": _timesync,
    "PARAM_REQUEST_LIST": _param_list,
    "PARAM_REQUEST_READ": _param_read,
    "PARAM_SET": _param_set,
    "ODOMETRY": _odometry,
    "SET_GPS_GLOBAL_ORIGIN": _origin,
}
