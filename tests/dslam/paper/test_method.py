"""The paper's method from readings to estimate: exactness without noise, every verdict, units, misuse."""

from __future__ import annotations

import numpy as np
import pytest
from paper_scenes import best_error, clear_scene, fly, pairwise_distances, projections, seen_error

from dslam_mav import Flight, Leg, Medium, Verdict
from dslam_mav.dslam.paper.method import estimate_by_paper
from dslam_mav.dslam.paper.options import PaperOptions
from dslam_mav.dslam.scoring import score
from dslam_mav.records import Truth
from missions.patterns import from_turns, star

STATIC = Medium(spread_m=1.0, static=True)
PATH = from_turns(np.full(4, 5.0), np.deg2rad([136.0, 151.0, 154.0]))
SOURCES, AMPLITUDE = np.array([[2.81, 1.24], [3.92, -0.45], [0.93, 2.7]]), np.array([100.0, 70.0, 150.0])


@pytest.mark.parametrize(
    ("k", "legs", "leg", "box", "scenes"), [(2, 3, 4.5, 2.0, 8), (2, 4, 4.5, 2.0, 8), (3, 3, 4.5, 2.0, 5)]
)
def test_without_noise_the_papers_errors_are_at_rounding(k, legs, leg, box, scenes):
    rng = np.random.default_rng(11)
    for _ in range(scenes):
        path, position, amplitude = clear_scene(rng, k, legs, leg, box)
        result = estimate_by_paper(fly(path, position, amplitude), STATIC, None, 5)
        assert result.verdict in (Verdict.IDENTIFIED, Verdict.AMBIGUOUS)
        shift = np.array([0.3, 0.4])  # the paper's errors divide by distances from the scene's origin
        truth = Truth(position + shift, amplitude, path + shift)
        errors = [score(e, truth) for e in (result, *result.alternatives)]
        best = min(errors, key=lambda s: s.paper_sources)
        assert max(best.paper_sources, best.paper_lines, best.paper_amplitudes) <= 1e-9


@pytest.mark.parametrize(
    "places",
    [
        [[1.83, -1.61], [-0.24, -1.75], [0.97, 1.09], [-1.54, 1.35]],
        [[0.79, -1.55], [1.85, 2.23], [-1.49, -1.5], [-0.46, 2.04], [-2.29, 1.93]],
    ],
)
def test_four_and_five_sources_lose_no_more_than_their_legs_do(places):
    path = from_turns(np.full(3, 9.0), np.deg2rad([120.0, 120.0]))
    position = path[:3].mean(axis=0) + np.array(places)
    amplitude = 40.0 * 3.0 ** np.linspace(0.0, 1.0, len(places))
    result = estimate_by_paper(fly(path, position, amplitude, n=128), STATIC, len(places), 5)
    lost = result.diagnostics["conditioning"]["digits_lost"]
    assert lost < 12.5
    assert seen_error(result, path, position, amplitude) < 10.0 ** (lost - 15.0)


def test_in_space_with_four_sources_and_six_legs():
    path = [[0.9, -3.3, -0.2], [-3.0, -0.4, -1.5], [2.9, -1.4, -1.1], [0.9, 3.3, -0.2], [1.7, -2.9, 0.1], [1, 1.4, -3]]
    path = np.array([*path, [2.7, 1.8, 0.9]])
    position = np.array([[1.5, -1.6, 0.2], [-1.7, -0.2, -1.4], [1.2, -0.4, -1.4], [1.0, 1.6, -0.5]])
    amplitude = [100.0, 80.0, 120.0, 60.0]
    medium = Medium(spread_m=1.0, static=True, dimensions=3)
    result = estimate_by_paper(fly(path, position, amplitude), medium, 4, 5)
    lost = result.diagnostics["conditioning"]["digits_lost"]
    assert result.verdict is Verdict.IDENTIFIED
    assert lost < 8.0
    assert seen_error(result, path, position, amplitude) < 1e-7


def test_the_loss_of_the_legs_is_reported():
    """A source that is faint on a leg costs its centre digits there, and the estimate says how many."""
    far = SOURCES + np.array([[0.0, 0.0], [0.0, -2.3], [0.0, 0.0]])
    plain = PaperOptions(polish=False)
    near, away = (estimate_by_paper(fly(PATH, s, AMPLITUDE), STATIC, 3, 5, plain) for s in (SOURCES, far))
    lost = [e.diagnostics["conditioning"]["digits_lost"] for e in (near, away)]
    assert lost[1] > lost[0] + 1.5
    assert "digits" not in near.reason
    faint = fly(PATH, SOURCES, AMPLITUDE * [1.0, 1e-7, 1.0])
    assert "digits" in estimate_by_paper(faint, STATIC, 3, 5, plain).reason
    mended = estimate_by_paper(faint, STATIC, 3, 5)
    assert mended.diagnostics["rounded"]
    assert seen_error(mended, PATH, SOURCES, AMPLITUDE * [1.0, 1e-7, 1.0]) < 1e-6


@pytest.mark.parametrize(("k", "path"), [(3, star(7, 3, 10.0)), (3, star(5, 2, 10.0))])
def test_a_source_lost_on_some_legs_is_found_from_the_others(k, path):
    """Stars wide enough for centres ≥ 1 √C apart on every leg: some legs see a source ten digits below another."""
    rng, clear = np.random.default_rng(k), 0
    while clear < 1:
        position = path[:-1].mean(axis=0) + rng.uniform(-5.0, 5.0, (k, 2))
        y = np.sort(projections(path, position, np.ones(k)).y, axis=0)
        if np.diff(y, axis=0).min() < 1.0 or y.min() < 0.0 or y.max() > 10.0:
            continue
        clear += 1
        amplitude = 20.0 * 10.0 ** rng.random(k)
        result = estimate_by_paper(fly(path, position, amplitude), STATIC, None, 5)
        assert result.verdict is Verdict.IDENTIFIED
        assert seen_error(result, path, position, amplitude) < 1e-10


def test_the_missing_standard_deviations_are_said():
    result = estimate_by_paper(fly(PATH, SOURCES, AMPLITUDE), STATIC, 3, 5)
    assert np.isnan(result.position_covariance_m2).all()
    assert "no standard deviations" in result.reason


def test_three_legs_and_two_sources_give_every_solution_that_stands():
    path = from_turns(np.full(3, 4.5), np.deg2rad([140.0, 125.0]))
    rng = np.random.default_rng(13)
    seen = set()
    for _ in range(12):
        position = path.mean(axis=0) + rng.uniform(-1.5, 1.5, (2, 2))
        result = estimate_by_paper(fly(path, position, [100.0, 60.0]), STATIC, 2, 5)
        seen.add(result.verdict)
        assert best_error(result, path, position, [100.0, 60.0]) < 1e-6
        assert (result.verdict is Verdict.AMBIGUOUS) == (len(result.alternatives) > 0)
        assert all(np.abs(e.residual).max() < 1e-6 for e in (result, *result.alternatives))
    assert seen == {Verdict.IDENTIFIED, Verdict.AMBIGUOUS}


def test_one_source_needs_a_closed_path():
    path = star(5, 2, 4.0)
    position = path[:-1].mean(axis=0)[None] + 0.3
    flight = fly(path, position, [100.0])
    result = estimate_by_paper(flight, STATIC, 1, 5)
    assert result.verdict is Verdict.NOT_IDENTIFIABLE
    assert "open path" in result.reason
    assert np.isnan(result.sources.position_m).all()
    closed = estimate_by_paper(flight, STATIC, 1, 5, closed=True)
    assert best_error(closed, path, position, [100.0]) < 1e-9
    by_flight = estimate_by_paper(Flight(flight.legs, closed=True), STATIC, 1, 5)
    assert np.array_equal(by_flight.sources.position_m, closed.sources.position_m)


def test_a_closed_triangle_tells_how_well_the_centres_close():
    path = star(3, 1, 4.0)
    flight = fly(path, [[2.2, 1.1]], [100.0])
    result = estimate_by_paper(flight, STATIC, 1, 5, closed=True)
    assert seen_error(result, path, [[2.2, 1.1]], [100.0]) < 1e-11
    assert abs(result.diagnostics["closure_defect_m"]) < 1e-11


@pytest.mark.parametrize(("unit", "gain"), [(1e12, 1.0), (1e-12, 1e6), (3.0, 1e-12)])
def test_answers_scale_with_lengths_and_readings(unit, gain):
    base = fly(PATH, SOURCES, AMPLITUDE)
    legs = [Leg(x.length_m * unit, x.distance_m * unit, x.time_s, x.reading * gain) for x in base.legs]
    a = estimate_by_paper(base, STATIC, None, 5)
    b = estimate_by_paper(Flight(tuple(legs)), Medium(spread_m=unit, static=True), None, 5)
    assert b.verdict is a.verdict
    assert b.sources.position_m == pytest.approx(a.sources.position_m * unit, rel=1e-7)
    assert b.sources.amplitude == pytest.approx(a.sources.amplitude * unit**2 * gain, rel=1e-7)
    assert b.sources.peak_reading == pytest.approx(a.sources.peak_reading * gain, rel=1e-7)


def test_mu_and_tau_stand_for_the_spread_in_a_static_field():
    flight = fly(PATH, SOURCES, AMPLITUDE)
    first = flight.legs[0].time_s[0]
    a = estimate_by_paper(flight, STATIC, 3, 5)
    b = estimate_by_paper(flight, Medium(diffusivity_m2_s=0.125, activation_s=first - 2.0, static=True), 3, 5)
    assert b.sources.position_m == pytest.approx(a.sources.position_m)
    assert (b.sources.activation_s == first - 2.0).all()


def test_known_ambient_is_taken_off_and_residuals_are_measured_minus_model():
    base = fly(PATH, SOURCES, AMPLITUDE)
    legs = [Leg(x.length_m, x.distance_m, x.time_s, x.reading + 3.0) for x in base.legs]
    result = estimate_by_paper(Flight(tuple(legs)), Medium(spread_m=1.0, static=True, ambient=3.0), 3, 5)
    assert seen_error(result, PATH, SOURCES, AMPLITUDE) < 1e-8
    assert result.residual.shape == (base.n_readings,)
    bumped = list(base.legs)
    reading = bumped[1].reading.copy()
    reading[10] += 0.01
    bumped[1] = Leg(5.0, bumped[1].distance_m, bumped[1].time_s, reading)
    off = estimate_by_paper(Flight(tuple(bumped)), STATIC, 3, 5).residual
    assert int(np.argmax(np.abs(off[64:128]))) == 10
    assert off[74] > 0.0


def test_noise_sd_and_the_robust_way_under_noise():
    rng = np.random.default_rng(14)
    path = from_turns(np.full(4, 4.5), np.deg2rad([143.0, 106.0, 147.0]))
    position, amplitude = np.array([[2.22, 1.86], [0.56, 1.43]]), np.array([153.0, 91.0])
    errors = {}
    for name, options in {
        "auto": PaperOptions(),
        "robust": PaperOptions(samples="robust"),
        "pencil": PaperOptions(samples="robust", solver="pencil"),
    }.items():
        found = []
        for _ in range(6):
            flight = fly(path, position, amplitude, noise=1e-4, rng=rng)
            result = estimate_by_paper(flight, STATIC, 2, 5, options)
            found.append(best_error(result, path, position, amplitude))
        errors[name] = np.nanmedian(found)
    assert errors["auto"] < 0.05
    assert errors["robust"] < 1.0
    assert errors["pencil"] < 1.0


def test_readings_of_another_field_are_told():
    rng = np.random.default_rng(15)
    legs = [Leg(5.0, x.distance_m, x.time_s, rng.random(64)) for x in fly(PATH, SOURCES, AMPLITUDE).legs]
    result = estimate_by_paper(Flight(tuple(legs)), STATIC, 3, 5)
    assert result.verdict in (Verdict.NOT_CONVERGED, Verdict.MODEL_MISFIT)
    assert result.reason


def test_nothing_to_read_too_few_legs_too_few_readings():
    silent = [Leg(5.0, x.distance_m, x.time_s, 0.0 * x.reading) for x in fly(PATH, SOURCES, AMPLITUDE).legs]
    for k in (None, 2):
        assert estimate_by_paper(Flight(tuple(silent)), STATIC, k, 5).verdict is Verdict.NOT_IDENTIFIABLE
    few = estimate_by_paper(fly(PATH[:3], SOURCES, AMPLITUDE), STATIC, 3, 5)
    assert few.verdict is Verdict.TOO_FEW_DATA
    assert few.sources.position_m.shape == (3, 2)
    assert few.path.vertices_m.shape == (3, 2)
    assert estimate_by_paper(fly(PATH, SOURCES, AMPLITUDE, n=5), STATIC, 3, 5).verdict is Verdict.TOO_FEW_DATA
    flat = Medium(spread_m=1.0, static=True, dimensions=3)
    in_space = np.column_stack((PATH, np.zeros(5)))
    sources = np.column_stack((SOURCES, np.zeros(3)))
    result = estimate_by_paper(fly(in_space, sources, AMPLITUDE), flat, 3, 5)
    assert result.verdict is Verdict.NOT_IDENTIFIABLE
    assert "needs 4 sources and 6 legs" in result.reason


@pytest.mark.parametrize(
    ("medium", "kwargs", "named"),
    [
        (Medium(spread_m=1.0, static=True, ambient=None), {}, "medium.ambient"),
        (Medium(spread_m=1.0, static=True, sensor_lag_s=0.1), {}, "medium.sensor_lag_s"),
        (Medium(activation_s=-1.0), {}, "medium.diffusivity_m2_s"),
        (Medium(diffusivity_m2_s=1.0, activation_s=1e6), {}, "medium.activation_s"),
        (STATIC, {"n_sources": 0}, "n_sources"),
        (STATIC, {"max_sources": 0}, "max_sources"),
        (STATIC, {"known_points": {9: [0.0, 0.0], 0: [0.0, 0.0]}}, "known_points"),
        (STATIC, {"known_points": {0: [0.0, 0.0]}}, "known_points"),
    ],
)
def test_misuse_names_the_argument(medium, kwargs, named):
    arguments = {"n_sources": 3, "max_sources": 5, "known_points": None} | kwargs
    with pytest.raises(ValueError, match=named):
        estimate_by_paper(fly(PATH, SOURCES, AMPLITUDE), medium, **arguments)


@pytest.mark.parametrize(
    "wrong",
    [
        {"samples": "best"},
        {"solver": "fft"},
        {"omega_0": -1.0},
        {"fit_margin": -0.1},
        {"denoise": -1},
        {"separation_epsilon": 1.5},
        {"refine_points": "some"},
    ],
)
def test_wrong_options_are_named(wrong):
    with pytest.raises(ValueError, match=next(iter(wrong))):
        PaperOptions(**wrong)


def test_the_same_flight_has_the_same_answer_bit_for_bit():
    rng = np.random.default_rng(16)
    flight = fly(PATH, SOURCES, AMPLITUDE, noise=1e-4, rng=rng)
    a, b = (estimate_by_paper(flight, STATIC, 3, 5) for _ in range(2))
    assert np.array_equal(a.sources.position_m, b.sources.position_m)
    assert pairwise_distances(a.path.vertices_m).tobytes() == pairwise_distances(b.path.vertices_m).tobytes()
