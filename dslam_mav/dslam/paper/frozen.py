"""IV-A: an evolving field held still on each leg, at the time of the leg's middle sample: C_j = 4μ(t̂_j − τ).

Kept as C at the flight's first reading and what it has grown since, 4μ(t − t_0): only the first depends on τ.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.field import squared_spread_m2
from dslam_mav.records import Flight, Medium

Array = NDArray[np.float64]


def known_activation(medium: Medium) -> float | None:
    """τ where one known activation time holds for all sources."""
    tau = medium.activation_s
    if isinstance(tau, tuple) and len(set(tau)) == 1:
        return float(tau[0])
    return float(tau) if isinstance(tau, (int, float)) else None


def known_spread2_m2(first_s: float, medium: Medium) -> float | None:
    """C at the first reading, at `first_s`; None where μ, τ and the spread do not settle it (IV-B finds it)."""
    if medium.spread_m is not None:
        return float(medium.spread_m**2)
    tau = known_activation(medium)
    if medium.diffusivity_m2_s is None or tau is None:
        return None
    return float(squared_spread_m2(first_s, medium.diffusivity_m2_s, tau))


def growth_m2(flight: Flight, medium: Medium) -> list[Array]:
    """For every leg (N,): 4μ(t − t_0), zero in a static field."""
    t_0 = flight.legs[0].time_s[0]
    rate = 0.0 if medium.static or medium.diffusivity_m2_s is None else medium.diffusivity_m2_s
    return [squared_spread_m2(leg.time_s, rate, t_0) for leg in flight.legs]
