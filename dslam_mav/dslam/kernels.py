"""Compiled kernels of the search: Levenberg–Marquardt on compressed legs, corner fits, heading scans.

Everything here works on the generalised samples of `compress.py`, in units where the noise of a sample is 1.
Notation (theory, section 8): z (L, R) samples; `table` (L, G, 2, R) holds φ(Y) and φ'(Y) at Y = y0 + g·h;
`c` (L,) the squared spread a leg sees across its line; `length` (L,). A candidate is headings θ (L,), sources S (K, 2)
measured from the start of its first leg, and log amplitudes α (K,), where a source adds e^{α − d²/C} φ(Y) to a leg.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Flags = NDArray[np.bool_]

_OPTIONS: dict[str, Any] = {
    "cache": True,
    "nogil": True,
    "error_model": "numpy",
    "fastmath": {"contract", "reassoc", "nsz"},
}

MAX_EXPONENT = 300.0
STEP_HEADING_RAD = 0.5
STEP_POSITION = 1.0
STEP_LOG_AMPLITUDE = 1.0


@njit(**_OPTIONS)
def _sample(table: Array, y0: float, h: float, y: float, phi: Array, dphi: Array) -> None:
    """φ and φ' at y by cubic Hermite interpolation of one leg's table (G, 2, R); zero outside the table."""
    u = (y - y0) / h
    g = int(math.floor(u))
    size = phi.shape[0]
    if g < 0 or g >= table.shape[0] - 1:
        for r in range(size):
            phi[r] = 0.0
            dphi[r] = 0.0
        return
    t = u - g
    t2 = t * t
    t3 = t2 * t
    h01 = 3.0 * t2 - 2.0 * t3
    h00 = 1.0 - h01
    h10 = (t3 - 2.0 * t2 + t) * h
    h11 = (t3 - t2) * h
    d01 = (6.0 * t - 6.0 * t2) / h
    d10 = 3.0 * t2 - 4.0 * t + 1.0
    d11 = 3.0 * t2 - 2.0 * t
    left, right = table[g], table[g + 1]
    for r in range(size):
        phi[r] = h00 * left[0, r] + h01 * right[0, r] + h10 * left[1, r] + h11 * right[1, r]
        dphi[r] = d01 * (right[0, r] - left[0, r]) + d10 * left[1, r] + d11 * right[1, r]


@njit(**_OPTIONS)
def _solve(a: Array, b: Array, p: int) -> bool:
    """Solve a x = b in place for symmetric positive a[:p, :p] (Cholesky); False where it is not positive."""
    for i in range(p):
        for j in range(i + 1):
            total = a[i, j]
            for q in range(j):
                total -= a[i, q] * a[j, q]
            if i == j:
                if not total > 0.0:
                    return False
                a[i, i] = math.sqrt(total)
            else:
                a[i, j] = total / a[j, j]
    for i in range(p):
        total = b[i]
        for q in range(i):
            total -= a[i, q] * b[q]
        b[i] = total / a[i, i]
    for i in range(p - 1, -1, -1):
        total = b[i]
        for q in range(i + 1, p):
            total -= a[q, i] * b[q]
        b[i] = total / a[i, i]
    return True


@njit(**_OPTIONS)
def _normal_equations(
    z: Array,
    table: Array,
    y0: float,
    h: float,
    c: Array,
    length: Array,
    lo: int,
    hi: int,
    theta: Array,
    s: Array,
    alpha: Array,
    alpha0: float,
    amp_sd: float,
    work: tuple[Array, ...],
    jtj: Array,
    jtr: Array,
) -> float:
    """Cost of a candidate on legs lo … hi, and its normal equations.

    Parameters in order: headings of legs lo+1 … hi, then (x, y, α) of every source. The columns of earlier headings
    are combinations of the sources' columns, since turning leg i moves all that follows: −l_i n_iᵀ Σ_k ∂/∂S_k.
    """
    k_sources = alpha.shape[0]
    size = z.shape[1]
    n_head = hi - lo
    n_par = n_head + 3 * k_sources
    n_col = 3 * k_sources + 3
    col, res, phi, dphi, gram, combo = work
    for i in range(n_par):
        jtr[i] = 0.0
        for j in range(i + 1):
            jtj[i, j] = 0.0
    cost = 0.0
    bx = 0.0
    by = 0.0
    for j in range(lo, hi + 1):
        cx, cy = math.cos(theta[j]), math.sin(theta[j])
        ix, iy, ih = 3 * k_sources, 3 * k_sources + 1, 3 * k_sources + 2
        for r in range(size):
            res[r] = -z[j, r]
            col[ix, r] = 0.0
            col[iy, r] = 0.0
            col[ih, r] = 0.0
        for k in range(k_sources):
            px, py = s[k, 0] - bx, s[k, 1] - by
            y = px * cx + py * cy
            d = py * cx - px * cy
            amp = math.exp(min(alpha[k] - d * d / c[j], MAX_EXPONENT))
            _sample(table[j], y0, h, y, phi, dphi)
            across = -2.0 * d / c[j]
            for r in range(size):
                g = amp * phi[r]
                gp = amp * dphi[r]
                res[r] += g
                sx = gp * cx - across * g * cy
                sy = gp * cy + across * g * cx
                col[3 * k, r] = sx
                col[3 * k + 1, r] = sy
                col[3 * k + 2, r] = g
                col[ix, r] += sx
                col[iy, r] += sy
                col[ih, r] += gp * d - across * g * y
        # inner products of the leg's few columns, then of the parameters made from them
        for p in range(n_col):
            total = 0.0
            for r in range(size):
                total += col[p, r] * res[r]
            gram[p, n_col] = total
            for q in range(p + 1):
                total = 0.0
                for r in range(size):
                    total += col[p, r] * col[q, r]
                gram[p, q] = total
                gram[q, p] = total
        for r in range(size):
            cost += res[r] * res[r]
        n_act = j - lo
        for i in range(n_head):
            combo[i, 0] = 0.0
            combo[i, 1] = 0.0
            combo[i, 2] = 0.0
        for i in range(n_act):
            if i > 0:
                angle = theta[lo + i]
                combo[i - 1, 0] = length[lo + i] * math.sin(angle)
                combo[i - 1, 1] = -length[lo + i] * math.cos(angle)
        if n_act > 0:
            combo[n_act - 1, 2] = 1.0
        for a in range(n_act):
            a0, a1, a2 = combo[a, 0], combo[a, 1], combo[a, 2]
            jtr[a] += a0 * gram[ix, n_col] + a1 * gram[iy, n_col] + a2 * gram[ih, n_col]
            for b in range(a + 1):
                b0, b1, b2 = combo[b, 0], combo[b, 1], combo[b, 2]
                jtj[a, b] += (
                    a0 * (b0 * gram[ix, ix] + b1 * gram[ix, iy] + b2 * gram[ix, ih])
                    + a1 * (b0 * gram[iy, ix] + b1 * gram[iy, iy] + b2 * gram[iy, ih])
                    + a2 * (b0 * gram[ih, ix] + b1 * gram[ih, iy] + b2 * gram[ih, ih])
                )
            for q in range(3 * k_sources):
                jtj[n_head + q, a] += a0 * gram[ix, q] + a1 * gram[iy, q] + a2 * gram[ih, q]
        for p in range(3 * k_sources):
            jtr[n_head + p] += gram[p, n_col]
            for q in range(p + 1):
                jtj[n_head + p, n_head + q] += gram[p, q]
        bx += length[j] * cx
        by += length[j] * cy
    weight = 1.0 / (amp_sd * amp_sd)
    for k in range(k_sources):
        excess = alpha[k] - alpha0
        index = n_head + 3 * k + 2
        cost += weight * excess * excess
        jtr[index] += weight * excess
        jtj[index, index] += weight
    return cost


@njit(**_OPTIONS)
def _workspace(k_sources: int, size: int, n_legs: int) -> tuple[Array, ...]:
    n_col = 3 * k_sources + 3
    return (
        np.empty((n_col, size)),
        np.empty(size),
        np.empty(size),
        np.empty(size),
        np.empty((n_col, n_col + 1)),
        np.zeros((max(n_legs, 1), 3)),
    )


@njit(**_OPTIONS)
def fit_batch(
    z: Array,
    table: Array,
    y0: float,
    h: float,
    c: Array,
    length: Array,
    lo: int,
    hi: int,
    theta: Array,
    s: Array,
    alpha: Array,
    alpha0: float,
    amp_sd: float,
    iterations: int,
    tolerance: float,
) -> tuple[Array, Flags]:
    """Levenberg–Marquardt on legs lo … hi for every candidate, in place; returns (costs, converged).

    theta (B, L), s (B, K, 2), alpha (B, K). Steps are clipped (0.5 rad, one spread, 1 in log amplitude).
    """
    batch = theta.shape[0]
    k_sources = alpha.shape[1]
    n_head = hi - lo
    n_par = n_head + 3 * k_sources
    work = _workspace(k_sources, z.shape[1], z.shape[0])
    jtj = np.empty((n_par, n_par))
    jtr = np.empty(n_par)
    jtj_try = np.empty((n_par, n_par))
    jtr_try = np.empty(n_par)
    chol = np.empty((n_par, n_par))
    step = np.empty(n_par)
    th_try = np.empty(theta.shape[1])
    s_try = np.empty((k_sources, 2))
    al_try = np.empty(k_sources)
    costs = np.empty(batch)
    converged = np.zeros(batch, dtype=np.bool_)
    for b in range(batch):
        th, sb, al = theta[b], s[b], alpha[b]
        cost = _normal_equations(z, table, y0, h, c, length, lo, hi, th, sb, al, alpha0, amp_sd, work, jtj, jtr)
        lam = 1e-3
        for _ in range(iterations):
            for i in range(n_par):
                step[i] = -jtr[i]
                for j in range(i + 1):
                    chol[i, j] = jtj[i, j]
                chol[i, i] = jtj[i, i] * (1.0 + lam) + 1e-12
            if not _solve(chol, step, n_par):
                lam = lam * 10.0 + 1e-6
                continue
            for i in range(th.shape[0]):
                th_try[i] = th[i]
            biggest = 0.0
            for i in range(n_head):
                move = min(max(step[i], -STEP_HEADING_RAD), STEP_HEADING_RAD)
                biggest = max(biggest, abs(move))
                th_try[lo + 1 + i] = th[lo + 1 + i] + move
            for k in range(k_sources):
                for q in range(2):
                    move = min(max(step[n_head + 3 * k + q], -STEP_POSITION), STEP_POSITION)
                    biggest = max(biggest, abs(move))
                    s_try[k, q] = sb[k, q] + move
                move = min(max(step[n_head + 3 * k + 2], -STEP_LOG_AMPLITUDE), STEP_LOG_AMPLITUDE)
                biggest = max(biggest, abs(move))
                al_try[k] = al[k] + move
            cost_try = _normal_equations(
                z, table, y0, h, c, length, lo, hi, th_try, s_try, al_try, alpha0, amp_sd, work, jtj_try, jtr_try
            )
            if cost_try < cost:
                gain = cost - cost_try
                cost = cost_try
                th[:] = th_try
                sb[:, :] = s_try
                al[:] = al_try
                jtj, jtj_try = jtj_try, jtj
                jtr, jtr_try = jtr_try, jtr
                lam = max(lam * 0.2, 1e-9)
                if gain < tolerance * (1.0 + cost) and biggest < 1e-2:
                    converged[b] = True
                    break
            else:
                if biggest < 1e-7:
                    converged[b] = True
                    break
                lam *= 8.0
                if lam > 1e12:
                    break
        costs[b] = cost
    return costs, converged


@njit(**_OPTIONS)
def corner_fits(
    z: Array,
    table: Array,
    y0: float,
    h: float,
    c: Array,
    length: Array,
    j: int,
    uvw: Array,
    prior_sd: float,
    iterations: int,
) -> Array:
    """Fit (U, V, W) of every source on legs j and j+1, their angle left out; in place, returns the data costs.

    uvw (B, K, 3): U and W are the source's projections on the two legs from their common corner, V its log
    contribution at the corner: leg j sees e^{V+U²/C} φ(l+U), leg j+1 sees e^{V+W²/C} φ(W). This is pairing (11) built
    into the model. A weak prior anchored at each start keeps the starts apart.
    """
    batch, k_sources = uvw.shape[0], uvw.shape[1]
    size = z.shape[1]
    n_par = 3 * k_sources
    first = np.empty((2 * k_sources, size))
    second = np.empty((2 * k_sources, size))
    res1 = np.empty(size)
    res2 = np.empty(size)
    phi = np.empty(size)
    dphi = np.empty(size)
    jtj = np.empty((n_par, n_par))
    jtr = np.empty(n_par)
    step = np.empty(n_par)
    trial = np.empty((k_sources, 3))
    best = np.empty((k_sources, 3))
    anchor = np.empty((k_sources, 3))
    costs = np.empty(batch)
    weight = 1.0 / (prior_sd * prior_sd)
    for b in range(batch):
        anchor[:, :] = uvw[b]
        trial[:, :] = uvw[b]
        best[:, :] = uvw[b]
        best_total = np.inf
        best_data = np.inf
        lam = 1e-2
        for it in range(iterations + 1):
            for r in range(size):
                res1[r] = -z[j, r]
                res2[r] = -z[j + 1, r]
            penalty = 0.0
            for k in range(k_sources):
                u, v, w = trial[k, 0], trial[k, 1], trial[k, 2]
                amp = math.exp(min(v + u * u / c[j], MAX_EXPONENT))
                _sample(table[j], y0, h, length[j] + u, phi, dphi)
                for r in range(size):
                    g = amp * phi[r]
                    res1[r] += g
                    first[2 * k, r] = amp * dphi[r] + 2.0 * u / c[j] * g
                    first[2 * k + 1, r] = g
                amp = math.exp(min(v + w * w / c[j + 1], MAX_EXPONENT))
                _sample(table[j + 1], y0, h, w, phi, dphi)
                for r in range(size):
                    g = amp * phi[r]
                    res2[r] += g
                    second[2 * k, r] = amp * dphi[r] + 2.0 * w / c[j + 1] * g
                    second[2 * k + 1, r] = g
                for q in range(3):
                    penalty += weight * (trial[k, q] - anchor[k, q]) ** 2
            data = 0.0
            for r in range(size):
                data += res1[r] * res1[r] + res2[r] * res2[r]
            if data + penalty < best_total:
                best_total = data + penalty
                best_data = data
                best[:, :] = trial
                lam = max(lam * 0.3, 1e-9)
                for a in range(k_sources):
                    for q in range(k_sources):
                        uu = 0.0
                        uv = 0.0
                        vv = 0.0
                        vu = 0.0
                        vw = 0.0
                        wv = 0.0
                        ww = 0.0
                        for r in range(size):
                            uu += first[2 * a, r] * first[2 * q, r]
                            uv += first[2 * a, r] * first[2 * q + 1, r]
                            vu += first[2 * a + 1, r] * first[2 * q, r]
                            vv += (
                                first[2 * a + 1, r] * first[2 * q + 1, r] + second[2 * a + 1, r] * second[2 * q + 1, r]
                            )
                            vw += second[2 * a + 1, r] * second[2 * q, r]
                            wv += second[2 * a, r] * second[2 * q + 1, r]
                            ww += second[2 * a, r] * second[2 * q, r]
                        i, m = 3 * a, 3 * q
                        jtj[i, m] = uu
                        jtj[i, m + 1] = uv
                        jtj[i, m + 2] = 0.0
                        jtj[i + 1, m] = vu
                        jtj[i + 1, m + 1] = vv
                        jtj[i + 1, m + 2] = vw
                        jtj[i + 2, m] = 0.0
                        jtj[i + 2, m + 1] = wv
                        jtj[i + 2, m + 2] = ww
                    ru = 0.0
                    rv = 0.0
                    rw = 0.0
                    for r in range(size):
                        ru += first[2 * a, r] * res1[r]
                        rv += first[2 * a + 1, r] * res1[r] + second[2 * a + 1, r] * res2[r]
                        rw += second[2 * a, r] * res2[r]
                    jtr[3 * a] = ru + weight * (trial[a, 0] - anchor[a, 0])
                    jtr[3 * a + 1] = rv + weight * (trial[a, 1] - anchor[a, 1])
                    jtr[3 * a + 2] = rw + weight * (trial[a, 2] - anchor[a, 2])
                for i in range(n_par):
                    jtj[i, i] += weight
            else:
                lam *= 6.0
            if it == iterations:
                break
            chol = jtj.copy()
            for i in range(n_par):
                chol[i, i] *= 1.0 + lam
                step[i] = -jtr[i]
            if not _solve(chol, step, n_par):
                lam = lam * 10.0 + 1e-6
                continue
            for k in range(k_sources):
                for q in range(3):
                    trial[k, q] = best[k, q] + min(max(step[3 * k + q], -1.0), 1.0)
        uvw[b] = best
        costs[b] = best_data
    return costs


@njit(**_OPTIONS)
def open_corner(
    uvw: Array, c1: float, c2: float, length: float, angles: Array, max_offset: float, max_alpha: float
) -> tuple[Array, Array, Array]:
    """Source maps of corner solutions at every turn angle ψ: S from the first leg's start, α; one angle per scan.

    The offset of a source from the first leg is d = (W − U cos ψ)/sin ψ; maps with |d| > max_offset or an amplitude
    above max_alpha are left out. Returns (theta of the second leg, S (B, K, 2), alpha (B, K)).
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


@njit(**_OPTIONS)
def scan_heading(
    z: Array,
    table: Array,
    y0: float,
    h: float,
    c: Array,
    length: Array,
    j: int,
    start: Array,
    s: Array,
    alpha: Array,
    headings: Array,
    backwards: bool,
) -> tuple[Array, Array]:
    """Cost of leg j at every heading for every candidate, and the two best local minima.

    `start` (B, 2) is the leg's start, or its end when `backwards`; s (B, K, 2) in the same frame. Returns
    (best headings (B, 2), their costs (B, 2)); a missing second minimum costs inf.
    """
    batch, k_sources = s.shape[0], s.shape[1]
    m = headings.shape[0]
    size = z.shape[1]
    phi = np.empty(size)
    dphi = np.empty(size)
    res = np.empty(size)
    cost = np.empty(m)
    best = np.empty((batch, 2))
    best_cost = np.full((batch, 2), np.inf)
    for b in range(batch):
        for a in range(m):
            cx, cy = math.cos(headings[a]), math.sin(headings[a])
            shift = length[j] if backwards else 0.0
            for r in range(size):
                res[r] = -z[j, r]
            for k in range(k_sources):
                px, py = s[b, k, 0] - start[b, 0], s[b, k, 1] - start[b, 1]
                y = px * cx + py * cy + shift
                d = py * cx - px * cy
                exponent = alpha[b, k] - d * d / c[j]
                if exponent < -30.0:
                    continue
                amp = math.exp(min(exponent, MAX_EXPONENT))
                _sample(table[j], y0, h, y, phi, dphi)
                for r in range(size):
                    res[r] += amp * phi[r]
            total = 0.0
            for r in range(size):
                total += res[r] * res[r]
            cost[a] = total
        for a in range(m):
            here = cost[a]
            if here <= cost[a - 1] and here < cost[(a + 1) % m]:
                if here < best_cost[b, 0]:
                    best[b, 1], best_cost[b, 1] = best[b, 0], best_cost[b, 0]
                    best[b, 0], best_cost[b, 0] = headings[a], here
                elif here < best_cost[b, 1]:
                    best[b, 1], best_cost[b, 1] = headings[a], here
    return best, best_cost


@njit(**_OPTIONS)
def distinct(theta: Array, s: Array, alpha: Array, lo: int, hi: int, keep: int, tolerance: float) -> Indices:
    """Indices of the first `keep` candidates (given best first) that differ by more than `tolerance`.

    Sources are compared in order of x, headings by their cosine and sine.
    """
    batch, k_sources = alpha.shape
    chosen = np.empty(min(keep, batch), dtype=np.int64)
    count = 0
    order = np.empty((batch, k_sources), dtype=np.int64)
    for b in range(batch):
        order[b] = np.argsort(s[b, :, 0])
        same = False
        for i in range(count):
            o = chosen[i]
            far = 0.0
            for k in range(k_sources):
                p, q = order[b, k], order[o, k]
                far = max(far, abs(s[b, p, 0] - s[o, q, 0]))
                far = max(far, abs(s[b, p, 1] - s[o, q, 1]))
            for j in range(lo, hi + 1):
                far = max(far, abs(math.cos(theta[b, j]) - math.cos(theta[o, j])))
                far = max(far, abs(math.sin(theta[b, j]) - math.sin(theta[o, j])))
            if far < tolerance:
                same = True
                break
        if not same:
            chosen[count] = b
            count += 1
            if count == keep:
                break
    return chosen[:count]
