"""Packets straight to observations are what the decoded frames give, whatever the packet."""

from __future__ import annotations

from typing import Any

from flown import fly, heartbeat, reading
from hypothesis import given, settings
from hypothesis import strategies as st

from dslam_mav.mav.decode import autopilot_system, decode
from dslam_mav.mav.frames import Encoder, messages, parse_frame
from dslam_mav.mav.packets import Gate, system_frames

M = messages()
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
    assert list(Gate(1, yaw=False).observations(packets)) == [o for o in seen if o is not None]


def test_cut_packets_are_nothing():
    raw = fly().frames[5].raw
    assert all(Gate(1, yaw=True).observation(raw[:n]) is None for n in range(len(raw)))
