"""Where the vehicle truly is, for the bridge: from its simulator where that tells, or as the vehicle believes. Pure.

A copter that navigates by optical flow drifts by metres and does not know it; the field it flies through stays.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from dslam_mav.errors import LinkError
from dslam_mav.mav.truth import KINDS, true_place
from dslam_mav.mission import DEGREES_E7, Home, e7_to_enu

Array = NDArray[np.float64]
Source = Literal["sim", "vehicle"]
Placed = tuple[int, tuple[float, float, float]]  # time_boot_ms, [east, north, up] in metres from home

FARTHEST_M = 10_000.0
"""A simulator further from the mission's home than this has another idea of where it is: what counts is where it
stood."""


class Whereabouts:
    """`source` None: the simulator if it is heard before the first vertex, else the vehicle's LOCAL_POSITION_NED.

    `home` is the mission's, from which the true place is measured; needed for a simulator. `used` is what served.
    """

    def __init__(self, source: Source | None = None, home: Home | None = None) -> None:
        if source == "sim" and home is None:
            raise ValueError("home: expected a place to measure the simulator's from, got None")
        self.used: Source | None = None
        self.home = home
        self._source = source
        self._kind = ""  # of the simulator's messages
        self._time_ms: int | None = None
        self._up_m = 0.0
        self._ground_m: float | None = None

    @property
    def may_be_simulated(self) -> bool:
        """Whether a simulator's messages would serve."""
        return self._source != "vehicle" and self.home is not None

    def hear(self, message: Any, *, settled: bool) -> Placed | None:
        """The vehicle's place, if this message of its autopilot tells it; `settled`: what served until now goes on."""
        kind = message.get_type()
        time_ms = getattr(message, "time_boot_ms", None)
        if time_ms is not None:
            self._time_ms = int(time_ms)
        if kind == "LOCAL_POSITION_NED":
            self._up_m = -float(message.z)
            if self._kind or self._source == "sim":
                return None
            self.used = "vehicle"
            return int(message.time_boot_ms), (message.y, message.x, -message.z)
        if kind in KINDS and self.may_be_simulated and not (settled and self.used == "vehicle"):
            return self._true(kind, message)
        return None

    def check(self) -> None:
        """LinkError if the mission has begun and the simulator was never heard though it was to be."""
        if self._source == "sim" and not self._kind:
            raise LinkError(
                "--truth-from sim: the vehicle offers neither SIM_STATE, SIMSTATE nor HIL_STATE_QUATERNION: it is no "
                "simulator, or will not tell; expected --truth-from vehicle"
            )

    def _true(self, kind: str, message: Any) -> Placed | None:
        true = true_place(message)
        if true is None or self.home is None:
            return None
        if not self._kind or KINDS.index(kind) < KINDS.index(self._kind):
            self._kind, self._ground_m = kind, None
        if kind != self._kind:
            return None
        if kind == "HIL_STATE_QUATERNION":
            self._time_ms = int(message.time_usec // 1000)
        if self._time_ms is None:
            return None
        east_m, north_m = self._enu_m(true)
        if self._ground_m is None:
            if math.hypot(east_m, north_m) > FARTHEST_M:
                self.home, east_m, north_m = true, 0.0, 0.0
            self._ground_m = true.altitude_m - self._up_m
        self.used = "sim"
        up_m = self._up_m if kind == "SIMSTATE" else true.altitude_m - self._ground_m
        return self._time_ms, (east_m, north_m, up_m)

    def _enu_m(self, true: Home) -> tuple[float, float]:
        assert self.home is not None
        return e7_to_enu(round(true.latitude_deg * DEGREES_E7), round(true.longitude_deg * DEGREES_E7), self.home)


def path_flown(planned_m: Array, sequence: Sequence[int], reached_m: Mapping[int, Array]) -> Array:
    """(L+1, 2) the corners that were flown: where the vehicle was when it reached each, by the items' numbers; those
    nobody told of are where the plan has them, and as far off as their neighbours.

    Overshoot and drift take a vehicle metres away from its plan: its readings are those of where it was.
    """
    known = [j for j, seq in enumerate(sequence) if seq in reached_m]
    if not known:
        return planned_m
    off_m = np.array([reached_m[sequence[j]][:2] - planned_m[j] for j in known])
    return np.asarray(planned_m + np.column_stack([np.interp(range(len(sequence)), known, axis) for axis in off_m.T]))
