"""Fields that are not quite the model's: what is found in them, how sure the answer says it is, and what it says."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from bench.recorded_fields import DATA, MEDIUM, demo_of, fly, rms_error
from random_scenes import random_case

from dslam_mav import Flight, Medium, Verdict, estimate
from dslam_mav.dslam.certify import noise
from dslam_mav.dslam.field import field
from missions.patterns import star
from sim_bridge.fields.frame_stack import FrameStack

needs_recordings = pytest.mark.skipif(not DATA.is_dir(), reason=f"{DATA} is missing")


@needs_recordings
@pytest.mark.parametrize(
    ("recording", "frame", "k_sources", "seed"),
    [("a", 1, 3, 50036), ("a", 0, 3, 50038), ("b", 0, 2, 50016), ("b", 0, 3, 50012)],
)
def test_misfit_does_not_hide_the_answer(recording, frame, k_sources, seed):
    """Fields in which a search that takes the misfit for signal loses the sources."""
    stack = FrameStack.read(DATA / f"spot_bilayer_{recording}.npz")
    assert fly(stack, frame, k_sources, seed).nearest < 0.15


@needs_recordings
def test_an_extended_release_is_told_by_its_shape():
    """Theory, section 10: κ ≈ −0.18 in the first frame, and it fits better than point releases do."""
    stack = FrameStack.read(DATA / "spot_bilayer_a.npz")
    _, flight, truth = demo_of(stack, 0, 2, 50001)
    free = estimate(flight, MEDIUM, 2)
    point = estimate(flight, Medium(static=True, ambient=None, extent=0.0), 2)
    assert free.medium.extent == pytest.approx(-0.18, abs=0.08)
    assert rms_error(free, truth) < 0.06
    assert free.diagnostics["cost"] < 0.9 * point.diagnostics["cost"]


@needs_recordings
def test_uncertainties_are_widened():
    stack = FrameStack.read(DATA / "spot_bilayer_a.npz")
    flown = [fly(stack, 1 + i % 4, 2, 50000 + i) for i in range(6)]
    inside = np.concatenate([f.inside for f in flown if f.error < 0.3])
    off = np.concatenate([f.off for f in flown if f.error < 0.3])
    axis = np.concatenate([f.half_axis for f in flown if f.error < 0.3])
    assert inside.mean() >= 0.8
    assert np.median(axis) < 4.0 * np.sqrt(np.mean(off**2))


def test_white_readings_keep_the_point_release():
    case = random_case((7, 2), 2, 30.0, medium=MEDIUM, ambient=20.0)
    result = estimate(case.flight, MEDIUM, 2)
    assert result.diagnostics["extent"] == 0.0
    assert result.noise_sd == pytest.approx(case.noise_sd, rel=0.15)


def test_only_residuals_that_are_not_white_widen():
    white = noise(100.0, 120, 20, (60.0, 60), 1.0)
    assert (white.variance, white.misfit) == (1.0, False)
    coloured = noise(220.0, 120, 20, (60.0, 60), 1.0)
    assert coloured.misfit
    assert coloured.variance > coloured.inside > coloured.outside


def _with_readings(flight, change):
    return Flight(tuple(replace(leg, reading=change(j, leg.reading)) for j, leg in enumerate(flight.legs)))


def _cold_scene(seed, k_sources):
    """A random scene whose last source cools."""
    case = random_case((seed, k_sources, 90), k_sources, 30.0, ambient=20.0)
    path = star(7, 3, 3.2)
    along = np.arange(64)[:, None] / 64.0
    last = case.position_m[-1:]
    twice = [2.0 * field(a + along * (b - a), 1.0, last, case.amplitude[-1:]) for a, b in pairwise(_canonical(path))]
    return _with_readings(case.flight, lambda j, y: y - twice[j])


def _canonical(path):
    first = path[1] - path[0]
    c, s = first / np.linalg.norm(first)
    turned = (path - path[0]) @ np.array([[c, -s], [s, c]])
    second = turned[2] - turned[1]
    return turned * [1.0, np.sign(second[1])]


@pytest.mark.parametrize("k_sources", [2, 3])
def test_a_source_that_cools_is_never_called_sure(k_sources):
    """Ambient unknown: the misfit is a few percent of the range, but many times the noise."""
    verdicts = [estimate(_cold_scene(seed, k_sources), MEDIUM, k_sources).verdict for seed in range(5)]
    assert Verdict.IDENTIFIED not in verdicts
    assert verdicts.count(Verdict.AMBIGUOUS) <= 2  # their misfit is about what a copter's drift leaves


@pytest.mark.parametrize(("k_sources", "seed", "snr_db"), [(2, 801, 30.0), (3, 800, 20.0), (3, 802, 40.0)])
def test_readings_upside_down_are_never_called_sure(k_sources, seed, snr_db):
    case = random_case((seed, k_sources), k_sources, snr_db, ambient=20.0)
    result = estimate(_with_readings(case.flight, lambda _, y: -y), MEDIUM, k_sources)
    assert result.verdict in (Verdict.MODEL_MISFIT, Verdict.NOT_IDENTIFIABLE, Verdict.NOT_CONVERGED)


@pytest.mark.parametrize("medium", [MEDIUM, Medium(static=True, spread_m=1.0), Medium(ambient=None)])
def test_noise_alone_is_no_source(medium):
    rng = np.random.default_rng(3)
    flight = _with_readings(random_case((1, 2), 2, 30.0).flight, lambda _, y: rng.standard_normal(y.size))
    for k_sources in (2, None):
        result = estimate(flight, medium, k_sources)
        assert result.verdict is Verdict.NOT_IDENTIFIABLE
        assert "No source is seen" in result.reason


class TestAFieldThatStandsStillSaidToEvolve:
    @pytest.mark.parametrize("seed", [701, 709])
    def test_is_answered_where_the_rate_is_free(self, seed):
        """The fit's valley runs on towards ever older fields."""
        case = random_case((seed, 3), 3, 40.0, ambient=20.0)
        result = estimate(case.flight, Medium(ambient=None, activation_s="shared"), 3)
        assert result.verdict is Verdict.IDENTIFIED
        truth = case.position_m[np.argsort(-case.amplitude)]
        np.testing.assert_allclose(result.sources.position_m, truth, atol=0.06)
        assert np.isnan(result.sources.activation_s).all()

    @pytest.mark.parametrize("seed", [0, 1, 2])
    def test_contradicts_a_known_diffusivity(self, seed):
        """C would grow from 1 to three times that during the flight, and does not."""
        case = random_case((seed, 3, 91), 3, 30.0, ambient=20.0)
        result = estimate(case.flight, Medium(diffusivity_m2_s=0.025, activation_s="shared", ambient=None), 3)
        assert result.verdict in (Verdict.MODEL_MISFIT, Verdict.NOT_IDENTIFIABLE)
        assert "stands still" in result.reason

    def test_one_that_does_evolve_is_not_doubted(self):
        medium = Medium(diffusivity_m2_s=0.25 / 22.4, activation_s="shared", ambient=None)
        for seed in range(3):
            case = random_case((seed, 3, 92), 3, 30.0, ambient=20.0, age_over_flight=1.0)
            assert estimate(case.flight, medium, 3).verdict in (Verdict.IDENTIFIED, Verdict.AMBIGUOUS)
