"""The joint residual against the field it is meant to be, and its Jacobian against differences, in every case."""

from dataclasses import replace

import numpy as np
import pytest
from random_scenes import random_case

from dslam_mav import Flight, Leg, Medium, ParametricPath
from dslam_mav.dslam.field import field, squared_spread_m2
from dslam_mav.dslam.joint import evaluate, residual_of
from dslam_mav.dslam.path import places, vertices
from dslam_mav.dslam.problem import Known, problem
from dslam_mav.dslam.state import State, layout, moved, parameter_names

MEDIA = {
    "spread known": Medium(spread_m=1.3, static=True),
    "static, spread and ambient unknown": Medium(static=True, ambient=None),
    "static, one activation each": Medium(diffusivity_m2_s=0.02, static=True),
    "evolving, all known": Medium(diffusivity_m2_s=0.02, activation_s=-15.0, ambient=None),
    "evolving, activations known": Medium(diffusivity_m2_s=0.02, activation_s=(-15.0, -9.0, -20.0)),
    "evolving, one activation unknown": Medium(diffusivity_m2_s=0.02, activation_s="shared"),
    "evolving, one activation each": Medium(diffusivity_m2_s=0.02),
    "evolving, diffusivity unknown": Medium(activation_s=-15.0, ambient=1.0),
    "evolving, nothing known": Medium(ambient=None),
    "drifting": Medium(spread_m=1.3, static=True, ambient=None, ambient_drift_per_s=None),
    "slow sensor": Medium(spread_m=1.3, static=True, sensor_lag_s=0.3),
    "sensor of unknown lag": Medium(diffusivity_m2_s=0.02, activation_s="shared", ambient=None, sensor_lag_s=None),
}
K = 3


def _flight(kind):
    flight = random_case((2,), 2, 20.0, readings_per_leg=20).flight
    if kind == "parametric":
        rng = np.random.default_rng(5)
        t = np.linspace(0.0, 20.0, 60)
        return Flight(parametric=ParametricPath(np.stack([t**0, t, np.sin(t), np.cos(0.3 * t)], 1), t, rng.random(60)))
    if kind == "climbs known":
        return Flight(tuple(replace(leg, rise_m=0.3 * (-1) ** j) for j, leg in enumerate(flight.legs)))
    return flight


def _state(prob, seed=0):
    rng = np.random.default_rng(seed)
    d, n_legs = prob.dimensions, prob.n_legs
    log_c = rng.normal(size=K) * 0.1 if prob.spread2 is None else np.broadcast_to(np.log(prob.spread2), K)
    log_rate = -1.0 if prob.rate is None else float(np.log(prob.rate)) if prob.rate else -np.inf
    theta = np.concatenate([[0.0], rng.normal(size=max(n_legs - 1, 0))])[:n_legs]
    climb = np.zeros(n_legs)
    if d == 3 and prob.rise is None:
        climb[2:] = rng.normal(size=max(n_legs - 2, 0)) * 0.4
    elif d == 3:
        climb = np.arcsin(prob.rise / prob.length)
    return State(
        theta=theta, s=rng.normal(size=(K, d)), log_amplitude=4.0 + rng.normal(size=K), log_spread2=np.array(log_c),
        log_rate=log_rate, ambient=0.4 if prob.ambient is None else prob.ambient, climb=climb,
        longer=np.zeros(n_legs), gap=0.1 * rng.normal(size=(n_legs, d)),
        coefficients=rng.normal(size=(0 if prob.basis is None else prob.basis.shape[1], d)),
        drift=0.02 if prob.drift is None else 0.0,
        extent=0.1 if prob.extent is None else prob.extent, turn=0.3, shift=rng.normal(size=d),
        log_lag=-1.0 if prob.lag is None else float(np.log(prob.lag)) if prob.lag else -np.inf,
    )  # fmt: skip


@pytest.mark.parametrize("medium", list(MEDIA.values())[:10], ids=list(MEDIA)[:10])
def test_the_residual_is_the_field_less_the_readings(medium):
    prob = problem(_flight("legs"), medium)
    state = _state(prob)
    corners = vertices(state.theta, prob.length) + np.vstack([np.zeros(2), np.cumsum(state.gap, axis=0)])
    heading = state.theta[prob.leg]
    where = corners[prob.leg] + prob.s[:, None] * np.stack([np.cos(heading), np.sin(heading)], axis=1)
    c = np.exp(state.log_spread2)[None, :] + np.exp(state.log_rate) * prob.t[:, None]
    if isinstance(medium.activation_s, tuple):
        c = squared_spread_m2(prob.t[:, None], 0.02, np.array(medium.activation_s))
    level = state.ambient + state.drift * prob.t
    expected = field(where, c, state.s, np.exp(state.log_amplitude)) + level - prob.y
    np.testing.assert_allclose(residual_of(prob, state), expected, rtol=1e-10, atol=1e-10)


def test_space_is_seen_through_every_climb():
    prob = problem(_flight("climbs known"), Medium(spread_m=1.0, static=True, dimensions=3))
    state = _state(prob)
    where = places(prob, state)
    assert where[0] == pytest.approx([0.0, 0.0, 0.0])
    last = prob.leg == 6
    climbed = prob.rise[:6].sum() + state.gap[:6, 2].sum() + prob.s[last] * prob.rise[6] / prob.length[6]
    np.testing.assert_allclose(where[last, 2], climbed, atol=1e-12)
    expected = field(where, 1.0, state.s, np.exp(state.log_amplitude)) - prob.y
    np.testing.assert_allclose(residual_of(prob, state), expected, rtol=1e-10, atol=1e-10)


def test_a_slow_sensor_settles_on_a_step_as_an_exponential():
    t = np.linspace(0.0, 5.0, 400)
    s = np.where(t < 1.0, 60.0, 0.0)  # far away, then all at once at the source
    leg = Leg(1.0, s, t, np.zeros(400))
    prob = problem(Flight((leg,)), Medium(spread_m=1.0, static=True, sensor_lag_s=0.5))
    state = replace(
        _state(prob), s=np.zeros((1, 2)), log_amplitude=np.log([np.pi]), log_spread2=np.zeros(1), theta=np.zeros(1)
    )
    seen = residual_of(prob, state)
    np.testing.assert_allclose(seen[t < 0.98], 0.0, atol=1e-12)
    np.testing.assert_allclose(seen[t > 1.1], 1.0 - np.exp(-(t[t > 1.1] - 1.0) / 0.5), atol=0.03)


def _knowing(prob, known):
    headings = (np.linspace(0.0, 5.0, prob.n_legs), 0.2)
    corners = max(prob.n_legs - 1, 0)
    points = (np.array([0, 2, 5]), np.arange(3.0 * prob.dimensions).reshape(3, -1), 0.3)
    kinds = {
        "nothing": Known(),
        "headings": Known(heading=headings),
        "ambient": Known(ambient=(0.3, 0.2)),
        "closed": Known(closed_sd=0.4),
        "points": Known(points=points),
        "lengths": Known(length_sd=np.where(np.arange(prob.n_legs) % 2, 0.1, 0.0)),
        "corners": Known(corner_sd=np.where(np.arange(corners) % 3, 0.1, 0.0), closed_sd=0.4),
        "beside": Known(corner_sd=np.full(corners, 0.1), beside=np.linspace(-0.3, 0.4, corners)),
        "strengths": Known(peak=(1e-3, 0.7), age=(1e-3, 2.0), lag=(0.2, 0.5)),
    }
    return replace(prob, known=kinds[known])


CASES = [
    *(("legs", medium, "nothing") for medium in MEDIA),
    *(("legs", "evolving, nothing known", known)
      for known in ("headings", "closed", "points", "lengths", "corners", "beside", "ambient", "strengths")),
    *((kind, medium, known) for kind in ("parametric", "climbs known", "climbs free")
      for medium, known in (("spread known", "points"), ("evolving, one activation each", "closed"))),
    ("climbs free", "spread known", "corners"),
    ("climbs known", "spread known", "beside"),
]  # fmt: skip


@pytest.mark.parametrize("extent", [0.0, None])
@pytest.mark.parametrize(("kind", "medium", "known"), CASES)
def test_the_jacobian_is_the_derivative(kind, medium, known, extent):
    in_space = 3 if kind.startswith("climbs") else 2
    prob = _knowing(problem(_flight(kind), replace(MEDIA[medium], dimensions=in_space)), known)
    prob = replace(prob, extent=extent)
    state = _state(prob, 3)
    residual, jacobian = evaluate(prob, state)
    np.testing.assert_allclose(residual, residual_of(prob, state), rtol=1e-12, atol=1e-12)
    at = layout(prob, K)
    assert jacobian.shape == (residual.size, at.size) == (residual.size, len(parameter_names(prob, K)))
    step = 1e-6
    for i, name in enumerate(parameter_names(prob, K)):
        direction = np.zeros(at.size)
        direction[i] = step
        ahead = residual_of(prob, moved(prob, state, direction, at))
        behind = residual_of(prob, moved(prob, state, -direction, at))
        off = np.abs((ahead - behind) / (2.0 * step) - jacobian[:, i]).max()
        assert off < 3e-7 * max(np.abs(jacobian).max(), 1.0), name


def test_parameters_are_named_in_order():
    prob = problem(random_case((1,), 2, 20.0).flight, Medium(ambient=None))
    names = parameter_names(prob, 2)
    assert names[:2] == ("heading of leg 2", "heading of leg 3")
    assert names[6:12] == ("source 1 x", "source 1 y", "source 2 x", "source 2 y", "ln amplitude 1", "ln amplitude 2")
    assert names[12:] == ("ln C 1", "ln C 2", "ln diffusivity", "ambient")
