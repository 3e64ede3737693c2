"""The joint model at many readings at once: what every unknown does to every reading, compiled.

A source of amplitude a at S with squared spread C adds, at x (theory, section 10; d dimensions, u = |x − S|²/C)

    g = a (πC)^{−d/2} e^{−u} (1 + κ (C_1/C)² L(u)),   L(u) = u²/2 − (d/2 + 1) u + d (d/2 + 1)/4,

L being the Laguerre polynomial that a source's extent at its release brings in; κ = 0 is a point release, (3).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from dslam_mav.dslam.kernels.tables import MAX_EXPONENT, OPTIONS, Array, Indices


@njit(**OPTIONS)
def on_legs(start: Array, along: Array, leg: Indices, distance: Array) -> Array:
    """(n, d) places at `distance` (n,) along legs of directions `along` (L, d) from their starts (L or more, d)."""
    d = along.shape[1]
    out = np.empty((leg.shape[0], d))
    for i in range(leg.shape[0]):
        j = leg[i]
        for q in range(d):
            out[i, q] = start[j, q] + distance[i] * along[j, q]
    return out


@njit(**OPTIONS)
def along_legs(along: Array, length: Array, leg: Indices, distance: Array) -> Array:
    """As `on_legs`, each leg begun where the last one, `length` (L,) long, ended."""
    n_legs, d = along.shape
    start = np.zeros((n_legs, d))
    for j in range(1, n_legs):
        for q in range(d):
            start[j, q] = start[j - 1, q] + length[j - 1] * along[j - 1, q]
    out: Array = on_legs(start, along, leg, distance)
    return out


@njit(**OPTIONS)
def add_field(
    x: Array, t: Array, s: Array, log_amplitude: Array, spread2: Array, rate: float, kappa: float, out: Array
) -> None:
    """Add every source's reading at places x (n, d), times t (n,) to `out` (n,); C_k(t) = spread2_k + rate·t."""
    n, d = x.shape
    half = 0.5 * d
    for k in range(s.shape[0]):
        for i in range(n):
            c = spread2[k] + rate * t[i]
            u = 0.0
            for q in range(d):
                u += (x[i, q] - s[k, q]) ** 2
            u /= c
            exponent = log_amplitude[k] - half * math.log(math.pi * c) - u
            value = math.exp(min(exponent, MAX_EXPONENT))
            if kappa != 0.0:
                growth = spread2[k] / c
                value *= 1.0 + kappa * growth * growth * (0.5 * u * u - (half + 1.0) * u + 0.5 * half * (half + 1.0))
            out[i] += value


@njit(**OPTIONS)
def add_columns(
    x: Array,
    t: Array,
    s: Array,
    log_amplitude: Array,
    spread2: Array,
    rate: float,
    kappa: float,
    medium: Array,
    first: tuple[int, int, int, int],
    out: Array,
    columns: Array,
    by_place: Array,
) -> None:
    """As `add_field`, and its derivatives into `columns` (n, P) and ∂/∂x into `by_place` (n, d).

    `first`: the columns where places, log amplitudes, the medium's unknowns and κ begin (κ's below 0: none).
    `medium` (K + 1, M): what the medium's unknowns do to every ln C_k at the first reading, and to ln rate.
    """
    n, d = x.shape
    half = 0.5 * d
    k_sources, n_medium = s.shape[0], medium.shape[1]
    i_place, i_amplitude, i_medium, i_kappa = first
    for i in range(n):
        for k in range(k_sources):
            c = spread2[k] + rate * t[i]
            u = 0.0
            for q in range(d):
                u += (x[i, q] - s[k, q]) ** 2
            u /= c
            exponent = log_amplitude[k] - half * math.log(math.pi * c) - u
            point = math.exp(min(exponent, MAX_EXPONENT))
            growth = spread2[k] / c
            shape = growth * growth * (0.5 * u * u - (half + 1.0) * u + 0.5 * half * (half + 1.0))
            g = point * (1.0 + kappa * shape)
            by_u = -g + point * kappa * growth * growth * (u - half - 1.0)
            out[i] += g
            for q in range(d):
                slope = by_u * 2.0 * (x[i, q] - s[k, q]) / c
                by_place[i, q] += slope
                columns[i, i_place + d * k + q] = -slope
            columns[i, i_amplitude + k] = g
            by_log_c = -u * by_u - half * g - 2.0 * point * kappa * shape
            by_first = by_log_c * growth + 2.0 * point * kappa * shape
            by_rate = by_log_c * (1.0 - growth)
            for m in range(n_medium):
                columns[i, i_medium + m] += by_first * medium[k, m] + by_rate * medium[k_sources, m]
            if i_kappa >= 0:
                columns[i, i_kappa] += point * shape


@njit(**OPTIONS)
def add_turns(
    by_place: Array, leg: Indices, distance: Array, length: Array, turns: Array, which: Indices, columns: Array
) -> None:
    """Columns of unknowns that turn legs: unknown p turns leg `which[p]`, its direction's derivative `turns[p]` (d,).

    A leg's own readings move by their distance along it, all later ones by its length.
    """
    n, d = by_place.shape
    for i in range(n):
        j = leg[i]
        for p in range(which.shape[0]):
            if which[p] > j:
                continue
            lever = distance[i] if which[p] == j else length[which[p]]
            total = 0.0
            for q in range(d):
                total += by_place[i, q] * turns[p, q]
            columns[i, p] = lever * total


@njit(**OPTIONS)
def lagged(columns: Array, t: Array, lag: float) -> Array:
    """What a first-order sensor of time constant `lag` makes of `columns` (n, P), in place; returns ∂/∂ln lag (n, P).

    Between readings the input is taken to be linear in time, before the first constant.
    """
    n, width = columns.shape
    slope = np.zeros((n, width))
    before = columns[0].copy()
    for i in range(1, n):
        h = t[i] - t[i - 1]
        e = math.exp(-h / lag)
        by_lag = e * h / (lag * lag)
        for p in range(width):
            now = columns[i, p]
            m = (now - before[p]) / h
            off = columns[i - 1, p] - before[p] + lag * m
            columns[i, p] = now - lag * m + e * off
            slope[i, p] = -lag * m + e * (slope[i - 1, p] + lag * m) + lag * by_lag * off
            before[p] = now
    return slope
