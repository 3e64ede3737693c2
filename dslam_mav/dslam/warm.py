"""Compiling ahead: the first estimate on a machine would otherwise take many seconds more than the second."""

from __future__ import annotations

import numpy as np

from dslam_mav.dslam.estimator import estimate
from dslam_mav.dslam.expected import Sensing, log_errors
from dslam_mav.dslam.field import field
from dslam_mav.dslam.layouts import Layouts
from dslam_mav.dslam.path import vertices
from dslam_mav.records import Flight, Leg, Medium


def warm_up() -> None:
    """Run a small estimate and a prediction, so that every kernel is compiled, or read from an earlier run's cache."""
    length = np.full(3, 3.0)
    theta = np.arange(3, dtype=np.float64) * (2.0 * np.pi / 3.0)
    corner = vertices(theta, length)
    legs = []
    for j in range(3):
        s = np.linspace(0.0, 3.0, 16, endpoint=False)
        places = corner[j] + s[:, None] * np.array([np.cos(theta[j]), np.sin(theta[j])])
        reading = field(places, 1.0, np.array([[1.0, 1.2], [2.2, 0.4]]), np.array([100.0, 70.0]))
        legs.append(Leg(3.0, s, 3.0 * j + s, reading))
    estimate(Flight(tuple(legs)), Medium(spread_m=1.0, static=True), 2)
    one = Layouts(np.array([[[1.0, 1.2]]]), np.ones((1, 1)), np.ones(1), np.zeros(1))
    log_errors(corner[None], one, Sensing(0.1, 20.0))
