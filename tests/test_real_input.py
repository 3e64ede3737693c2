"""Flights and fields nobody here made: ArduCopter and ArduRover firmware in its simulator, recorded diffusion."""

import json
from itertools import permutations
from pathlib import Path

import numpy as np
import pymap3d
import pytest

from dslam_mav import Medium, Verdict, estimate, read_flight
from dslam_mav.cli import main
from dslam_mav.dslam.align import to_canonical
from dslam_mav.mav.tlog import read_tlog
from dslam_mav.records import Truth
from dslam_mav.replay import flight_from_log

DATA = Path(__file__).parents[2] / "shared" / "data"
SPREAD_M = 12.49

pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason=f"{DATA} is missing")


def _truth(flight: str) -> Truth:
    body = json.loads((DATA / "flights" / f"{flight}.truth.json").read_text())
    sources = np.array([s["position_ned_m"] for s in body["sources"]])[:, ::-1]
    amplitude = np.array([s["amplitude"] for s in body["sources"]])
    return Truth(sources, amplitude, np.array(body["planned_vertices_ned_m"])[:, ::-1])


FLIGHTS = [
    ("copter_flow_k2_static", 2, Medium(static=True, ambient=None)),
    ("copter_flow_k3_static", 3, Medium(static=True, ambient=None)),
    ("copter_flow_k2_evolving", 2, Medium(diffusivity_m2_s=0.5, activation_s="shared", ambient=None)),
    ("rover_gps_k2_static", 2, Medium(static=True, ambient=None)),
]


def _flown(flight: str) -> np.ndarray:
    """(L + 1, 2) where the simulator had the vehicle when each item was reached."""
    path = DATA / "flights" / f"{flight}.tlog"
    home = json.loads(path.with_suffix(".truth.json").read_text())["home"]
    places = [
        (f.received_ns // 1_000_000 % 10**9, f.message.lat_int / 1e7, f.message.lon_int / 1e7)
        for f in read_tlog(path)
        if f.message.get_type() == "SIM_STATE"
    ]
    time_ms, latitude, longitude = np.array(places).T
    east, north, _ = pymap3d.geodetic2enu(latitude, longitude, 0.0, home[0], home[1], 0.0)
    legs = flight_from_log(path).legs
    at_ms = [*(leg.start_ms for leg in legs), legs[-1].end_ms]
    return np.stack([np.interp(at_ms, time_ms, east), np.interp(at_ms, time_ms, north)], axis=1)


@pytest.fixture(scope="module")
def blind_errors():
    """Of every source of every flight, in √C: headings, spread and ambient level unknown; and what lies within 95 %."""
    errors, within = [], []
    for flight, k_sources, medium in FLIGHTS:
        result = estimate(read_flight(DATA / "flights" / f"{flight}.tlog"), medium, k_sources)
        assert result.verdict in (Verdict.IDENTIFIED, Verdict.AMBIGUOUS), flight
        assert result.medium.ambient == pytest.approx(20.0, abs=0.4)
        truth = _truth(flight)
        errors_of = []
        for mode in (result, *result.alternatives):
            for order in permutations(range(k_sources)):
                off = mode.sources.position_m[list(order)] - to_canonical(_flown(flight)).apply(truth.source_position_m)
                inside = [
                    d @ np.linalg.solve(c, d) < 9.21
                    for d, c in zip(off, mode.position_covariance_m2[list(order)], strict=True)
                ]
                errors_of.append((np.linalg.norm(off, axis=1) / SPREAD_M, inside))
        nearest = min(errors_of, key=lambda e: e[0].max())
        errors += list(nearest[0])
        within += nearest[1]
    return np.array(errors), np.array(within)


def test_sources_are_found_blind_from_flights_of_real_firmware(blind_errors):
    errors, _ = blind_errors
    assert np.median(errors) <= 0.04
    assert errors.max() <= 0.10


def test_their_truth_lies_where_the_covariance_says(blind_errors):
    """All within 99 %; the 95 % ellipses hold 7 of these 9."""
    assert blind_errors[1].all()


def test_the_command_on_the_copter_flight(capsys):
    log = DATA / "flights" / "copter_flow_k2_static.tlog"
    arguments = ["replay", str(log), "--sources", "2", "--spread", "12.49", "--ambient", "auto", "--json"]
    assert main(arguments) == 0
    result = json.loads(capsys.readouterr().out)
    truth = _truth("copter_flow_k2_static")
    places = to_canonical(truth.vertices_m).apply(truth.source_position_m)
    found = np.array([source["position_m"] for source in result["sources"]])
    error = min(np.linalg.norm(found[list(order)] - places, axis=1).max() for order in permutations(range(2)))
    assert error < 0.15 * SPREAD_M


def test_recorded_diffusion_over_the_whole_chain(tmp_path, capsys):
    errors = []
    for seed, frame in enumerate((0, 1, 2, 3, 4)):
        arguments = ["fly", "--readings", str(DATA / "spot_bilayer_a.npz"), "--sources", "2", "--seed", str(seed)]
        arguments += ["--frames", str(frame), "--speedup", "30", "--out", str(tmp_path), "--json"]
        assert main(arguments) == 0
        result = json.loads(capsys.readouterr().out)
        assert result["medium"]["ambient"] is not None
        # The spot has an extent, found with it: √C is its second moment, a ninth less than its Gaussian fit's here.
        assert result["medium"]["spread_m"] == pytest.approx(10.0, rel=0.25)
        errors.append(result["errors"]["sources_rms_m"] / 10.0)
    assert np.median(errors) < 0.15
