"""Parametric paths (IV-C; Table I rows 4, 5): the start is found, and what cannot be known is said."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest

from dslam_mav import Flight, Medium, ParametricPath, estimate
from dslam_mav.dslam.align import to_canonical
from dslam_mav.dslam.curve import independent
from dslam_mav.dslam.field import field
from dslam_mav.records import Verdict

T = np.linspace(0.0, 1.0, 400, endpoint=False)
TURNS = 2.0 * np.pi * T
BASIS = np.stack([np.cos(TURNS), np.sin(TURNS), np.cos(3.0 * TURNS), np.sin(2.0 * TURNS)], axis=1)
SHAPE = np.array([[1.5, 0.2], [-0.3, 1.4], [0.6, -0.5], [0.4, 0.7]])
SOURCES = np.array([[0.9, 0.6], [-0.8, 0.4], [0.1, -1.1]])
KNOWN = Medium(spread_m=1.0, static=True)


def _flown(basis, shape, k_sources, seed=0):
    """At 40 dB; truth in the canonical gauge, where the path's own origin stays."""
    rng = np.random.default_rng(seed)
    path, sources = basis @ shape, SOURCES[:k_sources]
    clean = field(path, 1.0, sources, np.array([100.0, 70.0, 130.0])[:k_sources])
    sd = 0.01 * float(np.sqrt(np.mean(clean**2)))
    flight = Flight(parametric=ParametricPath(basis, 60.0 * T, clean + sd * rng.standard_normal(T.size)))
    return flight, sources @ to_canonical(path).rotation.T, sd


def _off(position, truth):
    orders = permutations(range(len(truth)))
    return min(float(np.linalg.norm(position[list(order)] - truth, axis=1).max()) for order in orders)


@pytest.mark.parametrize("k_sources", [2, 3])
def test_sources_beside_a_curve_are_found(k_sources):
    flight, truth, sd = _flown(BASIS, SHAPE, k_sources)
    result = estimate(flight, KNOWN, k_sources)
    assert result.verdict in (Verdict.IDENTIFIED, Verdict.AMBIGUOUS)
    assert 0.85 * sd < result.noise_sd < 1.15 * sd
    assert min(_off(e.sources.position_m, truth) for e in (result, *result.alternatives)) < 0.2
    assert result.path.coefficients_m.shape == (4, 2)
    np.testing.assert_allclose(BASIS @ result.path.coefficients_m, result.path.vertices_m, atol=1e-9)


def test_an_unknown_spread_leaves_the_size_open():
    flight, _, sd = _flown(BASIS, SHAPE, 2)
    result = estimate(flight, Medium(static=True), 2)
    assert result.verdict is Verdict.NOT_IDENTIFIABLE
    assert np.isnan(result.sources.position_m).all()
    assert "up to scale" in result.reason
    assert any("scale" in words for words in result.unseen_directions)
    assert 0.85 * sd < result.noise_sd < 1.15 * sd  # the shape itself is found
    assert result.diagnostics["shape"]["source"].shape == (2, 2)


@pytest.mark.parametrize(
    "basis",
    [BASIS[:, :2], T[:, None] - 0.5, np.stack([T**0, T, T**2], axis=1), BASIS[:, [0, 1, 0]]],
    ids=["an ellipse", "a line", "a parabola", "a function twice"],
)
def test_functions_whose_products_are_dependent_get_a_verdict(basis):
    flight, _, _ = _flown(basis, SHAPE[: basis.shape[1]], 1)
    result = estimate(flight, KNOWN, 1)
    assert result.verdict is Verdict.NOT_IDENTIFIABLE
    assert np.isnan(result.sources.position_m).all()
    assert result.unseen_directions


def test_reduced_functions_make_the_same_paths_up_to_a_shift():
    basis = np.column_stack([BASIS, np.ones(T.size), BASIS[:, 0] - BASIS[:, 1]])
    functions, made_of = independent(basis)
    assert functions.shape == (T.size, 4)
    np.testing.assert_allclose((basis - basis[0]) @ made_of, functions, atol=1e-9)
