"""A flight's readings in one place, what is known of the medium, and one candidate answer.

Parameters, in the canonical gauge (b_1 = 0, θ_1 = 0): headings θ_2 … θ_L, sources S_k, log amplitudes ln a_k, what is
unknown of the medium, the ambient level. What is known is not a parameter; what has a prior gets a residual row.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dslam_mav.records import Flight, Medium

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """All readings of a flight in one place, and what is known of the medium.

    `s`, `t`, `y` (n,) and `leg` (n,) in leg order; `length` (L,). `spread2` is the squared spread C at the first
    reading where it is known; `age_s` the sources' age then, for a field that evolves (None: static or unknown).
    `evolution`: what of C(t) is free: "fixed", "spread" (C at the first reading), "age" (its age, μ known),
    "both"; a static field knows only "fixed" and "spread".

    Priors have standard deviations in units of a reading's noise: headings, closure, and `peak_prior`: a source's
    peak reading beyond the first number costs as the logarithm's excess over the second. Without it, ever remoter and
    stronger sources beside ever straighter paths fit almost anything. `age_prior` likewise: in a field that stands
    still μ and τ run away together.
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
    age_prior: tuple[float, float] | None = None


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
