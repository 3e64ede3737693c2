"""Telemetry logs of ground stations: whole, corrupt, old, and files that are none."""

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dslam_mav.errors import BadInputError
from dslam_mav.mav.frames import Encoder, messages
from dslam_mav.mav.tlog import read_tlog

M = messages()
START_US = 1_700_000_000_000_000
FLIGHTS = Path(__file__).parents[3] / "shared" / "data" / "flights"


def records(n: int) -> list[bytes]:
    vehicle, bridge = Encoder(1, 1), Encoder(1, 158)
    packets = [
        vehicle.pack(M.MAVLink_local_position_ned_message(20 * i, float(i), 1.0, -5.0, 2.0, 0.0, 0.0))
        if i % 2
        else bridge.pack(M.MAVLink_named_value_float_message(20 * i, b"THERMAL", 20.0 + i))
        for i in range(n)
    ]
    return [(START_US + 20_000 * i).to_bytes(8, "big") + packet for i, packet in enumerate(packets)]


def write(path: Path, data: bytes) -> Path:
    path.write_bytes(data)
    return path


def test_frames_come_in_order_with_their_times_and_bytes(tmp_path):
    log = read_tlog(write(tmp_path / "a.tlog", b"".join(records(50))))
    frames = list(log)
    assert [f.received_ns for f in frames] == [1000 * (START_US + 20_000 * i) for i in range(50)]
    assert [f.raw for f in frames] == [r[8:] for r in records(50)]
    assert [f.message.time_boot_ms for f in frames] == [20 * i for i in range(50)]
    assert log.bad_bytes == 0
    assert len(list(log)) == 50  # a second time too


@settings(max_examples=50, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 20), st.binary(min_size=1, max_size=60)), min_size=1, max_size=8))
def test_garbage_between_records_costs_no_record(tmp_path_factory, garbage):
    chunks = records(20)
    for at, junk in garbage:
        chunks.insert(at, junk)
    log = read_tlog(write(tmp_path_factory.mktemp("junk") / "a.tlog", b"".join(chunks)))
    frames = list(log)
    assert {f.raw for f in frames} >= {r[8:] for r in records(20)}
    assert log.bad_bytes == sum(len(junk) for _, junk in garbage) or len(frames) > 20


def test_a_changed_byte_costs_one_frame_and_a_cut_end_the_last(tmp_path):
    data = bytearray(b"".join(records(30)))
    at = sum(len(r) for r in records(30)[:7]) + 8 + 14  # in the payload of the eighth
    data[at] ^= 0x40
    log = read_tlog(write(tmp_path / "a.tlog", bytes(data[:-3])))
    times = [f.message.time_boot_ms for f in log]
    assert times == [20 * i for i in range(29) if i != 7]
    assert log.bad_bytes == len(records(30)[7]) + len(records(30)[29]) - 3


def test_old_logs_hold_mavlink_1(tmp_path):
    sender = M.MAVLink(None, srcSystem=3, srcComponent=1)
    packet = M.MAVLink_mission_item_reached_message(4).pack(sender, force_mavlink1=True)
    assert packet[0] == 0xFE
    (frame,) = read_tlog(write(tmp_path / "a.tlog", START_US.to_bytes(8, "big") + packet))
    assert frame.message.seq == 4
    assert frame.message.get_srcSystem() == 3


@pytest.mark.parametrize(
    "data", [b"", b"time_s,value\n1,2\n" * 100, bytes(range(256)) * 40, b"\x89MCAP0\r\n" + bytes(999)]
)
def test_what_is_no_tlog_is_refused_in_one_line_that_names_it(tmp_path, data):
    path = write(tmp_path / "x.tlog", data)
    with pytest.raises(BadInputError, match=r"x\.tlog: no tlog: expected timestamped MAVLink") as problem:
        list(read_tlog(path))
    assert "\n" not in str(problem.value)


def test_a_missing_file_is_refused_at_once(tmp_path):
    with pytest.raises(BadInputError, match=r"none\.tlog: cannot be read: no such file"):
        read_tlog(tmp_path / "none.tlog")


@pytest.mark.parametrize(
    ("name", "kind", "count", "corrupt"),
    [
        ("ardusub_dive.tlog", "NAMED_VALUE_FLOAT", 4224, True),
        ("copter_waypoints.tlog", "MISSION_ITEM_REACHED", 16, False),
        ("rover_gps_k2_static.tlog", "NAMED_VALUE_FLOAT", 2848, False),
    ],
)
def test_real_logs(name, kind, count, corrupt):
    if not (FLIGHTS / name).exists():
        pytest.skip(f"{FLIGHTS / name} is not there")
    log = read_tlog(FLIGHTS / name)
    frames = list(log)
    assert sum(f.message.get_type() == kind for f in frames) == count
    assert (log.bad_bytes > 0) is corrupt
    stamps = [f.received_ns for f in frames]
    assert stamps[0] > 1e18
    assert max(stamps) - min(stamps) < 1e9 * 3600
