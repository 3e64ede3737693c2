"""Units of a flight's own size, so that no tolerance depends on metres, seconds or the sensor's scale."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.problem import Problem
from dslam_mav.dslam.state import Layout, State

Array = NDArray[np.float64]


class Units(NamedTuple):
    """How many metres, seconds and reading units the problem's own units are."""

    length: float
    time: float
    reading: float


def units_of(prob: Problem) -> Units:
    """The mean leg (parametric: √C where it is known), the flight's duration, the readings' range."""
    length = float(prob.length.mean()) if prob.n_legs else 1.0
    if not prob.n_legs and prob.spread2 is not None:
        length = float(np.sqrt(prob.spread2.mean()))
    return Units(length, float(prob.t[-1]) or 1.0, float(np.ptp(prob.y)))


def normalised(prob: Problem, unit: Units) -> Problem:
    """The same problem in those units."""
    length, time, reading = unit
    return replace(
        prob,
        s=prob.s / length,
        t=prob.t / time,
        y=prob.y / reading,
        length=prob.length / length,
        rise=None if prob.rise is None else prob.rise / length,
        ambient=None if prob.ambient is None else prob.ambient / reading,
        spread2=None if prob.spread2 is None else prob.spread2 / length**2,
        age=None if prob.age is None else prob.age / time,
        rate=None if prob.rate is None else prob.rate * (time / length**2),
        lag=None if prob.lag is None else prob.lag / time,
    )


def in_si(state: State, unit: Units) -> State:
    """A state of the normalised problem in metres, seconds and reading units."""
    length, time, reading = unit
    d = state.s.shape[1]
    return replace(
        state,
        s=state.s * length,
        log_amplitude=state.log_amplitude + np.log(reading) + d * np.log(length),
        log_spread2=state.log_spread2 + 2.0 * np.log(length),
        log_rate=state.log_rate + 2.0 * float(np.log(length)) - float(np.log(time)),
        ambient=state.ambient * reading,
        drift=state.drift * (reading / time),
        longer=state.longer * length,
        gap=state.gap * length,
        coefficients=state.coefficients * length,
        log_lag=state.log_lag + float(np.log(time)),
        shift=None if state.shift is None else state.shift * length,
    )


def parameter_units(at: Layout, unit: Units) -> Array:
    """(P,) what one unit of each unknown is in metres, radians, reading units; logarithms have none."""
    out = np.ones(at.size)
    for part in (at.coefficient, at.longer, at.gap, at.place, at.shift):
        out[part] = unit.length
    out[at.ambient] = unit.reading
    out[at.drift] = unit.reading / unit.time
    return out
