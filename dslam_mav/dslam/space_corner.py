"""Two adjacent legs in space: projections, then one angle, heights drawn (theory, section 8, steps 3 and 4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.compress import Compressed
from dslam_mav.dslam.kernels.distinct import distinct
from dslam_mav.dslam.kernels.space import SpaceFit, fit_in_space
from dslam_mav.dslam.rounds import Candidates

Array = NDArray[np.float64]

CORNER_STARTS = 120
CORNER_ITERATIONS = 12
CORNER_KEEP = 48
ANGLES = 24
HEIGHTS = 2  # draws of the sources' heights for each corner and angle
HEIGHT_SD = 1.0
MAX_OFFSET = 3.0
MAX_LOG_ABOVE = 6.0  # of a source's amplitude over the largest reading
AMPLITUDE_SD = 3.0
SAME = 0.05
NOISE_SDS = 4.0


@dataclass(frozen=True, slots=True, eq=False)
class Legs:
    """What is searched: legs compressed, and the sine of every climb (L,) where it is known."""

    comp: Compressed
    rise: Array | None

    @property
    def turns(self) -> int:
        """How many angles of a leg are unknown."""
        return 1 if self.rise is not None else 2

    def enough(self, k_sources: int) -> float:
        """χ² that noise, itself known from what the bases leave over, may well explain."""
        comp = self.comp
        freedom = max(int(comp.rank.sum()) - self.turns * (comp.rank.size - 1) - 4 * k_sources, 1)
        return freedom * (1.0 + NOISE_SDS * float(np.sqrt(2.0 / freedom + 2.0 / max(comp.dof_out, 1))))

    @property
    def largest(self) -> float:
        """Log of the largest reading, roughly, in the units of α."""
        size = np.sqrt((self.comp.legs.z**2).sum(axis=1).max() / self.comp.rank.mean())
        return float(np.log(max(float(size), 1e-3)))


def _signal(legs: Legs, j: int, rng: np.random.Generator, size: tuple[int, ...]) -> tuple[Array, Array]:
    """Places along leg j drawn where its signal is, and the log amplitudes one source there would have."""
    t = legs.comp.legs
    nodes = t.y0 + t.h * np.arange(t.table.shape[1])
    curves = t.table[j, :, 0, :]
    square = (curves**2).sum(axis=1)
    inside = (nodes > -1.5) & (nodes < t.length[j] + 1.5)
    level = np.where(inside & (square > 1e-6), curves @ t.z[j] / np.maximum(square, 1e-6), 0.0)
    weight = np.maximum(level, 0.0) * np.sqrt(square)
    weight = weight + (0.05 * weight.max() + 1e-12) * inside
    pick = rng.choice(nodes.size, size=size, p=weight / weight.sum())
    return nodes[pick] + t.h * rng.random(size), np.log(np.maximum(level[pick], 1e-3 * level.max() + 1e-9))


def _corner(legs: Legs, k_sources: int, corner: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """(B, K, 3) distinct (U, W, V): projections on two legs from their corner and log contribution there; costs (B,).

    Two legs tell projections, not the angle between them: it is fitted as a right angle, with all heights 0.
    """
    t = legs.comp.legs
    size = (CORNER_STARTS, k_sources)
    (y, level), (w, other) = (_signal(legs, j, rng, size) for j in (corner, corner + 1))
    u = y - t.length[corner]
    v = np.minimum(level - u**2 / t.c[corner], other - w**2 / t.c[corner + 1]) + np.log(0.7)
    c = np.zeros((CORNER_STARTS, t.length.size, 3))
    c[:, corner, 0] = c[:, corner + 1, 1] = 1.0
    s = np.stack([y, w, np.zeros(size)], axis=2)
    how = SpaceFit(corner, corner + 1, 0, legs.largest, AMPLITUDE_SD, CORNER_ITERATIONS)
    alpha = v + u**2 + w**2
    cost = fit_in_space(t, how, c, s, alpha)
    u, w = s[:, :, 0] - t.length[corner], s[:, :, 1]
    uwv = np.stack([u, w, alpha - u**2 - w**2], axis=2)
    order = np.argsort(cost, kind="stable")
    rank = np.argsort(u, axis=1)
    flat = np.take_along_axis(uwv, rank[:, :, None], axis=1).reshape(len(uwv), -1)
    kept = order[distinct(flat[order], CORNER_KEEP, SAME)]
    return uwv[kept], cost[kept]


def open_corner_in_space(legs: Legs, k_sources: int, corner: int, rng: np.random.Generator) -> Candidates:
    """Candidates of a corner's solutions at every angle, heights drawn."""
    t = legs.comp.legs
    uwv, cost = _corner(legs, k_sources, corner, rng)
    first, second = _two_directions(legs, corner, rng)
    n, m = len(uwv), len(second)
    cosine = second @ first  # (m,)
    sine = np.sqrt(np.maximum(1.0 - cosine**2, 1e-6))
    u, w, v = (uwv[:, None, None, :, q] for q in range(3))
    d = (w - u * cosine[None, :, None, None]) / sine[None, :, None, None]
    h = HEIGHT_SD * rng.standard_normal((n, m, HEIGHTS, k_sources))
    alpha = v + u**2 + d**2 + h**2
    inside = (np.abs(d) < MAX_OFFSET).all(axis=3) & (alpha < legs.largest + MAX_LOG_ABOVE).all(axis=3)
    across = (second - cosine[:, None] * first) / sine[:, None]
    up = np.cross(first, across)
    away = d[..., None] * across[None, :, None, None, :] + h[..., None] * up[None, :, None, None, :]
    s = (t.length[corner] + u)[..., None] * first + away
    i, j, _ = at = np.nonzero(inside)
    c = np.zeros((i.size, t.length.size, 3))
    c[:, corner], c[:, corner + 1] = first, second[j]
    return Candidates(c, s[at], alpha[at], np.zeros(i.size), cost[i])


def _two_directions(legs: Legs, corner: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """The first leg's direction (3,), and those tried for the second (M, 3), on one side of it."""
    angle = np.asarray((np.arange(ANGLES) + rng.random()) * (np.pi / ANGLES), dtype=np.float64)
    if legs.rise is None:
        return np.array([1.0, 0.0, 0.0]), np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    return upright(np.zeros(1), legs.rise[corner])[0], upright(angle, legs.rise[corner + 1])


def upright(heading: Array, rise: float) -> Array:
    """(M, 3) directions of these headings, all with the sine of climb `rise`."""
    flat = np.sqrt(1.0 - rise**2)
    return np.stack([flat * np.cos(heading), flat * np.sin(heading), np.full(heading.size, rise)], axis=1)
