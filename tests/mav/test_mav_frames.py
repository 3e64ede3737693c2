from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v10 import common as mavlink1

from dslam_mav.mav.frames import Encoder, Parser, messages, parse_frame
from dslam_mav.mav.readings import from_message, to_message
from dslam_mav.observations import Reading


def packet(value: float = 1.5, system: int = 1, component: int = 158) -> bytes:
    return Encoder(system, component).pack(to_message(Reading(1234, value)))


def test_a_packet_comes_back_as_sent() -> None:
    raw = packet()
    (frame,) = Parser().feed(raw, 77)
    assert (frame.received_ns, frame.raw) == (77, raw)
    assert (frame.message.get_srcSystem(), frame.message.get_srcComponent()) == (1, 158)
    assert from_message(frame.message) == Reading(1234, 1.5)
    again = parse_frame(raw, 78)
    assert again is not None
    assert again.message.value == 1.5


@settings(deadline=None)
@given(st.lists(st.one_of(st.binary(max_size=60), st.just(packet())), max_size=12), st.data())
def test_packets_are_found_in_any_noise_however_it_is_cut(parts: list[bytes], data: st.DataObject) -> None:
    good = parts.count(packet())
    stream = b"".join(parts) + packet() * 20  # a false beginning may wait for up to 280 bytes
    parser, frames = Parser(), []
    while stream:
        cut = data.draw(st.integers(1, len(stream)))
        frames += parser.feed(stream[:cut], 0)
        stream = stream[cut:]
    found = sum(frame.raw == packet() for frame in frames)
    assert good + 8 <= found <= good + 20


def test_bad_bytes_are_counted_to_the_byte() -> None:
    parser = Parser()
    broken = bytearray(packet())
    broken[12] ^= 0x01
    frames = parser.feed(b"noise" + bytes(broken) + packet(), 0)
    assert len(frames) == 1
    assert parser.bad_bytes == len(b"noise") + len(broken)


def test_mavlink_1_is_ignored_and_counted() -> None:
    sender = mavlink1.MAVLink(None, srcSystem=1, srcComponent=1)
    old = mavlink1.MAVLink_heartbeat_message(2, 3, 0, 0, 3, 3).pack(sender)
    parser = Parser()
    assert len(parser.feed(old + packet(), 0)) == 1
    assert parser.bad_bytes == len(old)


def test_sequence_numbers_count_up_by_sender() -> None:
    encoder = Encoder(1, 191)
    raws = [encoder.pack(messages().MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3)) for _ in range(258)]
    assert [raw[4] for raw in raws] == [k % 256 for k in range(258)]


def test_parse_frame_wants_exactly_one_packet() -> None:
    raw = packet()
    assert parse_frame(raw[:-1], 0) is None
    assert parse_frame(raw + b"x", 0) is None
    assert parse_frame(b"", 0) is None


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_nan_and_infinity_pass_the_wire(value: float) -> None:
    (frame,) = Parser().feed(packet(value), 0)
    reading = from_message(frame.message)
    assert reading is not None
    assert reading.value == value or (math.isnan(value) and math.isnan(reading.value))


@settings(deadline=None)
@given(
    st.floats(width=32, allow_nan=False),
    st.integers(0, 2**32 - 1),
    st.from_regex(r"[A-Z0-9_]{1,10}", fullmatch=True),
)
def test_readings_survive(value: float, time_ms: int, name: str) -> None:
    raw = Encoder(1, 158).pack(to_message(Reading(time_ms, value, name)))
    (frame,) = Parser().feed(raw, 0)
    assert from_message(frame.message) == Reading(time_ms, value, name)


@pytest.mark.parametrize(
    ("reading", "words"),
    [
        (Reading(0, 1.0, "thermal"), "name 'thermal'"),
        (Reading(0, 1.0, "ELEVENBYTES"), "name 'ELEVENBYTES'"),
        (Reading(0, 1.0, ""), "name ''"),
        (Reading(0, 4e38), "value 4e"),
        (Reading(2**32, 1.0), "time_boot_ms 4294967296"),
        (Reading(-1, 1.0), "time_boot_ms -1"),
    ],
)
def test_what_the_wire_cannot_carry_is_refused_by_name(reading: Reading, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        to_message(reading)
