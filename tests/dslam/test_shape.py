"""Sources that are no Gaussians: the ± of an answer counts what their shape does to it."""

from __future__ import annotations

import numpy as np
from random_scenes import random_case

from dslam_mav import Medium
from dslam_mav.dslam.joint import evaluate
from dslam_mav.dslam.problem import problem
from dslam_mav.dslam.shape import SHARE, misshapen, moved_by_shape
from dslam_mav.dslam.state import State, layout

MEDIUM = Medium(spread_m=1.0, static=True)


def test_the_covariance_is_that_of_answers_moved_by_random_shapes() -> None:
    case = random_case((3, 2), 2, 40.0)
    prob = problem(case.flight, MEDIUM)
    state = State.flat(prob, case.heading_rad, case.position_m, np.log(case.amplitude), 0.0)
    jacobian = evaluate(prob, state, layout(prob, 2))[1]
    shapes = misshapen(prob, state)
    inverse = np.linalg.inv(jacobian.T @ jacobian)
    told = moved_by_shape(jacobian, inverse, shapes, energy=1.0) / SHARE

    rng = np.random.default_rng(0)
    added = shapes @ rng.standard_normal((shapes.shape[1], 20_000))
    moves = np.linalg.lstsq(jacobian, added, rcond=None)[0]
    left = ((added - jacobian @ moves) ** 2).sum(axis=0).mean()
    np.testing.assert_allclose(np.diag(told), (moves**2).mean(axis=1) / left, rtol=0.1)


def test_a_known_source_reads_as_its_first_order_term() -> None:
    """The terms are derivatives of the source: of first order, what a shift of it does to the readings."""
    case = random_case((5, 1), 1, 40.0)
    prob = problem(case.flight, MEDIUM)
    state = State.flat(prob, case.heading_rad, case.position_m, np.log(case.amplitude), 0.0)
    jacobian = evaluate(prob, state, layout(prob, 1))[1]
    by_shift = jacobian[: prob.y.size, layout(prob, 1).place]
    first = misshapen(prob, state)
    for axis in range(2):
        alike = [abs(np.corrcoef(column, by_shift[:, axis])[0, 1]) for column in first.T]
        assert max(alike) > 1.0 - 1e-12
