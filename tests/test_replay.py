"""Recorded flights: from a telemetry log, from a flight log, and what is missing from others."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pymap3d
import pytest
from flown import fly, pack

from dslam_mav.errors import BadInputError
from dslam_mav.flight_log import read_flight
from dslam_mav.legs import PlanFacts
from dslam_mav.log.reader import read_log
from dslam_mav.log.recorder import Recorder
from dslam_mav.log.topics import RAW
from dslam_mav.mav.frames import Frame, messages
from dslam_mav.mav.tlog import read_tlog
from dslam_mav.replay import Replayed, flight_from_frames, flight_from_packets

FLIGHTS = Path(__file__).parents[2] / "shared" / "data" / "flights"


def flight_from_log(path: Path, plan: PlanFacts | None = None) -> Replayed:
    """The flight in a .mcap or a .tlog."""
    if path.suffix == ".mcap":
        return flight_from_packets(read_log(path, (RAW,)).frames, str(path), plan=plan)
    return flight_from_frames(list(read_tlog(path)), str(path), plan=plan)


def tlog(path: Path, frames: list[Frame]) -> Path:
    path.write_bytes(b"".join((f.received_ns // 1000 + 10**15).to_bytes(8, "big") + f.raw for f in frames))
    return path


def without(frames: list[Frame], *kinds: str) -> list[Frame]:
    return [f for f in frames if f.message.get_type() not in kinds]


def test_a_flight_log_and_a_telemetry_log_of_the_same_frames_are_the_same_flight(tmp_path: Path):
    flown = fly(late_ms=250)
    with Recorder(tmp_path / "flight.mcap") as recorder:
        for frame in flown.frames:
            recorder.frame(frame.received_ns, frame.raw)
    a = flight_from_log(tmp_path / "flight.mcap").flight
    b = flight_from_log(tlog(tmp_path / "flight.tlog", flown.frames)).flight
    assert len(a.legs) == 4
    for p, q in zip(a.legs, b.legs, strict=True):
        assert p.distance_m.tobytes() == q.distance_m.tobytes()
        assert p.reading.tobytes() == q.reading.tobytes()
        assert p.length_m == q.length_m


@pytest.mark.parametrize(
    ("dropped", "wanted"),
    [
        (("HEARTBEAT",), "no autopilot: expected HEARTBEAT"),
        (("MISSION_ITEM_REACHED", "MISSION_CURRENT"), "no MISSION_ITEM_REACHED"),
        (("NAMED_VALUE_FLOAT",), "no THERMAL readings; names of NAMED_VALUE_FLOAT heard: none"),
        (("LOCAL_POSITION_NED", "VFR_HUD"), "the distance flown cannot be told on 4 legs"),
    ],
)
def test_what_a_log_lacks_is_said_in_one_line(tmp_path, dropped, wanted):
    path = tlog(tmp_path / "poor.tlog", without(fly().frames, *dropped))
    with pytest.raises(BadInputError) as problem:
        flight_from_log(path)
    assert str(problem.value).startswith(f"{path}: {wanted}")
    assert "\n" not in str(problem.value)


def test_names_of_another_vehicles_values_are_not_told(tmp_path):
    frames = without(fly().frames, "NAMED_VALUE_FLOAT")
    wire = messages().MAVLink_named_value_float_message(1, b"LUX", 1.0)
    own = messages().MAVLink_named_value_float_message(1, b"TEMP", 1.0)
    path = tlog(tmp_path / "poor.tlog", [*frames, pack(wire, 10**12, system=9), pack(own, 10**12)])
    with pytest.raises(BadInputError, match=r"heard: TEMP$"):
        flight_from_log(path)


def test_readings_that_are_all_nan_are_said_to_be(tmp_path):
    path = tlog(tmp_path / "nan.tlog", fly(value=lambda n, e: float("nan")).frames)
    with pytest.raises(BadInputError, match="none of the THERMAL readings is a finite number"):
        flight_from_log(path)


def test_a_plan_that_fits_no_item_is_no_flight(tmp_path):
    path = tlog(tmp_path / "a.tlog", fly().frames)
    with pytest.raises(BadInputError, match="no leg with readings"):
        flight_from_log(path, plan=PlanFacts((21, 22), (30.0,)))


def test_real_logs_that_hold_no_thermal_flight_are_refused():
    for name, wanted in (
        ("ardusub_dive.tlog", "no THERMAL readings; names of NAMED_VALUE_FLOAT heard: .*Lights1"),
        ("copter_waypoints.tlog", "no THERMAL readings; names of NAMED_VALUE_FLOAT heard: none"),
    ):
        if not (FLIGHTS / name).exists():
            pytest.skip(f"{FLIGHTS / name} is not there")
        with pytest.raises(BadInputError, match=wanted):
            flight_from_log(FLIGHTS / name)


@pytest.mark.parametrize(
    ("name", "legs", "drift_rms_m", "shape_rms_m"),
    [
        ("copter_flow_k2_static", 7, 0.55, 0.3),
        ("copter_flow_k3_static", 7, 0.55, 0.3),
        ("copter_flow_k2_evolving", 5, 0.85, 0.35),
        ("rover_gps_k2_static", 7, 0.15, 0.15),
    ],
)
def test_distances_of_real_firmware_against_the_simulators_truth(name, legs, drift_rms_m, shape_rms_m):
    """Optical flow mistakes a leg's length by up to 4 %; apart from that distances are good to 0.3 m."""
    path = FLIGHTS / f"{name}.tlog"
    if not path.exists():
        pytest.skip(f"{path} is not there")
    home = json.loads(path.with_suffix(".truth.json").read_text())["home"]
    truth = [
        (f.received_ns // 1_000_000 % 10**9, f.message.lat_int / 1e7, f.message.lon_int / 1e7)
        for f in read_tlog(path)
        if f.message.get_type() == "SIM_STATE"
    ]
    time_ms, latitude, longitude = np.array(truth).T
    east, north, _ = pymap3d.geodetic2enu(latitude, longitude, 0.0, home[0], home[1], 0.0)

    def place(at_ms):
        return np.stack([np.interp(at_ms, time_ms, east), np.interp(at_ms, time_ms, north)], axis=-1)

    replayed = flight_from_log(path)
    assert len(replayed.legs) == legs
    plain, scaled = [], []
    for leg in replayed.legs:
        start, end = place(leg.start_ms), place(leg.end_ms)
        length_m = np.hypot(*(end - start))
        true_m = (place(leg.time_ms) - start) @ (end - start) / length_m
        plain.append(leg.distance_m - true_m)
        scaled.append(leg.distance_m * (length_m / leg.length_m) - true_m)
    rms = [float(np.sqrt(np.mean(np.concatenate(e) ** 2))) for e in (plain, scaled)]
    assert rms[0] < drift_rms_m
    assert rms[1] < shape_rms_m


def test_read_flight_is_the_short_way(tmp_path: Path):
    path = tlog(tmp_path / "a.tlog", fly().frames)
    flight = read_flight(str(path))
    assert flight.lengths_m.tobytes() == flight_from_log(path).flight.lengths_m.tobytes()
