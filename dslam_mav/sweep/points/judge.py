"""An answer beside the truth, as a row."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dslam_mav.dslam.scoring import has_positions, line_rms_m, match, truth_in_gauge
from dslam_mav.records import Estimate, Flight, Truth
from dslam_mav.records.arrays import Array
from dslam_mav.sweep.points.columns import Row

FOUND_SD = 5.0
FOUND_SPREADS = 0.05  # nearer than this is found, however sure the answer is of itself


@dataclass(frozen=True, slots=True, eq=False)
class _Beside:
    """One answer and the truth in its gauge: `error_m` (M,) of the sources that have a true one, `squares` (M,) the
    same in the answer's own covariances (NaN where the method gives none), and whether there are as many as there are.
    """

    error_m: Array
    squares: Array
    path_error_m: float
    same_number: bool

    @property
    def rms_m(self) -> float:
        return float(np.sqrt(np.mean(self.error_m**2)))

    def is_truth(self, spread_m: float) -> bool:
        near = (self.error_m < FOUND_SPREADS * spread_m) | (self.squares < FOUND_SD**2)
        return self.same_number and bool(near.all())


def judged(answer: Estimate, flight: Flight, truth: Truth | None, spread_m: float) -> Row:
    """The result columns of an answer; without `truth` only those that need none. `spread_m`: √C, its yardstick."""
    row: Row = {
        "k_true": None if truth is None else len(truth.amplitude),
        "k_found": len(answer.sources),
        "verdict": answer.verdict.name,
        "reason": answer.reason,
        "alternatives": len(answer.alternatives),
        "readings": flight.n_readings,
        "legs": len(flight.legs),
        "path_length_m": float(flight.lengths_m.sum()),
        "spread_m": answer.spread_m,
        "noise_sd": answer.noise_sd,
        "sd_m": _sd_m(answer) if has_positions(answer) else None,
    }
    return row if truth is None else row | _errors(answer, truth, spread_m)


def _errors(answer: Estimate, truth: Truth, spread_m: float) -> Row:
    first, *others = [_beside(mode, truth) for mode in (answer, *answer.alternatives)]
    placed = [one for one in (first, *others) if one is not None]
    row: Row = {
        "found": first is not None and first.is_truth(spread_m),
        "listed": any(one.is_truth(spread_m) for one in placed),
        "nearest_error_m": min((one.rms_m for one in placed if one.same_number), default=None),
    }
    if first is not None:
        row |= {
            "source_error_median_m": float(np.median(first.error_m)),
            "source_error_max_m": float(first.error_m.max()),
            "source_error_rms_m": first.rms_m,
            "path_error_m": first.path_error_m,
            "nees": float(first.squares.mean()) / answer.sources.position_m.shape[1],
        }
    return row


def _beside(mode: Estimate, truth: Truth) -> _Beside | None:
    """None where it has no positions."""
    aligned = truth_in_gauge(mode, truth)
    if aligned is None or not has_positions(mode):
        return None
    found, real = match(mode.sources.position_m, aligned.source_position_m)
    off = mode.sources.position_m[found] - aligned.source_position_m[real]
    own = mode.position_covariance_m2[found]
    squares = np.full(len(found), np.nan)
    if np.isfinite(own).all():
        squares = np.array([o @ np.linalg.pinv(c) @ o for o, c in zip(off, own, strict=True)])
    m = min(len(mode.path.vertices_m), len(aligned.vertices_m))
    path = line_rms_m(mode.path.vertices_m[:m] - aligned.vertices_m[:m], aligned.vertices_m[:m])
    return _Beside(np.linalg.norm(off, axis=1), squares, path, len(mode.sources) == len(truth.amplitude))


def _sd_m(answer: Estimate) -> float:
    return float(np.sqrt(np.trace(answer.position_covariance_m2, axis1=1, axis2=2).mean()))
