"""The covariance where the model bends: wider than the bound there, the bound itself where it does not."""

from dataclasses import replace

import numpy as np
import pytest
from random_scenes import random_case, truth_fit

from dslam_mav.dslam import bound, profile
from dslam_mav.dslam.joint import evaluate
from dslam_mav.dslam.problem import problem
from dslam_mav.dslam.profile import second_moment
from dslam_mav.dslam.state import layout

MIRROR = np.array([1.0, -1.0])


def _both(prob, state, variance):
    """The bound's covariance at a state, and the second moment along the profiles."""
    at = layout(prob, len(state.s))
    flat = bound.information(evaluate(prob, state, at)[1], variance).covariance
    return flat, second_moment(prob, state, at, flat, variance)


def _fitted(seed, k_sources, snr_db):
    case = random_case((seed,), k_sources, snr_db)
    return problem(case.flight, case.medium), truth_fit(case).state, case.noise_sd**2


@pytest.mark.parametrize("k_sources", [2, 3])
def test_where_the_model_is_straight_the_bound_is_left_as_it_is(k_sources):
    prob, state, variance = _fitted(7, k_sources, 80.0)
    flat, moment = _both(prob, state, variance)
    np.testing.assert_array_equal(moment, flat)


def test_never_below_the_bound_and_above_it_where_the_valley_is_flat():
    wider = []
    for seed in range(12):
        flat, moment = _both(*_fitted(seed, 3, 20.0))
        np.testing.assert_allclose(moment, moment.T, rtol=1e-9, atol=1e-12 * np.abs(moment).max())
        scale = np.sqrt(np.outer(np.diag(flat), np.diag(flat)))
        assert np.linalg.eigvalsh((moment - flat) / scale).min() > -1e-6
        wider.append(np.trace(moment) / np.trace(flat))
    assert np.max(wider) > 1.2
    assert np.median(wider) < 2.0


def test_the_compiled_model_says_what_the_general_one_says(monkeypatch):
    for seed in range(6):
        quick = _both(*_fitted(seed, 3, 20.0))[1]
        with monkeypatch.context() as other:
            other.setattr(profile, "plain", lambda _: False)
            general = _both(*_fitted(seed, 3, 20.0))[1]
        np.testing.assert_allclose(quick, general, rtol=1e-6, atol=1e-9 * np.abs(general).max())


@pytest.mark.parametrize("seed", [0, 3, 5])
def test_neither_the_sources_order_nor_left_and_right_matter(seed):
    prob, state, variance = _fitted(seed, 3, 20.0)
    at = layout(prob, 3)
    order = [2, 0, 1]
    turned = replace(
        state, theta=-state.theta, s=state.s[order] * MIRROR, log_amplitude=state.log_amplitude[order],
        log_spread2=state.log_spread2[order],
    )  # fmt: skip
    index, sign = np.arange(at.size), np.ones(at.size)
    index[at.place] = index[at.place].reshape(3, 2)[order].ravel()
    index[at.amplitude] = index[at.amplitude][order]
    sign[at.heading], sign[at.place] = -1.0, np.tile(MIRROR, 3)
    moment, of_turned = _both(prob, state, variance)[1], _both(prob, turned, variance)[1]
    expected = moment[np.ix_(index, index)] * np.outer(sign, sign)
    size = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    np.testing.assert_allclose(of_turned / size, expected / size, atol=1e-4)


def test_a_place_without_bound_keeps_what_the_bound_says():
    prob, state, variance = _fitted(1, 3, 20.0)
    flat, moment = _both(prob, state, 1e6 * variance)
    np.testing.assert_array_equal(moment, flat)
