"""What a person knows besides the readings: headings, a closed path, known points, plausible strengths."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dslam_mav.dslam.arguments import short
from dslam_mav.dslam.problem import Known, Problem
from dslam_mav.dslam.units import Units
from dslam_mav.records import Flight
from dslam_mav.records.arrays import finite, number, read_only

Array = NDArray[np.float64]

PLAUSIBLE_PEAK = 1.0  # times the readings' range: a stronger source must have been kept away from …
PEAK_LOG_SD = 0.8  # … and the logarithm of what it has beyond costs by this standard deviation
OLDEST_FLIGHTS = 30.0  # flights: an older field stands still as far as one can tell; beyond it age costs by …
AGE_LOG_SD = 1.0  # … this standard deviation of its logarithm
USUAL_LAG = 0.02  # of the flight: where an unknown lag is looked for, …
LAG_LOG_SD = 2.0  # … give or take this standard deviation of its logarithm
EXTENT_SD = 0.3
BESIDE_MATTERS = 1e-3  # of a leg: legs that begin nearer to their lines begin on them
OVERSHOT_SHARE = 1.0 / 50.0  # of a leg: a vehicle that flies so far past its corners and back begins its legs there
CLOSED_SHARE = 1e-3  # of the path: how well a path said to be closed closes
POINT_SHARE = 1e-4  # of the path: how well a known point is known
LEAST_SD = 1e-6  # of the path, or a radian: as exact as a prior may be
FINEST = 1e-5  # of a reading's noise: what is known better is as good as exact, and float64 could not weigh it
SLACK = (
    0.05  # of the legs between two known points: how much further apart they may lie, surveyed and flown as they are …
)
SLACK_SD = 5.0  # … and of the legs' own standard deviations


@dataclass(frozen=True, slots=True, eq=False)
class Priors:
    """`heading_rad` (L,) with their sd, counter-clockwise from east; `closed_sd_m` of the closure; known points.

    `point_index` (M,) vertices lie at `points_m` (M, d); `length_sd_m` (L,) of leg lengths,
    `corner_sd_m` (L − 1,) of where the next leg begins, `beside_m` (L − 1,) how far beside its line that is, on
    either side unless the corners are known to be `overshot`. `ambient`: level and standard deviation; `noise`: a
    reading's standard deviation measured elsewhere, and its degrees of freedom.
    """

    heading_rad: Array | None = None
    heading_sd_rad: float = 0.0
    closed_sd_m: float | None = None
    point_index: NDArray[np.int64] | None = None
    points_m: Array | None = None
    length_sd_m: Array | None = None
    corner_sd_m: Array | None = None
    beside_m: Array | None = None
    overshot: bool = False
    ambient: tuple[float, float] | None = None
    noise: tuple[float, float] | None = None

    @property
    def any(self) -> bool:
        """Whether anything is known that the readings do not say."""
        return self.anchored or self.closed_sd_m is not None or self.ambient is not None

    @property
    def anchored(self) -> bool:
        """Whether the frame is known."""
        return self.heading_rad is not None or self.points_m is not None


def priors_of(
    flight: Flight,
    dimensions: int,
    closed_sd_m: float | None,
    known_points: Mapping[int, ArrayLike] | None,
    heading_prior: tuple[ArrayLike, float] | None,
) -> Priors:
    """The arguments of `estimate` checked; ValueError names the one that cannot be."""
    wanted = "a positive standard deviation"
    if closed_sd_m is not None and number(closed_sd_m, "closed_sd_m", wanted) <= 0.0:
        raise ValueError(f"closed_sd_m: expected a positive standard deviation, got {short(closed_sd_m)}")
    n_legs = len(flight.legs)
    if closed_sd_m is None and flight.closed:
        closed_sd_m = CLOSED_SHARE * float(flight.lengths_m.sum()) if n_legs else None
        if closed_sd_m is None:
            raise ValueError("closed_sd_m: expected the closure's standard deviation for a parametric path")
    if closed_sd_m is not None and n_legs:
        closed_sd_m = max(float(closed_sd_m), LEAST_SD * float(flight.lengths_m.sum()))
    heading, heading_sd = _headings(n_legs, heading_prior)
    index, points = _points(flight, dimensions, known_points, heading is not None)
    lengths = np.array([leg.length_sd_m for leg in flight.legs])
    corner = np.array([leg.corner_sd_m for leg in flight.legs[:-1]])
    far = any(leg.beside_m > BESIDE_MATTERS * leg.length_m for leg in flight.legs[1:])
    beside = np.array([leg.beside_m if far else 0.0 for leg in flight.legs[1:]])
    overshot = [leg.overshot_m > OVERSHOT_SHARE * leg.length_m for leg in flight.legs[:-1]]
    lengths_sd, corner_sd, beside_m = (each if (each > 0.0).any() else None for each in (lengths, corner, beside))
    known = sum(overshot) > len(overshot) // 2
    return Priors(heading, heading_sd, closed_sd_m, index, points, lengths_sd, corner_sd, beside_m, known)


def measured(name: str, pair: tuple[float, float] | None) -> tuple[float, float] | None:
    """A pair of a measured number and how well it is known, checked; ValueError names the argument."""
    if pair is None:
        return None
    if not isinstance(pair, (tuple, list)) or len(pair) != 2:
        raise ValueError(f"{name}: expected two numbers, got {short(pair)}")
    value, known = (float(number(each, name, "two finite numbers")) for each in pair)
    if known <= 0.0 or (name == "noise_prior" and value < 0.0):
        raise ValueError(f"{name}: expected positive numbers, got {short(pair)}")
    return value, known


def _headings(n_legs: int, prior: tuple[ArrayLike, float] | None) -> tuple[Array | None, float]:
    if prior is None:
        return None, 0.0
    if not isinstance(prior, (tuple, list)) or len(prior) != 2:
        raise ValueError(f"heading_prior: expected headings and their standard deviation, got {short(prior)}")
    heading = read_only(prior[0], "heading_prior", (n_legs,))
    finite(heading, "heading_prior")
    if not n_legs:
        raise ValueError("heading_prior: expected None for a parametric path, which has no headings")
    sd = number(prior[1], "heading_prior", "a positive standard deviation")
    if sd <= 0.0:
        raise ValueError(f"heading_prior: expected a positive standard deviation, got {sd}")
    return heading, max(sd, LEAST_SD)


def _points(
    flight: Flight, dimensions: int, known: Mapping[int, ArrayLike] | None, oriented: bool
) -> tuple[NDArray[np.int64] | None, Array | None]:
    if known is None:
        return None, None
    if not isinstance(known, Mapping):
        raise ValueError(f"known_points: expected vertex indices with their places, got {short(known)}")
    if not known:
        return None, None
    count = len(flight.legs) + 1 if flight.legs else flight.n_readings
    for i, point in known.items():
        if isinstance(i, bool) or not (isinstance(i, (int, np.integer)) and 0 <= i < count):
            raise ValueError(f"known_points: expected vertex indices from 0 to {count - 1}, got {short(i)}")
        finite(read_only(point, f"known_points[{i}]", (dimensions,)), f"known_points[{i}]")
    least = 1 if oriented else 2
    if len(known) < least:
        raise ValueError(f"known_points: expected at least {least} points to anchor the path, got {len(known)}")
    index = np.array(sorted(known), dtype=np.int64)
    points = np.array([known[int(i)] for i in index], dtype=np.float64)
    _check_reach(flight, index, points)
    return index, points


def _check_reach(flight: Flight, index: NDArray[np.int64], points: Array) -> None:
    """ValueError where two points lie further apart than the legs between them are long, uncertain as those are."""
    for m in range(index.size - 1 if flight.legs else 0):
        a, b = int(index[m]), int(index[m + 1])
        apart, length = float(np.linalg.norm(points[m + 1] - points[m])), sum(leg.length_m for leg in flight.legs[a:b])
        if apart > length * (1.0 + SLACK) + SLACK_SD * sum(leg.length_sd_m for leg in flight.legs[a:b]):
            wanted = f"points {a} and {b} no further apart than the {length:.6g} m flown between them"
            raise ValueError(f"known_points: expected {wanted}, got {apart:.6g} m")


def bounded(prob: Problem, noise_sd: float, priors: Priors, unit: Units, *, loose: float = 0.0) -> Problem:
    """With the priors every flight has: on strengths, on the age of a field that hardly evolves, on leg lengths, and,
    `loose`, on where legs begin: past the corners where it is above 0, before them where it is below.
    """
    duration = float(prob.t[-1])
    unaged = prob.rate is None and prob.age is None
    lengths = None
    if priors.length_sd_m is not None:
        sd = priors.length_sd_m / unit.length / noise_sd
        lengths = np.where(sd > 0.0, np.maximum(sd, FINEST), 0.0)
    corner = beside = None
    if loose and priors.corner_sd_m is not None:
        sd = abs(loose) * priors.corner_sd_m / unit.length / noise_sd
        corner = np.where(sd > 0.0, np.maximum(sd, FINEST), 0.0)
        if priors.beside_m is not None:
            beside = np.sign(loose) * priors.beside_m / unit.length
    known = Known(
        peak=(PLAUSIBLE_PEAK, PEAK_LOG_SD / noise_sd),
        age=(OLDEST_FLIGHTS * duration, AGE_LOG_SD / noise_sd) if unaged else None,
        lag=(float(np.log(USUAL_LAG * duration)), LAG_LOG_SD / noise_sd) if prob.lag is None else None,
        extent_sd=EXTENT_SD / noise_sd,
        length_sd=lengths,
        corner_sd=corner,
        noise_sd=noise_sd,
        beside=beside,
    )
    return replace(prob, known=known, slack=0.0 if loose else prob.slack)


def constrained(prob: Problem, noise_sd: float, priors: Priors, unit: Units, *, loose: float = 0.0) -> Problem:
    """With all that is known, weighed against the noise of a reading."""
    prob = bounded(prob, noise_sd, priors, unit, loose=loose)
    heading, points = None, None
    if priors.heading_rad is not None:
        heading = (priors.heading_rad, max(priors.heading_sd_rad / noise_sd, FINEST))
    if priors.points_m is not None and priors.point_index is not None:
        size = float(prob.length.sum()) if prob.n_legs else float(np.ptp(priors.points_m, axis=0).max()) / unit.length
        points = (priors.point_index, priors.points_m / unit.length, POINT_SHARE * size / noise_sd)
    closed = None
    if priors.closed_sd_m is not None:
        closed = max(priors.closed_sd_m / unit.length / noise_sd, FINEST)
    ambient = None
    if priors.ambient is not None:
        level, sd = priors.ambient
        ambient = (level / unit.reading, max(sd / unit.reading / noise_sd, FINEST))
    return replace(prob, known=replace(prob.known, heading=heading, points=points, closed_sd=closed, ambient=ambient))


def eased(prob: Problem, factor: float) -> Problem:
    """With what is known of the frame, of the path's end and of the ambient level so many times less sure."""
    known = prob.known
    heading = None if known.heading is None else (known.heading[0], known.heading[1] * factor)
    points = None if known.points is None else (known.points[0], known.points[1], known.points[2] * factor)
    closed = None if known.closed_sd is None else known.closed_sd * factor
    ambient = None if known.ambient is None else (known.ambient[0], known.ambient[1] * factor)
    return replace(prob, known=replace(known, heading=heading, points=points, closed_sd=closed, ambient=ambient))
