"""IV-B: unknown activation times of separated sources. One group of readings above ε is one source; its width is C.

The field is held still on each leg (IV-A), so C_kj = C_k + 4μ(t̂_j − t_0), and C_k = 4μ(t_0 − τ_k) gives τ_k (the
paper's further π is a misprint).
"""

from __future__ import annotations

from collections import Counter
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.paper.gaussians import Gaussians, LegFit, heights, polish
from dslam_mav.dslam.paper.layout import Failure, Projections
from dslam_mav.dslam.paper.options import PaperOptions
from dslam_mav.dslam.paper.pairing import LegPeaks
from dslam_mav.dslam.paper.scenery import Scenery

Array = NDArray[np.float64]
Index = NDArray[np.intp]

LEAST_READINGS = 4  # in a group: a Gaussian has three parameters
SHARES = np.geomspace(1e-6, 0.6, 60)  # of the largest reading, tried as ε
NOISE_SDS = 4.0  # ε is never below this many standard deviations of the noise
TOP = 0.2  # share of a group's largest reading from which its logarithm is fitted
ROUNDING = 1e-13  # floor of a leg's noise


class Separated(NamedTuple):
    """Peaks of every leg, the legs' noise, and each leg's condition."""

    legs: list[LegPeaks]
    noise: float
    condition: Array


def separated_peaks(scene: Scenery, k: int, options: PaperOptions) -> Separated | Failure:
    """K peaks with their own widths on every leg, or which leg does not show K separate groups."""
    legs, condition, cost, free = [], [], 0.0, 0
    for j, (s, y) in enumerate(zip(scene.s, scene.reading, strict=True)):
        found = groups(s, y, k, options.separation_epsilon)
        if len(found) != k:
            seen = f"{len(found)} separate group{'' if len(found) == 1 else 's'} of readings, {k} expected"
            return Failure(f"Leg {j + 1} shows {seen}: with unknown activation times sources must be separated (IV-B).")
        fit = _fit(s, y, found)
        g = fit.gaussians
        if not ((g.a > 0.0).all() and (g.c > 0.0).all() and np.isfinite(fit.condition)):
            return Failure(f"Leg {j + 1}: no {k} separate Gaussians fit it.")
        legs.append(_peaks(fit, s.size, float(scene.growth_mid[j])))
        condition.append(fit.condition)
        cost, free = cost + fit.cost, free + max(s.size - 3 * k, 0)
    return Separated(legs, float(np.sqrt(cost / free)) if free else 0.0, np.array(condition))


def count_groups(scene: Scenery, most: int, options: PaperOptions) -> int:
    """The largest number of separate groups a leg shows at any ε, by most legs' vote; of equal votes the larger."""
    votes: Counter[int] = Counter()
    for s, y in zip(scene.s, scene.reading, strict=True):
        shares = SHARES if options.separation_epsilon is None else np.array([options.separation_epsilon])
        seen = max((len(split(s, y, share)) for share in shares if share >= _least_share(y)), default=0)
        votes[min(seen, most)] += 1
    return max(votes, key=lambda k: (votes[k], k)) if votes else 0


def groups(s: Array, y: Array, k: int, epsilon: float | None) -> list[Index]:
    """Indices of each group of readings above ε; without ε, the lowest share that shows K of them."""
    if epsilon is not None or k == 1:
        return split(s, y, epsilon) if epsilon is not None else [np.argsort(s, kind="stable")]
    tried = [split(s, y, share) for share in SHARES if share >= _least_share(y)]
    best = next((g for g in tried if len(g) == k), None)
    return best if best is not None else max(tried, key=len, default=[])


def split(s: Array, y: Array, share: float) -> list[Index]:
    """Indices of the runs along the leg in which readings exceed `share` of the largest; short ones are noise."""
    order = np.argsort(s, kind="stable")
    above = y[order] > share * y.max()
    inside = np.flatnonzero(above)
    for a, b in pairwise(inside):
        if 1 < b - a <= LEAST_READINGS:  # a gap this short is noise
            above[a:b] = True
    edges = np.flatnonzero(np.diff(np.concatenate(([False], above, [False])).astype(int)))
    runs = [order[a:b] for a, b in zip(edges[::2], edges[1::2], strict=True)]
    return [run for run in runs if len(run) >= LEAST_READINGS]


def _least_share(y: Array) -> float:
    """ε's floor as a share of the largest reading: the noise, from second differences along the leg."""
    if y.size < 5 or not y.max() > 0.0:
        return 1.0
    jitter = float(np.median(np.abs(np.diff(y, 2)))) / (0.6745 * np.sqrt(6.0))
    return float(NOISE_SDS * jitter / y.max())


def _fit(s: Array, y: Array, found: list[Index]) -> LegFit:
    """One Gaussian a group by maximum likelihood, then all of them together on all the leg's readings.

    PAPER DEVIATION: the paper stops at the groups; each holds its neighbours' tails, which the last fit takes out.
    """
    lone = [polish(s[g], y[g], _by_logarithm(s[g], y[g]), free_spread=True).gaussians for g in found]
    start = Gaussians(*(np.concatenate([getattr(g, name) for g in lone]) for name in ("y", "a", "c")))
    together = polish(s, y, start, free_spread=True)
    order = np.argsort(together.gaussians.y, kind="stable")
    k = len(order)
    index = np.concatenate((order, order + k, order + 2 * k))
    gaussians = Gaussians(*(part[order] for part in together.gaussians))
    return together._replace(gaussians=gaussians, covariance=together.covariance[np.ix_(index, index)])


def _by_logarithm(s: Array, y: Array) -> Gaussians:
    """A Gaussian from a parabola through ln y, readings weighed by themselves (their logarithm's noise is σ/y)."""
    top = y > TOP * y.max()
    at, value = s[top], y[top]
    middle, extent = float((at * value).sum() / value.sum()), max(float(np.ptp(at)), 1e-6)
    if top.sum() >= 3:
        u = (at - middle) / extent
        powers = np.column_stack((np.ones_like(u), u, u**2))
        _, beta, gamma = np.linalg.lstsq(powers * value[:, None], np.log(value) * value, rcond=None)[0]
        if gamma < -1e-6:
            c = -(extent**2) / gamma
            centre = np.array([middle - 0.5 * beta / gamma * extent])
            return Gaussians(centre, heights(s, y, centre, np.array([c])), np.array([c]))
    return Gaussians(np.array([middle]), np.array([float(y.max())]), np.array([extent**2]))


def _peaks(fit: LegFit, n: int, growth: float) -> LegPeaks:
    g, k = fit.gaussians, len(fit.gaussians.y)
    variance = max(fit.cost / max(n - 3 * k, 1), ROUNDING**2)
    own = np.arange(k)
    blocks = np.stack(
        [np.stack([fit.covariance[own + a, own + b] for b in (0, k)], axis=-1) for a in (0, k)], axis=-2
    )  # (K, 2, 2) of (Y, A)
    var_ln_c = fit.covariance[own + 2 * k, own + 2 * k]
    return LegPeaks(g.y, g.a, g.c, blocks * variance, g.c - growth, g.c**2 * var_ln_c * variance)


def pool_and_repeat(scene: Scenery, p: Projections, common: bool) -> Projections:
    """Each source's C pooled over the legs (`common`: over the sources too), then Y and A anew with it (V-C)."""
    c_first = np.full(len(p.y), p.c_first.mean()) if common else p.c_first
    c = c_first[:, None] + scene.growth_mid[None, :]
    if not (c > 0.0).all():
        return p
    y, a, var_y, var_ln_a = p.y.copy(), p.a.copy(), p.var_y.copy(), p.var_ln_a.copy()
    k = len(y)
    for j, (s, reading) in enumerate(zip(scene.s, scene.reading, strict=True)):
        fit = polish(s, reading, Gaussians(p.y[:, j], p.a[:, j], c[:, j]))
        if not (fit.gaussians.a > 0.0).all():
            return p
        variance = max(fit.cost / max(s.size - 2 * k, 1), ROUNDING**2)
        y[:, j], a[:, j] = fit.gaussians.y, fit.gaussians.a
        var_y[:, j] = np.diag(fit.covariance)[:k] * variance
        var_ln_a[:, j] = np.diag(fit.covariance)[k:] * variance / a[:, j] ** 2
    return p._replace(y=y, a=a, c=c, var_y=var_y, var_ln_a=var_ln_a, c_first=c_first)
