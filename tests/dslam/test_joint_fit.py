"""The joint fit: the compiled one does what the general one does, and both come to rest where valleys are flat."""

from dataclasses import replace

import numpy as np
import pytest
from random_scenes import random_case, truth_fit

from dslam_mav import Medium
from dslam_mav.dslam import fit as fitting
from dslam_mav.dslam.joint import evaluate
from dslam_mav.dslam.plain import compiled
from dslam_mav.dslam.problem import Known, problem
from dslam_mav.dslam.state import State, layout, moved, parameter_names

EVOLVING = {"age_over_flight": 2.0}
CASES = {
    "spread known": (Medium(spread_m=1.0, static=True), {}, Known()),
    "spread and ambient unknown": (Medium(static=True, ambient=None), {}, Known(peak=(20.0, 0.3))),
    "ages unknown": (Medium(ambient=None), EVOLVING, Known(peak=(20.0, 0.3), age=(30.0, 0.5))),
    "diffusivity unknown": (Medium(activation_s=-44.8), EVOLVING, Known()),
    "one age each": (Medium(diffusivity_m2_s=0.25 / 44.8), {**EVOLVING, "log_ages": 0.3}, Known(peak=(20.0, 0.3))),
}


def _begun(case, prob, seed=1):
    rng = np.random.default_rng(seed)
    turn = np.append(0.0, 0.05 * rng.standard_normal(case.heading_rad.size - 1))
    s = case.position_m + 0.05 * rng.standard_normal(case.position_m.shape)
    start = State.flat(prob, case.heading_rad - case.heading_rad[0] + turn, s, np.log(case.amplitude), 0.05)
    rate = 1.0 / case.age_s.mean() if prob.rate is None else prob.rate
    return replace(start, ambient=case.ambient, log_rate=float(np.log(rate)) if rate else -np.inf)


@pytest.mark.parametrize("iterations", [1, 4, 12])
@pytest.mark.parametrize("name", list(CASES))
def test_the_compiled_fit_goes_where_the_general_one_goes(name, iterations, monkeypatch):
    medium, scene, known = CASES[name]
    case = random_case((5, 1), 3, 20.0, medium=medium, ambient=4.0 if medium.ambient is None else 0.0, **scene)
    prob = replace(problem(case.flight, medium), known=known)
    start = _begun(case, prob)
    assert fitting.plain(prob)
    quick = fitting.fit(prob, start, iterations=iterations)
    monkeypatch.setattr(fitting, "plain", lambda _: False)
    general = fitting.fit(prob, start, iterations=iterations)
    assert quick.cost == pytest.approx(general.cost, rel=1e-9)
    assert quick.converged == general.converged
    np.testing.assert_allclose(quick.residual, general.residual, atol=1e-6)
    for part in ("theta", "s", "log_amplitude", "log_spread2"):
        np.testing.assert_allclose(getattr(quick.state, part), getattr(general.state, part), rtol=1e-7, atol=1e-7)


@pytest.mark.parametrize("name", list(CASES))
def test_the_compiled_model_is_the_joint_one(name):
    medium, scene, known = CASES[name]
    case = random_case((5, 2), 3, 20.0, medium=medium, ambient=4.0 if medium.ambient is None else 0.0, **scene)
    prob = replace(problem(case.flight, medium), known=known)
    state = _begun(case, prob)
    at = layout(prob, 3)
    there = compiled(prob, state)
    step = 0.01 * np.random.default_rng(3).standard_normal(at.size)
    got, wanted = there.evaluate(there.start + step), evaluate(prob, moved(prob, state, step, at), at)
    rows = prob.y.size
    np.testing.assert_allclose(got[0][:rows], wanted[0][:rows], rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(got[1][:rows], wanted[1][:rows], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(got[0] @ got[0], wanted[0] @ wanted[0], rtol=1e-10)  # the priors' rows may be others
    np.testing.assert_allclose(got[1].T @ got[0], wanted[1].T @ wanted[0], rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize("lengths_known", [True, False])
def test_a_fit_that_would_crawl_for_hundreds_of_steps_settles(lengths_known):
    """A leg that hardly sees anything: Σ r ∂²r is as large as JᵀJ along it."""
    case = random_case((31024, 2, 20), 2, 20.0, medium=Medium(static=True, ambient=None), ambient=20.0)
    prob = problem(case.flight, case.medium)
    if not lengths_known:
        prob = replace(prob, known=Known(length_sd=np.full(7, 1e-6)))
    start = State.flat(prob, case.heading_rad - case.heading_rad[0], case.position_m, np.log(case.amplitude), 0.0)
    crawling = fitting.fit(prob, replace(start, ambient=20.0))
    found = fitting.settled(prob, crawling)
    assert not crawling.converged
    assert found.converged
    residual, jacobian = evaluate(prob, found.state)
    slope = jacobian.T @ residual / np.linalg.norm(jacobian, axis=0) / np.linalg.norm(residual)
    assert len(slope) == len(parameter_names(prob, 2))
    assert np.abs(slope).max() < 1e-3
    assert found.cost < crawling.cost
    assert found.cost <= truth_fit(case).cost * (1.0 + 1e-6)
