"""Reading and setting a vehicle's parameters (https://mavlink.io/en/services/parameter.html).

A PARAM_VALUE carries a float whatever the parameter's type: ArduPilot puts the value into it, PX4 the bytes of the
integer. Which one it is the profile says.
"""

from __future__ import annotations

import math
import struct
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from dslam_mav.errors import DslamError, LinkError
from dslam_mav.mav.frames import COMPONENT_AUTOPILOT, messages
from dslam_mav.mav.mission.talk import Talk

REAL32 = 9
_LAYOUTS = {1: "<Bxxx", 2: "<bxxx", 3: "<Hxx", 4: "<hxx", 5: "<I", 6: "<i"}  # MAV_PARAM_TYPE of whole numbers
_ANSWER_S = 1.0
_TRIES = 4
_ROUNDS = 6
_QUIET_S = 0.4


@dataclass(frozen=True, slots=True)
class Param:
    """One parameter as the vehicle holds it; `type` is its MAV_PARAM_TYPE."""

    name: str
    value: float
    type: int = REAL32


def to_wire(value: float, kind: int, *, bytewise: bool) -> float:
    """The float that PARAM_SET carries; ValueError if the type cannot hold the value."""
    layout = _LAYOUTS.get(kind)
    if layout is None:
        return value
    if not float(value).is_integer():
        raise ValueError(f"{value:g}: expected a whole number")
    try:
        packed = struct.pack(layout, int(value))
    except struct.error:
        raise ValueError(f"{value:g}: too large for the parameter's type") from None
    return float(struct.unpack("<f", packed)[0]) if bytewise else float(value)


def from_wire(message: Any, *, bytewise: bool) -> float:
    """The value in a PARAM_VALUE (or PARAM_SET)."""
    layout = _LAYOUTS.get(message.param_type)
    value = float(message.param_value)
    if layout is None or not bytewise:
        return value
    # small integers are tiny floats, some NaN: the bytes count
    return float(struct.unpack(layout, struct.pack("<f", value))[0])


def same_value(one: float, other: float) -> bool:
    """Whether two values are the same parameter: float32, and decimal numbers come back a little different."""
    return math.isclose(one, other, rel_tol=1e-6, abs_tol=1e-9)


def read_params(talk: Talk, names: Sequence[str]) -> dict[str, Param]:
    """Those of the parameters that the vehicle has (or answers for), asked for at once and again what is missing."""
    held: dict[str, Param] = {}
    refused: set[str] = set()
    for _ in range(_ROUNDS):
        missing = [name for name in names if name not in held and name not in refused]
        if not missing:
            break
        for name in missing:
            talk.send(
                messages().MAVLink_param_request_read_message(talk.system, COMPONENT_AUTOPILOT, name.encode(), -1)
            )
        quiet_s = time.monotonic() + _QUIET_S
        while time.monotonic() < quiet_s and not held.keys() | refused >= set(names):
            message = talk.receive(quiet_s)
            refused |= {talk.param_error} & set(names)
            if message is not None and (param := _param(talk, message)) is not None and param.name in names:
                held[param.name] = param
                quiet_s = time.monotonic() + _QUIET_S
    return held


def read_param(talk: Talk, name: str) -> Param | None:
    """One parameter; None if the vehicle has none of that name (or does not answer for it)."""
    return read_params(talk, (name,)).get(name)


def set_param(talk: Talk, param: Param) -> Param:
    """Set it to `param.value` and read it back; DslamError when the vehicle keeps another value, LinkError when it does
    not answer.
    """
    try:
        wire = to_wire(param.value, param.type, bytewise=talk.profile().bytewise)
    except ValueError as problem:
        raise DslamError(f"vehicle {talk.system}: {param.name} {problem}") from None
    message = messages().MAVLink_param_set_message(
        talk.system, COMPONENT_AUTOPILOT, param.name.encode(), wire, param.type
    )
    held = None
    for _ in range(_TRIES):
        talk.send(message)
        held = _await(talk, param.name)
        if held is not None and same_value(held.value, param.value):
            return held
    if held is None:
        raise LinkError(f"vehicle {talk.system} on {talk.link.url} does not answer for parameter {param.name}")
    raise DslamError(
        f"vehicle {talk.system} keeps {param.name} at {held.value:g}, {param.value:g} was asked{talk.last_words()}"
    )


def _await(talk: Talk, name: str) -> Param | None:
    until_s = time.monotonic() + _ANSWER_S
    while (message := talk.receive(until_s)) is not None and time.monotonic() < until_s:
        param = _param(talk, message)
        if param is not None and param.name == name:
            return param
    return None


def _param(talk: Talk, message: Any) -> Param | None:
    if message.get_type() != "PARAM_VALUE":
        return None
    value = from_wire(message, bytewise=talk.profile().bytewise)
    return Param(message.param_id, value, int(message.param_type))
