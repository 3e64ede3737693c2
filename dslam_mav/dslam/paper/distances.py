"""Appendix C: two sources, directions by their distances from the legs (2-D).

With p = d²_11, q = d²_21, r = d_11 d_21 and the sums a_j, b_j, g_j of (28),

    D_j = [[p + a_j, r + g_j], [r + g_j, q + b_j]] = [d_1j; d_2j] [d_1j d_2j],   det D_j = 0:
    b_j p + a_j q − 2 g_j r + a_j b_j − g_j² = 0,   j = 2 … L,   and   p q = r²

(the form of C-B; (29) and (30) are its differences). Three independent rows give (p, q, r) at once, two leave a line on
which p q = r² is a quadratic: L = 3, and arrangements such as footnote 4's with more legs. Every root with
p + a_j ≥ 0 and q + b_j ≥ 0 on all legs stands.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.paper.layout import Failure, Layout, Projections, complete

Array = NDArray[np.float64]

RANK = 1e-8  # singular values below this share of the largest are zero
SLACK = 1e-7  # by how much p + a_j may fall below zero by rounding, in C
SIGN_DOUBT = 1e-5  # of (23)'s two sides, in C: nearer to zero both signs are tried, and the readings tell
SIGN_SDS = 10.0  # the same, in standard deviations of the centres, times how far these lie
MOST_CHAINS = 4


def by_distances(p: Projections) -> list[Layout] | Failure:
    """Every layout of two sources that stands, at least one; or why there is none."""
    k, n_legs = p.y.shape
    if p.dimensions != 2:
        return Failure("Distances from the legs settle directions in the plane only.")
    if k != 2 or n_legs < 3:
        return Failure(f"The distances need two sources and three legs, got {k} and {n_legs}.")
    sums = cumulative_sums(p)
    found = _roots(sums)
    if isinstance(found, Failure):
        return found
    standing, how = [x for x in found if _stands(x, sums, p)], "distances"
    if not standing:
        # PAPER DEVIATION: under noise squares of distances fall below zero; the nearest squares are tried, and the
        # readings judge them like any other answer.
        standing, how = found, "distances (none consistent, the nearest)"
    return [complete(_directions(p, offset), p, how) for x in standing for offset in _signed(x, sums, p)]


def cumulative_sums(p: Projections) -> Array:
    """(L, 3): a_j, b_j, g_j of (27), (28), zero for j = 1."""
    ahead = p.y[:, :-1] - p.length[:-1]  # Y_{k,j−1} − l_{j−1}
    here = p.y[:, 1:]
    alpha = ahead[0] ** 2 - here[0] ** 2
    beta = ahead[1] ** 2 - here[1] ** 2
    gamma = ahead[0] * ahead[1] - here[0] * here[1]
    steps = np.column_stack((alpha, beta, gamma))
    return np.vstack((np.zeros((1, 3)), np.cumsum(steps, axis=0)))


def _roots(sums: Array) -> list[Array] | Failure:
    """Solutions (p, q, r) of the determinants' equations."""
    a, b, g = sums[1:].T
    matrix = np.column_stack((b, a, -2.0 * g))
    right = g**2 - a * b  # + a_j b_j − g_j² on the left: C-B turns these signs
    _, values, vectors = np.linalg.svd(matrix, full_matrices=True)
    rank = int((values > RANK * max(values[0], 1e-300)).sum())
    x0 = np.linalg.lstsq(matrix, right, rcond=RANK)[0]
    if rank == 3:
        return [_on_cone(x0, matrix, right)]
    if rank < 2:
        return Failure("A degenerate arrangement (footnote 4): the legs' equations for the distances are all the same.")
    n = vectors[2]
    # (x0 + t n) on p q = r²
    quadratic = [
        n[0] * n[1] - n[2] ** 2,
        x0[0] * n[1] + x0[1] * n[0] - 2.0 * x0[2] * n[2],
        x0[0] * x0[1] - x0[2] ** 2,
    ]
    roots = np.roots(quadratic).real  # a pair with an imaginary part is noise: its middle is nearest to a solution
    if not len(roots):
        return Failure("A degenerate arrangement (footnote 4): the equations leave the distances free.")
    return [x0 + t * n for t in roots]


def _on_cone(x: Array, matrix: Array, right: Array) -> Array:
    """The solution moved onto p q = r² by a few Gauss–Newton steps in (d_11, d_21).

    PAPER DEVIATION: (30) is solved for three numbers of which only two are free; noise makes them disagree.
    """
    values, axes = np.linalg.eigh(np.array([[x[0], x[2]], [x[2], x[1]]]))
    d = axes[:, 1] * np.sqrt(max(values[1], 0.0))
    for _ in range(20):
        slope = matrix @ np.array([[2.0 * d[0], 0.0], [0.0, 2.0 * d[1]], [d[1], d[0]]])
        off = right - matrix @ np.array([d[0] ** 2, d[1] ** 2, d[0] * d[1]])
        step = np.linalg.lstsq(slope, off, rcond=1e-12)[0]
        d = d + step
        if np.abs(step).max() <= 1e-15 * (1.0 + np.abs(d).max()):
            break
    settled = np.array([d[0] ** 2, d[1] ** 2, d[0] * d[1]])
    worse = np.linalg.norm(matrix @ settled - right) > 2.0 * np.linalg.norm(matrix @ x - right) + 1e-6
    return x if worse or not np.isfinite(settled).all() else settled


def _stands(x: Array, sums: Array, p: Projections) -> bool:
    """Whether p + a_j ≥ 0 and q + b_j ≥ 0 on every leg, but for rounding and what noise leaves."""
    doubt = 6.0 * np.sqrt(p.var_y.max()) * (1.0 + np.abs(p.y).max()) + SLACK * p.c.max()
    return bool((x[0] + sums[:, 0] >= -doubt).all() and (x[1] + sums[:, 1] >= -doubt).all())


def _signed(x: Array, sums: Array, p: Projections) -> list[Array]:
    """(L, 2) each: d_1j and d_2j, signs along the chain by (23), both where (23) cannot tell."""
    offsets = np.array([_rank_one(x + row) for row in sums])  # up to a sign s_j
    doubt = SIGN_DOUBT * p.c.max() + SIGN_SDS * float(np.sqrt(p.var_y.max())) * np.abs(p.y).max()
    chains = [offsets[:1]]
    for j in range(1, len(offsets)):
        ahead, here = p.y[:, j - 1] - p.length[j - 1], p.y[:, j]
        grown = []
        for chain in chains:
            before = chain[-1, 1] * ahead[0] - chain[-1, 0] * ahead[1]  # left side of (23)
            after = here[0] * offsets[j, 1] - here[1] * offsets[j, 0]
            sure = min(abs(before), abs(after)) > doubt or len(chains) > MOST_CHAINS
            signs = [1.0 if before * after >= 0.0 else -1.0] if sure else [1.0, -1.0]
            grown += [np.vstack((chain, sign * offsets[j])) for sign in signs]
        chains = grown
    return chains


def _rank_one(d: Array) -> Array:
    """(2,) d with d dᵀ nearest to D_j: never a root of the small one, which would cost half its digits."""
    values, axes = np.linalg.eigh(np.array([[d[0], d[2]], [d[2], d[1]]]))
    return np.asarray(axes[:, 1] * np.sqrt(max(values[1], 0.0)))


def _directions(p: Projections, offset: Array) -> Array:
    """(L, 2) directions, c_1 along +x, from (22) at every corner: the turn that takes one leg's frame to the next.

    PAPER DEVIATION: C-A2 solves (22) for c_2 alone and C-A5 the later legs from the sources; (22) holds at every
    corner, and a turn fitted to both sources stays a turn under noise.
    """
    heading = np.zeros(len(p.length))
    for j in range(1, len(heading)):
        before = np.column_stack((p.y[:, j - 1] - p.length[j - 1], offset[j - 1]))  # S_k − b_j in leg j − 1's frame
        after = np.column_stack((p.y[:, j], offset[j]))  # the same in leg j's
        sine = (after[:, 0] * before[:, 1] - after[:, 1] * before[:, 0]).sum()
        cosine = (before * after).sum()
        heading[j] = heading[j - 1] + np.arctan2(sine, cosine)
    return np.column_stack((np.cos(heading), np.sin(heading)))
