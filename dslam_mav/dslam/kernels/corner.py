"""Two adjacent legs alone: sources by their projections, then one angle (theory, section 8, steps 3 and 4)."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from dslam_mav.dslam.kernels.tables import MAX_EXPONENT, OPTIONS, Array, LegTables, sample, solve

STEP = 1.0  # largest move of U, V or W in one iteration


@njit(**OPTIONS)
def _leg_columns(legs: LegTables, j: int, shift: float, uvw: Array, which: int, col: Array, phi: Array) -> None:
    """One leg's residual and derivatives: rows 2k, 2k+1 are ∂ by the projection and by V, the last the residual.

    A source adds e^{V + U²/C} φ(shift + U) to the leg, U being uvw[:, which].
    """
    k_sources, size = uvw.shape[0], legs.z.shape[1]
    for r in range(size):
        col[2 * k_sources, r] = -legs.z[j, r]
    for k in range(k_sources):
        u, v = uvw[k, which], uvw[k, 1]
        amplitude = math.exp(min(v + u * u / legs.c[j], MAX_EXPONENT))
        sample(legs.table[j], legs.y0, legs.h, shift + u, phi[0], phi[1])
        for r in range(size):
            g = amplitude * phi[0, r]
            col[2 * k, r] = amplitude * phi[1, r] + 2.0 * u / legs.c[j] * g
            col[2 * k + 1, r] = g
            col[2 * k_sources, r] += g


@njit(**OPTIONS)
def _add_leg(col: Array, which: int, jtj: Array, jtr: Array) -> float:
    """Add a leg's inner products to the normal equations in (U, V, W); returns its cost."""
    k_sources, size = col.shape[0] // 2, col.shape[1]
    for p in range(2 * k_sources + 1):
        i = 3 * (p // 2) + (which if p % 2 == 0 else 1)
        for q in range(p + 1):
            total = 0.0
            for r in range(size):
                total += col[p, r] * col[q, r]
            m = 3 * (q // 2) + (which if q % 2 == 0 else 1)
            if p < 2 * k_sources:
                jtj[i, m] += total
                if p != q:
                    jtj[m, i] += total
            elif q < p:
                jtr[m] += total
    cost = 0.0
    for r in range(size):
        cost += col[2 * k_sources, r] * col[2 * k_sources, r]
    return cost


@njit(**OPTIONS)
def corner_fits(legs: LegTables, j: int, uvw: Array, prior_sd: float, iterations: int) -> Array:
    """Fit (U, V, W) of every source on legs j and j+1, their angle left out; in place, returns the data costs (B,).

    uvw (B, K, 3): U and W are the source's projections on the two legs from their common corner, V its log
    contribution at the corner: leg j sees e^{V+U²/C} φ(l+U), leg j+1 sees e^{V+W²/C} φ(W). This is pairing (11) built
    into the model. A weak prior anchored at each start keeps the starts apart.
    """
    batch, k_sources = uvw.shape[0], uvw.shape[1]
    n_par = 3 * k_sources
    col = np.empty((2 * k_sources + 1, legs.z.shape[1]))
    phi = np.empty((2, legs.z.shape[1]))
    jtj, jtr = np.empty((n_par, n_par)), np.empty(n_par)
    kept, kept_r = np.empty((n_par, n_par)), np.empty(n_par)
    chol, step = np.empty((n_par, n_par)), np.empty(n_par)
    trial, best, anchor = np.empty((k_sources, 3)), np.empty((k_sources, 3)), np.empty((k_sources, 3))
    costs = np.empty(batch)
    weight = 1.0 / (prior_sd * prior_sd)
    for b in range(batch):
        anchor[:, :] = uvw[b]
        trial[:, :] = uvw[b]
        lowest = np.inf
        damping = 1e-2
        for it in range(iterations + 1):
            jtj[:, :] = 0.0
            jtr[:] = 0.0
            _leg_columns(legs, j, legs.length[j], trial, 0, col, phi)
            data = _add_leg(col, 0, jtj, jtr)
            _leg_columns(legs, j + 1, 0.0, trial, 2, col, phi)
            data += _add_leg(col, 2, jtj, jtr)
            total = data
            for k in range(k_sources):
                for q in range(3):
                    off = trial[k, q] - anchor[k, q]
                    total += weight * off * off
                    jtr[3 * k + q] += weight * off
                    jtj[3 * k + q, 3 * k + q] += weight
            if total < lowest:
                lowest = total
                costs[b] = data
                best[:, :] = trial
                kept[:, :] = jtj
                kept_r[:] = jtr
                damping = max(damping * 0.3, 1e-9)
            else:
                damping *= 6.0
            if it == iterations:
                break
            for i in range(n_par):
                chol[i, :] = kept[i]
                chol[i, i] *= 1.0 + damping
                step[i] = -kept_r[i]
            if not solve(chol, step, n_par):
                damping = damping * 10.0 + 1e-6
                continue
            for k in range(k_sources):
                for q in range(3):
                    trial[k, q] = best[k, q] + min(max(step[3 * k + q], -STEP), STEP)
        uvw[b] = best
    return costs


@njit(**OPTIONS)
def open_corner(
    uvw: Array, c1: float, c2: float, length: float, angles: Array, max_offset: float, max_alpha: float
) -> tuple[Array, Array, Array]:
    """Source maps of corner solutions at every turn angle ψ: one angle, and nothing K-dimensional is guessed.

    The offset of a source from the first leg is d = (W − U cos ψ)/sin ψ; maps with |d| > max_offset or an amplitude
    above max_alpha are left out. Returns turn angles (B,), S (B, K, 2) from the first leg's start, α (B, K).
    """
    n, k_sources = uvw.shape[0], uvw.shape[1]
    m = angles.shape[0]
    turn = np.empty(n * m)
    s = np.empty((n * m, k_sources, 2))
    alpha = np.empty((n * m, k_sources))
    count = 0
    mean_c = 0.5 * (c1 + c2)
    for i in range(n):
        for a in range(m):
            cos_a, sin_a = math.cos(angles[a]), math.sin(angles[a])
            fits = True
            for k in range(k_sources):
                u, v, w = uvw[i, k, 0], uvw[i, k, 1], uvw[i, k, 2]
                d = (w - u * cos_a) / sin_a
                s[count, k, 0] = length + u
                s[count, k, 1] = d
                alpha[count, k] = v + (u * u + d * d) / mean_c
                if abs(d) > max_offset or alpha[count, k] > max_alpha:
                    fits = False
                    break
            if fits:
                turn[count] = angles[a]
                count += 1
    return turn[:count], s[:count], alpha[:count]
