"""Frames of a flight nobody flew: an autopilot's packets and a bridge's readings, in order of arrival."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from dslam_mav.mav.frames import Encoder, Frame, messages, parse_frame

M = messages()
STAR = [(0.0, 0.0), (30.0, 6.0), (2.0, 20.0), (12.0, -9.0), (28.0, 22.0)]  # north, east


def value_at(north_m: float, east_m: float) -> float:
    return 20.0 + 5.0 * math.exp(-((north_m - 12) ** 2 + (east_m - 9) ** 2) / 100.0)


@dataclass
class Flown:
    frames: list[Frame]
    lengths_m: list[float]
    corner_ms: list[int]
    distance_m: dict[int, tuple[int, float]]  # time_boot_ms of a reading -> (leg, metres along it)


def pack(message: Any, received_ns: int, system: int = 1, component: int = 1) -> Frame:
    frame = parse_frame(Encoder(system, component).pack(message), received_ns)
    assert frame is not None
    return frame


def repack(frame: Frame, /, **fields: Any) -> Frame:
    """The same packet with other values in these fields."""
    message = copy.copy(frame.message)
    for name, value in fields.items():
        setattr(message, name, value)
    return pack(message, frame.received_ns, message.get_srcSystem(), message.get_srcComponent())


def reading(time_ms: int, value: float, received_ms: int, name: str = "THERMAL", component: int = 158) -> Frame:
    wire = M.MAVLink_named_value_float_message(time_ms % 2**32, name.encode(), value)
    return pack(wire, received_ms * 1_000_000, 1, component)


def heartbeat(received_ms: int, *, armed: bool = True, system: int = 1) -> Frame:
    mode = M.MAV_MODE_FLAG_SAFETY_ARMED if armed else 0
    wire = M.MAVLink_heartbeat_message(M.MAV_TYPE_QUADROTOR, M.MAV_AUTOPILOT_ARDUPILOTMEGA, mode, 0, 4, 3)
    return pack(wire, received_ms * 1_000_000, system)


def fly(
    vertices_m: Sequence[tuple[float, float]] = STAR,
    *,
    speed_m_s: float = 4.0,
    position_ms: int = 100,
    reading_ms: int = 50,
    start_ms: int = 20_000,
    hold_ms: int = 0,
    late_ms: int = 0,
    value: Callable[[float, float], float] = value_at,
) -> Flown:
    """Straight legs at constant speed from item 1 on; `hold_ms` at each corner, readings `late_ms` late."""
    corners = np.array(vertices_m)
    lengths = np.hypot(*np.diff(corners, axis=0).T)
    legs_ms = [round(1000 * length / speed_m_s) for length in lengths]
    out: list[tuple[float, int, Frame]] = []
    distances: dict[int, tuple[int, float]] = {}
    corner_ms = [start_ms]

    def send(at_ms: float, frame: Frame) -> None:
        out.append((at_ms, len(out), frame))

    def position(at_ms: int, place: Any, velocity: Any) -> None:
        (north, east), (vn, ve) = map(float, place), map(float, velocity)
        local = M.MAVLink_local_position_ned_message(at_ms % 2**32, north, east, -10.0, vn, ve, 0.0)
        speed = M.MAVLink_vfr_hud_message(0.0, math.hypot(vn, ve), 90, 50, 594.0, 0.0)
        for message in (local, speed):
            send(at_ms, pack(message, at_ms * 1_000_000))

    def progress(at_ms: int, seq: int) -> None:
        if seq >= 0:
            send(at_ms, pack(M.MAVLink_mission_item_reached_message(seq), at_ms * 1_000_000))
        send(at_ms, pack(M.MAVLink_mission_current_message(seq + 1), at_ms * 1_000_000))

    send(start_ms - 10, heartbeat(start_ms - 10))
    position(start_ms - 5, corners[0], (0.0, 0.0))
    send(start_ms - 5, pack(M.MAVLink_mission_current_message(1), start_ms * 1_000_000))
    position(start_ms, corners[0], (0.0, 0.0))
    progress(start_ms, 1)
    for j, (length, leg_ms) in enumerate(zip(lengths, legs_ms, strict=True)):
        begin_ms = corner_ms[-1]
        way = (corners[j + 1] - corners[j]) / length
        for t in range(begin_ms + position_ms, begin_ms + leg_ms, position_ms):
            position(t, corners[j] + way * length * (t - begin_ms) / leg_ms, way * speed_m_s)
        for t in range(begin_ms, begin_ms + leg_ms, reading_ms):
            s = length * (t - begin_ms) / leg_ms
            place = corners[j] + way * s
            distances[t] = (j, s)
            send(t + late_ms, reading(t, value(*place), t + late_ms))
        end_ms = begin_ms + leg_ms
        for t in range(end_ms, end_ms + hold_ms + 1, position_ms):
            position(t, corners[j + 1], (0.0, 0.0) if hold_ms else way * speed_m_s)
        corner_ms.append(end_ms + hold_ms)
        progress(corner_ms[-1], j + 2)
    position(corner_ms[-1] + 200, corners[-1], (0.0, 0.0))
    send(corner_ms[-1] + 300, heartbeat(corner_ms[-1] + 300, armed=False))
    frames = [frame for _, _, frame in sorted(out, key=lambda item: item[:2])]
    return Flown(frames, [float(x) for x in lengths], corner_ms, distances)
