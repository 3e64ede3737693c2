"""One round of the search: a corner, one angle, then leg by leg (theory, section 8, steps 3–6).

Two adjacent legs alone, their angle left out, give each source's projections on both; one turn angle then opens the
map of all sources at once; legs are added on either side, each by a scan of its heading, and the fit on the compressed
legs so far keeps the best.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.compress import Compressed
from dslam_mav.dslam.kernels.beam_fit import beam_fits
from dslam_mav.dslam.kernels.corner import corner_fits, open_corner
from dslam_mav.dslam.kernels.distinct import distinct
from dslam_mav.dslam.kernels.fit import FitOptions, fit_batch
from dslam_mav.dslam.kernels.scan import scan_heading
from dslam_mav.dslam.modes import Modes, best, canonical, misfit

Array = NDArray[np.float64]

CORNER_STARTS = 80
CORNER_ITERATIONS = 40
CORNER_PRIOR_SD = 1.0
CORNER_KEEP = 24
CORNER_APART = 0.05
TURN_ANGLES = 40
REACH_SPREADS = 2.6
SCAN_HEADINGS = 64
SCAN_KEEP = 200
BEAM = 60
BEAM_ITERATIONS = (6, 5, 4, 4, 8)
FINALIST_ITERATIONS = 10
FINISH_WINDOW = 100.0  # finish those whose χ² is within this of the best
FINISHED = 24
FINISHED_ITERATIONS = 60
TOLERANCE = 1e-9
AMPLITUDE_SD = 3.0  # of the weak prior on log amplitude about the largest reading


def search_round(
    comp: Compressed, k_sources: int, corner: int, rng: np.random.Generator, reach: float = REACH_SPREADS
) -> Modes:
    """One round from one corner (legs `corner` and `corner + 1`): the best few distinct minima on all legs.

    `reach`: how far from the corner's first leg a source may be.
    """
    last = comp.legs.length.size - 1
    beam = _open(comp, k_sources, corner, rng, reach)
    lo, hi, step = corner, corner + 1, 0
    while len(beam) and (lo > 0 or hi < last):
        beam, lo, hi = _add_leg(comp, beam, (lo, hi), step, rng)
        step += 1
    if not len(beam):
        return beam
    beam = best(roughly_fitted(comp, beam, 0, last, FINALIST_ITERATIONS), 0, last, BEAM)
    near = beam.cost < beam.cost[:1] + FINISH_WINDOW * misfit(beam, comp, k_sources)
    beam = roughly_fitted(comp, beam.take(np.flatnonzero(near)[:FINISHED]), 0, last, FINISHED_ITERATIONS)
    beam = fitted(comp, best(beam, 0, last, FINISHED), 0, last, FINISHED_ITERATIONS)
    return canonical(best(beam, 0, last, FINISHED))


def fitted(comp: Compressed, modes: Modes, lo: int, hi: int, iterations: int) -> Modes:
    """The candidates after so many iterations of the fit on legs lo … hi."""
    theta, s, alpha = modes.theta.copy(), modes.s.copy(), modes.alpha.copy()
    how = FitOptions(lo, hi, _largest_log(comp), AMPLITUDE_SD, iterations, TOLERANCE)
    cost, _ = fit_batch(comp.legs, how, theta, s, alpha)
    return Modes(theta, s, alpha, cost, modes.rounds)


def roughly_fitted(comp: Compressed, modes: Modes, lo: int, hi: int, iterations: int) -> Modes:
    """As `fitted`, eight candidates at a time, with one C on a leg."""
    theta, s, alpha = modes.theta.copy(), modes.s.copy(), modes.alpha.copy()
    how = FitOptions(lo, hi, _largest_log(comp), AMPLITUDE_SD, iterations, TOLERANCE)
    cost = beam_fits(comp.products, how, theta, s, alpha)
    return Modes(theta, s, alpha, cost, modes.rounds)


def corners_by_energy(comp: Compressed) -> NDArray[np.int64]:
    """Corners in the order rounds use them: first those whose weaker leg sees most."""
    energy = (comp.legs.z**2).sum(axis=1)
    return np.argsort(-np.minimum(energy[:-1], energy[1:]), kind="stable").astype(np.int64)


def _largest_log(comp: Compressed) -> float:
    """Log of the largest reading, roughly, in the units of α: a sample's size is that of its leg's peak."""
    size = np.sqrt((comp.legs.z**2).sum(axis=1).max() / comp.rank.mean())
    return float(np.log(max(float(size), 1e-3)))


def _corner_starts(comp: Compressed, corner: int, k_sources: int, rng: np.random.Generator) -> Array:
    """(B, K, 3) starts (U, V, W) drawn where the two legs' samples say the signal is."""
    legs = comp.legs
    nodes = legs.y0 + legs.h * np.arange(legs.table.shape[1])
    places, logs = [], []
    for j in (corner, corner + 1):
        curves = legs.table[j, :, 0, :]
        norm = (curves**2).sum(axis=1)
        inside = (nodes > -1.5) & (nodes < legs.length[j] + 1.5)
        level = np.where(inside & (norm > 1e-6), curves @ legs.z[j] / np.maximum(norm, 1e-6), 0.0)
        weight = np.maximum(level, 0.0) * np.sqrt(norm)
        weight = weight + (0.05 * weight.max() + 1e-12) * inside
        pick = rng.choice(nodes.size, size=(CORNER_STARTS, k_sources), p=weight / weight.sum())
        places.append(nodes[pick] + legs.h * rng.random(pick.shape))
        logs.append(np.log(np.maximum(level[pick], 1e-3 * level.max() + 1e-9)))
    u, w = places[0] - legs.length[corner], places[1]
    v = np.minimum(logs[0] - u**2 / legs.c[corner], logs[1] - w**2 / legs.c[corner + 1])
    return np.stack([u, v + np.log(0.7), w], axis=2)


def _open(comp: Compressed, k_sources: int, corner: int, rng: np.random.Generator, reach: float) -> Modes:
    """Candidates on the two legs of one corner; sources from the first of the two legs' start."""
    legs = comp.legs
    uvw = _corner_starts(comp, corner, k_sources, rng)
    costs = corner_fits(comp.products, corner, uvw, CORNER_PRIOR_SD, CORNER_ITERATIONS)
    order = np.argsort(costs, kind="stable")
    by_u = np.take_along_axis(uvw, np.argsort(uvw[:, :, 0], axis=1)[:, :, None], axis=1)
    marks = by_u.reshape(len(uvw), 3 * k_sources)
    angles = (np.arange(TURN_ANGLES) + rng.random()) * (np.pi / TURN_ANGLES)
    turn, s, alpha = open_corner(
        uvw[order[distinct(marks[order], CORNER_KEEP, CORNER_APART)]],
        legs.c[corner],
        legs.c[corner + 1],
        legs.length[corner],
        np.clip(angles, 1e-3, np.pi - 1e-3),
        reach,
        _largest_log(comp) + 3.0 * AMPLITUDE_SD,
    )
    theta = np.zeros((turn.size, legs.length.size))
    theta[:, corner + 1] = turn
    return Modes(theta, s, alpha, np.zeros(turn.size))


def _add_leg(
    comp: Compressed, beam: Modes, span: tuple[int, int], step: int, rng: np.random.Generator
) -> tuple[Modes, int, int]:
    """One leg more, on the side with more energy: scan its heading, keep the best, fit all legs so far."""
    legs, (lo, hi) = comp.legs, span
    energy = (legs.z**2).sum(axis=1)
    backwards = hi == legs.length.size - 1 or (lo > 0 and energy[lo - 1] > energy[hi + 1])
    j = lo - 1 if backwards else hi + 1
    start = np.zeros((len(beam), 2))
    if not backwards:
        for i in range(lo, hi + 1):
            start[:, 0] += legs.length[i] * np.cos(beam.theta[:, i])
            start[:, 1] += legs.length[i] * np.sin(beam.theta[:, i])
    headings = (np.arange(SCAN_HEADINGS) + rng.random()) * (2.0 * np.pi / SCAN_HEADINGS)
    found, cost = scan_heading(comp.products, j, start, beam.s, beam.alpha, headings, backwards)
    score = (cost + beam.cost[:, None]).ravel()
    order = np.argsort(score, kind="stable")[:SCAN_KEEP]
    order = order[np.isfinite(score[order])]
    grown = beam.take(order // 2)
    grown.theta[:, j] = found.ravel()[order]
    if backwards:
        grown.s[:, :, 0] += (legs.length[j] * np.cos(grown.theta[:, j]))[:, None]
        grown.s[:, :, 1] += (legs.length[j] * np.sin(grown.theta[:, j]))[:, None]
    lo, hi = min(lo, j), max(hi, j)
    grown = roughly_fitted(comp, grown, lo, hi, BEAM_ITERATIONS[min(step, len(BEAM_ITERATIONS) - 1)])
    return best(grown, lo, hi, BEAM), lo, hi
