"""Stored packets straight to observations: what `decode` makes of their frames, many times as fast. Pure.

A log of an hour holds some 250 000 packets. Decoding each into a message of pymavlink's takes longer than the estimate;
here only the few fields that pass the gate are unpacked, those of readings for all packets at once. Signed packets, and
what is no good packet, go the long way.
"""

from __future__ import annotations

import struct
from binascii import crc_hqx
from collections.abc import Callable, Iterable, Iterator, Sequence
from operator import itemgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dslam_mav.mav.decode import READING_NAME, decode
from dslam_mav.mav.frames import COMPONENT_AUTOPILOT, COMPONENT_ESTIMATOR, Frame, messages, parse_frame
from dslam_mav.observations import GroundSpeed, Observation, Odometry, Progress, Reading, ReadingSeries, Yaw

Stored = tuple[int, bytes]
"""(nanoseconds since 1970, packet)."""

Bytes = NDArray[np.uint8]
Ints = NDArray[np.int64]

_HEADER_BYTES = 10
_MIRRORED = bytes(int(f"{byte:08b}"[::-1], 2) for byte in range(256))
MARKER = 0xFD
_HQX = [crc_hqx(bytes((byte,)), 0) for byte in _MIRRORED]
_CRC = np.array([_MIRRORED[crc >> 8] | _MIRRORED[crc & 255] << 8 for crc in _HQX], np.uint16)  # byte by byte
_THERMAL = READING_NAME.encode()
_READING = np.dtype([("time_boot_ms", "<u4"), ("value", "<f4"), ("name", "S10")])
_Make = Callable[[tuple[Any, ...], int], "Observation | None"]


def _reading(fields: tuple[Any, ...], component: int) -> Reading | None:
    time_boot_ms, value, name = fields
    text = name.partition(b"\x00")[0]
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

    def recorded(self, packets: Sequence[Stored]) -> tuple[list[tuple[int, Observation]], list[ReadingSeries]]:
        """What an estimate may know of them: readings by sender, all else in order, each with its place among the
        packets. For `LegCollector.add_recorded`. Where a reading's packet is none that our senders write, all are among
        the others.
        """
        raws = [raw for _, raw in packets]
        length = np.fromiter(map(len, raws), np.int64, len(raws))
        data = np.frombuffer(b"".join(raws) + bytes(_HEADER_BYTES), np.uint8)
        begin = np.cumsum(length) - length
        header = data[begin[:, None] + np.arange(_HEADER_BYTES)]
        number = header[:, 7:] @ np.array([1, 1 << 8, 1 << 16])
        ours = (length >= _HEADER_BYTES) & (header[:, 0] == MARKER) & (header[:, 5] == self._system)
        ours &= np.isin(number, list(self._kinds))
        plain = ours & (header[:, 2] == 0) & (length == _HEADER_BYTES + header[:, 1].astype(np.int64) + 2)
        found: list[tuple[int, Observation]] = []
        series: list[ReadingSeries] = []
        for kind, (layout, extra, make) in self._kinds.items():
            heard = self._heard(kind, header[:, 6])
            orders, payload = _payloads(
                data, begin, length, np.flatnonzero(plain & (number == kind) & heard), layout, extra
            )
            if kind == self._reading_id:
                if _odd_names(payload):
                    return self._one_by_one(packets), []
                series = _series(orders, header[orders, 6], payload)
            else:
                made = (make(fields, COMPONENT_AUTOPILOT) for fields in layout.iter_unpack(payload.tobytes()))
                found += [(order, one) for order, one in zip(orders.tolist(), made, strict=True) if one is not None]
        found += self._one_by_one(packets, np.flatnonzero(ours & ~plain).tolist())
        if any(isinstance(one, Reading) for _, one in found):
            return self._one_by_one(packets), []
        found.sort(key=itemgetter(0))
        return found, series

    def _one_by_one(
        self, packets: Sequence[Stored], orders: Iterable[int] | None = None
    ) -> list[tuple[int, Observation]]:
        """Of the packets `orders`, or of all."""
        found = []
        for order in range(len(packets)) if orders is None else orders:
            received_ns, raw = packets[order]
            observation = self.observation(raw, received_ns)
            if observation is not None:
                found.append((order, observation))
        return found

    def _heard(self, kind: int, component: Any) -> Any:
        """Whether a packet of this kind counts from this component (or, of an array, from each)."""
        return component != COMPONENT_ESTIMATOR if kind == self._reading_id else component == COMPONENT_AUTOPILOT

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
        layout, extra, make = kind
        if not self._heard(number, component) or not _whole(raw, extra):
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


def _payloads(
    data: Bytes, begin: Ints, length: Ints, orders: Ints, layout: struct.Struct, extra: bytes
) -> tuple[Ints, Bytes]:
    """Of the packets `orders`, those that are whole, and their payloads (N, size of the layout)."""
    whole, payloads = [np.empty(0, np.int64)], [np.empty((0, layout.size), np.uint8)]
    for size in np.unique(length[orders]).tolist():
        some = orders[length[orders] == size]
        packet = data[begin[some][:, None] + np.arange(size)]
        good = _all_whole(packet, extra[0])
        payload = np.zeros((np.count_nonzero(good), layout.size), np.uint8)  # trailing zeros are cut off on the wire
        carried = packet[good, _HEADER_BYTES:-2][:, : layout.size]
        payload[:, : carried.shape[1]] = carried
        whole.append(some[good])
        payloads.append(payload)
    order, payload = np.concatenate(whole), np.concatenate(payloads)
    sorted_ = np.argsort(order)
    return order[sorted_], payload[sorted_]


def _odd_names(payload: Bytes) -> bool:
    """Whether one is not ASCII, or goes on behind its end."""
    name = payload[:, 8:]
    return bool((name >= 128).any() or ((name[:, :-1] == 0) & (name[:, 1:] != 0)).any())


def _series(order: Ints, component: Bytes, payload: Bytes) -> list[ReadingSeries]:
    """The readings by sender."""
    thermal = (payload[:, 8 : 8 + len(_THERMAL)] == np.frombuffer(_THERMAL, np.uint8)).all(axis=1)
    fields = payload.view(_READING).ravel()
    left, series = np.flatnonzero(thermal), []
    while left.size:
        name, sender = fields["name"][left[0]], component[left[0]]
        is_own = (fields["name"][left] == name) & (component[left] == sender)
        own, left = left[is_own], left[~is_own]
        time_boot_ms, value = fields["time_boot_ms"][own].astype(np.int64), fields["value"][own].astype(np.float64)
        series.append(ReadingSeries(name.decode("ascii"), int(sender), order[own], time_boot_ms, value))
    return series


def _all_whole(packet: Bytes, extra: int) -> NDArray[np.bool_]:
    """(N,) what `_whole` says of each of (N, size) packets."""
    crc = np.full(len(packet), 0xFFFF, np.uint16)
    for column in packet[:, 1:-2].T:
        crc = (crc >> 8) ^ _CRC[(crc ^ column) & 255]
    crc = (crc >> 8) ^ _CRC[(crc ^ extra) & 255]
    return np.asarray(crc == packet[:, -2] + (packet[:, -1].astype(np.uint16) << 8))


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
