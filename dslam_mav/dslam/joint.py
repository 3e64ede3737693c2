"""One residual and one analytic Jacobian over all readings of all legs (theory, section 8).

With Y = (S − b_j)ᵀc_j (4), d = (S − b_j)ᵀn_j and u = s − Y a source adds g = a/(πC) e^{−(u² + d²)/C} (3), so

    ∂g/∂Y = 2u g/C,   ∂g/∂d = −2d g/C,   ∂g/∂S = ∂g/∂Y c_j + ∂g/∂d n_j,   ∂g/∂ln C = g ((u² + d²)/C − 1),
    ∂g/∂θ_j = d ∂g/∂Y − Y ∂g/∂d,   ∂g/∂θ_i = −l_i n_iᵀ ∂g/∂S for an earlier leg i.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.problem import Problem, State, parameter_names, squared_spread, vertices

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class _Terms:
    """What residual and Jacobian share: Y_kj, d at every reading, u, C, r²/C and every source's share g (K, n)."""

    along: Array
    d: Array
    u: Array
    c: Array
    r2: Array
    g: Array
    by_medium: list[Array]


def _terms(prob: Problem, state: State) -> _Terms:
    cos, sin = np.cos(state.theta), np.sin(state.theta)
    start = vertices(state.theta, prob.length)
    dx = state.s[:, 0, None] - start[None, :-1, 0]
    dy = state.s[:, 1, None] - start[None, :-1, 1]
    along, across = dx * cos + dy * sin, dy * cos - dx * sin  # Y_kj (4) and d_kj, (K, L)
    c, by_medium = squared_spread(prob, state)
    u = prob.s[None, :] - along[:, prob.leg]
    d = across[:, prob.leg]
    r2 = (u * u + d * d) / c
    g = np.exp(state.log_amplitude[:, None] - r2) / (np.pi * c)  # (3)
    return _Terms(along, d, u, c, r2, g, by_medium)


def residual_of(prob: Problem, state: State) -> Array:
    """Residual (n + priors,): model − measured, then the priors' rows."""
    readings = _terms(prob, state).g.sum(axis=0) + state.ambient - prob.y
    return np.concatenate([readings, _prior_rows(prob, state)[0]])


def evaluate(prob: Problem, state: State) -> tuple[Array, Array]:
    """Residual (n + priors,) and Jacobian (n + priors, P)."""
    terms = _terms(prob, state)
    n_legs, k_sources = prob.length.size, state.log_amplitude.size
    leg, u, d, c, g = prob.leg, terms.u, terms.d, terms.c, terms.g
    cos, sin = np.cos(state.theta), np.sin(state.theta)
    by_y = 2.0 * u * g / c
    by_d = -2.0 * d * g / c
    by_sx = by_y * cos[leg] - by_d * sin[leg]
    by_sy = by_y * sin[leg] + by_d * cos[leg]
    first = n_legs - 1
    columns = np.zeros((prob.y.size, len(parameter_names(prob, k_sources))))
    sum_x, sum_y = by_sx.sum(axis=0), by_sy.sum(axis=0)
    own = (d * by_y - terms.along[:, leg] * by_d).sum(axis=0)
    for i in range(1, n_legs):
        turned = prob.length[i] * (sin[i] * sum_x - cos[i] * sum_y)
        columns[:, i - 1] = np.where(leg > i, turned, np.where(leg == i, own, 0.0))
    columns[:, first : first + 2 * k_sources : 2] = by_sx.T
    columns[:, first + 1 : first + 2 * k_sources : 2] = by_sy.T
    columns[:, first + 2 * k_sources : first + 3 * k_sources] = g.T
    index = first + 3 * k_sources
    by_log_c = (g * (terms.r2 - 1.0)).sum(axis=0)
    for slope in terms.by_medium:
        columns[:, index] = by_log_c * slope
        index += 1
    if prob.ambient is None:
        columns[:, index] = 1.0
    prior, prior_columns = _prior_rows(prob, state)
    residual = np.concatenate([g.sum(axis=0) + state.ambient - prob.y, prior])
    return residual, np.vstack([columns, prior_columns])


def _prior_rows(prob: Problem, state: State) -> tuple[Array, Array]:
    """Residual rows of the priors and their Jacobian (rows, P)."""
    n_legs, k_sources = prob.length.size, state.log_amplitude.size
    n_par = len(parameter_names(prob, k_sources))
    off: list[Array] = [np.empty(0)]
    slopes: list[Array] = [np.empty((0, n_par))]
    if prob.peak_prior is not None:
        peak, sd = prob.peak_prior
        excess = state.log_amplitude - np.log(np.pi * peak) - state.log_spread2
        beyond = (excess > 0.0) / sd
        rows = np.zeros((k_sources, n_par))
        first = n_legs - 1 + 2 * k_sources
        rows[:, first : first + k_sources] = np.diag(beyond)
        if prob.evolution != "fixed":  # its first free parameter is ln C, or moves it one to one
            rows[:, first + k_sources] = -beyond
        off.append(excess * beyond)
        slopes.append(rows)
    if prob.age_prior is not None:
        oldest, sd = prob.age_prior
        older = max(state.log_age - float(np.log(oldest)), 0.0)
        rows = np.zeros((1, n_par))
        rows[0, parameter_names(prob, k_sources).index("ln age")] = (older > 0.0) / sd
        off.append(np.array([older / sd]))
        slopes.append(rows)
    if prob.heading_prior is not None:
        heading, sd = prob.heading_prior
        turned = state.theta + state.turn - heading
        rows = np.zeros((n_legs, n_par))
        rows[1:, : n_legs - 1] = np.eye(n_legs - 1)
        rows[:, -1] = 1.0
        off.append(((turned + np.pi) % (2.0 * np.pi) - np.pi) / sd)
        slopes.append(rows / sd)
    if prob.closed_sd_m is not None:
        rows = np.zeros((2, n_par))
        rows[0, : n_legs - 1] = -prob.length[1:] * np.sin(state.theta[1:])
        rows[1, : n_legs - 1] = prob.length[1:] * np.cos(state.theta[1:])
        off.append(vertices(state.theta, prob.length)[-1] / prob.closed_sd_m)
        slopes.append(rows / prob.closed_sd_m)
    return np.concatenate(off), np.vstack(slopes)
