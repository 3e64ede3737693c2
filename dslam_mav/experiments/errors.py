"""The paper's errors of an estimate (V-A), in the scene's frame."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.align import to_canonical
from dslam_mav.dslam.scoring import has_positions, match, paper_line_error, paper_source_error
from dslam_mav.experiments.world import World
from dslam_mav.records import Estimate

Array = NDArray[np.float64]


def in_scene(estimate: Estimate, world: World) -> tuple[Array, Array, NDArray[np.intp]] | None:
    """(sources (K, d), vertices (M+1, d), index (K,) of each true source's estimate) in the scene's frame.

    Flights along legs are aligned on the first leg and the sense of the first turn; along a curve, and in space, by the
    orthogonal transformation that brings the whole paths together ("up to an orthogonal transformation", III-C).
    None where the estimate says no positions.
    """
    truth = world.truth
    if not has_positions(estimate) or estimate.path.vertices_m.shape != truth.vertices_m.shape:
        return None
    sources, vertices = estimate.sources.position_m, estimate.path.vertices_m
    if sources.shape[1] == 2 and estimate.path.coefficients_m is None:
        alignment = to_canonical(truth.vertices_m)
        sources, vertices = alignment.invert(sources), alignment.invert(vertices)
    else:
        sources, vertices = _whole_path(sources, vertices, truth.vertices_m)
    found, real = match(sources, truth.source_position_m)
    return sources, vertices, found[np.argsort(real)]


def _whole_path(sources: Array, vertices: Array, truth: Array) -> tuple[Array, Array]:
    centre, wanted = vertices.mean(axis=0), truth.mean(axis=0)
    left, _, right = np.linalg.svd((vertices - centre).T @ (truth - wanted))
    turn = left @ right
    return (sources - centre) @ turn + wanted, (vertices - centre) @ turn + wanted


def paper_errors(estimate: Estimate, world: World) -> dict[str, float]:
    """E_sources, E_lines, E_amp, and E_t1, E_t2, … (s) of each source; NaN where the estimate says no positions."""
    k = len(world.truth.amplitude)
    names = ["E_sources", "E_lines", "E_amp", *(f"E_t{i + 1}" for i in range(k))]
    placed = in_scene(estimate, world)
    if placed is None or len(estimate.sources) != k:
        return dict.fromkeys(names, float("nan"))
    sources, vertices, order = placed
    truth, real = world.truth, world.sources
    amplitude = np.abs(estimate.sources.amplitude[order] - real.amplitude) / real.amplitude
    late = np.abs(estimate.sources.activation_s[order] - real.activation_s)
    values = [
        paper_source_error(sources[order], truth.source_position_m),
        _curve_error(vertices, truth.vertices_m)
        if estimate.path.coefficients_m is not None
        else paper_line_error(vertices, truth.vertices_m),
        float(amplitude.mean()),
        *late.tolist(),
    ]
    return dict(zip(names, values, strict=True))


def _curve_error(vertices: Array, truth: Array) -> float:
    """E_lines of a curve: the mean over its readings."""
    return float(np.mean(np.linalg.norm(vertices - truth, axis=1) / np.linalg.norm(truth, axis=1)))
