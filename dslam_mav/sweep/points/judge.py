"""An answer beside the truth, as a row."""

from __future__ import annotations

import numpy as np

from dslam_mav.dslam.scoring import Score, has_positions, score
from dslam_mav.records import Estimate, Flight, Truth
from dslam_mav.records.arrays import Array
from dslam_mav.sweep.points.columns import Row

FOUND_SD = 5.0
FOUND_SPREADS = 0.05  # nearer than this is found, however sure the answer is of itself


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
    modes = [answer, *answer.alternatives]
    scores = [score(mode, truth) for mode in modes]
    hits = [_is_truth(mode, one, spread_m) for mode, one in zip(modes, scores, strict=True)]
    row: Row = {"found": hits[0], "listed": any(hits)}
    nearest = [one.source_error_rms_m for one in scores if one is not None and one.same_number]
    row["nearest_error_m"] = min(nearest, default=None)
    first = scores[0]
    if first is not None:
        matched = first.source_error_m[np.isfinite(first.source_error_m)]
        row |= {
            "source_error_median_m": float(np.median(matched)),
            "source_error_max_m": float(matched.max()),
            "source_error_rms_m": first.source_error_rms_m,
            "path_error_m": first.path_error_rms_m,
            "nees": float(_squares(answer, first).mean()) / answer.sources.position_m.shape[1],
        }
    return row


def _is_truth(mode: Estimate, judged_by: Score | None, spread_m: float) -> bool:
    if judged_by is None or not judged_by.same_number:
        return False
    near = judged_by.source_error_m < FOUND_SPREADS * spread_m
    return bool((near | (_squares(mode, judged_by) < FOUND_SD**2)).all())


def _squares(mode: Estimate, judged_by: Score) -> Array:
    """(M,) squared errors of the matched sources in their own covariances; NaN where the method gives none."""
    place, truth, own = mode.sources.position_m, judged_by.truth.source_position_m, mode.position_covariance_m2
    pairs = [(k, real) for k, real in enumerate(judged_by.matching) if real is not None]
    if not np.isfinite(own).all():
        return np.full(len(pairs), np.nan)
    return np.array([(off := place[k] - truth[real]) @ np.linalg.pinv(own[k]) @ off for k, real in pairs])


def _sd_m(answer: Estimate) -> float:
    return float(np.sqrt(np.trace(answer.position_covariance_m2, axis1=1, axis2=2).mean()))
