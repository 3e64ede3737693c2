"""A leg without noise, fitted to rounding: ln f and its K Gaussians, in place of the filter's last digits.

    ln f(s) = ln Σ_k A_k e^{−(s − Y_k)²/C},   so   ln (f e^{s²/C}) = ln Σ_k b_k u_k^s

is convex, with slopes between the outermost 2 Y_k/C: the exact generalised samples (Appendix A) without their range.
Rounding is a share of every reading, so that tails eight digits below the peak place a source as well as the peak.

PAPER DEVIATION: the paper stops at the roots of the filter, which lose the digits of the largest sample on all others.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.paper.gaussians import Gaussians, LegFit

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

ROUNDED = 1e-12  # RMS of ln (measured / model) that is rounding and nothing else
ROUNDING = 1e-15  # the same where no more can be had
FAITHFUL = 1e-12  # share of a reading its own rounding may be of it: others are left out
LEAST = 1e-280  # of a reading: below, digits are lost to underflow
MOST_STEPS, TRIES = 150, 8
LONGEST = 0.5  # step of a centre, in √C; of ln A ten times as much
GAIN = 1e-4  # a step that lowers the cost by less than this share is the last
DRAWN = 36  # starts besides those the slopes tell
PLAIN = 1e6  # condition below which a fit down to rounding has no other beside it
MORE = 8  # starts after such a fit otherwise: a source faint enough has several places that leave next to nothing


class Logarithms(NamedTuple):
    """Of the readings above their rounding: distances s (N,), ln f (N,), weights (N,); and which of all they are."""

    s: Array
    value: Array
    weight: Array
    kept: Flags


def logarithms(s: Array, reading: Array, offset: float) -> Logarithms:
    """ln of a leg's readings; `offset`: the ambient level that was taken off, whose rounding they carry."""
    size = np.abs(reading) + 2.0 * offset
    kept = (reading > LEAST) & (np.finfo(np.float64).eps * size < FAITHFUL * np.abs(reading))
    return Logarithms(s[kept], np.log(reading[kept]), reading[kept] / size[kept], kept)


def fit_leg(ln: Logarithms, k: int, c: float, ends: tuple[float, float], first: Iterable[Array] = ()) -> LegFit | None:
    """K Gaussians that leave no more than rounding, or None. `first`: centres to start from.

    Covariance and condition are for a unit error of ln f; `cost` is the sum of squares of what is left of ln f.
    """
    if ln.s.size < 2 * k:
        return None
    best: LegFit | None = None
    more = MORE
    for start in (*first, *_starts(ln, k, c, ends)):
        # A_k can be no larger than a reading alone would make it; half of that is a start.
        height = (ln.value[:, None] + (ln.s[:, None] - start) ** 2 / c).min(axis=0) - np.log(2.0)
        fit = _descend(ln, start, height, c)
        if fit is not None and (best is None or fit.cost < best.cost):
            best = fit
        if best is not None:
            if best.cost <= ln.s.size * ROUNDING**2 or more == 0 or best.condition < PLAIN:
                return best
            more -= 1
    return best


def _starts(ln: Logarithms, k: int, c: float, ends: tuple[float, float]) -> Iterator[Array]:
    """Centres (K,) from the slopes of ln f + s²/C, whose plateaus are at 2 Y_k/C, then at random between `ends`."""
    order = np.argsort(ln.s, kind="stable")
    step = np.diff(ln.s[order])
    apart = step > 0.0
    slope = 0.5 * c * np.diff((ln.value + ln.s**2 / c)[order])[apart] / step[apart]
    slope = np.clip(slope, *ends) if slope.size else np.array(ends)
    low, high = float(slope.min()), float(slope.max())
    centre = np.quantile(slope, (np.arange(k) + 0.5) / k)
    for _ in range(15):
        nearest = np.abs(slope[:, None] - centre).argmin(axis=1)
        centre = np.array([slope[nearest == i].mean() if (nearest == i).any() else centre[i] for i in range(k)])
    yield centre
    yield np.linspace(low, high, k)
    rng = np.random.default_rng(k)
    for i in range(DRAWN):
        drawn = np.sort(rng.uniform(low, high, k) if i % 2 else rng.uniform(*ends, k))
        if i % 4 == 1:
            drawn[0], drawn[-1] = low, high
        yield drawn


def _descend(ln: Logarithms, y: Array, height: Array, c: float) -> LegFit | None:
    """Levenberg–Marquardt in (Y, ln A); None where it ends above rounding."""
    k, damping = len(y), 1e-3
    left, share = _left(ln, y, height, c)
    cost = float(left @ left)
    for _ in range(MOST_STEPS):
        slope = np.hstack((share * 2.0 * (ln.s[:, None] - y) / c, share)) * ln.weight[:, None]
        size = np.linalg.norm(slope, axis=0)
        size = np.where(size > 0.0, size, 1.0)
        lowered = False
        for _ in range(TRIES):
            padded = np.vstack((slope / size, np.sqrt(damping) * np.eye(2 * k)))
            step = np.linalg.lstsq(padded, np.concatenate((left, np.zeros(2 * k))), rcond=None)[0] / size
            moved = y + np.clip(step[:k], -LONGEST, LONGEST) * np.sqrt(c)
            raised = height + np.clip(step[k:], -10.0 * LONGEST, 10.0 * LONGEST)
            trial, its_share = _left(ln, moved, raised, c)
            new = float(trial @ trial)
            if new < cost:
                lowered = cost - new > GAIN * cost
                y, height, left, share, cost, damping = moved, raised, trial, its_share, new, max(0.1 * damping, 1e-20)
                break
            damping *= 10.0
        if not lowered or cost <= ln.s.size * ROUNDING**2:
            break
    if not cost <= ln.s.size * ROUNDED**2:
        return None
    return _assessed(ln, y, height, c, cost)


def _left(ln: Logarithms, y: Array, height: Array, c: float) -> tuple[Array, Array]:
    """(N,) weighted ln f − ln model, and (N, K) each Gaussian's share of the model."""
    value, share = ln_sum(height - (ln.s[:, None] - y) ** 2 / c)
    return (ln.value - value) * ln.weight, share


def ln_sum(exponent: Array) -> tuple[Array, Array]:
    """(N,) ln Σ_k e^{x_k} for x (N, K), without overflow, and (N, K) each term's share of the sum."""
    top = exponent.max(axis=1)
    part = np.exp(exponent - top[:, None])
    total = part.sum(axis=1)
    return top + np.log(total), part / total[:, None]


def _assessed(ln: Logarithms, y: Array, height: Array, c: float, cost: float) -> LegFit:
    k, a = len(y), np.exp(height)
    share = _left(ln, y, height, c)[1]
    slope = np.hstack((share * 2.0 * (ln.s[:, None] - y) / c, share)) * ln.weight[:, None]
    size = np.maximum(np.linalg.norm(slope, axis=0), 1e-150)
    _, values, right = np.linalg.svd(slope / size, full_matrices=False)
    values = np.maximum(values, np.finfo(np.float64).eps * values[0])
    with np.errstate(over="ignore", invalid="ignore"):
        inverse = (right.T / values**2) @ right / size[:, None] / size[None, :]
    condition = float(np.sqrt(np.diag(inverse)[:k].max() / c))
    scale = np.concatenate((np.ones(k), a))  # from ln A to A
    with np.errstate(over="ignore", invalid="ignore"):
        covariance = np.nan_to_num(inverse * np.outer(scale, scale), nan=0.0, posinf=1e200, neginf=-1e200)
    return LegFit(Gaussians(y, a, np.full(k, c)), covariance, condition, cost)
