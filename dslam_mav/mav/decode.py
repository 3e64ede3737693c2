"""The gate between MAVLink and the estimator: GPS-denied by construction. Pure.

What `decode` does not turn into an `Observation` no estimate can ever depend on.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import Any

from dslam_mav.mav.frames import COMPONENT_AUTOPILOT, COMPONENT_ESTIMATOR, Frame, messages
from dslam_mav.mav.readings import from_message
from dslam_mav.observations import GroundSpeed, Observation, Odometry, Progress, Reading, Yaw

READING_NAME = "THERMAL"


def decode(frame: Frame, system: int, *, yaw: bool = False) -> Observation | None:
    """The little of a frame that an estimate may use; None for everything else, and for every other system.

    Readings come from any component of the vehicle's system but the estimator itself; mission progress, dead
    reckoning and speed from its autopilot only; the yaw only where the pilot asked for it.
    """
    message = frame.message
    if message.get_srcSystem() != system:
        return None
    component = message.get_srcComponent()
    kind = message.get_type()
    if kind == "NAMED_VALUE_FLOAT":
        return None if component == COMPONENT_ESTIMATOR else _reading(message, component)
    if component != COMPONENT_AUTOPILOT:
        return None
    return _from_autopilot(kind, message, yaw)


def _reading(message: Any, component: int) -> Reading | None:
    reading = from_message(message)
    if reading is None or not reading.name.startswith(READING_NAME):
        return None
    return Reading(reading.time_boot_ms, reading.value, reading.name, component)


def _from_autopilot(kind: str, message: Any, yaw: bool) -> Observation | None:
    match kind:
        case "MISSION_ITEM_REACHED":
            return Progress(int(message.seq), reached=True)
        case "MISSION_CURRENT":
            return Progress(int(message.seq), reached=False)
        case "LOCAL_POSITION_NED":
            return Odometry(
                int(message.time_boot_ms),
                float(message.x), float(message.y), float(message.vx), float(message.vy),
            )  # fmt: skip
        case "VFR_HUD":
            return GroundSpeed(float(message.groundspeed))
        case "ATTITUDE" if yaw:
            return Yaw(int(message.time_boot_ms), float(message.yaw))
        case _:
            return None


def autopilot_system(frames: Iterable[Frame]) -> int | None:
    """The system whose autopilot (component 1, no ground station) is heard most, of those with readings if any has
    some; None if there is no autopilot.
    """
    dialect = messages()
    beats: Counter[int] = Counter()
    read: set[int] = set()
    for frame in frames:
        message = frame.message
        if message.get_type() == "NAMED_VALUE_FLOAT" and isinstance(decode(frame, message.get_srcSystem()), Reading):
            read.add(int(message.get_srcSystem()))
        elif (
            message.get_type() == "HEARTBEAT"
            and message.get_srcComponent() == COMPONENT_AUTOPILOT
            and message.type != dialect.MAV_TYPE_GCS
            and message.autopilot != dialect.MAV_AUTOPILOT_INVALID
        ):
            beats[int(message.get_srcSystem())] += 1
    return min(beats, key=lambda system: (system not in read, -beats[system], system)) if beats else None


def names_heard(frames: Iterable[Frame], system: int) -> tuple[str, ...]:
    """Every name of a NAMED_VALUE_FLOAT from this system, sorted: to tell somebody whose readings are called
    otherwise.
    """
    own = (frame.message for frame in frames if frame.message.get_srcSystem() == system)
    return tuple(sorted({str(message.name) for message in own if message.get_type() == "NAMED_VALUE_FLOAT"}))
