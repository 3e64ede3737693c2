"""Starts for the joint fit: corner fits, one angle, a beam over legs, all modes (theory, section 8, steps 2–7).

A round takes one corner of the path. Two legs alone, their angle left out, give each source's projections on both
(`corner_fits`); one turn angle then opens the map of all sources at once; legs are added on either side, each by a
scan of its heading, and the joint fit on the compressed legs keeps the best. Rounds with other corners and fresh
randomness go on until the best answers are found again and again.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam import kernels
from dslam_mav.dslam.compress import Compressed

Array = NDArray[np.float64]

CORNER_STARTS = 80
CORNER_ITERATIONS = 40
CORNER_KEEP = 24
TURN_ANGLES = 40
MAX_OFFSET_SPREADS = 2.6
SCAN_HEADINGS = 60
SCAN_KEEP = 200
BEAM = 60
BEAM_ITERATIONS = (6, 5, 4, 4, 8)
FINALISTS = 30
FINISHED = 8
MODE_WINDOW = 25.0  # keep modes whose χ² is within this of the best
NEW_MODE_WINDOW = 12.0
SAME_MODE = 0.03  # in spreads, and in the headings' cosines
MAX_ROUNDS = 24
QUIET_ROUNDS = 3
AMPLITUDE_SD = 3.0  # of the weak prior on log amplitude about the largest reading


@dataclass(frozen=True, slots=True, eq=False)
class Modes:
    """Distinct minima, best first: headings θ (M, L), sources S (M, K, 2) from vertex 0, α (M, K), χ² `cost` (M,).

    In the units of the `Compressed` they were found on; headings are relative to the first leg's, which is 0.
    """

    theta: Array
    s: Array
    alpha: Array
    cost: Array
    rounds: int = 0

    def __len__(self) -> int:
        return int(self.cost.size)

    def take(self, index: Array | NDArray[np.int64]) -> Modes:
        """Some of the modes, in the given order."""
        return Modes(self.theta[index], self.s[index], self.alpha[index], self.cost[index], self.rounds)


def _largest_log(comp: Compressed) -> float:
    """Log of the largest reading, roughly, in the units of α: a sample's size is that of its leg's peak."""
    return float(np.log(max(np.sqrt((comp.z**2).sum(axis=1).max() / comp.rank.mean()), 1e-3)))


def _corner_starts(comp: Compressed, corner: int, k_sources: int, rng: np.random.Generator) -> Array:
    """(B, K, 3) starts (U, V, W) drawn where the two legs' samples say the signal is."""
    draws = []
    logs = []
    nodes = comp.y0 + comp.h * np.arange(comp.table.shape[1])
    for j in (corner, corner + 1):
        match = comp.table[j, :, 0, :] @ comp.z[j]
        norm = (comp.table[j, :, 0, :] ** 2).sum(axis=1)
        inside = (nodes > -1.5) & (nodes < comp.length[j] + 1.5)
        level = np.where(inside & (norm > 1e-6), match / np.maximum(norm, 1e-6), 0.0)
        weight = np.maximum(level, 0.0) * np.sqrt(norm)
        weight = weight + 0.05 * weight.max() * inside + 1e-12 * inside
        pick = rng.choice(nodes.size, size=(CORNER_STARTS, k_sources), p=weight / weight.sum())
        draws.append(nodes[pick] + comp.h * rng.random(pick.shape))
        logs.append(np.log(np.maximum(level[pick], 1e-3 * level.max() + 1e-9)))
    u = draws[0] - comp.length[corner]
    w = draws[1]
    v_first = logs[0] - u**2 / comp.c[corner]
    v_second = logs[1] - w**2 / comp.c[corner + 1]
    v = np.minimum(v_first, v_second) + np.log(0.7)
    return np.stack([u, v, w], axis=2)


def _best(theta: Array, s: Array, alpha: Array, cost: Array, lo: int, hi: int, keep: int, tolerance: float) -> Modes:
    """The best `keep` distinct candidates."""
    order = np.argsort(cost, kind="stable")
    order = order[np.isfinite(cost[order])]
    theta, s, alpha, cost = theta[order], s[order], alpha[order], cost[order]
    index = kernels.distinct(theta, s, alpha, lo, hi, keep, tolerance)
    return Modes(theta[index], s[index], alpha[index], cost[index])


def _open_corner(comp: Compressed, k_sources: int, corner: int, rng: np.random.Generator) -> Modes:
    """Candidates on the two legs of one corner; sources from the first of the two legs' start."""
    uvw = _corner_starts(comp, corner, k_sources, rng)
    costs = kernels.corner_fits(
        comp.z, comp.table, comp.y0, comp.h, comp.c, comp.length, corner, uvw, 1.0, CORNER_ITERATIONS
    )
    order = np.argsort(costs, kind="stable")
    kept: list[int] = []
    for i in order:
        ordered = uvw[i][np.argsort(uvw[i][:, 0])]
        if all(np.abs(ordered - uvw[q][np.argsort(uvw[q][:, 0])]).max() > 0.05 for q in kept):
            kept.append(int(i))
            if len(kept) == CORNER_KEEP:
                break
    angles = (np.arange(TURN_ANGLES) + rng.random()) * (np.pi / TURN_ANGLES)
    turn, s, alpha = kernels.open_corner(
        uvw[kept],
        comp.c[corner],
        comp.c[corner + 1],
        comp.length[corner],
        np.clip(angles, 1e-3, np.pi - 1e-3),
        MAX_OFFSET_SPREADS,
        _largest_log(comp) + 3.0 * AMPLITUDE_SD,
    )
    theta = np.zeros((turn.size, comp.length.size))
    theta[:, corner + 1] = turn
    return Modes(theta, s, alpha, np.zeros(turn.size))


def _add_leg(
    comp: Compressed, beam: Modes, lo: int, hi: int, rng: np.random.Generator, step: int
) -> tuple[Modes, int, int]:
    """One leg more, on the side with more energy: scan its heading, keep the best, fit all legs so far."""
    energy = (comp.z**2).sum(axis=1)
    last = comp.length.size - 1
    backwards = hi == last or (lo > 0 and energy[lo - 1] > energy[hi + 1])
    j = lo - 1 if backwards else hi + 1
    start = np.zeros((len(beam), 2))
    if not backwards:
        for i in range(lo, hi + 1):
            start[:, 0] += comp.length[i] * np.cos(beam.theta[:, i])
            start[:, 1] += comp.length[i] * np.sin(beam.theta[:, i])
    headings = (np.arange(SCAN_HEADINGS) + rng.random()) * (2.0 * np.pi / SCAN_HEADINGS)
    found, cost = kernels.scan_heading(
        comp.z, comp.table, comp.y0, comp.h, comp.c, comp.length, j, start, beam.s, beam.alpha, headings, backwards
    )
    score = (cost + (beam.cost[:, None] if step else 0.0)).ravel()
    order = np.argsort(score, kind="stable")[:SCAN_KEEP]
    order = order[np.isfinite(score[order])]
    parent = order // 2
    theta, s, alpha = beam.theta[parent].copy(), beam.s[parent].copy(), beam.alpha[parent].copy()
    theta[:, j] = found.ravel()[order]
    if backwards:
        s[:, :, 0] += (comp.length[j] * np.cos(theta[:, j]))[:, None]
        s[:, :, 1] += (comp.length[j] * np.sin(theta[:, j]))[:, None]
        lo = j
    else:
        hi = j
    iterations = BEAM_ITERATIONS[min(step, len(BEAM_ITERATIONS) - 1)]
    cost, _ = _fit(comp, theta, s, alpha, lo, hi, iterations)
    return _best(theta, s, alpha, cost, lo, hi, BEAM, SAME_MODE), lo, hi


def _fit(
    comp: Compressed, theta: Array, s: Array, alpha: Array, lo: int, hi: int, iterations: int, tolerance: float = 1e-9
) -> tuple[Array, NDArray[np.bool_]]:
    costs, converged = kernels.fit_batch(
        comp.z, comp.table, comp.y0, comp.h, comp.c, comp.length, lo, hi, theta, s, alpha,
        _largest_log(comp), AMPLITUDE_SD, iterations, tolerance,
    )  # fmt: skip
    return costs, converged


def search_round(comp: Compressed, k_sources: int, corner: int, rng: np.random.Generator) -> Modes:
    """One round from one corner (legs `corner` and `corner + 1`): the best few distinct minima on all legs."""
    last = comp.length.size - 1
    beam = _open_corner(comp, k_sources, corner, rng)
    lo, hi, step = corner, corner + 1, 0
    while len(beam) and (lo > 0 or hi < last):
        beam, lo, hi = _add_leg(comp, beam, lo, hi, rng, step)
        step += 1
    if not len(beam):
        return beam
    beam = beam.take(np.arange(min(FINALISTS, len(beam))))
    cost, _ = _fit(comp, beam.theta, beam.s, beam.alpha, 0, last, 10)
    beam = _best(beam.theta, beam.s, beam.alpha, cost, 0, last, FINISHED, SAME_MODE)
    cost, _ = _fit(comp, beam.theta, beam.s, beam.alpha, 0, last, 60)
    return _canonical(_best(beam.theta, beam.s, beam.alpha, cost, 0, last, FINISHED, SAME_MODE))


def _canonical(modes: Modes) -> Modes:
    """Turn every mode so that its first leg has heading 0, and mirror it so that its first turn is positive."""
    theta, s = modes.theta.copy(), modes.s.copy()
    for i in range(len(modes)):
        first = theta[i, 0]
        turned = theta[i] - first
        cos, sin = np.cos(first), np.sin(first)
        s[i] = s[i] @ np.array([[cos, -sin], [sin, cos]])
        sines = np.sin(np.diff(turned))
        turns = sines[np.abs(sines) > 1e-3]
        if turns.size and turns[0] < 0.0:
            turned = -turned
            s[i, :, 1] *= -1.0
        theta[i] = turned
    return Modes(theta, s, modes.alpha, modes.cost, modes.rounds)


def merge(modes: Modes, more: Modes, window: float) -> Modes:
    """Both sets' distinct minima within `window` of the best."""
    if not len(more):
        return modes
    theta = np.concatenate([modes.theta, more.theta])
    s = np.concatenate([modes.s, more.s])
    alpha = np.concatenate([modes.alpha, more.alpha])
    cost = np.concatenate([modes.cost, more.cost])
    near = cost < cost.min() + window
    both = _best(theta[near], s[near], alpha[near], cost[near], 0, theta.shape[1] - 1, 64, SAME_MODE)
    return Modes(both.theta, both.s, both.alpha, both.cost, max(modes.rounds, more.rounds))


def corners_by_energy(comp: Compressed) -> NDArray[np.int64]:
    """Corners in the order rounds use them: first those whose weaker leg sees most."""
    energy = (comp.z**2).sum(axis=1)
    return np.argsort(-np.minimum(energy[:-1], energy[1:]), kind="stable").astype(np.int64)


def empty_modes(n_legs: int, k_sources: int) -> Modes:
    """No mode yet."""
    return Modes(np.empty((0, n_legs)), np.empty((0, k_sources, 2)), np.empty((0, k_sources)), np.empty(0))


def search(comp: Compressed, k_sources: int, rng: np.random.Generator, *, max_rounds: int = MAX_ROUNDS) -> Modes:
    """All modes: rounds until `QUIET_ROUNDS` in a row bring neither a better answer nor a new one nearly as good."""
    corners = corners_by_energy(comp)
    modes = empty_modes(comp.length.size, k_sources)
    quiet = 0
    rounds = 0
    while rounds < max_rounds and quiet < QUIET_ROUNDS:
        more = search_round(comp, k_sources, int(corners[rounds % corners.size]), rng)
        rounds += 1
        slack = NEW_MODE_WINDOW * misfit(modes, comp, k_sources)
        before = int((modes.cost < modes.cost.min() + slack).sum()) if len(modes) else -1
        lowest = modes.cost.min() if len(modes) else np.inf
        modes = merge(modes, more, MODE_WINDOW * misfit(merge(modes, more, np.inf), comp, k_sources))
        if not len(modes):
            continue
        improved = modes.cost.min() < lowest - 1e-3 * (1.0 + 1e-3 * lowest)
        after = int((modes.cost < modes.cost.min() + slack).sum())
        quiet = 0 if improved or after > before else quiet + 1
    return Modes(modes.theta, modes.s, modes.alpha, modes.cost, rounds)


def misfit(modes: Modes, comp: Compressed, k_sources: int) -> float:
    """By how much the best answer's χ² exceeds what noise explains, at least 1: Δχ² is measured in its units."""
    if not len(modes):
        return 1.0
    freedom = int(comp.rank.sum()) - (comp.length.size - 1) - 3 * k_sources
    return max(1.0, float(modes.cost.min()) / max(freedom, 1))
