"""A flight's readings in one place, and what is known of path, medium and sensor.

What is known is not a parameter; what has a prior gets a residual row (rows.py).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dslam_mav.records import Flight, Medium

Array = NDArray[np.float64]

NUMBERS_A_LEG = 13  # that sources can do to it (compress.py)


@dataclass(frozen=True, slots=True, eq=False)
class Known:
    """Priors and constraints, with standard deviations in units of a reading's noise, taken to be `noise_sd`.

    `heading`: headings (L,) and their sd. `closed_sd`: of the path's end about its start. `points`: vertex indices,
    their places (M, d), their sd. `length_sd` (L,): of leg lengths; 0 is exact. `corner_sd`
    (L − 1,): of where the next leg begins, along each axis; 0 is exact. `beside` (L − 1,): how far the next leg's line
    passes from where this one ends, as the corner was overshot, below 0 cut; in units of length. `peak`: a source's
    peak reading beyond the first number costs as the logarithm's excess over the second; without it, ever remoter and
    stronger sources beside ever straighter paths fit almost anything. `age` likewise: in a field that stands still μ
    and τ run away together. `lag`: ln of the sensor's time constant and its sd. `ambient`: the level and its sd.
    """

    heading: tuple[Array, float] | None = None
    closed_sd: float | None = None
    points: tuple[NDArray[np.int64], Array, float] | None = None
    length_sd: Array | None = None
    corner_sd: Array | None = None
    beside: Array | None = None
    peak: tuple[float, float] | None = None
    age: tuple[float, float] | None = None
    lag: tuple[float, float] | None = None
    extent_sd: float | None = None
    noise_sd: float = 1.0
    ambient: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """All readings of a flight in one place, and what is known of the medium.

    `s`, `t`, `y` (n,) and `leg` (n,) in leg order; `length` (L,); `rise` (L,) height gained where it is known (3-D).
    `basis` (n, P) instead of legs for a parametric path. `spread2` (1,) or (K,): C at the first reading where it is
    known; `age` (1,) or (K,): the sources' age then; `rate` = 4μ where known, 0 in a static field.
    `drift` of the ambient level that is unknown, None; one that is known has been taken out of the readings.
    `spreads`: how many C are unknown, "none", "shared" or "each".

    Many readings are carried by few (reduce.py): then `s`, `t`, `leg` are places of the model, leg j's block of which
    `mix[j]` turns into as many of the numbers `y`; `n_readings` are behind them and `outside` is what they leave over.

    `slack`: how far readings may be off, root mean square, because legs were not flown quite as told.
    """

    s: Array
    t: Array
    y: Array
    leg: NDArray[np.int64]
    length: Array
    ambient: float | None
    static: bool
    spreads: str
    spread2: Array | None
    age: Array | None
    rate: float | None
    dimensions: int = 2
    rise: Array | None = None
    basis: Array | None = None
    lag: float | None = 0.0
    extent: float | None = 0.0
    drift: float | None = 0.0
    known: Known = Known()
    mix: tuple[Array, ...] | None = None
    n_readings: int = 0
    outside: float = 0.0
    slack: float = 0.0

    @property
    def n_legs(self) -> int:
        """Straight legs; 0 for a parametric path."""
        return self.length.size

    @property
    def doubt(self) -> float:
        """What slack adds to the cost for each of the numbers that a leg's readings can carry."""
        return self.slack**2 * self.n_readings / (NUMBERS_A_LEG * max(self.n_legs, 1))


def problem(flight: Flight, medium: Medium) -> Problem:
    """The problem a flight and a medium pose, point releases assumed unless the medium says otherwise."""
    curve = flight.parametric
    if curve is not None:
        distance, t, y = np.zeros(curve.reading.size), curve.time_s, curve.reading
        leg, basis = np.zeros(y.size, dtype=np.int64), curve.basis
    else:
        distance = np.concatenate([leg.distance_m for leg in flight.legs])
        t = np.concatenate([leg.time_s for leg in flight.legs])
        y = np.concatenate([leg.reading for leg in flight.legs])
        leg = np.repeat(np.arange(len(flight.legs)), [leg.reading.size for leg in flight.legs])
        basis = None
    first = float(t[0])
    mu, tau = medium.diffusivity_m2_s, medium.activation_s
    age = None if tau is None or isinstance(tau, str) else first - np.atleast_1d(np.asarray(tau, dtype=np.float64))
    spread2 = None
    if medium.spread_m is not None:
        spread2 = np.array([medium.spread_m**2])
    elif mu is not None and age is not None:
        spread2 = 4.0 * mu * age
    one_each = tau is None and not (medium.static and mu is None)
    spreads = "none" if spread2 is not None else "each" if one_each else "shared"
    rises = [leg.rise_m for leg in flight.legs]
    climbs = medium.dimensions == 3 and bool(rises) and all(rise is not None for rise in rises)
    drift = medium.ambient_drift_per_s
    return Problem(
        s=distance,
        t=t - first,
        y=y - drift * (t - first) if drift else y,
        leg=leg,
        length=flight.lengths_m,
        ambient=medium.ambient,
        static=medium.static,
        spreads=spreads,
        spread2=spread2,
        age=age,
        rate=0.0 if medium.static else (None if mu is None else 4.0 * mu),
        dimensions=medium.dimensions,
        rise=np.array(rises, dtype=np.float64) if climbs else None,
        basis=basis,
        lag=medium.sensor_lag_s,
        extent=medium.extent or 0.0,
        drift=0.0 if drift is not None else None,
        n_readings=y.size,
    )


def steadied(flight: Flight, drift_per_s: float) -> Flight:
    """The flight's readings without a drift of the ambient level."""
    if not drift_per_s or flight.parametric is not None:
        return flight
    first = min(float(leg.time_s[0]) for leg in flight.legs if leg.time_s.size)
    legs = (replace(leg, reading=leg.reading - drift_per_s * (leg.time_s - first)) for leg in flight.legs)
    return replace(flight, legs=tuple(legs))


def alike(prob: Problem) -> Problem:
    """The problem with one C for all sources, whatever is known of each, and nothing known beside the readings; a level
    that drifts is one unknown on every leg.
    """
    return replace(
        prob,
        spreads="shared" if prob.spreads == "each" else prob.spreads,
        spread2=None if prob.spread2 is None else np.exp(np.log(prob.spread2).mean(keepdims=True)),
        age=None if prob.age is None else np.exp(np.log(prob.age).mean(keepdims=True)),
        lag=prob.lag or 0.0,
        extent=0.0,
        ambient=None if prob.drift is None else prob.ambient,
        drift=0.0,
        known=Known(),
    )
