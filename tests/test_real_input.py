"""Flights and fields nobody here made: ArduCopter and ArduRover firmware in its simulator, recorded diffusion."""

import json
from itertools import permutations
from pathlib import Path

import numpy as np
import pytest

from dslam_mav import Medium, Verdict, estimate, read_flight
from dslam_mav.cli import main
from dslam_mav.dslam.align import to_canonical
from dslam_mav.dslam.scoring import score
from dslam_mav.records import Truth

DATA = Path(__file__).parents[2] / "shared" / "data"
SPREAD_M = 12.49

pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason=f"{DATA} is missing")


def _truth(flight: str) -> Truth:
    body = json.loads((DATA / "flights" / f"{flight}.truth.json").read_text())
    sources = np.array([s["position_ned_m"] for s in body["sources"]])[:, ::-1]
    amplitude = np.array([s["amplitude"] for s in body["sources"]])
    return Truth(sources, amplitude, np.array(body["planned_vertices_ned_m"])[:, ::-1])


@pytest.mark.parametrize(
    ("flight", "k_sources"), [("copter_flow_k2_static", 2), ("copter_flow_k3_static", 3), ("rover_gps_k2_static", 2)]
)
def test_flights_of_real_firmware(flight, k_sources):
    readings = read_flight(DATA / "flights" / f"{flight}.tlog")
    result = estimate(readings, Medium(spread_m=SPREAD_M, static=True, ambient=None), k_sources)
    assert result.verdict in (Verdict.IDENTIFIED, Verdict.AMBIGUOUS)
    errors = score(result, _truth(flight))
    assert errors is not None
    assert (errors.source_error_m < 0.15 * SPREAD_M).all()
    assert result.medium.ambient == pytest.approx(20.0, abs=0.3)


def test_an_evolving_field_under_real_firmware():
    readings = read_flight(DATA / "flights" / "copter_flow_k2_evolving.tlog")
    result = estimate(readings, Medium(diffusivity_m2_s=0.5, activation_s="shared", ambient=None), 2)
    truth = _truth("copter_flow_k2_evolving")
    places = to_canonical(truth.vertices_m).apply(truth.source_position_m)
    near = min(
        float(np.linalg.norm(mode.sources.position_m[list(order)] - places, axis=1).max())
        for mode in (result, *result.alternatives)
        for order in permutations(range(2))
    )
    assert near < 0.25 * result.spread_m
    assert result.spread_m == pytest.approx(15.49, rel=0.1)


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
