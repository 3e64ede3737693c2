"""The joint residual against the field it is meant to be, and its Jacobian against differences."""

import numpy as np
import pytest
from random_scenes import random_case

from dslam_mav import Medium
from dslam_mav.dslam.field import field, squared_spread_m2
from dslam_mav.dslam.fit import moved
from dslam_mav.dslam.joint import evaluate, residual_of
from dslam_mav.dslam.priors import Priors, constrained
from dslam_mav.dslam.problem import State, parameter_names, problem, vertices

MEDIA = [
    Medium(spread_m=1.3, static=True),
    Medium(static=True, ambient=None),
    Medium(diffusivity_m2_s=0.02, activation_s=-15.0, ambient=None),
    Medium(diffusivity_m2_s=0.02),
    Medium(activation_s=-15.0, ambient=1.0),
    Medium(ambient=None),
]


def _state(prob, seed=0):
    rng = np.random.default_rng(seed)
    log_age = np.log(prob.age_s) if prob.age_s is not None else np.log(17.0)
    log_c = np.log(prob.spread2) if prob.spread2 is not None else 0.2
    if prob.evolution == "age":
        log_c = float(np.log(4.0 * prob.diffusivity) + log_age)
    theta = np.concatenate([[0.0], rng.normal(size=prob.length.size - 1)])
    ambient = 0.4 if prob.ambient is None else prob.ambient
    return State(theta, rng.normal(size=(3, 2)), 4.0 + rng.normal(size=3), float(log_c), float(log_age), ambient, 0.3)


@pytest.mark.parametrize("medium", MEDIA)
def test_the_residual_is_the_field_less_the_readings(medium):
    case = random_case((1,), 2, 20.0, readings_per_leg=20)
    prob = problem(case.flight, medium)
    state = _state(prob)
    corners = vertices(state.theta, prob.length)
    heading = state.theta[prob.leg]
    places = corners[prob.leg] + prob.s[:, None] * np.stack([np.cos(heading), np.sin(heading)], axis=1)
    if medium.static:
        c = np.full((prob.t.size, 1), np.exp(state.log_spread2))
    else:
        age = np.exp(state.log_age)
        c = squared_spread_m2(prob.t[:, None], np.exp(state.log_spread2) / (4.0 * age), -age)
    expected = field(places, c, state.s, np.exp(state.log_amplitude)) + state.ambient - prob.y
    np.testing.assert_allclose(residual_of(prob, state), expected, rtol=1e-10, atol=1e-10)


@pytest.mark.parametrize("medium", MEDIA)
@pytest.mark.parametrize("known", ["nothing", "headings", "closed"])
def test_the_jacobian_is_the_derivative(medium, known):
    case = random_case((2,), 2, 20.0, readings_per_leg=20)
    prob = problem(case.flight, medium)
    if known == "headings":
        prob = constrained(prob, Priors(np.linspace(0.0, 5.0, 7), 0.1), 0.5)
    elif known == "closed":
        prob = constrained(prob, Priors(closed_sd_m=0.2), 0.5)
    state = _state(prob, 3)
    residual, jacobian = evaluate(prob, state)
    np.testing.assert_array_equal(residual, residual_of(prob, state))
    assert jacobian.shape == (residual.size, len(parameter_names(prob, 3)))
    step = 1e-6
    for i in range(jacobian.shape[1]):
        direction = np.zeros(jacobian.shape[1])
        direction[i] = step
        ahead = residual_of(prob, moved(prob, state, direction))
        behind = residual_of(prob, moved(prob, state, -direction))
        np.testing.assert_allclose((ahead - behind) / (2.0 * step), jacobian[:, i], atol=2e-7 * np.abs(jacobian).max())


def test_parameters_are_named_in_order():
    prob = problem(random_case((1,), 2, 20.0).flight, Medium(ambient=None))
    names = parameter_names(prob, 2)
    assert names[:2] == ("heading of leg 2", "heading of leg 3")
    assert names[6:12] == ("source 1 x", "source 1 y", "source 2 x", "source 2 y", "ln amplitude 1", "ln amplitude 2")
    assert names[12:] == ("ln C", "ln age", "ambient")
