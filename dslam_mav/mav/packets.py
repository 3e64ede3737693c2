"""Stored packets straight to observations: what `decode` makes of their frames, several times as fast. Pure.

A log of an hour holds some 250 000 packets. Decoding each into a message of pymavlink's takes longer than the estimate;
here only the few fields that pass the gate are unpacked. Signed packets, and what is no good packet, go the long way.
"""

from __future__ import annotations

import struct
from binascii import crc_hqx
from collections.abc import Callable, Iterable, Iterator
from typing import Any

from dslam_mav.mav.decode import READING_NAME, decode
from dslam_mav.mav.frames import COMPONENT_AUTOPILOT, COMPONENT_ESTIMATOR, Frame, messages, parse_frame
from dslam_mav.observations import GroundSpeed, Observation, Odometry, Progress, Reading, Yaw

Stored = tuple[int, bytes]
"""(nanoseconds since 1970, packet)."""

_HEADER_BYTES = 10
_MIRRORED = bytes(int(f"{byte:08b}"[::-1], 2) for byte in range(256))
MARKER = 0xFD
_THERMAL = READING_NAME.encode()
_Make = Callable[[tuple[Any, ...], int], "Observation | None"]


def _reading(fields: tuple[Any, ...], component: int) -> Reading | None:
    time_boot_ms, value, name = fields
    text = name.rstrip(b"\x00")
    return Reading(time_boot_ms, value, text.decode("ascii"), component) if text.startswith(_THERMAL) else None


_FROM_AUTOPILOT: dict[str, tuple[str, _Make]] = {
    "LOCAL_POSITION_NED": ("<Iffffff", lambda f, _: Odometry(f[0], f[1], f[2], f[4], f[5])),
    "VFR_HUD": ("<ffffhH", lambda f, _: GroundSpeed(f[1])),
    "MISSION_ITEM_REACHED": ("<H", lambda f, _: Progress(f[0], reached=True)),
    "MISSION_CURRENT": ("<H", lambda f, _: Progress(f[0], reached=False)),
    "ATTITUDE": ("<Iffffff", lambda f, _: Yaw(f[0], f[3])),
}


class Gate:
    """One vehicle's packets -> observations, with the rules of `mav.decode.decode`."""

    def __init__(self, system: int, *, yaw: bool) -> None:
        self._system = system
        self._yaw = yaw
        self._kinds: dict[int, tuple[struct.Struct, bytes, _Make]] = {}
        dialect = messages()
        for name, (layout, make) in _FROM_AUTOPILOT.items():
            if yaw or name != "ATTITUDE":
                number = getattr(dialect, f"MAVLINK_MSG_ID_{name}")
                self._kinds[number] = (struct.Struct(layout), bytes((dialect.mavlink_map[number].crc_extra,)), make)
        self._reading_id = dialect.MAVLINK_MSG_ID_NAMED_VALUE_FLOAT
        extra = bytes((dialect.mavlink_map[self._reading_id].crc_extra,))
        self._kinds[self._reading_id] = (struct.Struct("<If10s"), extra, _reading)

    def observations(self, packets: Iterable[Stored]) -> Iterator[Observation]:
        """What an estimate may know of them, in their order."""
        for received_ns, raw in packets:
            observation = self.observation(raw, received_ns)
            if observation is not None:
                yield observation

    def observation(self, raw: bytes, received_ns: int = 0) -> Observation | None:
        """What an estimate may know of one packet."""
        if len(raw) < _HEADER_BYTES or raw[0] != MARKER or raw[5] != self._system:
            return None
        number, component = int.from_bytes(raw[7:10], "little"), raw[6]
        kind = self._kinds.get(number)
        if kind is None:
            return None
        if raw[2] != 0 or len(raw) != _HEADER_BYTES + raw[1] + 2:
            return self._the_long_way(raw, received_ns)
        heard = component != COMPONENT_ESTIMATOR if number == self._reading_id else component == COMPONENT_AUTOPILOT
        layout, extra, make = kind
        if not heard or not _whole(raw, extra):
            return None
        payload = raw[_HEADER_BYTES:-2]
        if len(payload) < layout.size:  # trailing zeros are cut off on the wire
            payload += bytes(layout.size - len(payload))
        try:
            return make(layout.unpack_from(payload), component)
        except UnicodeDecodeError:
            return self._the_long_way(raw, received_ns)

    def _the_long_way(self, raw: bytes, received_ns: int) -> Observation | None:
        frame = parse_frame(raw, received_ns)
        return None if frame is None else decode(frame, self._system, yaw=self._yaw)


def _whole(raw: bytes, extra: bytes) -> bool:
    """Whether a packet's checksum holds: CRC-16/MCRF4XX, the mirror image of the standard library's CRC."""
    mirrored = crc_hqx((raw[1:-2] + extra).translate(_MIRRORED), 0xFFFF)
    return _MIRRORED[mirrored >> 8] == raw[-2] and _MIRRORED[mirrored & 255] == raw[-1]


def system_frames(packets: Iterable[Stored]) -> Iterator[Frame]:
    """The frames by which `autopilot_system` finds the vehicle: heartbeats, and the first reading of each sender."""
    dialect = messages()
    heartbeat, reading = dialect.MAVLINK_MSG_ID_HEARTBEAT, dialect.MAVLINK_MSG_ID_NAMED_VALUE_FLOAT
    seen: set[tuple[bytes, bytes]] = set()
    for received_ns, raw in packets:
        number = int.from_bytes(raw[7:10], "little")
        if number == reading:
            sender = raw[5:7], raw[18:28]
            if sender in seen or not sender[1].startswith(_THERMAL):
                continue
            seen.add(sender)
        elif number != heartbeat:
            continue
        frame = parse_frame(raw, received_ns)
        if frame is not None:
            yield frame
