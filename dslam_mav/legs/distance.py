"""How far along its leg the vehicle was, as a scalar: from dead reckoning, from speed, or from the plan.

A leg is measured from its own samples alone, and only through differences and scalar products of two
components: the answer does not change when the dead-reckoned frame is turned, mirrored or shifted, not even
between two legs. Products are written out, not left to a BLAS: a fused multiply-add would make the exchange
of the axes visible in the last bit.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from dslam_mav.legs.straight import straight_part

Array = NDArray[np.float64]
Distance = Literal["odometry", "speed", "plan"]

MAX_EDGE_S = 2.0
"""The longest time between a leg's end and its outermost sample that is bridged."""


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """Samples of one leg, in seconds since its start: dead reckoning at `time_s` (M,), speed at
    `speed_time_s` (Q,).

    `speed_m_s` (Q,) is unsigned ground speed; `position_m` and `velocity_m_s` (M, 2) are in a frame of the
    vehicle's own; times never fall.
    """

    time_s: Array
    position_m: Array
    velocity_m_s: Array
    speed_time_s: Array
    speed_m_s: Array


@dataclass(frozen=True, slots=True, eq=False)
class Placed:
    """A leg's believed length, `distance_m` (N,) at the times asked for, and where they are known the metres
    travelled altogether (a leg much shorter than its way was not flown straight) and which readings (N,) its
    straight part holds. `beside_m`: how far beside that part's line the leg began, `end_beside_m` ended.
    """

    length_m: float
    distance_m: Array
    mode: Distance
    travelled_m: float | None = None
    straight: NDArray[np.bool_] | None = None
    beside_m: float = 0.0
    end_beside_m: float = 0.0

    @property
    def overshot_m(self) -> float:
        """How far past its end it was."""
        return max(0.0, float(self.distance_m.max(initial=0.0)) - self.length_m)


def place(
    motion: Motion,
    duration_s: float,
    time_s: Array,
    *,
    mode: Distance | None,
    planned_m: float | None,
) -> Placed | None:
    """Distances along a leg of `duration_s` at the times `time_s` (N,) since its start; None: it cannot be
    told.

    With `mode` None the first of odometry, speed and plan that the samples allow.
    """
    placed = None
    if mode in ("odometry", None):
        placed = from_odometry(motion, duration_s, time_s)
    if placed is None and mode in ("speed", None):
        placed = from_velocity(motion, duration_s, time_s) or from_speed(motion, duration_s, time_s)
    if placed is None and mode in ("plan", None) and planned_m is not None and duration_s > 0.0:
        placed = Placed(planned_m, planned_m * (time_s / duration_s), "plan")
    if placed is None:
        return None
    return replace(placed, distance_m=placed.distance_m + 0.0)  # −0.0 would be 0.0 seen in a mirror


def from_odometry(motion: Motion, duration_s: float, time_s: Array) -> Placed | None:
    """Displacement since the leg's start, projected on the line its straight part was flown on: signed, so that
    overshoot, hover and return come out right.
    """
    if not _covers(motion.time_s, duration_s):
        return None
    # Differences of two samples are exact; everything after sees no origin.
    position = motion.position_m - motion.position_m[0]
    if not position.any():
        return None
    at = np.concatenate([[0.0, duration_s], time_s])
    place_m = _smooth(motion.time_s, position, motion.velocity_m_s, at)
    chord = place_m[1] - place_m[0]
    length_m = float(np.sqrt(_dot(chord, chord)))
    if length_m == 0.0:
        return Placed(0.0, np.zeros(time_s.size), "odometry")
    steps = np.diff(position, axis=0)
    travelled_m = float(np.sqrt(steps[:, 0] * steps[:, 0] + steps[:, 1] * steps[:, 1]).sum())
    moved = place_m[2:] - place_m[0]
    along_m, across_m = _dot(moved, chord) / length_m, _dot(moved, chord[::-1] * [-1.0, 1.0]) / length_m
    offset_m, slope, straight = straight_part(along_m, across_m, length_m)
    longer = float(np.sqrt(1.0 + slope * slope))
    distance_m = (along_m + slope * across_m) / longer
    beside_m, end_beside_m = (abs(each) / longer for each in (offset_m, offset_m + slope * length_m))
    return Placed(length_m / longer, distance_m, "odometry", travelled_m, straight, beside_m, end_beside_m)


def from_velocity(motion: Motion, duration_s: float, time_s: Array) -> Placed | None:
    """Velocity along the leg's own mean velocity, with its sign, integrated."""
    if not _covers(motion.time_s, duration_s) or not motion.velocity_m_s.any():
        return None
    inside = np.clip(motion.time_s, 0.0, duration_s)
    moved = np.array([_integral(inside, v, np.array([0.0, duration_s])) for v in motion.velocity_m_s.T])
    total = moved[:, 1] - moved[:, 0]
    norm = float(np.sqrt(_dot(total, total)))
    if norm == 0.0:
        return None
    along_m_s = _dot(motion.velocity_m_s, total) / norm
    return _integrated(inside, along_m_s, duration_s, time_s)


def from_speed(motion: Motion, duration_s: float, time_s: Array) -> Placed | None:
    """Ground speed integrated: it has no sign, so hovering and coming back from an overshoot count as
    distance.
    """
    if not _covers(motion.speed_time_s, duration_s):
        return None
    return _integrated(np.clip(motion.speed_time_s, 0.0, duration_s), motion.speed_m_s, duration_s, time_s)


def _covers(sampled_s: Array, duration_s: float) -> bool:
    return (
        sampled_s.size >= 2
        and duration_s > 0.0
        and sampled_s[0] <= MAX_EDGE_S
        and duration_s - sampled_s[-1] <= MAX_EDGE_S
    )


def _dot(a: Array, b: Array) -> Array:
    """a·b of (..., 2) and (2,): the same to the last bit with the axes exchanged."""
    return np.asarray(a[..., 0] * b[0] + a[..., 1] * b[1])


def _integrated(sampled_s: Array, speed_m_s: Array, duration_s: float, time_s: Array) -> Placed:
    at = np.concatenate([[0.0, duration_s], time_s])
    s = _integral(sampled_s, speed_m_s, at)
    return Placed(float(s[1] - s[0]), s[2:] - s[0], "speed")


def _integral(sampled_s: Array, value: Array, at_s: Array) -> Array:
    """∫ value dt up to `at_s`, value linear between samples and constant beyond them."""
    steps = 0.5 * (value[1:] + value[:-1]) * np.diff(sampled_s)
    total = np.concatenate([[0.0], np.cumsum(steps)])
    i = np.clip(np.searchsorted(sampled_s, at_s, side="right") - 1, 0, sampled_s.size - 2)
    span = sampled_s[i + 1] - sampled_s[i]
    since = at_s - sampled_s[i]
    share = np.divide(np.clip(since, 0.0, span), span, out=np.zeros(at_s.size), where=span > 0.0)
    within = since * value[i] + 0.5 * share * np.clip(since, 0.0, span) * (value[i + 1] - value[i])
    beyond = np.maximum(since - span, 0.0) * (value[i + 1] - value[i])
    return np.asarray(total[i] + within + beyond)


def _smooth(sampled_s: Array, position_m: Array, velocity_m_s: Array, at_s: Array) -> Array:
    """Position (N, 2) at `at_s` (N,): cubic between samples, through their velocities; at most MAX_EDGE_S
    beyond the outermost samples at constant acceleration.
    """
    i = np.clip(np.searchsorted(sampled_s, at_s, side="right") - 1, 0, sampled_s.size - 2)
    step = np.maximum(sampled_s[i + 1] - sampled_s[i], 1e-3)
    u = (at_s - sampled_s[i]) / step
    inside = np.clip(u, 0.0, 1.0)[:, None]
    h = step[:, None]
    p0, p1, v0, v1 = position_m[i], position_m[i + 1], velocity_m_s[i], velocity_m_s[i + 1]
    rest = 1.0 - inside
    cubic = (
        (p0 * (1.0 + 2.0 * inside) * rest + v0 * (h * inside) * rest) * rest
        + (p1 * (1.0 + 2.0 * rest) * inside - v1 * (h * rest) * inside) * inside
    )  # fmt: skip
    beyond = (u[:, None] - inside) * h
    edge_velocity = np.where(beyond < 0.0, v0, v1)
    acceleration = (v1 - v0) / h
    return np.asarray(cubic + beyond * edge_velocity + 0.5 * beyond * beyond * acceleration)
