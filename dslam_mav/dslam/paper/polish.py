"""Refinement without noise: directions, sources and amplitudes fitted to ln f of all legs, down to rounding.

In place of IV-D, whose linear interpolation is worse than what it would mend. A source that is faint on one leg is
plain on another: together the legs hold digits that the one by one loses.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.paper.layout import Layout, vertices
from dslam_mav.dslam.paper.logarithms import GAIN, LONGEST, ROUNDED, ROUNDING, TRIES, Logarithms, ln_sum, logarithms
from dslam_mav.dslam.paper.scenery import Scenery

Array = NDArray[np.float64]

MOST_STEPS = 100


class _Point(NamedTuple):
    direction: Array
    source: Array
    ln_amplitude: Array


def polish(scene: Scenery, layout: Layout) -> Layout | None:
    """The layout that leaves no more than rounding of all readings, by Levenberg–Marquardt from this; or None."""
    legs = [logarithms(s, y, scene.offset) for s, y in zip(scene.s, scene.reading, strict=True)]
    at = _Point(layout.direction, layout.source, layout.ln_amplitude)
    left, slope = _left(scene, legs, at)
    cost, damping, count = float(left @ left), 1e-3, left.size
    for _ in range(MOST_STEPS):
        size = np.linalg.norm(slope, axis=0)
        size = np.where(size > 0.0, size, 1.0)
        lowered = False
        for _ in range(TRIES):
            padded = np.vstack((slope / size, np.sqrt(damping) * np.eye(len(size))))
            step = np.linalg.lstsq(padded, np.concatenate((left, np.zeros(len(size)))), rcond=None)[0] / size
            trial = _moved(at, step)
            new_left, new_slope = _left(scene, legs, trial)
            new = float(new_left @ new_left)
            if new < cost:
                lowered = cost - new > GAIN * cost
                at, left, slope, cost, damping = trial, new_left, new_slope, new, max(0.1 * damping, 1e-20)
                break
            damping *= 10.0
        if not lowered or cost <= count * ROUNDING**2:
            break
    if not cost <= count * ROUNDED**2:
        return None
    return Layout(at.direction, at.source, at.ln_amplitude, f"{layout.how}, polished", rounded=True)


def _left(scene: Scenery, legs: list[Logarithms], at: _Point) -> tuple[Array, Array]:
    """(N,) weighted ln f − ln model of all readings, and (N, P) the model's derivatives.

    P: turns of every direction (L, d−1), sources (K, d), ln a (K,). The gauge is left to the damping.
    """
    (n_legs, d), k = at.direction.shape, len(at.source)
    b, turn = vertices(at.direction, scene.length), tangents(at.direction)
    free = n_legs * (d - 1)
    lefts, slopes = [], []
    for j, ln in enumerate(legs):
        c = spread2(scene, j, ln)[:, None]
        off = at.source - (b[j] + ln.s[:, None] * at.direction[j])[:, None, :]  # (N, K, d)
        value, share = ln_sum(at.ln_amplitude - 0.5 * d * np.log(np.pi * c) - (off**2).sum(axis=2) / c)
        pull = -2.0 / c[:, :, None] * share[:, :, None] * off  # by S_k
        slope = np.zeros((ln.s.size, free + k * (d + 1)))
        slope[:, free : free + k * d] = pull.reshape(len(pull), -1)
        slope[:, free + k * d :] = share
        shift = -pull.sum(axis=1)  # by the reading's place
        for i in range(j + 1):
            reach = ln.s if i == j else np.full(ln.s.size, scene.length[i])
            slope[:, i * (d - 1) : (i + 1) * (d - 1)] = (shift @ turn[i].T) * reach[:, None]
        lefts.append((ln.value - value) * ln.weight)
        slopes.append(slope * ln.weight[:, None])
    return np.concatenate(lefts), np.vstack(slopes)


def _moved(at: _Point, step: Array) -> _Point:
    (n_legs, d), k = at.direction.shape, len(at.source)
    free = n_legs * (d - 1)
    turned = np.clip(step[:free], -0.3, 0.3).reshape(n_legs, d - 1)
    direction = at.direction + np.einsum("ji,jid->jd", turned, tangents(at.direction))
    source = at.source + np.clip(step[free : free + k * d], -LONGEST, LONGEST).reshape(k, d)
    amplitude = at.ln_amplitude + np.clip(step[free + k * d :], -10.0 * LONGEST, 10.0 * LONGEST)
    return _Point(direction / np.linalg.norm(direction, axis=1, keepdims=True), source, amplitude)


def spread2(scene: Scenery, j: int, ln: Logarithms) -> Array:
    """(N,) C at the kept readings of leg `j`: as the field evolves, not at the leg's middle (IV-A)."""
    assert scene.c_first is not None
    return np.asarray(scene.c_first + scene.growth[j][ln.kept])


def tangents(direction: Array) -> Array:
    """(L, d−1, d) orthonormal and normal to every direction (L, d)."""
    return np.array([np.linalg.svd(c[None])[2][1:] for c in direction])
