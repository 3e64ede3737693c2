"""What was read while the vehicle stood before its first leg: the sensor's noise, and the level of that place. Pure.

It stands where its dead reckoning stays within half a metre, slowly, between two news of its mission; without dead
reckoning, where its ground speed says so. Height is not looked at. No direction is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LEAST_READINGS = 20
STILL_M = 0.5
STILL_M_S = 0.5
MOST_APART_MS = 2_000
"""Between two samples that tell where it is: what happens in more is not known."""

BLOCK = 32
"""Readings over which a drift counts as a straight line."""

OUTLIER_SD = 5.0
BATCHES = 8
_MAD_TO_SD = 1.4826


@dataclass(frozen=True, slots=True, eq=False)
class Standing:
    """The readings `value` (N,) of the longest stand before the first leg, at `time_ms` (N,)."""

    time_ms: NDArray[np.int64]
    value: Array

    @property
    def seconds(self) -> float:
        """From the first reading to the last."""
        return float(self.time_ms[-1] - self.time_ms[0]) / 1000.0

    def noise(self) -> tuple[float, float]:
        """Standard deviation of a reading, and its degrees of freedom: about a straight line through every `BLOCK`
        readings, without spikes.
        """
        off, _ = _about_lines(self.value)
        middle = _MAD_TO_SD * float(np.median(np.abs(off)))
        usual = np.abs(off) <= OUTLIER_SD * middle if middle > 0.0 else np.ones(off.size, dtype=np.bool_)
        off, lines = _about_lines(self.value[usual])
        freedom = float(off.size - 2 * lines)
        return math.sqrt(float(off @ off) / freedom), freedom

    def level(self) -> tuple[float, float]:
        """Mean reading and its standard error: by the scatter of the means of parts, where noise alone is less."""
        means = np.array([part.mean() for part in np.array_split(self.value, BATCHES)])
        error = self.noise()[0] / math.sqrt(self.value.size)
        return float(self.value.mean()), max(error, float(means.std(ddof=1)) / math.sqrt(BATCHES))


def stand_before(until_ms: int, readings: tuple[NDArray[np.int64], Array], told: Array) -> Standing | None:
    """The longest stand that ends before `until_ms`; None: none with enough readings.

    `told` (M, 4 or more): news of the mission before it, ms, and x, y, vx, vy, or the speed alone.
    """
    time_ms, value = readings
    best = slice(0, 0)
    for start_ms, end_ms in _stands(told[told[:, 1] < until_ms]):
        inside = slice(*np.searchsorted(time_ms, [start_ms, end_ms + 1]))
        if inside.stop - inside.start > best.stop - best.start:
            best = inside
    enough = best.stop - best.start >= LEAST_READINGS
    return Standing(time_ms[best], value[best]) if enough else None


def _stands(told: Array) -> list[tuple[int, int]]:
    """First and last ms of every stretch without motion."""
    placed = told.shape[1] > 3
    v = told[:, 4:6] if placed else told[:, 2:3]
    slow = (v * v).sum(axis=1) <= STILL_M_S * STILL_M_S
    stands: list[tuple[int, int]] = []
    first: int | None = None
    for i in range(len(told)):
        if first is not None and not (slow[i] and _together(told, first, i)):
            stands.append((int(told[first, 1]), int(told[i - 1, 1])))
            first = None
        if first is None and slow[i]:
            first = i
    return stands if first is None else [*stands, (int(told[first, 1]), int(told[-1, 1]))]


def _together(told: Array, first: int, i: int) -> bool:
    """Whether a sample is of the stand that began at another."""
    if told[i, 0] != told[first, 0] or not 0.0 <= told[i, 1] - told[i - 1, 1] <= MOST_APART_MS:
        return False
    if told.shape[1] <= 3:
        return True
    x, y = told[i, 2] - told[first, 2], told[i, 3] - told[first, 3]
    return bool(x * x + y * y <= STILL_M * STILL_M)


def _about_lines(value: Array) -> tuple[Array, int]:
    """What is left beside a straight line through every block, and how many there are."""
    parts = np.array_split(value, max(1, value.size // BLOCK))
    return np.concatenate([_about_a_line(part) for part in parts]), len(parts)


def _about_a_line(value: Array) -> Array:
    at = np.arange(value.size) - 0.5 * (value.size - 1)
    off = value - value.mean()
    slope = float(at @ off) / float(at @ at)
    return np.asarray(off - slope * at)
