"""Starts of the fit with all that is known: the search's answers turned, shifted and mirrored into the known frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from dslam_mav.dslam.path import corners, vertices
from dslam_mav.dslam.priors import Priors
from dslam_mav.dslam.problem import Problem
from dslam_mav.dslam.state import State

RESTARTS = 40  # of one source


def both_sides(prob: Problem, states: Sequence[State]) -> list[State]:
    """Every answer and its mirror image, turned and shifted to where it agrees best with what is known of the frame.

    Readings alone do not tell left from right, so that the search's canonical gauge may be the wrong one of the two.
    """
    known = prob.known
    if known.heading is None and known.points is None:
        return list(states)
    out = []
    for state in states:
        for side in (1.0, -1.0):
            theta, sides = side * state.theta, np.ones(prob.dimensions)
            sides[1] = side
            there = replace(
                state, theta=theta, s=state.s * sides, gap=state.gap * sides, coefficients=state.coefficients * sides
            )
            if known.heading is not None:
                off = known.heading[0] - theta
                there = replace(there, turn=float(np.arctan2(np.sin(off).sum(), np.cos(off).sum())))
            if known.points is not None:
                there = _onto_points(prob, there)
            out.append(there)
    return out


def _onto_points(prob: Problem, state: State) -> State:
    """Turned about the vertical and shifted so that known points are met best (Procrustes, Remark 3)."""
    assert prob.known.points is not None
    index, points, _ = prob.known.points
    path = corners(prob, state)[index]
    if without_scale(prob):  # the fit does not find its way over orders of magnitude
        wide, own = (float(np.linalg.norm(places - places.mean(axis=0))) for places in (points, path))
        if wide > 0.0 and own > 0.0:
            state = _grown(state, wide / own)
            path = corners(prob, state)[index]
    from_centre, to_centre = path - path.mean(axis=0), points - points.mean(axis=0)
    cross = from_centre[:, 0] * to_centre[:, 1] - from_centre[:, 1] * to_centre[:, 0]
    turn = float(np.arctan2(cross.sum(), (from_centre[:, :2] * to_centre[:, :2]).sum()))
    if prob.known.heading is not None:
        turn = state.turn
    cos, sin = np.cos(turn), np.sin(turn)
    rotation = np.eye(prob.dimensions)
    rotation[:2, :2] = [[cos, -sin], [sin, cos]]
    return replace(state, turn=turn, shift=points.mean(axis=0) - rotation @ path.mean(axis=0))


def without_scale(prob: Problem) -> bool:
    """Whether readings do not say how large a parametric path is: (c, S, C, a) → (λc, λS, λ²C, λᵈa) changes none of
    them (Table I row 5; theory, section 8).
    """
    return prob.basis is not None and prob.spread2 is None and not prob.rate


def _grown(state: State, factor: float) -> State:
    log, d = float(np.log(factor)), state.s.shape[1]
    return replace(
        state,
        coefficients=state.coefficients * factor,
        s=state.s * factor,
        log_amplitude=state.log_amplitude + d * log,
        log_spread2=state.log_spread2 + 2.0 * log,
        log_rate=state.log_rate + 2.0 * log,
    )


def lone_starts(prob: Problem, priors: Priors, like: State, rng: np.random.Generator) -> list[State]:
    """Starts for one source, whose readings alone leave its place and the path a continuum.

    Headings as known, or random turns; the source anywhere about that path.
    """
    out = []
    for _ in range(RESTARTS):
        if priors.heading_rad is not None:
            theta = priors.heading_rad - priors.heading_rad[0]
        else:
            turn = 2.0 * np.pi / prob.n_legs * rng.integers(1, max(2, (prob.n_legs + 1) // 2))
            theta = np.concatenate([[0.0], np.cumsum(turn + 0.2 * rng.standard_normal(prob.n_legs - 1))])
        path = vertices(theta, prob.length)
        place = rng.uniform(path.min(axis=0) - like.spread, path.max(axis=0) + like.spread)
        peak = np.log(np.pi) + like.log_spread2[:1]
        out.append(replace(like, theta=theta, s=place[None, :], log_amplitude=peak))
    return out
