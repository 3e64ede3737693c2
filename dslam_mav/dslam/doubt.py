"""Answers that fit, and yet cannot be: readings colder than the ambient level, known places that the path misses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.priors import POINT_SHARE, Priors
from dslam_mav.records import Estimate, Flight, Verdict

Array = NDArray[np.float64]

WINDOWS = (4, 8, 16)  # readings whose mean tells a dip from noise
DIP_SD = 6.0
DIP_MATTERS = 0.06  # of the readings' range
MISSED_SD = 5.0


def doubted(result: Estimate, flight: Flight, priors: Priors) -> Estimate:
    """The estimate, called a misfit where what is known of sources or path speaks against it."""
    if result.verdict not in (Verdict.IDENTIFIED, Verdict.AMBIGUOUS):
        return result
    reason = _cold(result, flight) or _missed(result, flight, priors)
    if reason is None:
        return result
    others = (replace(other, verdict=Verdict.MODEL_MISFIT) for other in result.alternatives)
    return replace(result, verdict=Verdict.MODEL_MISFIT, reason=reason, alternatives=tuple(others))


def _cold(result: Estimate, flight: Flight) -> str | None:
    """A stretch of readings below the ambient level, which sources only raise (3)."""
    curve = flight.parametric
    parts = [leg.reading for leg in flight.legs] if curve is None else [curve.reading]
    span = float(max(part.max() for part in parts) - min(part.min() for part in parts))
    level, sd = result.medium.ambient or 0.0, result.diagnostics["residual_outside_sd"]
    depth = 0.0
    for part in parts:
        for width in WINDOWS:
            if part.size < width:
                continue
            lowest = float(np.convolve((level - part) / span, np.full(width, 1.0 / width), mode="valid").max())
            if lowest * span > DIP_SD * sd / np.sqrt(width):
                depth = max(depth, lowest)
    if depth <= DIP_MATTERS:
        return None
    return (
        f"Readings lie below the ambient level of {level:.3g} by {100.0 * depth:.0f} % of their range: "
        "a source that cools, or another ambient level, is not in the model."
    )


def _missed(result: Estimate, flight: Flight, priors: Priors) -> str | None:
    """A known point that the path does not come to, or a closed path that does not close."""
    path = result.path.vertices_m
    size = float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())
    own = float(sum(leg.length_sd_m for leg in flight.legs))  # at worst
    if priors.points_m is not None and priors.point_index is not None:
        off = np.linalg.norm(path[priors.point_index] - priors.points_m, axis=1)
        worst = int(np.argmax(off))
        if off[worst] > MISSED_SD * (POINT_SHARE * size + own):
            return f"The path misses known point {int(priors.point_index[worst])} by {off[worst]:.3g} m."
    if priors.closed_sd_m is not None:
        gap = float(np.linalg.norm(path[-1] - path[0]))
        if gap > MISSED_SD * (priors.closed_sd_m + own):
            return f"The path said to be closed stays open by {gap:.3g} m."
    return None
