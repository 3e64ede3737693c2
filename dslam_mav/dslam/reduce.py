"""Many readings carried by few: one pass over them, after which nothing costs more for there having been many.

For the joint fit, exactly: along a leg the model is smooth, and a polynomial through its values at M Chebyshev points
is the model to 1e-10 (Trefethen, "Approximation Theory and Approximation Practice", chapter 8). With V the
polynomials at the N readings, VᵀV = RᵀR and z = R⁻ᵀVᵀy,

    |f(s) − y|² = |R V₀⁻¹ f(nodes) − z|² + |y|² − |z|²:

M numbers stand for N readings, white noise stays white, and what is left over is part of every answer's residual.
For the search, nearly: means of neighbouring readings.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from dslam_mav.dslam.problem import Problem
from dslam_mav.records import Flight, Leg

Array = NDArray[np.float64]

MOST_FOR_SEARCH = 512  # readings of a leg that the search looks at
WORTH_IT = 3  # a leg with fewer than this many readings a node is left as it is
BLOCK = 8192  # readings taken at once
ROUNDING = 1e-9
ORDER_FLOOR = 12
ORDER_PER_SPREAD = 9.0  # points per half length in √C; with the floor: 1e-10 of a Gaussian anywhere about the leg
GAP = 0.01  # of a leg: the widest stretch without readings
STEADY = (
    1e-6  # of the flight: how far times may stray from a steady run along the leg; Unix times are rounded to 2e-7 s
)


def binned(prob: Problem, *, by_time: bool = False) -> Problem:
    """For the search: every leg's readings averaged in equal numbers of neighbours, at most 512 of them a leg."""
    along = prob.t if by_time else prob.s
    counts = np.bincount(prob.leg, minlength=prob.n_legs)
    if prob.basis is not None or prob.mix is not None or counts.max() <= MOST_FOR_SEARCH:
        return prob
    many = int(np.ceil(counts.max() / MOST_FOR_SEARCH))
    parts: list[tuple[Array, Array, Array]] = []
    for j in range(prob.n_legs):
        own = np.flatnonzero(prob.leg == j)
        own = own[np.argsort(along[own], kind="stable")][: max(own.size // many, 1) * many]
        s, t, y = (values[own].reshape(-1, min(many, own.size)).mean(axis=1) for values in (prob.s, prob.t, prob.y))
        parts.append((s, t, y))
    return replace(
        prob,
        s=np.concatenate([s for s, _, _ in parts]),
        t=np.concatenate([t for _, t, _ in parts]),
        y=np.concatenate([y for _, _, y in parts]),
        leg=np.repeat(np.arange(prob.n_legs), [s.size for s, _, _ in parts]),
        n_readings=sum(s.size for s, _, _ in parts),
    )


def unlagged(prob: Problem, lag: float) -> Problem:
    """For the search: readings placed where a sensor of time constant `lag` mostly saw them, so long before.

    What a leg's first readings still show of the leg before is left out, where enough are left. Along the leg a source
    is seen wider, its variance C/2 by the square of the way flown meanwhile: half of that is added to a known C.
    """
    s, seen = prob.s.copy(), np.ones(prob.s.size, dtype=np.bool_)
    way2 = 0.0
    for j in range(prob.n_legs):
        own = np.flatnonzero(prob.leg == j)
        if own.size < 2:
            continue
        ways = lag * np.gradient(prob.s[own], prob.t[own])
        s[own] -= ways
        way2 += float(ways @ ways) / prob.s.size
        late = prob.t[own] - prob.t[own[0]] >= lag
        seen[own] = late if 2 * late.sum() >= own.size else True
    n_readings = int(seen.sum())
    wider = None if prob.spread2 is None else prob.spread2 + way2
    return replace(
        prob,
        s=s[seen],
        t=prob.t[seen],
        y=prob.y[seen],
        leg=prob.leg[seen],
        n_readings=n_readings,
        spread2=wider,
        lag=0.0,
    )


def at_once(flight: Flight, lag_s: float) -> Flight:
    """The flight's readings placed where a sensor of time constant `lag_s` mostly saw them; without those at a leg's
    beginning that are of the leg before.
    """
    if not lag_s:
        return flight
    return replace(flight, legs=tuple(_at_once(leg, lag_s) for leg in flight.legs))


def _at_once(leg: Leg, lag_s: float) -> Leg:
    if leg.reading.size < 2:
        return leg
    distance_m = leg.distance_m - lag_s * np.gradient(leg.distance_m, leg.time_s)
    own = distance_m >= -ROUNDING * leg.length_m
    return replace(leg, distance_m=distance_m[own], time_s=leg.time_s[own], reading=leg.reading[own])


def reduced(prob: Problem, narrowest_spread: float) -> Problem:
    """The same problem with its readings reduced, where that is exact; `narrowest_spread` is the least √C in question.

    Legs must be straight, their sensor without lag, and the field still or each leg flown steadily, so that the model
    is a smooth function of distance alone.
    """
    if prob.basis is not None or prob.lag != 0.0:
        return prob
    legs = [np.flatnonzero(prob.leg == j) for j in range(prob.n_legs)]
    spans = [(float(prob.s[own].min()), float(prob.s[own].max())) for own in legs]
    longest = max(hi - lo for lo, hi in spans)
    order = ORDER_FLOOR + int(np.ceil(ORDER_PER_SPREAD * 0.5 * longest / narrowest_spread))
    if any(own.size < max(WORTH_IT * order, 0.5 * order**2) or not _spread_out(prob.s[own]) for own in legs):
        return prob
    points = chebyshev.chebpts1(order)
    to_terms = np.linalg.inv(chebyshev.chebvander(points, order - 1))
    s, t, mix, z, outside = [], [], [], [], 0.0
    for own, (lo, hi) in zip(legs, spans, strict=True):
        when = _steady_times(prob, own, 0.5 * (lo + hi) + 0.5 * (hi - lo) * points)
        if when is None:
            return prob
        unit = (2.0 * prob.s[own] - lo - hi) / (hi - lo)
        triangle, seen, left = _carried(unit, prob.y[own], order)
        s.append(0.5 * (lo + hi) + 0.5 * (hi - lo) * points)
        t.append(when)
        mix.append(triangle @ to_terms)
        z.append(seen)
        outside += left
    return replace(
        prob,
        s=np.concatenate(s),
        t=np.concatenate(t),
        y=np.concatenate(z),
        leg=np.repeat(np.arange(prob.n_legs), order),
        mix=tuple(mix),
        outside=outside,
    )


def _spread_out(distance: Array) -> bool:
    """Whether readings cover a leg evenly enough for a polynomial through it to be held everywhere."""
    gaps = np.diff(distance)
    if gaps.min() < 0.0:
        gaps = np.diff(np.sort(distance))
    return bool(gaps.max() < GAP * float(np.ptp(distance)))


def _steady_times(prob: Problem, own: NDArray[np.int64], nodes: Array) -> Array | None:
    """Times at the nodes; None where field or ambient level change and the leg was not flown at one speed."""
    if prob.static and prob.drift is not None:
        return np.full(nodes.size, float(prob.t[own[0]]))
    slope, start = np.polyfit(prob.s[own], prob.t[own], 1)
    if np.abs(start + slope * prob.s[own] - prob.t[own]).max() > STEADY * float(prob.t[-1]):
        return None
    return np.asarray(start + slope * nodes)


def _carried(unit: Array, reading: Array, order: int) -> tuple[Array, Array, float]:
    """R (M, M), R⁻ᵀVᵀy (M,) and what is left of |y|², block by block, so that memory does not grow with the readings.

    Readings far denser than the nodes leave VᵀV nearly as it is for a continuum, well enough conditioned to factor.
    """
    gram, moments, square = np.zeros((order, order)), np.zeros(order), 0.0
    for begin in range(0, unit.size, BLOCK):
        x, y = unit[begin : begin + BLOCK], reading[begin : begin + BLOCK]
        terms = np.empty((order, x.size))
        terms[0], terms[1] = 1.0, x
        for k in range(2, order):
            terms[k] = 2.0 * x * terms[k - 1] - terms[k - 2]
        gram += terms @ terms.T
        moments += terms @ y
        square += float(y @ y)
    triangle = np.linalg.cholesky(gram).T
    seen = solve_triangular(triangle, moments, trans="T")
    return np.asarray(triangle), np.asarray(seen), max(square - float(seen @ seen), 0.0)
