"""III-B: which centre of one leg is which of the next.

The same source on adjacent legs, with b_{j+1} common to both (11), π and C kept and C its own on each leg (IV-A):

    C_j (ln a − ln h_kj) − C_{j+1} (ln a − ln h_k',j+1) = Y²_k',j+1 − (Y_kj − l_j)²,   h = A (πC)^{d/2} = a e^{−d²/C}

With C_j = C_{j+1} the amplitude drops out and C·log(A_kj/A_k',j+1) = (Y_kj − l_j)² − Y²_k',j+1 is left, the paper's.
"""

from __future__ import annotations

from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from dslam_mav.dslam.paper.layout import Projections

Array = NDArray[np.float64]
Index = NDArray[np.intp]

FLOOR = 1e-9  # sd of (11) that rounding leaves, in squared length units of the problem (√C ≈ 1)
WINDOW = 9.0  # χ² by which a pairing may be worse than the best and still be kept
MOST_PER_CORNER = 6
MOST_CHAINS = 12
AMPLITUDE_SD = 1.0  # of ln a about a common value, as long as no source has its own


class LegPeaks(NamedTuple):
    """One leg's centres Y (K,), heights A (K,), spreads C (K,) and the covariances (K, 2, 2) of (Y, A).

    `c_first` (K,): C at the flight's first reading, with its variance `var_c` (0 where it is known): a source's own
    width tells it from others (IV-B).
    """

    y: Array
    a: Array
    c: Array
    covariance: Array
    c_first: Array
    var_c: Array

    def taken(self, order: Index) -> LegPeaks:
        """The same peaks in another order."""
        return LegPeaks(*(part[order] for part in self))


class Corner(NamedTuple):
    """Pairings of a corner, (K,) each, best first, with their χ²."""

    orders: tuple[Index, ...]
    cost: tuple[float, ...]


def mismatch(before: LegPeaks, after: LegPeaks, length: float, ln_a: Array, d: int) -> tuple[Array, Array]:
    """(K, K) by how much (11) fails for k before and k' after the corner, and its variance. `ln_a` (K,): of k."""
    ln_before = np.log(before.a) + 0.5 * d * np.log(np.pi * before.c)
    ln_after = np.log(after.a) + 0.5 * d * np.log(np.pi * after.c)
    left = before.c * (ln_a - ln_before) + (before.y - length) ** 2  # = |S_k − b_{j+1}|² by (9)
    right = after.c * (ln_a[:, None] - ln_after) + after.y**2  # the same by (10)
    side_before = np.stack((2.0 * (before.y - length), -before.c / before.a), axis=1)
    side_after = np.stack((2.0 * after.y, -after.c / after.a), axis=1)
    var_before = np.einsum("ki,kij,kj->k", side_before, before.covariance, side_before)
    var_after = np.einsum("ki,kij,kj->k", side_after, after.covariance, side_after)
    return left[:, None] - right, var_before[:, None] + var_after[None, :] + FLOOR**2


def corner(before: LegPeaks, after: LegPeaks, length: float, ln_a: Array, d: int, doubt: float) -> Corner:
    """All pairings of a corner that stand; `doubt`: sd of ln a."""
    off, variance = mismatch(before, after, length, ln_a, d)
    change = before.c[:, None] - after.c[None, :]
    apart = before.c_first[:, None] - after.c_first[None, :]
    cost = off**2 / (variance + (doubt * change) ** 2)
    cost = cost + apart**2 / (before.var_c[:, None] + after.var_c[None, :] + FLOOR**2)
    return _standing(np.minimum(cost, 1e12))


def _standing(cost: Array) -> Corner:
    """The best assignment of cost (K, K), and all that are reached from it by exchanges within WINDOW."""
    k = len(cost)
    rows = np.arange(k)
    best = linear_sum_assignment(cost)[1]
    found = {tuple(best.tolist()): float(cost[rows, best].sum())}
    lowest = found[tuple(best.tolist())]
    queue = [tuple(best.tolist())]
    while queue:
        order = queue.pop(0)
        for i, j in combinations(range(k), 2):
            swapped = list(order)
            swapped[i], swapped[j] = swapped[j], swapped[i]
            key = tuple(swapped)
            total = float(cost[rows, swapped].sum())
            if key not in found and total - lowest < WINDOW and len(found) < 4 * MOST_PER_CORNER:
                found[key] = total
                queue.append(key)
    ranked = sorted(found.items(), key=lambda item: item[1])[:MOST_PER_CORNER]
    return Corner(tuple(np.array(order, dtype=np.intp) for order, _ in ranked), tuple(c for _, c in ranked))


def chains(legs: list[LegPeaks], length: Array, d: int) -> list[Projections]:
    """Pairings chained over all legs, best first: near-ties (footnote 1) are kept, and the readings decide."""
    common = _common_ln_a(legs, length, d)
    k = len(legs[0].y)
    rough = _chained(legs, length, d, np.full(k, common), AMPLITUDE_SD)
    if not _evolves(legs):
        return [_projections(legs, orders, length, d) for orders, _ in rough]
    # Each source's own ln a, told by (11) along its chain, settles what the common one left open.
    again: dict[bytes, tuple[list[Index], float]] = {}
    for orders, _ in rough:
        own = _own_ln_a(legs, orders, length, d, common)
        for better, cost in _chained(legs, length, d, own, 0.3 * AMPLITUDE_SD):
            key = np.concatenate(better).tobytes()
            if key not in again or cost < again[key][1]:
                again[key] = (better, cost)
    ranked = sorted(again.values(), key=lambda item: item[1])[:MOST_CHAINS]
    return [_projections(legs, orders, length, d) for orders, _ in ranked]


def _evolves(legs: list[LegPeaks]) -> bool:
    """Whether C differs between legs, so that (11) keeps the amplitude."""
    c = np.array([leg.c for leg in legs])
    return bool(np.ptp(c) > 1e-12 * c.max())


def _chained(legs: list[LegPeaks], length: Array, d: int, ln_a: Array, doubt: float) -> list[tuple[list[Index], float]]:
    """Beam over the corners; `ln_a` (K,) in the order of leg 1's peaks."""
    beam: list[tuple[list[Index], float]] = [([np.arange(len(ln_a))], 0.0)]
    for j in range(len(legs) - 1):
        grown = []
        for orders, cost in beam:
            ends = corner(legs[j].taken(orders[-1]), legs[j + 1], float(length[j]), ln_a, d, doubt)
            grown += [([*orders, order], cost + extra) for order, extra in zip(ends.orders, ends.cost, strict=True)]
        beam = sorted(grown, key=lambda item: item[1])[:MOST_CHAINS]
    return beam


def _common_ln_a(legs: list[LegPeaks], length: Array, d: int) -> float:
    """One ln a for all, at least the largest ln h (d² ≥ 0), that lets (11) hold best over all corners."""
    least = max(float((np.log(leg.a) + 0.5 * d * np.log(np.pi * leg.c)).max()) for leg in legs)
    if not _evolves(legs):
        return least
    grid = least + np.linspace(0.0, 4.0, 17)
    totals = [
        sum(corner(legs[j], legs[j + 1], float(length[j]), np.full(len(legs[0].y), x), d, 0.3).cost[0]
            for j in range(len(legs) - 1))
        for x in grid
    ]  # fmt: skip
    return float(grid[int(np.argmin(totals))])


def _own_ln_a(legs: list[LegPeaks], orders: list[Index], length: Array, d: int, common: float) -> Array:
    """(K,) each chain's ln a by least squares: (11) is linear in it wherever C changes at a corner."""
    k = len(orders[0])
    rows = np.arange(k)
    top, bottom = np.zeros(k), np.zeros(k)
    for j in range(len(legs) - 1):
        before, after = legs[j].taken(orders[j]), legs[j + 1].taken(orders[j + 1])
        off, variance = mismatch(before, after, float(length[j]), np.full(k, common), d)
        slope = before.c - after.c
        top -= slope * off[rows, rows] / variance[rows, rows]
        bottom += slope**2 / variance[rows, rows]
    prior = 1.0 / AMPLITUDE_SD**2
    return np.asarray(common + np.clip(top / (bottom + prior), -3.0, 3.0))


def _projections(legs: list[LegPeaks], orders: list[Index], length: Array, d: int) -> Projections:
    taken = [leg.taken(order) for leg, order in zip(legs, orders, strict=True)]
    a = np.column_stack([leg.a for leg in taken])
    sure = 1.0 / (np.column_stack([leg.var_c for leg in taken]) + FLOOR**2)
    c_first = (sure * np.column_stack([leg.c_first for leg in taken])).sum(axis=1) / sure.sum(axis=1)
    return Projections(
        y=np.column_stack([leg.y for leg in taken]),
        a=a,
        c=np.column_stack([leg.c for leg in taken]),
        var_y=np.column_stack([leg.covariance[:, 0, 0] for leg in taken]),
        var_ln_a=np.column_stack([leg.covariance[:, 1, 1] for leg in taken]) / a**2,
        c_first=c_first,
        length=length,
        dimensions=d,
    )
