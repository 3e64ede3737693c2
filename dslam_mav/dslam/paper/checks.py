"""Misuse of the arguments (ValueError, naming the command line's option too) and flights with too little in them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from dslam_mav.dslam.paper.frozen import known_activation
from dslam_mav.records import Flight, Medium
from dslam_mav.records.words import count


def check(
    flight: Flight, medium: Medium, n_sources: int | None, max_sources: int, known: Mapping[int, ArrayLike] | None
) -> None:
    """ValueError where an argument asks for what the paper's method does not take."""
    if not flight.legs:
        raise ValueError("flight: expected at least one leg")
    _check_medium(medium, n_sources)
    if max_sources < 1:
        raise ValueError(f"max_sources: expected 1 or more, got {max_sources}")
    tau = known_activation(medium)
    first = next((float(leg.time_s[0]) for leg in flight.legs if leg.time_s.size), None)
    if tau is not None and first is not None and tau >= first:
        raise ValueError(
            f"medium.activation_s (--activation): expected a time before the first reading at {first} s, got {tau}"
        )
    for i, point in (known or {}).items():
        if not 0 <= i <= len(flight.legs):
            raise ValueError(f"known_points: expected vertices 0 to {len(flight.legs)}, got {i}")
        if np.shape(point) != (medium.dimensions,) or not np.isfinite(np.asarray(point, dtype=np.float64)).all():
            raise ValueError(f"known_points[{i}]: expected {medium.dimensions} finite numbers, got {point!r}")
    if known is not None and len(known) < medium.dimensions:
        raise ValueError(f"known_points: expected at least {medium.dimensions} points, got {len(known)}")


def check_parametric(medium: Medium, n_sources: int | None, known: Mapping[int, ArrayLike] | None) -> None:
    """The same for a flight along a curve (IV-C): static field, in the plane, without known points."""
    _check_medium(medium, n_sources)
    if not medium.static:
        raise ValueError("medium.static: method 'paper' takes parametric paths through a static field only (IV-C)")
    if medium.dimensions != 2:
        raise ValueError(f"medium.dimensions: expected 2 on a parametric path, got {medium.dimensions}")
    if known is not None:
        raise ValueError("known_points: expected None on a parametric path")


def _check_medium(medium: Medium, n_sources: int | None) -> None:
    if n_sources is not None and n_sources < 1:
        raise ValueError(f"n_sources: expected 1 or more, or None, got {n_sources}")
    if medium.ambient is None:
        raise ValueError("medium.ambient (--ambient): method 'paper' needs it known, got None")
    if medium.ambient_drift_per_s is None:
        raise ValueError("medium.ambient_drift_per_s: method 'paper' takes a number, got None")
    if medium.sensor_lag_s != 0.0:
        raise ValueError(f"medium.sensor_lag_s: method 'paper' takes a sensor without lag, got {medium.sensor_lag_s}")
    if not medium.static and medium.diffusivity_m2_s is None:
        raise ValueError("medium.diffusivity_m2_s (--diffusivity): method 'paper' needs it in an evolving field")
    tau = medium.activation_s
    if isinstance(tau, tuple) and n_sources is not None and len(tau) != n_sources:
        raise ValueError(f"medium.activation_s: expected {n_sources} times, got {len(tau)}")


def too_few(flight: Flight, k: int) -> str | None:
    """Why there are too few legs or readings for K sources, or None."""
    if len(flight.legs) < 3:
        return f"The paper's algebra needs three legs, got {len(flight.legs)}."
    for j, leg in enumerate(flight.legs):
        if leg.reading.size < 2 * k:
            return f"Leg {j + 1} has {count(leg.reading.size, 'reading')}, and needs {2 * k} for {count(k, 'centre')}."
    return None
