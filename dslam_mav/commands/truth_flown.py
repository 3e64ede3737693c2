"""The truth a flight is held against: the scene's sources, and the corners where they were flown."""

from __future__ import annotations

import time
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from dslam_mav.commands.readings import Readings
from dslam_mav.errors import LogError
from dslam_mav.log.recorder import Recorder
from dslam_mav.mission import Mission, leg_plan
from dslam_mav.records import Truth
from sim_bridge.whereabouts import path_flown

Array = NDArray[np.float64]
NOWHERE: Mapping[int, Array] = {}


def truth_along(readings: Readings, held: Mission, reached_m: Mapping[int, Array] = NOWHERE) -> Truth | None:
    """With the corners as planned, or where the vehicle was when it reached them; None: the sources are not known."""
    truth = readings.truth
    if truth is None:
        return None
    legs = leg_plan(held)
    vertices_m = path_flown(legs.vertices_m, legs.sequence, reached_m)
    return Truth(truth.source_position_m, truth.amplitude, vertices_m)


def attach_truth(recorder: Recorder, readings: Readings, held: Mission) -> None:
    """Before the flight: what the readings come from, and the truth as far as it is known then."""
    if readings.attachment is not None:
        recorder.attach(*readings.attachment)
    if (truth := truth_along(readings, held)) is not None:
        recorder.truth(time.time_ns(), truth)


def log_truth(recorder: Recorder, truth: Truth) -> LogError | None:
    """After the flight: the last one counts. A full disk must not cost the answer: it is given back."""
    try:
        recorder.truth(time.time_ns(), truth)
    except LogError as problem:
        return problem
    return None
