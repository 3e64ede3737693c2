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

from dslam_mav.records import Flight, Medium

Array = NDArray[np.float64]

MAX_STEP_HEADING_RAD = 0.3
MAX_STEP_SPREADS = 0.5
MAX_STEP_LOG = 0.5
MAX_ITERATIONS = 100
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


def evaluate(prob: Problem, state: State) -> tuple[Array, Array]:
    """Residual (n + priors,) and Jacobian (n + priors, P)."""
    n, n_legs, k_sources = prob.y.size, prob.length.size, state.log_amplitude.size
    cos, sin = np.cos(state.theta), np.sin(state.theta)
    start = vertices(state.theta, prob.length)
    dx = state.s[:, 0, None] - start[None, :-1, 0]
    dy = state.s[:, 1, None] - start[None, :-1, 1]
    along, across = dx * cos + dy * sin, dy * cos - dx * sin  # Y_kj and d_kj, (K, L)
    c, free = squared_spread(prob, state)
    leg = prob.leg
    u = prob.s[None, :] - along[:, leg]
    d = across[:, leg]
    r2 = (u * u + d * d) / c
    g = np.exp(state.log_amplitude[:, None] - r2) / (np.pi * c)
    by_y = 2.0 * u * g / c
    by_d = -2.0 * d * g / c
    by_x = by_y * cos[leg] - by_d * sin[leg]
    by_yy = by_y * sin[leg] + by_d * cos[leg]
    n_head = n_legs - 1
    columns = np.zeros((n, n_head + 3 * k_sources + len(medium_names(prob))))
    sum_x, sum_y = by_x.sum(axis=0), by_yy.sum(axis=0)
    own = (d * by_y - along[:, leg] * by_d).sum(axis=0)
    for i in range(1, n_legs):
        moved = prob.length[i] * (sin[i] * sum_x - cos[i] * sum_y)
        columns[:, i - 1] = np.where(leg > i, moved, np.where(leg == i, own, 0.0))
    columns[:, n_head : n_head + 2 * k_sources : 2] = by_x.T
    columns[:, n_head + 1 : n_head + 2 * k_sources : 2] = by_yy.T
    columns[:, n_head + 2 * k_sources : n_head + 3 * k_sources] = g.T
    index = n_head + 3 * k_sources
    by_c = (g * (r2 - 1.0)).sum(axis=0)
    for slope in free:
        columns[:, index] = by_c * slope
        index += 1
    if prob.ambient is None:
        columns[:, index] = 1.0
    residual = g.sum(axis=0) + state.ambient - prob.y
    return _with_priors(prob, state, residual, columns)


def _with_priors(prob: Problem, state: State, residual: Array, columns: Array) -> tuple[Array, Array]:
    """Add the residual rows of priors, in the readings' noise units (the caller scales their standard deviations)."""
    n_legs, k_sources = prob.length.size, state.log_amplitude.size
    if prob.peak_prior is not None:
        peak, sd = prob.peak_prior
        excess = state.log_amplitude - np.log(np.pi * peak) - state.log_spread2
        beyond = (excess > 0.0) / sd
        rows = np.zeros((k_sources, columns.shape[1]))
        first = n_legs - 1 + 2 * k_sources
        rows[:, first : first + k_sources] = np.diag(beyond)
        if prob.evolution != "fixed":  # its first free parameter is ln C, or moves it one to one
            rows[:, first + k_sources] = -beyond
        columns = np.vstack([columns, rows])
        residual = np.concatenate([residual, excess * beyond])
    if prob.heading_prior is not None:
        heading, sd = prob.heading_prior
        off = state.theta + state.turn - heading
        off = (off + np.pi) % (2.0 * np.pi) - np.pi
        rows = np.zeros((n_legs, columns.shape[1] + 1))
        rows[1:, : n_legs - 1] = np.eye(n_legs - 1)
        rows[:, -1] = 1.0
        columns = np.vstack([np.hstack([columns, np.zeros((len(columns), 1))]), rows / sd])
        residual = np.concatenate([residual, off / sd])
    if prob.closed_sd_m is not None:
        end = vertices(state.theta, prob.length)[-1]
        rows = np.zeros((2, columns.shape[1]))
        rows[0, : n_legs - 1] = -prob.length[1:] * np.sin(state.theta[1:])
        rows[1, : n_legs - 1] = prob.length[1:] * np.cos(state.theta[1:])
        columns = np.vstack([columns, rows / prob.closed_sd_m])
        residual = np.concatenate([residual, end / prob.closed_sd_m])
    return residual, columns


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
    """Levenberg–Marquardt from `start`, with Marquardt's scaling, to where a step no longer lowers the cost."""
    state = start
    residual, jacobian = evaluate(prob, state)
    cost = float(residual @ residual)
    damping = 1e-4
    converged = False
    for _ in range(iterations):
        size = np.sqrt((jacobian**2).sum(axis=0))
        size[size == 0.0] = 1.0
        scaled = jacobian / size
        normal = scaled.T @ scaled
        gradient = scaled.T @ residual
        step = np.linalg.lstsq(normal + damping * np.eye(size.size), -gradient, rcond=None)[0] / size
        trial = moved(prob, state, step)
        with np.errstate(over="ignore", invalid="ignore"):
            residual_try, jacobian_try = evaluate(prob, trial)
            cost_try = float(residual_try @ residual_try)
        if np.isfinite(cost_try) and cost_try <= cost:
            gain = cost - cost_try
            state, residual, jacobian, cost = trial, residual_try, jacobian_try, cost_try
            damping = max(damping * 0.1, 1e-12)
            if gain <= CONVERGED_GAIN * cost / prob.y.size:
                converged = True
                break
        else:
            damping *= 10.0
            if damping > 1e6:
                converged = True
                break
    return Fit(state, residual[: prob.y.size], cost, jacobian, converged)
