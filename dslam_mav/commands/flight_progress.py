"""How far a flight is, for a person's eyes only: told from messages that the estimator never sees. Pure."""

from __future__ import annotations

from typing import Any

import numpy as np

from dslam_mav.mission import LegPlan
from dslam_mav.records.words import count


class FlightProgress:
    """Follows one vehicle's mission of `legs` by MISSION_ITEM_REACHED and LOCAL_POSITION_NED."""

    def __init__(self, legs: LegPlan) -> None:
        self.total_m = float(legs.lengths_m.sum())
        self._legs = legs
        self._vertex = -1  # index of the one reached last
        self._corner: tuple[float, float] | None = None
        self._place: tuple[float, float] | None = None
        self._time_ms = 0
        self._start_ms: int | None = None

    def see(self, message: Any) -> None:
        """One message of the vehicle."""
        kind = message.get_type()
        if kind == "LOCAL_POSITION_NED":
            self._place = (message.x, message.y)
            self._time_ms = message.time_boot_ms
        elif kind == "MISSION_ITEM_REACHED" and message.seq in self._legs.sequence:
            vertex = self._legs.sequence.index(message.seq)
            if vertex > self._vertex:
                self._vertex, self._corner = vertex, self._place
                self._start_ms = self._time_ms if self._start_ms is None else self._start_ms

    @property
    def flown(self) -> bool:
        """Whether the last vertex was reached."""
        return self._vertex == len(self._legs.lengths_m)

    @property
    def flown_m(self) -> float:
        """Metres along the mission."""
        before_m = float(self._legs.lengths_m[: max(self._vertex, 0)].sum())
        if self._vertex < 0 or self.flown or self._place is None or self._corner is None:
            return before_m
        on_leg_m = float(np.hypot(self._place[0] - self._corner[0], self._place[1] - self._corner[1]))
        return before_m + min(on_leg_m, float(self._legs.lengths_m[self._vertex]))

    @property
    def what(self) -> str:
        """What the vehicle is doing."""
        if self._vertex < 0:
            return "to the first waypoint"
        n = len(self._legs.lengths_m)
        return f"{count(n, 'leg')} flown" if self.flown else f"leg {self._vertex + 1} of {n}"

    @property
    def detail(self) -> str:
        """Distance along the mission, and time by the vehicle's clock."""
        if self._start_ms is None:
            return ""
        return f"{self.flown_m:.0f} of {self.total_m:.0f} m, {(self._time_ms - self._start_ms) / 1e3:.0f} s of flight"
