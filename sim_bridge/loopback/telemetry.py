"""What the loopback vehicle tells of itself: one snapshot, and the messages made of it. Pure.

All times are simulated. GPS, battery and home are for a ground station's eyes: the estimator never looks at
them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

from dslam_mav.mav.frames import messages
from dslam_mav.mission import DEGREES_E7, Home, enu_to_e7
from sim_bridge.loopback.flight_model import Place
from sim_bridge.loopback.manners import Manners, Mode
from sim_bridge.loopback.simulated import hil_state_quaternion, sim_state

__all__ = ["Manners", "MissionState", "Mode", "Snapshot", "build"]

_EPOCH_S = 1_700_000_000  # simulated flights all begin at the same moment: they repeat

HEARTBEAT = 0
SYS_STATUS = 1
SYSTEM_TIME = 2
GPS_RAW_INT = 24
ATTITUDE = 30
LOCAL_POSITION_NED = 32
GLOBAL_POSITION_INT = 33
MISSION_CURRENT = 42
VFR_HUD = 74
AUTOPILOT_VERSION = 148
SIM_STATE = 108
HIL_STATE_QUATERNION = 115
HOME_POSITION = 242
EXTENDED_SYS_STATE = 245

# simulated milliseconds between two of a kind; LOCAL_POSITION_NED's is an option of the vehicle
DEFAULT_INTERVAL_MS = {
    SYS_STATUS: 1000,
    SYSTEM_TIME: 1000,
    GPS_RAW_INT: 500,
    ATTITUDE: 100,
    GLOBAL_POSITION_INT: 200,
    MISSION_CURRENT: 1000,
    VFR_HUD: 100,
    HOME_POSITION: 5000,
    EXTENDED_SYS_STATE: 1000,
}


class MissionState(IntEnum):
    """MISSION_STATE of MISSION_CURRENT."""

    NO_MISSION = 1
    NOT_STARTED = 2
    ACTIVE = 3
    PAUSED = 4
    COMPLETE = 5


@dataclass(frozen=True, slots=True)
class Snapshot:
    """The vehicle at one simulated millisecond: NED from home, its velocity, attitude (roll, pitch, yaw)."""

    time_ms: int
    place_m: Place
    velocity_m_s: Place
    attitude_rad: tuple[float, float, float]
    home: Home
    armed: bool
    mode: Mode
    seq: int
    n_items: int
    mission_state: MissionState
    manners: Manners
    true_m: Place
    located: bool
    guided: bool

    @property
    def flying(self) -> bool:
        """Whether it is off the ground."""
        return self.armed and self.place_m[2] < -0.05

    @property
    def altitude_m(self) -> float:
        """Above mean sea level."""
        return self.home.altitude_m - self.place_m[2]

    def latitude_longitude_e7(self) -> tuple[int, int]:
        """Where it is in degrees · 1e7."""
        return enu_to_e7(self.place_m[1], self.place_m[0], self.home)


def build(kind: int, now: Snapshot) -> Any | None:
    """The message of that number, None if the vehicle has none such."""
    builder = _BUILDERS.get(kind)
    return None if builder is None else builder(now)


def _heartbeat(now: Snapshot) -> Any:
    m = messages()
    base_mode = m.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | m.MAV_MODE_FLAG_STABILIZE_ENABLED
    base_mode |= m.MAV_MODE_FLAG_GUIDED_ENABLED
    base_mode |= m.MAV_MODE_FLAG_AUTO_ENABLED if now.mode is Mode.MISSION else 0
    base_mode |= m.MAV_MODE_FLAG_SAFETY_ARMED if now.armed else 0
    status = m.MAV_STATE_ACTIVE if now.armed else m.MAV_STATE_STANDBY
    number = now.manners.modes[now.mode]
    if now.mode is Mode.HOLD and now.manners.guided_first and not now.guided:
        number = 0  # STABILIZE
    return m.MAVLink_heartbeat_message(m.MAV_TYPE_QUADROTOR, now.manners.autopilot, base_mode, number, status, 3)


def _sys_status(_: Snapshot) -> Any:
    m = messages()
    sensors = m.MAV_SYS_STATUS_SENSOR_3D_GYRO | m.MAV_SYS_STATUS_SENSOR_3D_ACCEL | m.MAV_SYS_STATUS_SENSOR_GPS
    return m.MAVLink_sys_status_message(sensors, sensors, sensors, 100, 16000, 1000, 100, *(0,) * 6)


def _system_time(now: Snapshot) -> Any:
    return messages().MAVLink_system_time_message(_EPOCH_S * 1_000_000 + now.time_ms * 1000, _wire_ms(now))


def _gps_raw_int(now: Snapshot) -> Any:
    north, east, _ = now.velocity_m_s
    course_cdeg = round(math.degrees(math.atan2(east, north)) * 100) % 36000
    latitude, longitude = now.latitude_longitude_e7()
    return messages().MAVLink_gps_raw_int_message(
        now.time_ms * 1000,
        3,
        latitude,
        longitude,
        round(now.altitude_m * 1000),
        80,
        120,
        round(math.hypot(north, east) * 100),
        course_cdeg,
        12,
    )


def _attitude(now: Snapshot) -> Any:
    return messages().MAVLink_attitude_message(_wire_ms(now), *now.attitude_rad, 0.0, 0.0, 0.0)


def _local_position_ned(now: Snapshot) -> Any:
    return messages().MAVLink_local_position_ned_message(_wire_ms(now), *now.place_m, *now.velocity_m_s)


def _global_position_int(now: Snapshot) -> Any:
    velocity_cm_s = [round(v * 100) for v in now.velocity_m_s]
    if not now.located:
        return messages().MAVLink_global_position_int_message(_wire_ms(now), *(0,) * 4, *velocity_cm_s, 0)
    return messages().MAVLink_global_position_int_message(
        _wire_ms(now),
        *now.latitude_longitude_e7(),
        round(now.altitude_m * 1000),
        round(-now.place_m[2] * 1000),
        *velocity_cm_s,
        round(math.degrees(now.attitude_rad[2]) * 100) % 36000,
    )


def _mission_current(now: Snapshot) -> Any:
    return messages().MAVLink_mission_current_message(
        now.seq, now.n_items, int(now.mission_state), int(now.mode is Mode.MISSION)
    )


def _vfr_hud(now: Snapshot) -> Any:
    north, east, down = now.velocity_m_s
    speed_m_s = math.hypot(north, east)
    heading_deg = round(math.degrees(now.attitude_rad[2])) % 360
    return messages().MAVLink_vfr_hud_message(
        speed_m_s, speed_m_s, heading_deg, 50 if now.armed else 0, now.altitude_m, -down
    )


def _home_position(now: Snapshot) -> Any:
    home = now.home
    return messages().MAVLink_home_position_message(
        round(home.latitude_deg * DEGREES_E7),
        round(home.longitude_deg * DEGREES_E7),
        round(home.altitude_m * 1000),
        0.0,
        0.0,
        0.0,
        [1.0, 0.0, 0.0, 0.0],
        0.0,
        0.0,
        0.0,
    )


def _extended_sys_state(now: Snapshot) -> Any:
    m = messages()
    landed = m.MAV_LANDED_STATE_IN_AIR if now.flying else m.MAV_LANDED_STATE_ON_GROUND
    return m.MAVLink_extended_sys_state_message(0, landed)


def _autopilot_version(_: Snapshot) -> Any:
    m = messages()
    capabilities = (
        m.MAV_PROTOCOL_CAPABILITY_MISSION_INT
        | m.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
        | m.MAV_PROTOCOL_CAPABILITY_MAVLINK2
    )
    nothing = [0] * 8
    return m.MAVLink_autopilot_version_message(capabilities, 0x00010000, 0, 0, 0, nothing, nothing, nothing, 0, 0, 1)


def _wire_ms(now: Snapshot) -> int:
    return now.time_ms % 2**32


_BUILDERS: dict[int, Callable[[Snapshot], Any]] = {
    HEARTBEAT: _heartbeat,
    SYS_STATUS: _sys_status,
    SYSTEM_TIME: _system_time,
    GPS_RAW_INT: _gps_raw_int,
    ATTITUDE: _attitude,
    LOCAL_POSITION_NED: _local_position_ned,
    GLOBAL_POSITION_INT: _global_position_int,
    MISSION_CURRENT: _mission_current,
    VFR_HUD: _vfr_hud,
    AUTOPILOT_VERSION: _autopilot_version,
    SIM_STATE: lambda now: sim_state(now) if now.manners.name == "ardupilot" else None,
    HIL_STATE_QUATERNION: lambda now: hil_state_quaternion(now) if now.manners.name == "px4" else None,
    HOME_POSITION: _home_position,
    EXTENDED_SYS_STATE: _extended_sys_state,
}
