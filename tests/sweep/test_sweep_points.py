"""A point by itself: its randomness, its bound, and what its row says of answers right, wrong and missing."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from dslam_mav import Medium, bound, estimate
from dslam_mav.dslam.scoring import truth_in_gauge
from dslam_mav.records import Sources, Truth, Verdict
from dslam_mav.sweep.points.columns import OF_LOGS, OF_SCENES, RESULTS, SECONDS, plain
from dslam_mav.sweep.points.flown import Flown, Told, answered, row_of
from dslam_mav.sweep.points.judge import judged
from dslam_mav.sweep.points.seeds import generator, key_of
from dslam_mav.sweep.points.summary import grouped
from missions.patterns import pattern
from sim_bridge.fields.scene import Medium as SceneMedium
from sim_bridge.fields.scene import Noise, Sampling, Scene, Source, simulate

PATH = pattern("star5", 45.0, centre_m=(3.0, -2.0))
SCENE = Scene(
    SceneMedium(25.0, static=True),
    (Source((6.0, 1.0), 300.0, -1.0), Source((-4.0, 5.0), 250.0, -1.0)),
    Sampling(5.0, 0.5),
    noise=Noise(snr_db=35.0),
)
TOLD = Told(Medium(spread_m=10.0, static=True), 2)


def flown(seed: int = 1, scene: Scene = SCENE) -> Flown:
    peak = scene.amplitude / (np.pi * 100.0)
    sources = Sources(scene.source_position_m, scene.amplitude, peak, scene.activation_s)
    flight = simulate(scene, PATH, generator(seed, "test"))
    return Flown(flight, PATH, sources, scene.noise_sd(PATH), 5.0)


@pytest.fixture(scope="module")
def answer():
    return answered(flown(), TOLD, np.random.default_rng(0))


def test_randomness_follows_from_the_coordinates_alone():
    assert generator(1, "a", 2).random(4).tolist() == generator(1, "a", 2).random(4).tolist()
    drawn = [generator(*at).random() for at in ((1, "a", 2), (2, "a", 2), (1, "b", 2), (1, "a", 3), (1, "a2"))]
    assert len(set(drawn)) == 5
    assert key_of({"a": 1, "b": [2.5]}) == key_of({"b": [2.5], "a": 1}) != key_of({"a": 1, "b": [2.5000001]})


def test_a_right_answer_is_found_within_its_bound(answer):
    row = row_of(flown(), TOLD, answer)
    assert row["verdict"] in ("IDENTIFIED", "AMBIGUOUS")
    assert (row["found"], row["listed"], row["k_true"], row["k_found"]) == (True, True, 2, 2)
    assert 0.0 < row["source_error_median_m"] <= row["source_error_rms_m"] <= row["source_error_max_m"] < 1.0
    assert row["nearest_error_m"] <= row["source_error_rms_m"]
    assert row["spread_m"] == pytest.approx(10.0)
    least = bound(
        PATH, flown().sources, TOLD.medium, readings_per_leg=90, speed_m_s=5.0, noise_sd=flown().noise_sd
    ).position_covariance_m2  # fmt: skip
    assert row["bound_m"] == pytest.approx(math.sqrt(np.trace(least, axis1=1, axis2=2).mean()))
    assert row["error_over_bound"] == pytest.approx(row["source_error_rms_m"] / row["bound_m"])
    assert row["sd_m"] == pytest.approx(row["bound_m"], rel=0.3)
    assert (row["legs"], row["readings"], row["path_length_m"]) == (5, 450, pytest.approx(225.0))


def test_errors_are_those_of_places_moved_by_hand(answer):
    truth = truth_in_gauge(answer, flown().truth)
    off = np.array([[3.0, 0.0], [0.0, 4.0]])
    moved = replace(answer, sources=replace(answer.sources, position_m=truth.source_position_m + off), alternatives=())
    row = judged(moved, flown().flight, flown().truth, 10.0)
    assert (row["source_error_median_m"], row["source_error_max_m"]) == (pytest.approx(3.5), pytest.approx(4.0))
    assert row["source_error_rms_m"] == pytest.approx(math.sqrt(12.5))
    own = moved.position_covariance_m2
    assert row["nees"] == pytest.approx(sum(o @ np.linalg.inv(c) @ o for o, c in zip(off, own, strict=True)) / 4.0)
    assert (row["found"], row["listed"]) == (False, False)
    as_second = judged(replace(moved, alternatives=(replace(answer, alternatives=()),)), flown().flight,
                       flown().truth, 10.0)  # fmt: skip
    assert (as_second["found"], as_second["listed"], as_second["alternatives"]) == (False, True, 1)
    assert as_second["nearest_error_m"] < 1.0


def test_an_answer_with_another_number_of_sources_is_not_the_truth(answer):
    three = Truth(np.vstack([SCENE.source_position_m, [[30.0, 30.0]]]), np.append(SCENE.amplitude, 1.0), PATH)
    row = judged(answer, flown().flight, three, 10.0)
    assert (row["found"], row["listed"], row["k_true"], row["k_found"]) == (False, False, 3, 2)
    assert row["nearest_error_m"] is None
    assert row["source_error_max_m"] < 1.0


def test_no_answer_has_no_errors_but_its_bound():
    told = replace(TOLD, n_sources=8)
    short = replace(flown(), flight=replace(flown().flight, legs=flown().flight.legs[:1]))
    row = row_of(short, told, answered(short, told, np.random.default_rng(0)))
    assert row["verdict"] in (Verdict.TOO_FEW_DATA.name, Verdict.NOT_IDENTIFIABLE.name)
    assert row["found"] is False
    assert row["reason"]
    assert plain(row).get("source_error_rms_m") is None
    assert row["error_over_bound"] is None


def test_without_noise_there_is_no_bound():
    quiet = flown(scene=Scene(SCENE.medium, SCENE.sources, SCENE.sampling, noise=Noise(sd=0.0)))
    row = plain(row_of(quiet, TOLD, answered(quiet, TOLD, np.random.default_rng(0))))
    assert (row["bound_m"], row["error_over_bound"]) == (None, None)
    assert row["source_error_max_m"] < 0.01


def test_with_a_compass_the_answer_is_anchored_and_judged_so():
    told = replace(TOLD, heading_sd_rad=0.02)
    found = answered(flown(), told, np.random.default_rng(0))
    assert found.gauge == "anchored"
    row = row_of(flown(), told, found)
    assert row["source_error_max_m"] < 1.5
    assert row["path_error_m"] < 1.5


def test_the_papers_answer_has_errors_but_no_covariance():
    told = replace(TOLD, method="paper")
    quiet = flown(scene=Scene(SCENE.medium, SCENE.sources, SCENE.sampling, noise=Noise(snr_db=120.0)))
    row = plain(row_of(quiet, told, answered(quiet, told, np.random.default_rng(0))))
    assert row["source_error_rms_m"] < 0.5
    assert (row["found"], row["nees"], row["sd_m"]) == (True, None, None)


def test_a_log_without_truth_has_a_row_of_what_it_says_itself():
    found = estimate(flown().flight, TOLD.medium, 2)
    row = judged(found, flown().flight, None, found.spread_m)
    assert (row["k_true"], row["k_found"], row["noise_sd"]) == (None, 2, found.noise_sd)
    assert "found" not in row


def test_columns_are_named_once_and_cover_every_row(answer):
    for own in (OF_SCENES, OF_LOGS):
        names = [column.name for column in (*own, *RESULTS, SECONDS)]
        assert len(set(names)) == len(names)
    told = {column.name for column in RESULTS} - {"failure", "noise_snr_db"}
    assert set(row_of(flown(), TOLD, answer)) == told


def test_groups_sum_up_their_points():
    def row(mission: str, error: float | None, **other: Any) -> dict[str, Any]:
        known = {"mission": mission, "source_error_rms_m": error, "bound_m": 2.0, "seconds": 0.1, "verdict": None}
        ratio = None if error is None else error / 2.0
        return known | {"error_over_bound": ratio, "found": error is not None, "listed": True} | other

    rows = [row("b", 1.0, verdict="IDENTIFIED"), row("a", 5.0), row("b", 3.0, verdict="AMBIGUOUS"),
            row("b", None), row("b", 8.0, found=False, verdict="AMBIGUOUS")]  # fmt: skip
    first, second = grouped(rows, ("mission",))
    assert (first.labels, second.labels) == ({"mission": "b"}, {"mission": "a"})
    assert first.verdicts == {"AMBIGUOUS": 2, "IDENTIFIED": 1, "failed": 1}
    assert (first.points, first.error_m, first.bound_m) == (4, 3.0, 2.0)
    assert first.over_bound == pytest.approx(math.sqrt((0.25 + 2.25) / 2.0))
    assert (first.found_share, first.listed_share) == (0.5, 1.0)
