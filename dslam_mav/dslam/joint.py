"""The joint fit: one residual and one analytic Jacobian over all readings of all legs (theory, section 8).

Under white Gaussian noise its minimum is the maximum-likelihood estimate. Parameters, in the canonical gauge (b_1 = 0,
θ_1 = 0): headings θ_2 … θ_L, sources S_k, log amplitudes ln a_k, what is unknown of the medium, the ambient level. What
is known is not a parameter; what has a prior gets a residual row.

With Y = (S − b_j)ᵀc_j (4), d = (S − b_j)ᵀn_j and u = s − Y a source adds g = a/(πC) e^{−(u² + d²)/C} (3), so

    ∂g/∂Y = 2u g/C,   ∂g/∂d = −2d g/C,   ∂g/∂S = ∂g/∂Y c_j + ∂g/∂d n_j,   ∂g/∂ln C = g ((u² + d²)/C − 1),
    ∂g/∂θ_j = d ∂g/∂Y − Y ∂g/∂d,   ∂g/∂θ_i = −l_i n_iᵀ ∂g/∂S for an earlier leg i.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from dslam_mav.records import Flight, Medium

Array = NDArray[np.float64]

MAX_STEP_HEADING_RAD = 0.3
MAX_STEP_SPREADS = 0.5
MAX_STEP_LOG = 0.5
MAX_ITERATIONS = 100
PROBE = 0.1  # of a step: where the residual's second derivative is taken
MOST_BEND = 0.75  # acceleration over velocity, as in the paper
CONVERGED_GAIN = 1e-5  # in χ²: far below what a reading's noise can tell


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """All readings of a flight in one place, and what is known of the medium.

    `s`, `t`, `y` (n,) and `leg` (n,) in leg order; `length` (L,). `spread2` is the squared spread C at the first
    reading where it is known; `age_s` the sources' age then, for a field that evolves (None: static or unknown).
    `evolution`: what of C(t) is free: "fixed", "spread" (C at the first reading), "age" (its age, μ known),
    "both"; a static field knows only "fixed" and "spread".

    Priors have standard deviations in units of a reading's noise: headings, closure, and `peak_prior`: a source's
    peak reading beyond the first number costs as the logarithm's excess over the second. Without it, ever remoter and
    stronger sources beside ever straighter paths fit almost anything.
    """

    s: Array
    t: Array
    y: Array
    leg: NDArray[np.int64]
    length: Array
    ambient: float | None
    static: bool
    evolution: str
    spread2: float | None
    age_s: float | None
    diffusivity: float | None
    heading_prior: tuple[Array, float] | None = None
    closed_sd_m: float | None = None
    peak_prior: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """One candidate answer: θ (L,) with θ_1 = 0, S (K, 2), ln a (K,), ln C and ln age at the first reading, ambient.

    `turn` is the angle from the canonical gauge to the heading prior's frame, where there is a prior.
    """

    theta: Array
    s: Array
    log_amplitude: Array
    log_spread2: float
    log_age: float
    ambient: float
    turn: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """A minimum: the state, its residual (model − measured, readings only), cost, Jacobian (rows of priors last)."""

    state: State
    residual: Array
    cost: float
    jacobian: Array
    converged: bool


def problem(flight: Flight, medium: Medium) -> Problem:
    """The problem a flight and a medium pose."""
    t = np.concatenate([leg.time_s for leg in flight.legs])
    first = float(t[0])
    mu, tau = medium.diffusivity_m2_s, medium.activation_s
    known_tau = tau if isinstance(tau, (int, float)) else None
    age = None if known_tau is None else first - known_tau
    spread2 = None
    if medium.spread_m is not None:
        spread2 = medium.spread_m**2
    elif mu is not None and age is not None:
        spread2 = 4.0 * mu * age
    if spread2 is not None:
        evolution = "fixed"
    elif medium.static or age is not None:
        evolution = "spread"
    else:
        evolution = "age" if mu is not None else "both"
    return Problem(
        s=np.concatenate([leg.distance_m for leg in flight.legs]),
        t=t - first,
        y=np.concatenate([leg.reading for leg in flight.legs]),
        leg=np.repeat(np.arange(len(flight.legs)), [leg.reading.size for leg in flight.legs]),
        length=flight.lengths_m,
        ambient=medium.ambient,
        static=medium.static,
        evolution=evolution,
        spread2=spread2,
        age_s=age,
        diffusivity=mu,
    )


def medium_names(prob: Problem) -> tuple[str, ...]:
    """Names of the medium's free parameters."""
    names = {"fixed": (), "spread": ("ln C",), "age": ("ln age",), "both": ("ln C", "ln age")}[prob.evolution]
    return (*names, "ambient") if prob.ambient is None else tuple(names)


def parameter_names(prob: Problem, k_sources: int) -> tuple[str, ...]:
    """Names in the order of the parameter vector."""
    headings = tuple(f"heading of leg {j}" for j in range(2, prob.length.size + 1))
    places = tuple(f"source {k} {axis}" for k in range(1, k_sources + 1) for axis in "xy")
    amplitudes = tuple(f"ln amplitude {k}" for k in range(1, k_sources + 1))
    turn = ("turn",) if prob.heading_prior is not None else ()
    return (*headings, *places, *amplitudes, *medium_names(prob), *turn)


def vertices(theta: Array, length: Array) -> Array:
    """Path (L+1, 2) from headings and lengths, from the origin (2)."""
    steps = length[:, None] * np.stack([np.cos(theta), np.sin(theta)], axis=1)
    return np.vstack([np.zeros(2), np.cumsum(steps, axis=0)])


def squared_spread(prob: Problem, state: State) -> tuple[Array, list[Array]]:
    """C at every reading (n,), and ∂ln C/∂(free parameters of the medium), each (n,)."""
    n = prob.t.size
    c0 = np.exp(state.log_spread2)
    if prob.static:
        return np.full(n, c0), [np.ones(n)] if prob.evolution == "spread" else []
    age = np.exp(state.log_age)
    growth = 1.0 + prob.t / age
    if prob.evolution == "age":  # μ known: C = 4μ(age + t)
        assert prob.diffusivity is not None
        return 4.0 * prob.diffusivity * age * growth, [1.0 / growth]
    by_age = -(prob.t / age) / growth
    free = {"fixed": [], "spread": [np.ones(n)], "both": [np.ones(n), by_age]}[prob.evolution]
    return c0 * growth, free


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


def moved(prob: Problem, state: State, step: Array) -> State:
    """The state after a step of the parameter vector, each part's step kept within what the model is linear in."""
    n_head, k_sources = prob.length.size - 1, state.log_amplitude.size
    spread = np.exp(0.5 * state.log_spread2)
    theta = state.theta.copy()
    theta[1:] += np.clip(step[:n_head], -MAX_STEP_HEADING_RAD, MAX_STEP_HEADING_RAD)
    place = np.clip(step[n_head : n_head + 2 * k_sources], -MAX_STEP_SPREADS * spread, MAX_STEP_SPREADS * spread)
    index = n_head + 3 * k_sources
    logs = np.clip(step[n_head + 2 * k_sources : index], -MAX_STEP_LOG, MAX_STEP_LOG)
    log_spread2, log_age, ambient, turn = state.log_spread2, state.log_age, state.ambient, state.turn
    for name in medium_names(prob):
        if name == "ambient":
            ambient += float(step[index])
        else:
            change = float(np.clip(step[index], -MAX_STEP_LOG, MAX_STEP_LOG))
            log_spread2 += change if name == "ln C" else 0.0
            log_age += change if name == "ln age" else 0.0
        index += 1
    if prob.heading_prior is not None:
        turn += float(np.clip(step[index], -MAX_STEP_HEADING_RAD, MAX_STEP_HEADING_RAD))
    if prob.evolution == "age" and prob.diffusivity is not None:
        log_spread2 = float(np.log(4.0 * prob.diffusivity) + log_age)
    return State(theta, state.s + place.reshape(-1, 2), state.log_amplitude + logs, log_spread2, log_age, ambient, turn)


def fit(prob: Problem, start: State, *, iterations: int = MAX_ITERATIONS) -> Fit:
    """Levenberg–Marquardt from `start`, with Marquardt's scaling, to where a step no longer lowers the cost.

    A source that backs away from the path while it grows keeps α − d²/C: the cost's valleys are narrow and bent. Each
    step therefore carries its second-order correction, from one more residual (geodesic acceleration; Transtrum and
    Sethna, "Improvements to the Levenberg-Marquardt algorithm", arXiv:1201.5885).
    """
    state = start
    residual, jacobian = evaluate(prob, state)
    cost = float(residual @ residual)
    damping = 1e-3
    converged = False
    for _ in range(iterations):
        step = _accelerated_step(prob, state, residual, jacobian, damping)
        trial = None if step is None else moved(prob, state, step)
        if trial is not None:
            with np.errstate(over="ignore", invalid="ignore"):
                residual_try, jacobian_try = evaluate(prob, trial)
                cost_try = float(residual_try @ residual_try)
            if np.isfinite(cost_try) and cost_try <= cost:
                gain = cost - cost_try
                state, residual, jacobian, cost = trial, residual_try, jacobian_try, cost_try
                damping = max(damping * 0.2, 1e-12)
                if gain <= CONVERGED_GAIN * cost / prob.y.size:
                    converged = True
                    break
                continue
        damping *= 3.0
        if damping > 1e8:
            converged = True
            break
    return Fit(state, residual[: prob.y.size], cost, jacobian, converged)


def _accelerated_step(prob: Problem, state: State, residual: Array, jacobian: Array, damping: float) -> Array | None:
    """Velocity and half its acceleration; None where the path bends too much for a step of this size."""
    size = np.sqrt((jacobian**2).sum(axis=0))
    size[size == 0.0] = 1.0
    scaled = jacobian / size
    factor = cho_factor(scaled.T @ scaled + damping * np.eye(size.size), check_finite=False)
    velocity = cho_solve(factor, -(scaled.T @ residual), check_finite=False)
    with np.errstate(over="ignore", invalid="ignore"):
        ahead = residual_of(prob, moved(prob, state, PROBE * velocity / size))
        bend = 2.0 / PROBE * ((ahead - residual) / PROBE - scaled @ velocity)
    if not np.isfinite(bend).all():
        return None
    acceleration = cho_solve(factor, -(scaled.T @ bend), check_finite=False)
    if 2.0 * np.linalg.norm(acceleration) > MOST_BEND * np.linalg.norm(velocity):
        return None
    return np.asarray((velocity + 0.5 * acceleration) / size)
