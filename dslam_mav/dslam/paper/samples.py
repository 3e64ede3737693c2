"""Appendix A: the generalised samples of a leg, exact and robust."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

EVEN = 1e-9  # share of the spacing by which evenly spaced readings may be off
PER_SPREAD = 8  # points per √C at which (17) is asked to hold
ALIAS = 1.25  # frequencies are this much closer together than centres in the fit interval need
SPAN_TOLERANCE = 1e-13  # singular values below this share carry nothing but rounding


class Robust(NamedTuple):
    """s_m = Σ_k A_k e^{jω_m (Y_k − origin)}, m = 0 … M−1, with ω_m = ω_0 (1 − 2m/(M − 1)).

    `sd` (M,): of a sample under a unit noise; `miss` (M,): by how much (17) fails on the leg, RMS per unit of height.
    """

    samples: Complex
    omega: Array
    origin: float
    sd: Array
    miss: Array


def spacing(s: Array) -> float | None:
    """T_s where the readings are evenly spaced, else None."""
    if s.size < 2:
        return None
    step = (s[-1] - s[0]) / (s.size - 1)
    even = step > 0.0 and bool(np.abs(s - s[0] - step * np.arange(s.size)).max() <= EVEN * step)
    return float(step) if even else None


def exact(s: Array, reading: Array, c: float) -> tuple[Array, float]:
    """(N,) y_n e^{(s_n − o)²/C} = Σ_k b_k u_k^n with u_k = e^{2 T_s (Y_k − o)/C}, and the origin o.

    The paper's weight has a minus sign in the exponent, a misprint (theory, section 2). The origin is the middle of
    the readings, not the leg's start: the largest weight is then e^{l²/4C} and not e^{l²/C}.
    """
    origin = 0.5 * float(s[0] + s[-1])
    return reading * np.exp((s - origin) ** 2 / c), origin


def interval(s: Array, length: float, c: float, margin: float) -> tuple[float, float]:
    """Where centres may lie: the leg and its readings, and `margin` spreads beyond either end."""
    beyond = margin * float(np.sqrt(c))
    return min(0.0, float(s.min())) - beyond, max(length, float(s.max())) + beyond


class Span(NamedTuple):
    """A grid of centres (Q,) between `ends`, and the singular value decomposition of e^{−(y−s)²/C} (Q, N) over it."""

    ends: tuple[float, float]
    grid: Array
    left: Array
    values: Array
    right: Array


def span(s: Array, c: float, ends: tuple[float, float]) -> Span:
    """All that centres between `ends` can do to readings at distances s (N,); not to be written to."""
    return _span(s.tobytes(), float(c), ends)


@lru_cache(maxsize=4)  # legs of a flight, and flights over one scene, are often read at the same distances
def _span(distances: bytes, c: float, ends: tuple[float, float]) -> Span:
    s = np.frombuffer(distances, dtype=np.float64)
    count = int(np.ceil(PER_SPREAD * (ends[1] - ends[0]) / np.sqrt(c))) + 1
    grid = np.linspace(*ends, count)
    left, values, right = np.linalg.svd(np.exp(-((grid[:, None] - s) ** 2) / c), full_matrices=False)
    return Span(ends, grid, left, values, right)


def noise_outside(reading: Array, reach: Span) -> float:
    """Noise sd of a leg: of what no sum of Gaussians with centres in `reach` can carry; NaN if nothing is left."""
    basis = reach.right[reach.values > SPAN_TOLERANCE * reach.values[0]]
    free = reading.size - len(basis)
    if free < 1:
        return float("nan")
    off = reading - basis.T @ (basis @ reading)
    return float(np.sqrt(off @ off / free))


def moments_for(k: int, omega_0: float, ends: tuple[float, float]) -> int:
    """How many samples: at least the paper's 2K, more so that Cadzow can denoise and no two centres alias."""
    unambiguous = int(np.ceil(ALIAS * omega_0 * (ends[1] - ends[0]) / np.pi)) + 1
    return max(4 * k + 1, unambiguous)


def robust(s: Array, reading: Array, reach: Span, omega: Array, noise: float) -> Robust:
    """Generalised samples by reproducing exponentials (17), with weights from least squares on the actual distances.

    The weights c_{m,n} minimise the failure of (17) over all of `reach` and, in proportion to `noise` (sd of a
    reading over the leg's largest), their own size. `omega` (M,) rad/m.
    """
    ends, grid, left, values, right = reach
    origin = 0.5 * (ends[0] + ends[1])
    wanted = np.exp(1j * np.outer(grid - origin, omega))  # (Q, M)
    ridge = max(noise, SPAN_TOLERANCE) * np.sqrt(len(grid))
    gain = values / (values**2 + ridge**2)
    weights = (right.T * gain) @ (left.T @ wanted)  # (N, M): c_{m,n} of (17)
    off = (left * (values * gain)) @ (left.T @ wanted) - wanted
    on_leg = (grid >= s.min()) & (grid <= s.max())
    miss = np.sqrt(np.mean(np.abs(off[on_leg if on_leg.any() else slice(None)]) ** 2, axis=0))
    return Robust(weights.T @ reading, omega, origin, np.linalg.norm(weights, axis=0), miss)
