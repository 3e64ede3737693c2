"""ArduPilot's own logs: the same flight as its packets tell, and in one line what another log lacks."""

from __future__ import annotations

import random

import numpy as np
import pytest
from dataflash import FORMATS, dataflash, formats, record
from flown import STAR, Flown, fly
from pymavlink import DFReader

from dslam_mav.errors import BadInputError
from dslam_mav.mav.dataflash import read_dataflash
from dslam_mav.mission import Home, enu_to_e7, leg_plan
from dslam_mav.observations import Odometry, Reading, Yaw
from dslam_mav.recordings import Assumed, kind_of, open_recording
from dslam_mav.replay import flight_from_frames

FMT, NVAL = b"\xa3\x95\x80", b"\xa3\x95\xc8"
HOME = Home(-35.363262, 149.165237)


@pytest.fixture(scope="module")
def flown() -> Flown:
    return fly(late_ms=100)


@pytest.fixture(scope="module")
def places() -> list[tuple[int, int]]:
    return [enu_to_e7(east, north, HOME) for north, east in [(0.0, 0.0), *STAR]]


def test_pymavlinks_own_reader_reads_what_the_tests_write(tmp_path, flown, places):
    path = tmp_path / "00000001.BIN"
    path.write_bytes(dataflash(flown, places))
    reader = DFReader.DFReader_binary(str(path))
    value = reader.recv_match(type=["NVAL"], strict=True)
    assert (value.Name, value.SSys, value.SCom) == ("THERMAL", 1, 158)
    assert set(FORMATS) <= {form.name for form in reader.formats.values()}


def test_the_flight_is_that_of_its_packets(tmp_path, flown, places):
    path = tmp_path / "00000001.BIN"
    path.write_bytes(dataflash(flown, places))
    recording = open_recording(path)
    mine = recording.flight(recording.mission, Assumed())
    theirs = flight_from_frames(flown.frames, "frames", system=1)
    assert len(mine.flight.legs) == len(theirs.flight.legs) == 4
    for a, b in zip(mine.flight.legs, theirs.flight.legs, strict=True):
        np.testing.assert_array_equal(a.reading, b.reading)
        np.testing.assert_array_equal(a.time_s, b.time_s)
        np.testing.assert_allclose(a.distance_m, b.distance_m, atol=1e-9)


def test_the_mission_is_in_it(tmp_path, flown, places):
    path = tmp_path / "log.bin"
    path.write_bytes(dataflash(flown, places))
    mission = open_recording(path).mission
    assert mission is not None
    plan = leg_plan(mission)
    assert plan.sequence == (1, 2, 3, 4, 5)
    np.testing.assert_allclose(plan.lengths_m, flown.lengths_m, atol=0.02)


def test_the_compass_is_seen_only_where_it_was_asked_for(tmp_path, flown):
    legs = []
    for turned_deg in (0, 40):
        path = tmp_path / f"{turned_deg}.bin"
        path.write_bytes(dataflash(flown, turned_deg=turned_deg))
        blind, seen = (open_recording(path).flight(None, Assumed(yaw=yaw)) for yaw in (False, True))
        assert np.isnan(blind.collector.headings_rad(blind.legs)).all()
        turned_rad = seen.collector.headings_rad(seen.legs)
        np.testing.assert_allclose(turned_rad, np.radians(-turned_deg), atol=1e-9)
        legs.append(blind.flight.legs)
    assert all(a.distance_m.tobytes() == b.distance_m.tobytes() for a, b in zip(*legs, strict=True))


def test_only_the_filters_core_in_charge_and_no_position_is_read(tmp_path, flown):
    path = tmp_path / "log.bin"
    path.write_bytes(dataflash(flown))
    log = read_dataflash(path)
    assert {type(o) for o in log.observations} >= {Reading, Odometry, Yaw}
    sent = [f.message for f in flown.frames if f.message.get_type() == "LOCAL_POSITION_NED"]
    assert [o.x_m for o in log.observations if isinstance(o, Odometry)] == [m.x for m in sent]
    assert "POS" not in log.records


@pytest.mark.parametrize(
    ("kept", "wanted"),
    [
        ((), "no NVAL records"),
        (("NVAL", b"CamTilt"), "no THERMAL readings; names in NVAL: CamTilt"),
        (("NVAL", b"THERMAL"), "no MISE records"),
    ],
)
def test_what_a_log_lacks_is_said_in_one_line(tmp_path, kept, wanted):
    path = tmp_path / "poor.bin"
    value = record("NVAL", 2_000_000, 2000, kept[1], 1.0, 1, 158) if kept else b""
    path.write_bytes(formats() + record("MSG", 1_000_000, b"ArduCopter V4.6.0") + value)
    with pytest.raises(BadInputError) as problem:
        open_recording(path).flight(None, Assumed())
    assert str(problem.value).startswith(f"{path}: {wanted}")


def test_cut_and_damaged_logs_give_what_is_whole_or_one_line(tmp_path, flown, capfd):
    data, rng = dataflash(flown), random.Random(4)
    path = tmp_path / "hurt.bin"
    read, lines = 0, set[str]()
    for _ in range(12):
        hurt = bytearray(data[: rng.randrange(len(data))])
        for _ in range(3):
            hurt[rng.randrange(len(hurt))] ^= 1 << rng.randrange(8)
        path.write_bytes(hurt)
        try:
            read += len(read_dataflash(path).observations)
        except BadInputError as problem:
            lines |= {str(problem)}
    path.write_bytes(b"")
    with pytest.raises(BadInputError, match=r"hurt\.bin"):
        read_dataflash(path)
    assert read > 0
    assert not any("\n" in line for line in lines)
    assert capfd.readouterr().err == ""


def test_one_damaged_byte_costs_one_record_and_is_told(tmp_path, flown, capfd):
    data = dataflash(flown)
    whole = tmp_path / "whole.bin"
    whole.write_bytes(data)
    hurt = bytearray(data)
    hurt[data.index(NVAL, len(data) // 2) + 2] = 0x77  # a kind that no FMT describes
    path = tmp_path / "hurt.bin"
    path.write_bytes(hurt)
    log, all_of_it = read_dataflash(path), read_dataflash(whole)
    assert all_of_it.bad_bytes == 0
    assert log.records == {**all_of_it.records, "NVAL": all_of_it.records["NVAL"] - 1}
    assert log.bad_bytes == 0, "less than a page is as much as pads a whole log's end"
    hurt[data.index(FMT, 200) + 2] = 0x77  # all of one kind is lost with its description, and that kind alone
    path.write_bytes(hurt)
    assert sum(kind not in read_dataflash(path).records for kind in all_of_it.records) <= 1
    hurt = bytearray(data)
    hurt[len(data) // 2 : len(data) // 2 + 2000] = bytes(2000)
    path.write_bytes(hurt)
    log = read_dataflash(path)
    assert 2000 <= log.bad_bytes < 2300
    assert log.records["NVAL"] > all_of_it.records["NVAL"] - 20
    (note, *_) = open_recording(path).flight(None, Assumed()).notes
    assert note == f"hurt.bin: damaged, {log.bad_bytes:,} bytes are in no record; the others are used"
    assert capfd.readouterr().err == ""


def test_a_bin_without_one_record_is_none(tmp_path):
    path = tmp_path / "x.bin"
    for data in (bytes(3000), b"\xa3", random.Random(1).randbytes(500)):
        path.write_bytes(data)
        with pytest.raises(BadInputError, match=r"x\.bin: no DataFlash log: expected records that begin with a3 95"):
            read_dataflash(path)


def test_it_is_known_by_its_first_bytes_whatever_its_name(tmp_path, flown):
    path = tmp_path / "log.unknown"
    path.write_bytes(dataflash(flown))
    assert kind_of(path) == "dataflash"
