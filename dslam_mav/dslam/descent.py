"""Many answers at once slide down to where they fit the readings: Levenberg–Marquardt, one damping each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FIRST_DAMPING, LEAST_DAMPING, MOST_DAMPING = 1e-2, 1e-6, 1e6
LONGEST_STEP = 0.5  # radians, spreads, logarithms


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """N averaged readings: `leg` of each, `along` it, `reading`, `weight` (one over its sd), what C has `grown` by
    then; lengths (L,) of the legs.
    """

    length: Array
    leg: NDArray[np.int64]
    along: Array
    reading: Array
    weight: Array
    grown: Array
    noise_sd: float

    def only(self, leg: int) -> Seen:
        """Of one leg."""
        m = self.leg == leg
        return Seen(
            self.length, self.leg[m], self.along[m], self.reading[m], self.weight[m], self.grown[m], self.noise_sd
        )


@dataclass(frozen=True, slots=True, eq=False)
class Chains:
    """M answers: headings `theta` (M, L) with the first 0, `place` (M, K, 2), `log_peak` (M, K) at the first reading,
    `log_spread2` (M,), `ambient` (M,).
    """

    theta: Array
    place: Array
    log_peak: Array
    log_spread2: Array
    ambient: Array

    def __len__(self) -> int:
        return len(self.theta)

    def part(self, index: NDArray[np.int64]) -> Chains:
        """Some of them."""
        return Chains(
            self.theta[index], self.place[index], self.log_peak[index], self.log_spread2[index], self.ambient[index]
        )

    def vector(self) -> Array:
        """(M, P): headings but the first, places, ln peaks, ln C, ambient."""
        m = len(self)
        return np.column_stack(
            [self.theta[:, 1:], self.place.reshape(m, -1), self.log_peak, self.log_spread2, self.ambient]
        )

    def at(self, x: Array) -> Chains:
        """Of another vector."""
        m, k = self.log_peak.shape
        n = self.theta.shape[1] - 1
        theta = np.column_stack([np.zeros(m), x[:, :n]])
        place = x[:, n : n + 2 * k].reshape(m, k, 2)
        return Chains(theta, place, x[:, n + 2 * k : n + 3 * k], x[:, -2], x[:, -1])

    def upright(self) -> Chains:
        """Those whose first turn is to −y mirrored: the same readings in the canonical gauge."""
        if self.theta.shape[1] < 2:
            return self
        side = np.where(np.sin(self.theta[:, 1]) < 0.0, -1.0, 1.0)
        place = self.place * np.stack([np.ones_like(side), side], axis=1)[:, None]
        return Chains(self.theta * side[:, None], place, self.log_peak, self.log_spread2, self.ambient)

    def vertices(self, length: Array) -> Array:
        """(M, L+1, 2)."""
        step = length[:, None] * np.stack([np.cos(self.theta), np.sin(self.theta)], axis=2)
        return np.concatenate([np.zeros((len(self), 1, 2)), np.cumsum(step, axis=1)], axis=1)


@dataclass(frozen=True, slots=True, eq=False)
class Pull:
    """What chains lean on besides the readings: `anchor` (M, P), `precision` (P,), `noise` (M, N) added to weighted
    residuals.
    """

    anchor: Array
    precision: Array
    noise: Array


def cost_of(chains: Chains, seen: Seen, pull: Pull) -> Array:
    """(M,) squared weighted residuals, and what the anchors add."""
    residual = _model(chains, seen)[0]
    off = (chains.vector() - pull.anchor) * pull.precision
    return np.asarray(((residual + pull.noise) ** 2).sum(axis=1) + (off**2).sum(axis=1))


def cost_ahead(chains: Chains, begin: Array, headings: Array, seen: Seen) -> Array:
    """(M, H) squared weighted residuals on one leg more, from `begin` (M, 2) on, at each of the headings (H,)."""
    way = np.stack([np.cos(headings), np.sin(headings)], axis=1)
    first = np.exp(chains.log_spread2)[:, None]
    c = first + seen.grown
    peak = np.exp(np.minimum(chains.log_peak, 50.0))
    told = np.broadcast_to(chains.ambient[:, None, None], (len(chains), headings.size, seen.along.size)).copy()
    for k in range(peak.shape[1]):
        off = begin - chains.place[:, k]
        along = (off @ way.T)[:, :, None]
        far2 = (off**2).sum(axis=1)[:, None, None] + seen.along * (seen.along + 2.0 * along)
        told += (peak[:, k, None] * first / c)[:, None] * np.exp(-far2 / c[:, None])
    return np.asarray(((seen.weight * (told - seen.reading)) ** 2).sum(axis=2))


def descended(chains: Chains, seen: Seen, pull: Pull, iterations: int) -> Chains:
    """Each some steps down; none ends higher than it began."""
    x = chains.vector()
    damping = np.full(len(x), FIRST_DAMPING)
    residual, jacobian = _all(chains, seen, pull)
    cost = (residual**2).sum(axis=1)
    for _ in range(iterations):
        square = np.einsum("mnp,mnq->mpq", jacobian, jacobian, optimize=True)
        slope = np.einsum("mnp,mn->mp", jacobian, residual)
        own = np.einsum("mpp->mp", square)
        own += damping[:, None] * own + 1e-9
        step = -np.linalg.solve(square, slope[:, :, None])[:, :, 0]
        longest = np.abs(step[:, :-1]).max(axis=1) / (LONGEST_STEP * 2.0)
        step /= np.maximum(longest, 1.0)[:, None]
        trial = chains.at(x + step)
        residual_, jacobian_ = _all(trial, seen, pull)
        cost_ = (residual_**2).sum(axis=1)
        better = cost_ < cost
        x = np.where(better[:, None], x + step, x)
        residual[better], jacobian[better] = residual_[better], jacobian_[better]
        cost = np.where(better, cost_, cost)
        damping = np.clip(np.where(better, 0.3, 4.0) * damping, LEAST_DAMPING, MOST_DAMPING)
    return chains.at(x)


def _all(chains: Chains, seen: Seen, pull: Pull) -> tuple[Array, Array]:
    """Residuals (M, N + P) with the anchors' and their Jacobian."""
    residual, jacobian = _model(chains, seen)
    x = chains.vector()
    off = (x - pull.anchor) * pull.precision
    lean = np.broadcast_to(np.diag(pull.precision), (len(x), x.shape[1], x.shape[1]))
    return np.concatenate([residual + pull.noise, off], axis=1), np.concatenate([jacobian, lean], axis=1)


def _model(chains: Chains, seen: Seen) -> tuple[Array, Array]:
    """Weighted model − reading (M, N) and its Jacobian (M, N, P)."""
    m, k = chains.log_peak.shape
    n_legs, n = chains.theta.shape[1], seen.reading.size
    way = np.stack([np.cos(chains.theta), np.sin(chains.theta)], axis=2)
    corner = chains.vertices(seen.length)
    at = corner[:, seen.leg] + seen.along[None, :, None] * way[:, seen.leg]
    off = at[:, :, None] - chains.place[:, None]
    first = np.exp(chains.log_spread2)[:, None]
    c = first + seen.grown[None]
    growth = first / c
    far = (off**2).sum(axis=3) / c[:, :, None]
    g = np.exp(np.minimum(chains.log_peak, 50.0))[:, None] * growth[:, :, None] * np.exp(-far)
    w = seen.weight[None]
    residual = w * (g.sum(axis=2) + chains.ambient[:, None] - seen.reading)
    jacobian = np.empty((m, n, n_legs + 3 * k + 1))
    pull = (2.0 / c * w)[:, :, None, None] * off * g[..., None]
    places = slice(n_legs - 1, n_legs - 1 + 2 * k)
    jacobian[:, :, places] = pull.reshape(m, n, 2 * k)
    jacobian[:, :, places.stop : places.stop + k] = w[:, :, None] * g
    bent = growth[:, :, None]
    jacobian[:, :, -2] = w * ((1.0 - bent + bent * far) * g).sum(axis=2)
    jacobian[:, :, -1] = w
    slope = -pull.sum(axis=2)
    for j in range(1, n_legs):
        share = np.where(seen.leg == j, seen.along, np.where(seen.leg > j, seen.length[j], 0.0))
        across = slope[:, :, 1] * way[:, j, :1] - slope[:, :, 0] * way[:, j, 1:]
        jacobian[:, :, j - 1] = share[None] * across
    return residual, jacobian
