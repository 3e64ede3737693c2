"""The joint model of the plain case, compiled: straight legs in the plane, and of priors those on sources alone.

The vector is that of `Layout`: headings θ_2 … θ_L, S_k, ln a_k, the medium's unknowns (from what they are at the
start), ambient level.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from dslam_mav.dslam.kernels.model import add_columns, add_field, add_turns, along_legs
from dslam_mav.dslam.kernels.tables import OPTIONS, Array, Indices


class Flown(NamedTuple):
    """Readings y (n,) at distance s along legs, at times t; ln C_k at the first reading and ln 4μ in `base` (K + 1,)
    move with the medium's unknowns by `medium` (K + 1, M); `outside` and `n_readings` as in `Problem`.

    `peak`: ln of a source's plausible peak and 1/sd of the excess; `oldest`: likewise of ln age; 1/sd 0: no such prior.
    """

    s: Array
    t: Array
    y: Array
    leg: Indices
    length: Array
    medium: Array
    ambient: float
    ambient_free: bool
    extent: float
    outside: float
    n_readings: int
    peak: tuple[float, float]
    oldest: tuple[float, float]


@njit(**OPTIONS)
def medium_of(flown: Flown, base: Array, x: Array, k_sources: int) -> Array:
    """(K + 1,) ln C_k and ln 4μ."""
    first = flown.length.size - 1 + 3 * k_sources
    logs = base.copy()
    for i in range(k_sources + 1):
        for m in range(flown.medium.shape[1]):
            if flown.medium[i, m] != 0.0:
                logs[i] += flown.medium[i, m] * x[first + m]
    return logs


@njit(**OPTIONS)
def _along(n_legs: int, x: Array) -> Array:
    along = np.empty((n_legs, 2))
    along[0, 0], along[0, 1] = 1.0, 0.0
    for j in range(1, n_legs):
        along[j, 0], along[j, 1] = math.cos(x[j - 1]), math.sin(x[j - 1])
    return along


@njit(**OPTIONS)
def residual_of(flown: Flown, base: Array, x: Array, k_sources: int, residual: Array, columns: Array) -> None:
    """Residual (n + 2K,), the priors' last, and where `columns` (n + 2K, P) has any rows, the Jacobian."""
    n, n_legs = flown.s.size, flown.length.size
    i_place = n_legs - 1
    i_amplitude, i_medium = i_place + 2 * k_sources, i_place + 3 * k_sources
    i_ambient = i_medium + flown.medium.shape[1]
    along = _along(n_legs, x)
    places = along_legs(along, flown.length, flown.leg, flown.s)
    s = x[i_place:i_amplitude].copy().reshape((k_sources, 2))
    log_amplitude = x[i_amplitude:i_medium]
    logs = medium_of(flown, base, x, k_sources)
    spread2, rate = np.exp(logs[:k_sources]), math.exp(logs[k_sources])
    model = residual[:n]
    model[:] = 0.0
    if columns.shape[0] == 0:
        add_field(places, flown.t, s, log_amplitude, spread2, rate, flown.extent, model)
    else:
        columns[:, :] = 0.0
        by_place = np.zeros((n, 2))
        first = (i_place, i_amplitude, i_medium, -1)
        add_columns(
            places, flown.t, s, log_amplitude, spread2, rate, flown.extent, flown.medium, first,
            model, columns[:n], by_place,
        )  # fmt: skip
        turns, which = np.empty((n_legs - 1, 2)), np.arange(1, n_legs)
        for j in range(1, n_legs):
            turns[j - 1, 0], turns[j - 1, 1] = -along[j, 1], along[j, 0]
        add_turns(by_place, flown.leg, flown.s, flown.length, turns, which, columns[:n])
        if flown.ambient_free:
            columns[:n, i_ambient] = 1.0
    level = x[i_ambient] if flown.ambient_free else flown.ambient
    for i in range(n):
        model[i] += level - flown.y[i]
    _prior_rows(flown, log_amplitude, logs, residual, columns)


@njit(**OPTIONS)
def _prior_rows(flown: Flown, log_amplitude: Array, logs: Array, residual: Array, columns: Array) -> None:
    """What sources have beyond a plausible peak, and beyond a plausible age."""
    n, k_sources = flown.s.size, log_amplitude.size
    i_amplitude = flown.length.size - 1 + 2 * k_sources
    i_medium = i_amplitude + k_sources
    for k in range(k_sources):
        excess = log_amplitude[k] - flown.peak[0] - math.log(math.pi) - logs[k]
        stronger = flown.peak[1] if excess > 0.0 else 0.0
        residual[n + k] = excess * stronger
        older = logs[k] - logs[k_sources] - flown.oldest[0]
        beyond = flown.oldest[1] if older > 0.0 else 0.0
        residual[n + k_sources + k] = older * beyond if beyond > 0.0 else 0.0
        if columns.shape[0] > 0:
            columns[n + k, i_amplitude + k] = stronger
            for m in range(flown.medium.shape[1]):
                own, rate = flown.medium[k, m], flown.medium[k_sources, m]
                columns[n + k, i_medium + m] = -own * stronger
                columns[n + k_sources + k, i_medium + m] = (own - rate) * beyond
