"""Appendices A and B, Remark 4: centres and heights of one leg, against the sum of Gaussians they were made from."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dslam_mav.dslam.paper import fri, prony, samples
from dslam_mav.dslam.paper.options import PaperOptions

AUTO = PaperOptions()
Y, A, LENGTH = np.array([0.6, 1.9, 3.4]), np.array([1.0, 0.4, 0.7]), 4.0


def leg(s, y=Y, a=A, c=1.0, options=AUTO, noise=0.0, rng=None, length=LENGTH):
    reading = np.exp(-((s[:, None] - y) ** 2) / c) @ a
    if noise:
        reading = reading + noise * rng.standard_normal(s.size)
    return fri.view(s, reading, length, c, options)


EVEN = np.linspace(0.0, LENGTH, 64, endpoint=False)


@pytest.mark.parametrize("solver", ["annihilating", "tls", "pencil"])
def test_nodes_of_a_power_sum_are_its_exponentials(solver):
    u = np.exp(1j * np.array([-1.1, 0.2, 0.9]))
    s = (u[:, None] ** np.arange(12)).T @ np.array([1.0, 2.0, -0.5])
    width = 6 if solver == "pencil" else 4
    found = prony.nodes(prony.toeplitz_matrix(s, width), 3, solver)
    assert np.sort(np.angle(found)) == pytest.approx([-1.1, 0.2, 0.9], abs=1e-9)


def test_cadzow_brings_noisy_samples_nearer_to_the_clean_ones():
    rng = np.random.default_rng(1)
    clean = np.exp(1j * np.outer(np.arange(31), [-0.9, 0.4])) @ np.array([1.0, 0.6])
    noisy = clean + 0.05 * (rng.standard_normal(31) + 1j * rng.standard_normal(31))
    assert np.linalg.norm(prony.cadzow(noisy, 2, 15) - clean) < 0.6 * np.linalg.norm(noisy - clean)


def test_exact_samples_are_powers_of_the_centres_exponentials():
    weighted, origin = samples.exact(EVEN, leg(EVEN).reading, 1.0)
    step = EVEN[1] - EVEN[0]
    u, b = np.exp(2.0 * step * (Y - origin)), A * np.exp(-((Y - origin) ** 2) + 2.0 * (EVEN[0] - origin) * (Y - origin))
    assert weighted == pytest.approx((u[None, :] ** np.arange(64)[:, None]) @ b, rel=1e-12)


def test_robust_weights_reproduce_exponentials_on_uneven_distances():
    rng = np.random.default_rng(2)
    s = np.sort(rng.uniform(0.0, LENGTH, 80))
    omega = np.linspace(-3.0, 3.0, 9)
    found = samples.robust(s, leg(s).reading, samples.span(s, 1.0, (-1.0, 5.0)), omega, 1e-12)
    assert np.abs(found.samples - np.exp(1j * np.outer(omega, Y - found.origin)) @ A).max() < 1e-4


@pytest.mark.parametrize("solver", ["annihilating", "tls", "pencil"])
@pytest.mark.parametrize(("kind", "within"), [("exact", 1e-12), ("auto", 1e-12), ("robust", 1e-3)])
def test_a_clean_legs_centres_and_heights(kind, within, solver):
    options = PaperOptions(samples=kind, solver=solver)
    found = fri.centres(leg(EVEN, options=options), 3, options)
    assert found.fit.gaussians.y == pytest.approx(Y, abs=within)
    assert found.fit.gaussians.a == pytest.approx(A, abs=10.0 * within)


def test_uneven_distances_are_read_with_robust_samples_and_said_so():
    rng = np.random.default_rng(3)
    s = np.sort(rng.uniform(0.0, LENGTH, 64))
    for polish, how in ((False, "robust"), (True, "logarithms")):
        found = fri.centres(leg(s), 3, PaperOptions(samples="exact", polish=polish))
        assert found.how == how
        assert found.fit.gaussians.y == pytest.approx(Y, abs=1e-11)


@pytest.mark.parametrize("faint", [1e-3, 1e-6, 1e-9])
def test_polished_centres_of_a_faint_source_are_known_to_its_condition(faint):
    """A fit to the readings themselves loses the source at 1e-9; in logarithms its tail at the leg's end holds it."""
    y, a = np.array([0.4, 2.9, 4.0]), np.array([faint, 0.6, 1.0])
    found = fri.centres(leg(EVEN, y=y, a=a), 3, PaperOptions())
    assert found.how == "logarithms"
    assert np.abs(found.fit.gaussians.y - y).max() < 1e-14 * max(found.fit.condition, 1.0)
    plain = fri.centres(leg(EVEN, y=y, a=a), 3, PaperOptions(polish=False))
    assert plain.fit.condition > 30.0 * found.fit.condition


def test_a_known_ambient_levels_rounding_is_not_taken_for_readings():
    reading = leg(EVEN).reading
    view = fri.view(EVEN, (reading + 3.0) - 3.0, LENGTH, 1.0, PaperOptions(), 3.0)
    assert fri.centres(view, 3, PaperOptions()).fit.gaussians.y == pytest.approx(Y, abs=1e-10)


def test_centres_beyond_the_legs_ends_are_found_within_the_margin():
    y = np.array([-0.7, 1.6, 4.6])
    found = fri.centres(leg(EVEN, y=y), 3, PaperOptions(fit_margin=1.0))
    assert found.fit.gaussians.y == pytest.approx(y, abs=1e-10)


def test_under_noise_centres_are_off_by_what_their_covariance_says():
    rng = np.random.default_rng(4)
    nees = []
    for _ in range(30):
        found = fri.centres(leg(EVEN, noise=0.01, rng=rng), 3, PaperOptions())
        g = found.fit.gaussians
        off = np.concatenate((g.y - Y, g.a - A))
        nees.append(off @ np.linalg.solve(found.fit.covariance * found.variance, off) / 6.0)
    assert 0.65 < np.mean(nees) < 1.5


def test_the_condition_is_the_centres_error_over_the_noise():
    rng = np.random.default_rng(5)
    near = leg(EVEN, y=np.array([1.5, 2.2]), a=np.array([1.0, 0.8]))
    condition = fri.centres(near, 2, PaperOptions(polish=False)).fit.condition
    noise = 1e-5
    off = []
    for _ in range(40):
        noisy = leg(EVEN, y=np.array([1.5, 2.2]), a=np.array([1.0, 0.8]), noise=noise * near.largest, rng=rng)
        off.append(fri.centres(noisy, 2, PaperOptions()).fit.gaussians.y - [1.5, 2.2])
    assert np.sqrt(np.mean(np.square(off), axis=0)).max() / noise == pytest.approx(condition, rel=0.3)


@pytest.mark.parametrize("k", [1, 2, 3, 4])
@pytest.mark.parametrize(("noise", "right"), [(0.0, 20), (1e-4, 18)])
def test_the_rank_counts_sources(k, noise, right):
    rng = np.random.default_rng(6)
    counts = []
    for _ in range(20):
        y = 0.5 + 1.3 * np.arange(k) + rng.uniform(-0.15, 0.15, k)
        length = 1.3 * k + 0.5
        s = np.linspace(0.0, length, 64, endpoint=False)
        view = leg(s, y, 10.0 ** rng.uniform(-1.0, 0.0, k), noise=noise, rng=rng, length=length)
        counts.append(fri.count_on(view, 5, PaperOptions()))
    assert counts.count(k) >= right


def test_a_leg_without_a_reading_says_so():
    view = fri.view(EVEN, np.zeros(64), LENGTH, 1.0, PaperOptions())
    assert fri.count_on(view, 5, PaperOptions()) == 0
    assert "ambient" in fri.centres(view, 2, PaperOptions())
    assert "Prony needs 6" in fri.centres(leg(EVEN[:5]), 3, PaperOptions())


@settings(max_examples=25, deadline=None)
@given(st.floats(-0.4, 0.4), st.floats(0.3, 3.0), st.floats(-12.0, 12.0))
def test_centres_move_with_the_leg_and_scale_with_its_unit(shift, scale, decades):
    unit, gain = scale, 10.0**decades
    y = (Y + shift) * unit
    found = fri.centres(leg(EVEN * unit, y, A * gain, c=unit**2, length=LENGTH * unit), 3, PaperOptions())
    assert found.fit.gaussians.y == pytest.approx(y, rel=1e-9)
    assert found.fit.gaussians.a == pytest.approx(A * gain, rel=1e-9)
