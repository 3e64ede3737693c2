"""IV-C, Table I rows 4 and 5: flights along curves."""

from __future__ import annotations

import numpy as np
import pytest
from paper_scenes import pairwise_distances

from dslam_mav import Flight, Medium, Verdict
from dslam_mav.dslam.paper.method import estimate_by_paper
from dslam_mav.records import ParametricPath

T = np.linspace(0.0, 1.0, 400)
BASIS = np.column_stack((np.sin(2 * np.pi * T), np.cos(4 * np.pi * T) - 1.0, T))
TRUE = np.array([[3.0, 0.0], [1.0, 3.0], [6.0, 4.0]])
PLACES = BASIS @ TRUE
SOURCES = np.array([PLACES[60] + [0.5, -0.7], PLACES[330] + [-0.6, 0.5]])
AMPLITUDE = np.array([100.0, 60.0])
STATIC = Medium(spread_m=1.0, static=True)


def flown(basis, places, sources=SOURCES, amplitude=AMPLITUDE, unit=1.0, noise=0.0):
    away2 = ((places[:, None] - sources) ** 2).sum(axis=2)
    reading = (amplitude / np.pi * np.exp(-away2)).sum(axis=1)
    reading = reading + noise * reading.max() * np.random.default_rng(1).standard_normal(len(reading))
    return Flight(parametric=ParametricPath(basis, 10.0 * T, reading))


def shape_error(places, sources):
    some = slice(None, None, 40)
    return np.abs(pairwise_distances(places[some], sources) - pairwise_distances(PLACES[some], SOURCES)).max()


@pytest.mark.parametrize("n_sources", [2, None])
def test_row_4_finds_path_and_sources(n_sources):
    result = estimate_by_paper(flown(BASIS, PLACES), STATIC, n_sources, 5)
    assert result.verdict is Verdict.IDENTIFIED
    assert shape_error(result.path.vertices_m, result.sources.position_m) < 1e-9
    assert result.sources.amplitude == pytest.approx(AMPLITUDE, rel=1e-9)
    assert result.path.vertices_m == pytest.approx(BASIS @ result.path.coefficients_m, abs=1e-9)
    assert np.abs(result.residual).max() < 1e-9
    step = result.path.vertices_m[1] - result.path.vertices_m[0]
    assert step[0] > 0.0
    assert step[1] == pytest.approx(0.0, abs=1e-9)


def test_a_constant_among_the_functions_shifts_the_path_to_begin_at_0():
    basis = np.column_stack((np.ones_like(T), BASIS))
    result = estimate_by_paper(flown(basis, PLACES + 50.0, SOURCES + 50.0), STATIC, 2, 5)
    assert result.path.vertices_m[0] == pytest.approx([0.0, 0.0], abs=1e-9)
    assert shape_error(result.path.vertices_m, result.sources.position_m) < 1e-9


def test_under_noise_the_error_is_the_noises():
    result = estimate_by_paper(flown(BASIS, PLACES, noise=0.003), STATIC, 2, 5)
    assert shape_error(result.path.vertices_m, result.sources.position_m) < 0.03
    assert result.noise_sd == pytest.approx(0.003 * flown(BASIS, PLACES).parametric.reading.max(), rel=0.15)


def test_row_5_tells_the_shape_but_no_scale():
    for medium in (Medium(static=True), Medium(diffusivity_m2_s=1.0, static=True)):
        result = estimate_by_paper(flown(BASIS, PLACES), medium, 2, 5)
        assert result.verdict is Verdict.NOT_IDENTIFIABLE
        assert "scale" in result.reason
        assert np.isnan(result.sources.position_m).all()
        shape = result.diagnostics["shape"]
        assert shape["unit"] == "√C"
        assert shape_error(shape["places"], shape["source"]) < 1e-9


def test_the_scale_of_row_5_changes_no_reading():
    """(c, S, C, a) → (λc, λS, λ²C, λ²a): the same readings, so the same shape; with C known, the answer times λ."""
    factor = 7.0
    wide = estimate_by_paper(flown(BASIS, PLACES), Medium(spread_m=factor, static=True), 2, 5)
    assert shape_error(wide.path.vertices_m / factor, wide.sources.position_m / factor) < 1e-9
    assert wide.sources.amplitude == pytest.approx(AMPLITUDE * factor**2, rel=1e-9)


def test_what_curves_do_not_tell_is_said():
    ellipse = np.column_stack((np.sin(2 * np.pi * T), np.cos(2 * np.pi * T)))
    places = ellipse @ np.array([[5.0, 0.0], [1.0, 5.0]])
    sources = np.array([places[60] + 0.5, places[330] - 0.5])
    result = estimate_by_paper(flown(ellipse, places, sources), STATIC, 2, 5)
    assert result.verdict is Verdict.NOT_IDENTIFIABLE
    assert "dependent" in result.reason
    line = BASIS @ np.array([[3.0, 0.0], [1.0, 0.0], [6.0, 0.0]])
    on_line = estimate_by_paper(flown(BASIS, line, line[[60]] + [0.0, 0.5], AMPLITUDE[:1]), STATIC, 1, 5)
    assert on_line.verdict is Verdict.NOT_IDENTIFIABLE
    assert "straight line" in on_line.reason or "dependent" in on_line.reason
    silent = Flight(parametric=ParametricPath(BASIS, T, np.zeros(400)))
    assert estimate_by_paper(silent, STATIC, 2, 5).verdict is Verdict.NOT_IDENTIFIABLE
    short = Flight(parametric=ParametricPath(BASIS[:6], T[:6], np.ones(6)))
    assert estimate_by_paper(short, STATIC, 2, 5).verdict is Verdict.TOO_FEW_DATA


def test_an_evolving_field_on_a_curve_is_misuse():
    with pytest.raises(ValueError, match=r"medium\.static"):
        estimate_by_paper(flown(BASIS, PLACES), Medium(diffusivity_m2_s=1.0, activation_s=-1.0), 2, 5)
