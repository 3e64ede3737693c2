"""One candidate answer, and the vector of its unknowns.

In the canonical gauge (b_1 = 0, θ_1 = 0): headings θ_2 … θ_L, climbs where they are unknown (3-D; the first two legs
in the plane z = 0), or the coefficients of a parametric path; leg lengths that are uncertain, and where the next leg
begins; sources S_k, ln a_k;
what is unknown of the medium, of the sensor, and of the way from this gauge to that of known headings or points.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dslam_mav.dslam.problem import Problem

Array = NDArray[np.float64]

MAX_STEP_RAD = 0.3
MAX_STEP_SPREADS = 0.5
MAX_STEP_LOG = 0.5
MAX_STEP_EXTENT = 0.1
MAX_EXTENT = 0.6  # beyond it the shape 1 + κL(u) is far below zero somewhere: no density released at once


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """θ (L,) with θ_1 = 0, S (K, d), ln a (K,), ln C at the first reading (K,), ln 4μ (−∞: static), ambient level.

    `climb` (L,) of every leg above the plane, `longer` (L,) what a leg is longer than said, `gap` (L, d) from its
    end to where the next begins, `coefficients` (P, d) of a parametric path, κ `extent`, `log_lag`, `drift`; `turn`
    and `shift` (d,) lead to the frame of known headings and points.
    """

    theta: Array
    s: Array
    log_amplitude: Array
    log_spread2: Array
    log_rate: float
    ambient: float
    climb: Array
    longer: Array
    gap: Array
    coefficients: Array
    extent: float = 0.0
    log_lag: float = -np.inf
    drift: float = 0.0
    turn: float = 0.0
    shift: Array | None = None

    @classmethod
    def flat(cls, prob: Problem, theta: Array, s: Array, log_amplitude: Array, log_spread2: ArrayLike) -> State:
        """In the plane, the medium as far as it is known; ln C (1,) or (K,)."""
        rate = prob.rate if prob.rate is not None else 0.0
        k_sources, d = s.shape
        return cls(
            theta=theta,
            s=s,
            log_amplitude=log_amplitude,
            log_spread2=np.array(np.broadcast_to(np.asarray(log_spread2, dtype=np.float64), (k_sources,))),
            log_rate=float(np.log(rate)) if rate > 0.0 else -np.inf,
            ambient=prob.ambient or 0.0,
            climb=np.zeros(prob.n_legs),
            longer=np.zeros(prob.n_legs),
            gap=np.zeros((prob.n_legs, d)),
            coefficients=np.zeros((0 if prob.basis is None else prob.basis.shape[1], d)),
            extent=prob.extent or 0.0,
            log_lag=float(np.log(prob.lag)) if prob.lag else -np.inf,
        )

    @property
    def spread(self) -> float:
        """√C at the first reading, of the source that has spread least."""
        return float(np.exp(0.5 * self.log_spread2.min()))


class Layout(NamedTuple):
    """Which unknowns stand where in the vector; an empty slice: none of the kind."""

    heading: slice
    climb: slice
    coefficient: slice
    longer: slice
    gap: slice
    place: slice
    amplitude: slice
    medium: slice
    extent: slice
    ambient: slice
    drift: slice
    lag: slice
    turn: slice
    shift: slice
    map: Array  # medium_map

    @property
    def size(self) -> int:
        """P, how many unknowns there are."""
        return int(self.shift.stop)


def any_in(part: slice) -> bool:
    """Whether there are unknowns of a kind."""
    return bool(part.stop > part.start)


def layout(prob: Problem, k_sources: int) -> Layout:
    """Where each kind of unknown stands."""
    n_legs, d, known = prob.n_legs, prob.dimensions, prob.known
    uncertain = 0 if known.length_sd is None else int((known.length_sd > 0.0).sum())
    by_medium = medium_map(prob, k_sources)
    counts = (
        max(n_legs - 1, 0),
        max(n_legs - 2, 0) if climbs_unknown(prob) else 0,
        0 if prob.basis is None else prob.basis.shape[1] * d,
        uncertain,
        loose_corners(prob).size * d,
        k_sources * d,
        k_sources,
        by_medium.shape[1],
        int(prob.extent is None),
        int(prob.ambient is None),
        int(prob.drift is None),
        int(prob.lag is None),
        int(known.heading is not None or known.points is not None),
        d if known.points is not None else 0,
    )
    ends = [int(end) for end in np.cumsum(counts)]
    parts = [slice(end - count, end) for end, count in zip(ends, counts, strict=True)]
    return Layout(*parts, by_medium)  # type: ignore[call-arg, arg-type]


def climbs_unknown(prob: Problem) -> bool:
    """Whether every leg's climb has to be found."""
    return prob.dimensions == 3 and prob.rise is None and prob.basis is None


def medium_map(prob: Problem, k_sources: int) -> Array:
    """(K + 1, M): what each unknown of the medium does to every ln C_k at the first reading, and to ln 4μ."""
    columns = []
    if prob.spreads == "each":
        columns += list(np.eye(k_sources, k_sources + 1))
    elif prob.spreads == "shared":
        with_rate = prob.rate is None and prob.age is not None  # C = 4μ·age: μ moves both
        columns.append(np.append(np.ones(k_sources), float(with_rate)))
    if prob.rate is None and prob.age is None:
        columns.append(np.eye(k_sources + 1)[k_sources])
    return np.array(columns).reshape(len(columns), k_sources + 1).T


def parameter_names(prob: Problem, k_sources: int) -> tuple[str, ...]:
    """Names in the order of the vector."""
    n_legs, axes = prob.n_legs, "xyz"[: prob.dimensions]
    each = range(1, k_sources + 1)
    headings = [f"heading of leg {j}" for j in range(2, n_legs + 1)]
    climbs = [f"climb of leg {j}" for j in range(3, n_legs + 1)] if climbs_unknown(prob) else []
    terms = range(1, prob.basis.shape[1] + 1) if prob.basis is not None else ()
    coefficients = [f"coefficient {i} {a}" for i in terms for a in axes]
    longer = [f"length of leg {j + 1}" for j in uncertain_legs(prob)]
    gaps = [f"corner {j + 2} {a}" for j in loose_corners(prob) for a in axes]
    places = [f"source {k} {a}" for k in each for a in axes]
    amplitudes = [f"ln amplitude {k}" for k in each]
    medium = []
    if prob.spreads == "each":
        medium += [f"ln C {k}" for k in each]
    elif prob.spreads == "shared":
        medium.append("ln C")
    if prob.rate is None and prob.age is None:
        medium.append("ln diffusivity")
    frame = layout(prob, k_sources)
    kinds = (
        ("extent", frame.extent),
        ("ambient", frame.ambient),
        ("ambient drift", frame.drift),
        ("ln lag", frame.lag),
        ("turn", frame.turn),
    )
    rest = [name for name, part in kinds if any_in(part)]
    shift = [f"shift {a}" for a in axes] if prob.known.points is not None else []
    return (*headings, *climbs, *coefficients, *longer, *gaps, *places, *amplitudes, *medium, *rest, *shift)


def uncertain_legs(prob: Problem) -> NDArray[np.int64]:
    """Legs whose length is not exact."""
    if prob.known.length_sd is None:
        return np.empty(0, dtype=np.int64)
    return np.flatnonzero(prob.known.length_sd > 0.0)


def loose_corners(prob: Problem) -> NDArray[np.int64]:
    """Legs that the next one may begin away from."""
    if prob.known.corner_sd is None:
        return np.empty(0, dtype=np.int64)
    return np.flatnonzero(prob.known.corner_sd > 0.0)


def moved(prob: Problem, state: State, step: Array, at: Layout) -> State:
    """The state after a step of the vector, each part of it kept within what the model is linear in."""
    d = state.s.shape[1]
    reach = MAX_STEP_SPREADS * state.spread

    def part(where: slice, most: float = MAX_STEP_LOG) -> Array:
        return np.minimum(np.maximum(step[where], -most), most)

    theta = state.theta.copy()
    theta[1:] += part(at.heading, MAX_STEP_RAD)
    change: dict[str, object] = {}
    if any_in(at.climb):
        climb = state.climb.copy()
        climb[2:] += part(at.climb, MAX_STEP_RAD)
        change["climb"] = climb
    if any_in(at.coefficient):
        change["coefficients"] = state.coefficients + part(at.coefficient, reach).reshape(-1, d)
    if any_in(at.longer):
        longer = state.longer.copy()
        longer[uncertain_legs(prob)] += part(at.longer, reach)
        change["longer"] = longer
    if any_in(at.gap):
        gap = state.gap.copy()
        gap[loose_corners(prob)] += part(at.gap, reach).reshape(-1, d)
        change["gap"] = gap
    if any_in(at.medium):
        logs = at.map @ part(at.medium)
        change["log_spread2"] = state.log_spread2 + logs[:-1]
        change["log_rate"] = state.log_rate + float(logs[-1])
    if any_in(at.extent):
        extent = state.extent + float(part(at.extent, MAX_STEP_EXTENT)[0])
        change["extent"] = min(max(extent, -MAX_EXTENT), MAX_EXTENT)
    if any_in(at.ambient):
        change["ambient"] = state.ambient + float(step[at.ambient][0])
    if any_in(at.drift):
        change["drift"] = state.drift + float(step[at.drift][0])
    if any_in(at.lag):
        change["log_lag"] = state.log_lag + float(part(at.lag)[0])
    if any_in(at.turn):
        change["turn"] = state.turn + float(part(at.turn, MAX_STEP_RAD)[0])
    if state.shift is not None and any_in(at.shift):
        change["shift"] = state.shift + step[at.shift]
    s = state.s + part(at.place, reach).reshape(-1, d)
    return replace(state, theta=theta, s=s, log_amplitude=state.log_amplitude + part(at.amplitude), **change)  # type: ignore[arg-type]
