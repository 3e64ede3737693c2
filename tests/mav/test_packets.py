"""Packets straight to observations are what the decoded frames give, whatever the packet."""

from __future__ import annotations

from dataclasses import astuple
from typing import Any

import numpy as np
from flown import fly, heartbeat, reading
from hypothesis import given, settings
from hypothesis import strategies as st

from dslam_mav.legs import LegCollector
from dslam_mav.mav.decode import autopilot_system, decode
from dslam_mav.mav.frames import Encoder, messages, parse_frame
from dslam_mav.mav.packets import Gate, system_frames
from dslam_mav.observations import Reading

M = messages()
FLIGHT = fly([(0.0, 0.0), (8.0, 2.0), (1.0, 6.0)], hold_ms=300, late_ms=120).frames
U16, U32 = st.integers(0, 2**16 - 1), st.integers(0, 2**32 - 1)
F32 = st.floats(width=32)
NAME = st.one_of(
    st.sampled_from([b"THERMAL", b"THERMAL2", b"THERMAL_12", b"SRC1_E", b"THERMAL\xff", b"THERMAL\x00X"]),
    st.binary(max_size=10),
)

MESSAGE = st.one_of(
    st.builds(M.MAVLink_named_value_float_message, U32, NAME, F32),
    st.builds(M.MAVLink_local_position_ned_message, U32, F32, F32, F32, F32, F32, F32),
    st.builds(M.MAVLink_vfr_hud_message, F32, F32, st.integers(-9, 9), st.integers(0, 99), F32, F32),
    st.builds(M.MAVLink_mission_item_reached_message, U16),
    st.builds(M.MAVLink_mission_current_message, U16, U16, st.integers(0, 5), st.integers(0, 2)),
    st.builds(M.MAVLink_attitude_message, U32, F32, F32, F32, F32, F32, F32),
    st.builds(M.MAVLink_heartbeat_message, *[st.integers(0, 255)] * 6),
)


def long_way(raw: bytes, system: int, *, yaw: bool) -> Any:
    frame = parse_frame(raw, 0)
    return None if frame is None else decode(frame, system, yaw=yaw)


@settings(max_examples=400, deadline=None)
@given(message=MESSAGE, sender=st.tuples(st.sampled_from([1, 2]), st.sampled_from([1, 158, 191])), yaw=st.booleans(),
       hurt=st.none() | st.tuples(st.integers(0, 60), st.integers(1, 255)))  # fmt: skip
def test_every_packet_gives_what_its_frame_gives(message, sender, yaw, hurt):
    raw = bytearray(Encoder(*sender).pack(message))
    if hurt is not None:
        raw[hurt[0] % len(raw)] ^= hurt[1]
    seen = Gate(1, yaw=yaw).observation(bytes(raw))
    assert repr(seen) == repr(long_way(bytes(raw), 1, yaw=yaw))  # NaN is NaN


def test_a_flights_packets_and_its_vehicle():
    frames = [heartbeat(1, system=9), *fly().frames, reading(1, 2.0, 3, name="SRC1_X", component=191)]
    packets = [(frame.received_ns, frame.raw) for frame in frames]
    assert autopilot_system(system_frames(packets)) == autopilot_system(frames) == 1
    seen = [decode(frame, 1) for frame in frames]
    others, series = Gate(1, yaw=False).recorded(packets)
    readings = [
        (order, Reading(time_ms, value, one.name, one.component))
        for one in series
        for order, time_ms, value in zip(one.order.tolist(), one.time_boot_ms.tolist(), one.value.tolist(), strict=True)
    ]
    assert sorted([*others, *readings], key=lambda each: each[0]) == [
        (order, one) for order, one in enumerate(seen) if one is not None
    ]
    assert len(series) == 1
    assert not any(isinstance(one, Reading) for _, one in others)


SENT = st.tuples(
    MESSAGE,
    st.sampled_from([1, 1, 1, 2]),
    st.sampled_from([1, 1, 158, 159, 191]),
    st.none() | st.none() | st.tuples(st.integers(0, 60), st.integers(1, 255)),
)
NEAR = st.builds(M.MAVLink_named_value_float_message, st.integers(19_000, 26_000), NAME, F32)
TICK = st.builds(M.MAVLink_local_position_ned_message, st.integers(15_000, 40_000) | U32, F32, F32, F32, F32, F32, F32)
NEAR_SENT = st.tuples(NEAR | TICK, st.just(1), st.sampled_from([1, 158]), st.none())


@settings(max_examples=200, deadline=None)
@given(sent=st.lists(SENT | NEAR_SENT, max_size=40), flown_too=st.booleans(), at=st.integers(0, 400), yaw=st.booleans())
def test_a_recording_at_once_is_what_its_packets_are_one_by_one(sent, flown_too, at, yaw):
    """Wild packets, alone or amid a flight: clocks that jump, wrap and start late, copies, names cut or odd."""
    wild = []
    for message, system, component, hurt in sent:
        raw = bytearray(Encoder(system, component).pack(message))
        if hurt is not None:
            raw[hurt[0] % len(raw)] ^= hurt[1]
        wild.append(bytes(raw))
    known = [frame.raw for frame in FLIGHT] if flown_too else []
    packets = [(i, raw) for i, raw in enumerate([*known[:at], *wild, *known[at:]])]
    gate, slow, fast = Gate(1, yaw=yaw), LegCollector(), LegCollector()
    slow.add_all(one for _, raw in packets if (one := gate.observation(raw)) is not None)
    fast.add_recorded(*gate.recorded(packets))
    assert +fast.counts == +slow.counts
    assert fast.names == slow.names
    assert fast.last_event == slow.last_event
    assert fast.legs_completed == slow.legs_completed
    assert fast.settled == slow.settled
    assert same(fast.readings(), slow.readings())
    for one, other in zip(fast.legs(final=True), slow.legs(final=True), strict=True):
        assert same(astuple(one), astuple(other))
    assert fast.legs_counts == slow.legs_counts


def same(found: Any, known: Any) -> bool:
    return len(found) == len(known) and all(
        a.tobytes() == b.tobytes() if isinstance(a, np.ndarray) else a == b for a, b in zip(found, known, strict=True)
    )


def test_cut_packets_are_nothing():
    raw = fly().frames[5].raw
    assert all(Gate(1, yaw=True).observation(raw[:n]) is None for n in range(len(raw)))
