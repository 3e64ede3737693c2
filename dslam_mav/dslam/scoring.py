"""Errors of an estimate against truth (V-A).

An estimate in the canonical gauge is compared after a proper alignment on leg 1 and the sense of the first
turn, an anchored one as it is. The paper's relative errors divide by distances from an origin, so they are
computed in the scene's frame, whose origin is home and not the path's start.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.align import Alignment, to_canonical, truth_in_canonical
from dslam_mav.records import Estimate, Truth

Array = NDArray[np.float64]

PAPER_FRAME = "scene, origin at home"
_TOUCH_M = 1e-9  # a leg that passes the origin closer than this divides by zero in E_lines


@dataclass(frozen=True, slots=True, eq=False)
class Score:
    """What separates an estimate of K sources and L legs from truth; metres are of the estimate's gauge.

    `matching` names each estimated source's truth (best assignment) or None; `source_error_m` (K,) and
    `amplitude_relative_error` (K,) are NaN for unmatched ones. `vertex_error_m` (M+1,) and `path_error_rms_m`
    (along the whole line, not its corners alone) compare the M legs that both have. `paper_sources`,
    `paper_lines` and `paper_amplitudes` are E_sources, E_lines and E_amp of V-A in `paper_frame`; infinite
    where truth itself touches the origin. `truth` is the truth in the estimate's gauge.
    """

    source_error_m: Array
    matching: tuple[int | None, ...]
    amplitude_relative_error: Array
    vertex_error_m: Array
    path_error_rms_m: float
    paper_sources: float
    paper_lines: float
    paper_amplitudes: float
    same_number: bool
    truth: Truth
    paper_frame: str = PAPER_FRAME

    @property
    def source_error_rms_m(self) -> float:
        """Root mean square over the matched sources."""
        matched = self.source_error_m[np.isfinite(self.source_error_m)]
        return float(np.sqrt(np.mean(matched**2))) if matched.size else math.nan


def has_positions(estimate: Estimate) -> bool:
    """Whether the estimate says where things are: not so for verdicts that keep positions NaN."""
    return bool(
        len(estimate.sources)
        and np.isfinite(estimate.sources.position_m).all()
        and np.isfinite(estimate.path.vertices_m).all()
    )


def truth_in_gauge(estimate: Estimate, truth: Truth) -> Truth | None:
    """Truth in the gauge of the estimate; None where its path fixes no gauge or dimensions differ."""
    d = estimate.sources.position_m.shape[1]
    if truth.source_position_m.shape[1] != d or truth.vertices_m.shape[1] != d:
        return None
    if estimate.gauge == "anchored":
        return truth
    moves = len(truth.vertices_m) > 1 and bool(np.any(np.diff(truth.vertices_m, axis=0)))
    return truth_in_canonical(truth) if d == 2 and moves else None


def score(estimate: Estimate, truth: Truth) -> Score | None:
    """The errors of `estimate`; None where it has no positions or truth cannot be brought into its gauge."""
    aligned = truth_in_gauge(estimate, truth)
    if aligned is None or not has_positions(estimate):
        return None
    found, real = match(estimate.sources.position_m, aligned.source_position_m)
    k = len(estimate.sources)
    error_m, relative = np.full(k, np.nan), np.full(k, np.nan)
    error_m[found] = np.linalg.norm(estimate.sources.position_m[found] - aligned.source_position_m[real], axis=1)
    relative[found] = _ratio(
        np.abs(estimate.sources.amplitude[found] - truth.amplitude[real]), np.abs(truth.amplitude[real])
    )
    matching: list[int | None] = [None] * k
    for i, j in zip(found, real, strict=True):
        matching[int(i)] = int(j)
    m = min(len(estimate.path.vertices_m), len(aligned.vertices_m))
    offset_m = estimate.path.vertices_m[:m] - aligned.vertices_m[:m]
    alignment = _from_scene(estimate, truth)
    sources_m, vertices_m = (
        points if alignment is None else alignment.invert(points)
        for points in (estimate.sources.position_m[found], estimate.path.vertices_m[:m])
    )
    return Score(
        source_error_m=error_m,
        matching=tuple(matching),
        amplitude_relative_error=relative,
        vertex_error_m=np.linalg.norm(offset_m, axis=1),
        path_error_rms_m=line_rms_m(offset_m, aligned.vertices_m[:m]),
        paper_sources=paper_source_error(sources_m, truth.source_position_m[real]),
        paper_lines=paper_line_error(vertices_m, truth.vertices_m[:m]),
        paper_amplitudes=_mean(relative[found]),
        same_number=k == len(truth.amplitude),
        truth=aligned,
    )


def match(position_m: Array, truth_m: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """The assignment of (K, d) to (M, d) places with the least sum of distances: two (min(K, M),) indices."""
    from scipy.optimize import linear_sum_assignment  # a tenth of a second, for whoever knows the truth

    distance_m = np.linalg.norm(position_m[:, None, :] - truth_m[None, :, :], axis=2)
    found, real = linear_sum_assignment(distance_m)
    return found, real


def line_rms_m(offset_m: Array, vertices_m: Array) -> float:
    """Root mean square along a line (M+1, d) of an offset given at its vertices and linear between them."""
    lengths = np.linalg.norm(np.diff(vertices_m, axis=0), axis=1)
    if not lengths.sum() > 0.0:
        return math.nan
    a, b = offset_m[:-1], offset_m[1:]
    mean_square = ((a * a).sum(axis=1) + (a * b).sum(axis=1) + (b * b).sum(axis=1)) / 3.0
    return float(np.sqrt(max(0.0, float(lengths @ mean_square / lengths.sum()))))


def paper_source_error(estimated_m: Array, truth_m: Array) -> float:
    """E_sources = mean over sources of |S̃ − S| / |S| (V-A); both (K, d) in the scene's frame, matched."""
    return _mean(_ratio(np.linalg.norm(estimated_m - truth_m, axis=1), np.linalg.norm(truth_m, axis=1)))


def paper_line_error(estimated_m: Array, truth_m: Array) -> float:
    """E_lines = mean over legs of ∫₀¹ |r̃(s) − r(s)| / |r(s)| ds (V-A); both (M+1, d) in the scene's frame."""
    legs = range(len(truth_m) - 1)
    return _mean(np.array([_leg_integral(estimated_m[j : j + 2], truth_m[j : j + 2]) for j in legs]))


def _leg_integral(estimated_m: Array, truth_m: Array) -> float:
    """One leg of E_lines; both (2, d). Infinite where only the true leg meets the origin."""
    from scipy.integrate import quad

    start, along = truth_m[0], truth_m[1] - truth_m[0]
    offset, change = estimated_m[0] - start, estimated_m[1] - estimated_m[0] - along
    square = float(along @ along)
    nearest = min(1.0, max(0.0, -float(start @ along) / square)) if square > 0.0 else 0.0
    if np.linalg.norm(start + nearest * along) < _TOUCH_M:
        if np.linalg.norm(offset + nearest * change) > _TOUCH_M:
            return math.inf
        # Both pass through the origin together: the quotient is the same all along the leg.
        return math.sqrt(float(change @ change) / square) if square > 0.0 else 0.0

    def quotient(s: float) -> float:
        return float(np.linalg.norm(offset + s * change) / np.linalg.norm(start + s * along))

    return float(quad(quotient, 0.0, 1.0, points=[nearest], limit=200)[0])


def _from_scene(estimate: Estimate, truth: Truth) -> Alignment | None:
    return None if estimate.gauge == "anchored" else to_canonical(truth.vertices_m)


def _ratio(error: Array, size: Array) -> Array:
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(error == 0.0, 0.0, error / size)


def _mean(values: Array) -> float:
    return float(values.mean()) if values.size else math.nan
