"""The search in space: a corner, one angle, heights drawn, then leg by leg (theory, section 8, steps 3–7).

As in the plane, two adjacent legs with their angle left out give each source's projections on both, and one angle
opens the map of all sources, but for each one's offset from the plane of the two legs: that is drawn, and drawn anew
for sources no third leg has seen. Legs are added by a scan of their heading where the climb is known, of the sphere
where it is not.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.compress import Compressed
from dslam_mav.dslam.kernels.directions import scan_directions
from dslam_mav.dslam.kernels.space import SpaceFit, fit_in_space
from dslam_mav.dslam.rounds import Candidates, best, joined, searched
from dslam_mav.dslam.space_corner import AMPLITUDE_SD, HEIGHT_SD, Legs, open_corner_in_space, upright

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

REDRAWN = 4  # for sources two legs at most have seen
SCAN = {1: 60, 2: 300}  # headings, or directions of the sphere
KEEP_MINIMA = 3
SCAN_KEEP = 500
BEAM = 100
ITERATIONS = (12, 6, 5, 4, 4, 6)
FINALISTS = 24
FINISHED = 12
SEEN = 2.0  # times the noise: a source's trace on a leg from which it counts as seen there
POLISH = 300  # iterations at last, without that prior: valleys are flat where climbs are free
NO_PRIOR = 1e3
MAX_ROUNDS = 16


def search_in_space(legs: Legs, k_sources: int, rng: np.random.Generator, most: int = MAX_ROUNDS) -> Candidates:
    """Distinct minima on all legs, best first; directions (M, L, 3), sources from the start of the first leg."""
    corners = _corners_by_energy(legs.comp)
    last = legs.comp.legs.length.size - 1
    found = searched(
        lambda i: _round(legs, k_sources, int(corners[i % corners.size]), rng),
        lambda maps: _marks(maps, 0, last),
        most,
        legs.enough(k_sources),
    )
    return best(_fitted(legs, found, (0, last), POLISH, NO_PRIOR), lambda maps: _marks(maps, 0, last), len(found))


def _round(legs: Legs, k_sources: int, corner: int, rng: np.random.Generator) -> Candidates:
    """One round from one corner."""
    last = legs.comp.legs.length.size - 1
    beam, lo, hi, step = open_corner_in_space(legs, k_sources, corner, rng), corner, corner + 1, 0
    while len(beam) and (lo > 0 or hi < last):
        beam, lo, hi = _grown(legs, beam, (lo, hi), step, rng)
        step += 1
    if not len(beam):
        return beam
    beam = _fitted(legs, beam.take(np.arange(min(FINALISTS, len(beam)))), (0, last), 15)
    return _best(_fitted(legs, _best(beam, 0, last, FINISHED), (0, last), 60), 0, last, FINISHED)


def _fitted(
    legs: Legs, maps: Candidates, span: tuple[int, int], iterations: int, alpha_sd: float = AMPLITUDE_SD
) -> Candidates:
    c, s, alpha = maps.path.copy(), maps.s.copy(), maps.alpha.copy()
    how = SpaceFit(*span, legs.turns, legs.largest, alpha_sd, iterations)
    return Candidates(c, s, alpha, maps.level, fit_in_space(legs.comp.legs, how, c, s, alpha))


def _marks(maps: Candidates, lo: int, hi: int) -> Array:
    """What no rotation and no mirror changes on legs lo … hi."""
    rank = np.argsort(np.einsum("mkq,mq->mk", maps.s, maps.path[:, lo]), axis=1)
    s, c = np.take_along_axis(maps.s, rank[:, :, None], axis=1), maps.path[:, lo : hi + 1]
    along = np.einsum("mkq,mjq->mkj", s, c).reshape(len(maps), -1)
    bends = np.einsum("mjq,miq->mji", c, c).reshape(len(maps), -1)
    return np.hstack([along, np.linalg.norm(s, axis=2), bends])


def _best(maps: Candidates, lo: int, hi: int, keep: int) -> Candidates:
    return best(maps, lambda m: _marks(m, lo, hi), keep)


def _corners_by_energy(comp: Compressed) -> Indices:
    energy = (comp.legs.z**2).sum(axis=1)
    return np.argsort(-np.minimum(energy[:-1], energy[1:]), kind="stable").astype(np.int64)


def _ways(legs: Legs, j: int, rng: np.random.Generator) -> tuple[Array, Indices]:
    """Directions to try for leg j (M, 3), and which of them are next to each (M, n)."""
    count = SCAN[legs.turns]
    ranks = np.arange(count)
    if legs.rise is not None:
        heading = np.asarray((ranks + rng.random()) * (2.0 * np.pi / count), dtype=np.float64)
        ways = upright(heading, float(legs.rise[j]))
        return ways, np.stack([(ranks - 1) % count, (ranks + 1) % count], axis=1)
    z = 1.0 - (2.0 * ranks + 1.0) / count  # Fibonacci's spiral covers the sphere evenly
    heading = ranks * np.pi * (3.0 - np.sqrt(5.0)) + 2.0 * np.pi * rng.random()
    ways = np.stack([np.sqrt(1.0 - z**2) * np.cos(heading), np.sqrt(1.0 - z**2) * np.sin(heading), z], axis=1)
    return ways, np.argsort(-(ways @ ways.T), axis=1)[:, 1:7]


def _grown(
    legs: Legs, beam: Candidates, span: tuple[int, int], step: int, rng: np.random.Generator
) -> tuple[Candidates, int, int]:
    """One leg more, on the side with more energy: scan its direction, keep the best, fit all legs so far."""
    t, (lo, hi) = legs.comp.legs, span
    energy = (t.z**2).sum(axis=1)
    backwards = hi == t.length.size - 1 or (lo > 0 and energy[lo - 1] > energy[hi + 1])
    j = lo - 1 if backwards else hi + 1
    if step:
        beam = _redrawn(legs, beam, span, rng)
    start = np.zeros((len(beam), 3))
    if not backwards:
        start = np.einsum("mjq,j->mq", beam.path[:, lo : hi + 1], t.length[lo : hi + 1])
    ways, near = _ways(legs, j, rng)
    cost = scan_directions(t, j, start, beam.s, beam.alpha, ways, float(t.length[j]) if backwards else 0.0)
    lowest = np.where((cost[:, :, None] <= cost[:, near]).all(axis=2), cost, np.inf)
    best = np.argsort(lowest, axis=1)[:, :KEEP_MINIMA]
    score = (np.take_along_axis(lowest, best, axis=1) + beam.cost[:, None]).ravel()
    order = np.argsort(score, kind="stable")[:SCAN_KEEP]
    order = order[np.isfinite(score[order])]
    grown = beam.take(order // best.shape[1])
    c, s = grown.path.copy(), grown.s.copy()
    c[:, j] = ways[best.ravel()[order]]
    if backwards:
        s += t.length[j] * c[:, j, None, :]
    lo, hi = min(lo, j), max(hi, j)
    grown = _fitted(legs, replace(grown, path=c, s=s), (lo, hi), ITERATIONS[min(step, len(ITERATIONS) - 1)])
    return _best(grown, lo, hi, BEAM), lo, hi


def _redrawn(legs: Legs, beam: Candidates, span: tuple[int, int], rng: np.random.Generator) -> Candidates:
    """The beam, and copies in which sources that two legs at most have seen have new heights over their plane."""
    t, (lo, hi) = legs.comp.legs, span
    start = np.cumsum(beam.path[:, lo : hi + 1] * t.length[None, lo : hi + 1, None], axis=1)
    start = np.concatenate([np.zeros_like(start[:, :1]), start[:, :-1]], axis=1)
    p = beam.s[:, :, None, :] - start[:, None, :, :]  # (M, K, J, 3)
    y = np.einsum("mkjq,mjq->mkj", p, beam.path[:, lo : hi + 1])
    inside = np.minimum(np.maximum(y, 0.0), t.length[lo : hi + 1]) - y
    trace = beam.alpha[:, :, None] - ((p**2).sum(axis=3) - y**2 + inside**2) / t.c[lo : hi + 1]
    seen = trace > np.log(SEEN)
    blind = seen.sum(axis=2) <= 2
    if not blind.any():
        return beam
    strongest = np.argsort(-trace, axis=2)[:, :, :2]
    rows = np.arange(len(beam))[:, None]
    a, b = (beam.path[:, lo : hi + 1][rows, strongest[:, :, i]] for i in range(2))
    foot = start[rows, strongest[:, :, 0]]
    normal = np.cross(a, b)
    size = np.linalg.norm(normal, axis=2, keepdims=True)
    normal = np.where(size > 1e-3, normal / np.maximum(size, 1e-3), 0.0)
    now = np.einsum("mkq,mkq->mk", beam.s - foot, normal)
    parts = [beam]
    for _ in range(REDRAWN):
        new = HEIGHT_SD * rng.standard_normal(now.shape)
        new = np.where(blind & (size[:, :, 0] > 1e-3), new, now)
        s = beam.s + (new - now)[:, :, None] * normal
        parts.append(replace(beam, s=s, alpha=beam.alpha + new**2 - now**2))
    return joined(*parts)
