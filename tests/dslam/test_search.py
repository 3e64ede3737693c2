"""The search's kernels against plain numpy; its answers do not depend on how many threads find them."""

import numpy as np
import pytest
from numba import njit
from random_scenes import random_case, truth_fit

from dslam_mav.dslam.compress import Samples, compress
from dslam_mav.dslam.kernels.beam_fit import beam_fits
from dslam_mav.dslam.kernels.corner import corner_fits
from dslam_mav.dslam.kernels.fit import FitOptions, fit_batch
from dslam_mav.dslam.kernels.lanes import LANES, exponential, load, store
from dslam_mav.dslam.kernels.products import node, pair_products, value_slope
from dslam_mav.dslam.kernels.scan import scan_heading
from dslam_mav.dslam.search import search


def _compressed(case, *, ambient_unknown=False, spread2=None):
    spread2 = [np.ones(leg.reading.size) for leg in case.flight.legs] if spread2 is None else spread2
    legs = [Samples(g.length_m, g.distance_m, g.reading, c) for g, c in zip(case.flight.legs, spread2, strict=True)]
    return compress(legs, 1.0, ambient_unknown=ambient_unknown)


def _near_truth(case, comp, rng, count, off=0.1):
    theta = case.heading_rad + off * rng.standard_normal((count, case.heading_rad.size))
    theta[:, 0] = 0.0
    s = case.position_m + off * rng.standard_normal((count, *case.position_m.shape))
    alpha = np.log(case.amplitude / np.pi / comp.sigma) + off * rng.standard_normal((count, len(case.amplitude)))
    return theta, s, alpha


@njit
def _exponentials(rows):
    for i in range(rows.shape[0]):
        store(rows, i, exponential(load(rows, i)))


@njit
def _products(prods, j, rows):
    y = load(rows, 0)
    gg, ag, ga, aa = pair_products(prods, j, y, load(rows, 1))
    at, t = node(prods, y)
    z, z1 = value_slope(prods.own, j, at, t)
    for i, one in enumerate((gg, ag, ga, aa, z, z1)):
        store(rows, 2 + i, one)


def test_exponentials_of_eight_at_a_time():
    x = np.random.default_rng(0).uniform(-600.0, 250.0, (200, LANES))
    rows = x.copy()
    _exponentials(rows)
    np.testing.assert_allclose(rows, np.exp(x), rtol=1e-13)


def test_products_of_curves_are_sums_over_the_readings():
    case = random_case((1,), 2, 20.0)
    comp = _compressed(case)
    rows = np.random.default_rng(1).uniform(-2.0, 5.0, (8, LANES))
    rows[1, 0] = rows[0, 0]
    _products(comp.products, 2, rows)
    leg = case.flight.legs[2]
    u, w = (leg.distance_m[:, None] - rows[i] for i in (0, 1))
    f, g = np.exp(-u * u), np.exp(-w * w)
    f1, g1 = 2.0 * u * f, 2.0 * w * g
    y = leg.reading[:, None] / comp.sigma
    expected = [(f * g), (f1 * g), (f * g1), (f1 * g1), (y * f), (y * f1)]
    for row, terms in zip(rows[2:], expected, strict=True):
        np.testing.assert_allclose(row, terms.sum(axis=0), atol=2e-5 * max(1.0, np.abs(terms).sum(axis=0).max()))


@pytest.mark.parametrize("ambient_unknown", [False, True])
def test_costs_from_products_are_costs_from_samples(ambient_unknown):
    case = random_case((2,), 3, 20.0)
    comp = _compressed(case, ambient_unknown=ambient_unknown)
    start = _near_truth(case, comp, np.random.default_rng(2), 13)
    how = FitOptions(0, 6, 5.0, 3.0, 0, 1e-9)
    by_samples, _ = fit_batch(comp.legs, how, *(a.copy() for a in start))
    by_products = beam_fits(comp.products, how, *(a.copy() for a in start))
    np.testing.assert_allclose(by_products, by_samples, rtol=1e-5)


@pytest.mark.parametrize("span", [(0, 6), (2, 5)])
def test_both_fits_end_in_the_same_minima(span):
    case = random_case((3,), 3, 40.0)
    comp = _compressed(case)
    theta, s, alpha = _near_truth(case, comp, np.random.default_rng(3), 11, off=0.02)
    lo, hi = span
    before = case.flight.lengths_m[:lo, None] * np.stack([np.cos(theta[0, :lo]), np.sin(theta[0, :lo])], axis=1)
    s = s - before.sum(axis=0)
    how = FitOptions(lo, hi, 5.0, 3.0, 80, 1e-12)
    one, other = [a.copy() for a in (theta, s, alpha)], [a.copy() for a in (theta, s, alpha)]
    by_samples, _ = fit_batch(comp.legs, how, *one)
    by_products = beam_fits(comp.products, how, *other)
    same = np.abs(by_samples - by_products) < 1e-3 * by_samples
    assert same.mean() > 0.7  # a narrow valley may hold some of either up
    np.testing.assert_allclose(other[1][same], one[1][same], atol=2e-3)


def test_a_scan_finds_the_heading_flown():
    case = random_case((4,), 3, 40.0)
    comp = _compressed(case)
    state = truth_fit(case).state
    alpha = np.log(case.amplitude / np.pi / comp.sigma)
    headings = np.arange(64) * (2.0 * np.pi / 64)
    start = np.stack([np.cos(state.theta[0]), np.sin(state.theta[0])])[None] * case.flight.legs[0].length_m
    found, cost = scan_heading(comp.products, 1, start, case.position_m[None], alpha[None], headings, False)
    assert abs(np.angle(np.exp(1j * (found[0, 0] - case.heading_rad[1])))) <= np.pi / 64
    assert cost[0, 0] < cost[0, 1]


def test_a_corner_fit_lowers_the_cost_of_its_two_legs():
    case = random_case((5,), 2, 40.0)
    comp = _compressed(case)
    corner = np.array([case.flight.legs[0].length_m, 0.0])
    off = case.position_m - corner
    to = case.heading_rad[1]
    u, w = off[:, 0], off @ np.array([np.cos(to), np.sin(to)])
    v = np.log(case.amplitude / np.pi / comp.sigma) - (off**2).sum(axis=1)
    truth = np.stack([u, v, w], axis=1)
    starts = truth + 0.05 * np.random.default_rng(5).standard_normal((9, 2, 3))
    costs = corner_fits(comp.products, 0, starts, 1.0, 40)
    assert costs.max() < 60.0  # two legs of 13 numbers each, and what the weak prior keeps away from the optimum
    np.testing.assert_allclose(starts, np.broadcast_to(truth, starts.shape), atol=0.3)


@pytest.mark.parametrize("k_sources", [2, 4])
def test_threads_change_no_bit(k_sources):
    comp = _compressed(random_case((6,), k_sources, 20.0))
    one, two, again = (search(comp, k_sources, np.random.default_rng(1), threads=n) for n in (1, 2, 2))
    for other in (two, again):
        assert other.rounds == one.rounds
        for a, b in ((one.theta, other.theta), (one.s, other.s), (one.alpha, other.alpha), (one.cost, other.cost)):
            np.testing.assert_array_equal(a, b)


def test_a_certain_answer_takes_one_pair_of_rounds():
    case = random_case((8,), 3, 40.0)
    modes = search(_compressed(case), 3, np.random.default_rng(1))
    assert modes.rounds == 2
    assert len(modes) == 1
    assert (
        np.abs(modes.s[0][np.argsort(modes.s[0][:, 0])] - case.position_m[np.argsort(case.position_m[:, 0])]).max()
        < 0.1
    )
