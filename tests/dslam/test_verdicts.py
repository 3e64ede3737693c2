"""What estimate() says of flights that do not tell enough, or too much."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from changed import changed, changed_readings
from random_scenes import random_case

from dslam_mav import Flight, Leg, Medium, Verdict, estimate
from dslam_mav.dslam import certify
from missions.patterns import from_turns

KNOWN = Medium(spread_m=1.0, static=True)
FREE = Medium(static=True, ambient=None)


class TestVerdicts:
    def test_too_few_legs(self):
        result = estimate(Flight(random_case((1,), 2, 30.0).flight.legs[:2]), KNOWN, 2)
        assert result.verdict is Verdict.TOO_FEW_DATA
        assert "2 legs can be used" in result.reason
        assert result.sources.position_m.shape == (2, 2)
        assert np.isnan(result.sources.position_m).all()

    def test_more_sources_than_readings_can_carry(self):
        case = random_case((1,), 2, 30.0, readings_per_leg=4)
        result = estimate(Flight(case.flight.legs[:3]), KNOWN, 5)
        assert result.verdict is Verdict.TOO_FEW_DATA
        assert "12 readings cannot carry 17 unknowns" in result.reason

    def test_a_leg_without_readings(self):
        case = random_case((1,), 2, 30.0)
        empty = np.empty(0)
        flight = changed(case.flight, lambda j, leg: Leg(leg.length_m, empty, empty, empty) if j == 3 else leg)
        result = estimate(flight, KNOWN, 2)
        assert result.verdict is Verdict.TOO_FEW_DATA
        assert "Leg 4 has 0 readings" in result.reason

    def test_no_signal(self):
        flight = changed_readings(random_case((1,), 2, 30.0).flight, lambda _, y: np.full_like(y, 21.5))
        result = estimate(flight, FREE, 2)
        assert result.verdict is Verdict.NOT_IDENTIFIABLE
        assert "21.5" in result.reason

    def test_one_source_on_an_open_path(self):
        result = estimate(random_case((1, 1), 1, 30.0).flight, KNOWN, 1)
        assert result.verdict is Verdict.NOT_IDENTIFIABLE
        assert np.isnan(result.sources.position_m).all()
        assert np.isfinite(result.residual).all()
        assert result.unseen_directions
        assert "source 1" in result.reason
        assert not any(word in result.reason for word in ("bounded", "spreads of"))
        assert all("with" not in words and "ln " not in words for words in result.unseen_directions)

    def test_a_march_out_of_the_area(self):
        zigzag = from_turns(np.full(7, 3.2), np.array([1, -1, 1, -1, 1, -1]) * 0.5 * np.pi)
        case = random_case((8,), 2, 20.0, vertices=zigzag)
        assert estimate(case.flight, KNOWN, 2).verdict in (Verdict.NOT_IDENTIFIABLE, Verdict.AMBIGUOUS)

    def test_a_stuck_leg_is_no_diffusion(self):
        case = random_case((3, 2, 20), 2, 30.0)
        peak = max(leg.reading.max() for leg in case.flight.legs)
        flight = changed_readings(case.flight, lambda j, y: np.full_like(y, 0.7 * peak) if j in (2, 4) else y)
        result = estimate(flight, KNOWN, 2)
        assert result.verdict in (Verdict.MODEL_MISFIT, Verdict.NOT_IDENTIFIABLE)
        assert result.diagnostics["whiteness_p"] < 1e-6

    def test_a_misfit_widens_the_covariance(self):
        case = random_case((26,), 2, 40.0)
        bent = changed_readings(case.flight, lambda _, y: y + 0.02 * np.ptp(y) * np.sin(np.linspace(0.0, 6.0, y.size)))
        plain, off = estimate(case.flight, KNOWN, 2), estimate(bent, KNOWN, 2)
        assert off.diagnostics["whiteness_p"] < 1e-3 < plain.diagnostics["whiteness_p"]
        assert (off.sd_m > 2.0 * plain.sd_m).all()

    def test_an_ambiguous_answer_carries_its_alternatives(self):
        found = []
        for seed in range(12):
            result = estimate(random_case((seed, 2, 77), 2, 20.0).flight, KNOWN, 2)
            if result.verdict is Verdict.AMBIGUOUS:
                found.append(result)
        assert found
        for result in found:
            assert result.alternatives
            likelihoods = [e.log_likelihood for e in (result, *result.alternatives)]
            assert likelihoods[0] - min(likelihoods) < 4.6
            assert all(not e.alternatives for e in result.alternatives)

    def test_a_field_that_stands_still_has_no_age(self):
        case = random_case((33,), 2, 40.0)
        result = estimate(case.flight, Medium(activation_s="shared"), 2)
        assert result.verdict in (Verdict.IDENTIFIED, Verdict.AMBIGUOUS)
        assert np.isnan(result.sources.activation_s).all()
        assert result.medium.diffusivity_m2_s is None
        assert result.spread_m == pytest.approx(1.0, rel=0.05)

    @pytest.mark.parametrize("medium", [KNOWN, FREE])
    def test_odd_readings_never_raise(self, medium):
        case = random_case((34,), 2, 30.0)
        rng = np.random.default_rng(0)
        for change in (
            lambda j, leg: replace(leg, distance_m=np.full(64, 1.0)),
            lambda j, leg: replace(leg, distance_m=leg.distance_m + (1e4 if j == 2 else 0.0)),
            lambda j, leg: replace(leg, reading=np.zeros(64)),
            lambda j, leg: replace(leg, reading=-leg.reading),
            lambda j, leg: replace(leg, reading=rng.standard_normal(64)),
            lambda j, leg: replace(leg, reading=np.where(np.arange(64) == 5, 1e3, 0.0)),
            lambda j, leg: replace(leg, reading=leg.reading * 1e200),
        ):
            result = estimate(changed(case.flight, change), medium, 2)
            assert result.reason
            assert result.residual.shape == (448,)


@pytest.mark.parametrize(
    ("names", "words"),
    [
        (["heading of leg 8", "corner 8 x", "corner 8 y"], "the direction of leg 8, and where it begins"),
        (["corner 3 y", "heading of leg 3", "length of leg 3"], "where leg 3 begins, its direction, and its length"),
        (["source 2 x", "ln amplitude 2", "source 2 y", "ln C 2"], "where source 2 lies, its strength, and its spread"),
        (["ln amplitude 1", "heading of leg 2"], "the strength of source 1, and the direction of leg 2"),
        (["ln C"], "the spread of the sources"),
        (["coefficient 1 x", "coefficient 2 x", "turn"],
         "coefficient 1 of the path, coefficient 2 of the path, and the direction of the whole path"),
        ([], ""),
    ],
)  # fmt: skip
def test_what_is_unseen_is_said_in_plain_words(names: list[str], words: str):
    assert certify.in_plain_words(names) == words


def test_every_parameter_has_words():
    flight = random_case((1,), 2, 30.0).flight
    result = estimate(flight, Medium(static=False), 2)
    for name in result.parameter_names:
        assert certify.in_plain_words([name]).startswith(("the ", "where ")), name


@pytest.mark.parametrize(
    ("sd_m", "reason"),
    [
        (5.2, "Source 2 is known to ± 5.2 m only, more than 2 times the spread of 1.34 m: another leg that passes it"),
        (
            1e6,
            "The readings do not tell where source 2 lies: another leg that passes it in a new direction would help.",
        ),
        (np.inf, "The readings do not tell where source 2 lies: another leg"),
    ],
)
def test_a_source_that_is_not_placed_is_said_in_plain_words(sd_m: float, reason: str):
    blocks = np.stack([np.eye(2), np.diag([sd_m**2, 1.0])])
    level = certify.Noise(1.0, 1.0, 0.0, 1.0, 1.0, 1.0, 0.0)
    verdict, why = certify.verdict(level, blocks, 1.34, 0, converged=True)
    assert verdict is Verdict.NOT_IDENTIFIABLE
    assert why.startswith(reason)
