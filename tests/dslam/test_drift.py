"""An ambient level that drifts while the flight lasts: a sensor that warms up."""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest
from random_scenes import Case, random_case

from dslam_mav import Estimate, Flight, Medium, Verdict, estimate

MEDIUM = Medium(spread_m=1.0, static=True, ambient=None)
SHARE = 0.2  # of the readings' range, over the flight


def _drifting(case: Case, share: float) -> tuple[Flight, float]:
    readings = np.concatenate([leg.reading for leg in case.flight.legs])
    first, last = case.flight.legs[0].time_s[0], case.flight.legs[-1].time_s[-1]
    rate = share * float(np.ptp(readings)) / (last - first)
    legs = (replace(leg, reading=leg.reading + rate * (leg.time_s - first)) for leg in case.flight.legs)
    return Flight(tuple(legs)), rate


def _error(result: Estimate, case: Case) -> float:
    return min(
        float(np.linalg.norm(mode.sources.position_m[list(order)] - case.position_m, axis=1).max())
        for mode in (result, *result.alternatives)
        for order in permutations(range(len(case.position_m)))
    )


@pytest.fixture(scope="module")
def answers():
    cases = [random_case((612, seed), 3, 40.0) for seed in range(8)]
    flights = [_drifting(case, SHARE) for case in cases]
    told = replace(MEDIUM, ambient_drift_per_s=None)
    return [
        (case, flight, rate, estimate(flight, told, 3)) for case, (flight, rate) in zip(cases, flights, strict=True)
    ]


def test_a_drift_of_a_fifth_of_the_range_is_found_and_costs_little(answers):
    """Beside the same flights without it; taken for part of the field it costs everything."""
    fitted = [_error(result, case) for case, _, _, result in answers]
    steady = [_error(estimate(case.flight, MEDIUM, 3), case) for case, *_ in answers]
    assert np.median(fitted) < 1.5 * np.median(steady)
    assert max(fitted) < 0.15


def test_its_rate_is_told_with_its_sd(answers):
    for _, _, rate, result in answers:
        at = result.parameter_names.index("ambient drift")
        sd = float(np.sqrt(result.parameter_covariance[at, at]))
        assert abs(result.medium.ambient_drift_per_s - rate) < 4.5 * sd
        assert sd < 0.2 * rate


def test_a_known_drift_is_taken_out_of_the_readings(answers):
    """To the last digits what the flight without drift gives, whose level and residuals it keeps."""
    case, flight, rate, _ = answers[0]
    result = estimate(flight, replace(MEDIUM, ambient_drift_per_s=rate), 3)
    plain = estimate(case.flight, MEDIUM, 3)
    np.testing.assert_allclose(result.sources.position_m, plain.sources.position_m, atol=1e-6)
    np.testing.assert_allclose(result.residual, plain.residual, atol=1e-5)
    assert result.medium.ambient_drift_per_s == rate


def test_a_drift_nobody_told_of_is_no_silent_wrong_answer(answers):
    _, flight, _, _ = answers[0]
    assert estimate(flight, MEDIUM, 3).verdict not in (Verdict.IDENTIFIED, Verdict.AMBIGUOUS)


def test_wrong_drifts_are_named():
    with pytest.raises(ValueError, match="ambient_drift_per_s: expected a finite number or None, got nan"):
        Medium(ambient_drift_per_s=float("nan"))
    with pytest.raises(ValueError, match="ambient_drift_per_s: method 'paper' takes a number"):
        estimate(random_case((1,), 2, 40.0).flight, Medium(spread_m=1.0, static=True, ambient_drift_per_s=None), 2,
                 method="paper")  # fmt: skip
