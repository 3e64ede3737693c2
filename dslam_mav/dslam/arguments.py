"""What estimate() is given, checked: misuse is a ValueError that names the argument, hopeless data get words."""

from __future__ import annotations

from collections.abc import Mapping, Sized
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.problem import Problem
from dslam_mav.records import Estimate, Flight, Leg, Medium, Sources
from dslam_mav.records.arrays import finite, number

Array = NDArray[np.float64]

HUGE = 1e100  # lengths, spreads and times beyond it, or below its inverse, have squares that float64 cannot hold
NARROWEST = 1.0 / 500.0  # of the longest leg: a narrower spread is met by no path but by chance, …
WIDEST = 1e3  # … and over one so many times as wide as the longest leg readings are all alike
MOST_BEYOND = 1.0  # of a leg's length: how far off its ends a reading may lie and still be of that leg
MOST_TEXT = 60  # letters of a value told in an error …
MOST_ITEMS = 12  # … and items, not to build the text of a whole flight
ALIKE = 1e-12  # of the largest reading: readings that differ less do not differ
REMOTE = 1e-9  # of their distance from a known ambient level: that little difference sources do not explain


def check(flight: Flight, medium: Medium, method: str, start: Estimate | None, seed: int) -> None:
    """ValueError for what can be no flight, medium, method, start or seed, or not together."""
    if isinstance(flight, (tuple, list)) and flight and all(isinstance(leg, Leg) for leg in flight):
        raise ValueError(f"flight: expected a Flight, got its {len(flight)} legs alone; use Flight(legs)")
    _kind("flight", flight, Flight)
    _kind("medium", medium, Medium)
    if method not in ("joint", "paper"):
        raise ValueError(f'method: expected "joint" or "paper", got {short(method)}')
    if start is not None:
        _kind("start", start, Estimate)
    if not isinstance(seed, (int, np.integer)) or isinstance(seed, bool) or seed < 0:
        raise ValueError(f"seed: expected a whole number, 0 or more, got {short(seed)}")
    curve = flight.parametric
    if not flight.legs and curve is None:
        raise ValueError("flight: expected at least one leg, or a parametric path")
    if medium.dimensions == 2 and any(leg.rise_m for leg in flight.legs):
        raise ValueError("medium.dimensions: expected 3 for legs that climb (rise_m), got 2")
    _check_times(flight, medium)
    _check_sizes(flight, medium)


def check_count(name: str, value: Any, most: int) -> None:
    """ValueError unless so many sources can be looked for."""
    whole = isinstance(value, (int, np.integer)) and not isinstance(value, bool)
    if not (whole and 1 <= value <= most):
        raise ValueError(f"{name}: expected a whole number from 1 to {most}, got {short(value)}")


def check_mission(sources: Sources, medium: Medium, positive: Mapping[str, object]) -> None:
    """ValueError for what can be no sources or medium of a mission to come, or no `positive` numbers of it."""
    _kind("sources", sources, Sources)
    _kind("medium", medium, Medium)
    for name, value in positive.items():
        if number(value, name, "a positive number") <= 0.0:
            raise ValueError(f"{name}: expected a positive number, got {short(value)}")
    d = sources.position_m.shape[1]
    if not len(sources) or d != medium.dimensions:
        raise ValueError(f"sources: expected places in {medium.dimensions} dimensions, got {len(sources)} in {d}")
    for name in ("position_m", "amplitude", "peak_reading"):
        finite(getattr(sources, name), f"sources.{name}")
    for name in ("amplitude", "peak_reading"):
        if not (getattr(sources, name) > 0.0).all():
            raise ValueError(f"sources.{name}: expected positive numbers, got {getattr(sources, name).min():g}")


def usable(start: Estimate | None) -> Estimate | None:
    """The earlier estimate, where it is an answer to begin from; one without positions is none."""
    if start is None:
        return None
    sources, path = start.sources, start.path.vertices_m
    strong = np.concatenate([sources.amplitude, sources.peak_reading])
    if not (np.isfinite(sources.position_m).all() and np.isfinite(strong).all() and (strong > 0.0).all()):
        return None
    step = np.linalg.norm(np.diff(path, axis=0), axis=1)
    return start if step.size and np.isfinite(path).all() and (step > 0.0).any() else None


def hopeless(prob: Problem) -> str | None:
    """Why readings tell nothing, whatever is done with them; None where they may."""
    y = prob.y
    if float(np.ptp(y)) <= ALIKE * float(np.abs(y).max()):
        return f"All {y.size} readings are {y[0]:g}: no source is in reach, or the sensor is stuck."
    if prob.ambient is not None and float(np.ptp(y)) <= REMOTE * float(np.abs(y - prob.ambient).max()):
        return f"Readings are alike beside their distance from the ambient level of {prob.ambient:g}."
    if prob.basis is not None and not np.ptp(prob.basis, axis=0).any():
        return "The path's functions are constant: all readings were taken at one place."
    reason = _off_the_leg(prob)
    if reason is not None:
        return reason
    return None if prob.spread2 is None or not prob.n_legs else _out_of_scale(prob, prob.spread2)


def _off_the_leg(prob: Problem) -> str | None:
    """Readings too far beyond a leg's ends: the search would take them for readings nearer by (starts.samples)."""
    if not prob.n_legs:
        return None
    length = prob.length[prob.leg]
    beyond = np.maximum(-prob.s, prob.s - length) / length
    worst = int(np.argmax(beyond))
    if beyond[worst] <= MOST_BEYOND:
        return None
    return (
        f"A reading of leg {int(prob.leg[worst]) + 1} lies at {prob.s[worst]:.3g} m, more than the leg's length of "
        f"{length[worst]:.3g} m beyond its ends: distance_m, or where the leg begins, is wrong."
    )


def _out_of_scale(prob: Problem, first: Array) -> str | None:
    spread2 = np.concatenate([first, first + (prob.rate or 0.0) * prob.t[-1]])
    spread, longest = np.sqrt(spread2), float(prob.length.max())
    if spread.max() < NARROWEST * longest:
        return f"Sources only {spread.max():.3g} m wide are lost beside legs of {longest:.3g} m."
    if spread.min() > WIDEST * longest:
        return f"Sources {spread.min():.3g} m wide are flat along legs of {longest:.3g} m."
    return None


def _kind(name: str, value: object, kind: type) -> None:
    if not isinstance(value, kind):
        raise ValueError(f"{name}: expected a {kind.__name__}, got {short(value)}")


def short(value: object) -> str:
    """A value in a few words: what is long is told by its kind and size."""
    kind, size = type(value).__name__, len(value) if isinstance(value, Sized) else None
    text = repr(value) if size is None or size <= MOST_ITEMS else ""
    return (
        text if text and len(text) <= MOST_TEXT and "\n" not in text else f"{kind} of {size}" if size else f"a {kind}"
    )


def _check_times(flight: Flight, medium: Medium) -> None:
    """Every source has been released before the first reading."""
    curve, tau = flight.parametric, medium.activation_s
    times = [leg.time_s[0] for leg in flight.legs if leg.time_s.size] if curve is None else list(curve.time_s[:1])
    if times and tau is not None and not isinstance(tau, str) and float(np.max(tau)) >= times[0]:
        first, late = float(times[0]), float(np.max(tau))
        raise ValueError(f"medium.activation_s: expected a time before the first reading at {first} s, got {late}")


def _check_sizes(flight: Flight, medium: Medium) -> None:
    """Squares and differences of what is given can be held."""
    sizes = {f"flight.legs[{j}].length_m": leg.length_m for j, leg in enumerate(flight.legs)}
    for name in ("spread_m", "diffusivity_m2_s"):
        if getattr(medium, name) is not None:
            sizes[f"medium.{name}"] = getattr(medium, name)
    if flight.parametric is not None and flight.parametric.basis.any():
        sizes["flight.parametric.basis"] = float(np.abs(flight.parametric.basis).max())
    for name, size in sizes.items():
        if not 1.0 / HUGE <= size <= HUGE:
            raise ValueError(f"{name}: expected a size from {1.0 / HUGE:g} to {HUGE:g}, got {size:g}")
    parts = [leg.reading for leg in flight.legs] if flight.parametric is None else [flight.parametric.reading]
    ends = [float(end) for part in parts if part.size for end in (part.min(), part.max())]
    if ends and not np.isfinite(max(ends) - min(ends)):
        raise ValueError(f"flight: expected readings whose range float64 holds, got {min(ends):g} to {max(ends):g}")
