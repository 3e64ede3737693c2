"""Ambient level and noise measured elsewhere: what they add to an answer, and when they are not believed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from random_scenes import random_case

from dslam_mav import Medium, estimate
from dslam_mav.assumptions import Assumptions
from dslam_mav.calibrated import calibrated_answer
from dslam_mav.legs import Standing

FREE = Medium(spread_m=1.0, static=True, ambient=None)
CASE = random_case((5, 5), 2, 30.0, ambient=20.0, readings_per_leg=32)
SD = CASE.noise_sd


def ambient_sd(result) -> float:
    i = result.parameter_names.index("ambient")
    return float(np.sqrt(result.parameter_covariance[i, i]))


def test_a_level_that_is_known_holds_the_ambient_level_and_makes_it_surer():
    free = estimate(CASE.flight, FREE, 2)
    held = estimate(CASE.flight, FREE, 2, ambient_prior=(20.0, 0.01 * SD))
    assert abs(held.medium.ambient - 20.0) < 0.03 * SD
    assert ambient_sd(held) == pytest.approx(0.01 * SD, rel=0.1)
    assert ambient_sd(free) > 5.0 * ambient_sd(held)
    vague = estimate(CASE.flight, FREE, 2, ambient_prior=(25.0, 1e4))
    assert vague.medium.ambient == pytest.approx(free.medium.ambient, abs=0.05 * SD)


def test_noise_measured_elsewhere_counts_where_the_legs_agree():
    told = estimate(CASE.flight, FREE, 2, noise_prior=(SD, 1e6))
    assert told.diagnostics["noise_measured"]
    assert told.noise_sd == pytest.approx(SD, rel=1e-2)
    denied = estimate(CASE.flight, FREE, 2, noise_prior=(3.0 * SD, 200.0))
    assert not denied.diagnostics["noise_measured"]
    assert denied.noise_sd == estimate(CASE.flight, FREE, 2).noise_sd


@pytest.mark.parametrize("name", ["ambient_prior", "noise_prior"])
@pytest.mark.parametrize("pair", [(1.0,), (np.nan, 1.0), (1.0, 0.0), (1.0, -1.0), "ab"])
def test_misuse_names_the_argument(name, pair):
    with pytest.raises(ValueError, match=name):
        estimate(CASE.flight, FREE, 2, **{name: pair})


def test_a_level_known_twice_is_misuse():
    with pytest.raises(ValueError, match="ambient_prior"):
        estimate(CASE.flight, replace(FREE, ambient=20.0), 2, ambient_prior=(20.0, 0.1))


def by_stand(level: float | None, noise_sd: float = SD):
    standing = None
    if level is not None:
        standing = Standing(np.arange(300), level + noise_sd * np.random.default_rng(1).standard_normal(300))

    def answer(given):
        return estimate(CASE.flight, FREE, 2, ambient_prior=given.ambient, noise_prior=given.noise)

    return calibrated_answer(Assumptions(ambient="hover", noise="hover"), standing, answer)


def test_a_stand_out_of_reach_gives_the_ambient_level():
    result = by_stand(20.0)
    assert abs(result.medium.ambient - 20.0) < 0.3 * SD
    assert "left out" not in result.reason


def test_a_stand_in_the_field_is_left_out_and_said():
    result = by_stand(20.0 + 40.0 * SD)
    assert result.sources.position_m.tobytes() == by_stand(None).sources.position_m.tobytes()
    assert "it is left out. The vehicle stood in the field" in result.reason


def test_other_noise_is_left_out_and_said():
    assert "read standing is not that of the legs" in by_stand(20.0, 5.0 * SD).reason


def test_no_stand_is_said():
    assert "not read standing" in by_stand(None).reason
