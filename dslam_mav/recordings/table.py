"""Readings in a CSV file as a flight: legs from the places they were taken at, or from the plan."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dslam_mav.errors import BadInputError
from dslam_mav.legs import LegCollector, plan_facts
from dslam_mav.legs.places import NEAR_SHARE, passes, straight_pieces
from dslam_mav.mission import LegPlan, Mission, leg_plan
from dslam_mav.observations import Observation, Odometry, Progress, Reading
from dslam_mav.recordings.recording import Assumed
from dslam_mav.records.words import count
from dslam_mav.replay import Replayed, flight_of_collector
from dslam_mav.series import Series


@dataclass(frozen=True, slots=True)
class Table:
    """Readings in a CSV file, with the places they were taken at or without. Its times begin anywhere."""

    begun_ns = None

    path: Path
    series: Series
    mission: Mission | None = None

    def flight(self, mission: Mission | None, assumed: Assumed) -> Replayed:
        """The flight: legs from the plan, or from the straight pieces of the track; distances from the places.

        Without places the plan was flown at constant speed from the first reading to the last.
        """
        if assumed.yaw:
            raise BadInputError(f"--heading vehicle: {self.path} has no headings; use --heading none or plan")
        plan = None if mission is None else leg_plan(mission)
        if plan is not None and len(plan.sequence) < 2:
            raise BadInputError(f"{self.path}: its plan has no leg")
        place_m = self.series.place_m
        if place_m is None and plan is None:
            raise BadInputError(f"{self.path}: no places: expected columns east_m and north_m, or give --plan FILE")
        if place_m is None and assumed.distance in ("odometry", "speed"):
            raise BadInputError(f"{self.path}: --distance {assumed.distance}: expected columns east_m and north_m")
        collector = LegCollector(None if mission is None else plan_facts(mission), distance=assumed.distance)
        for time_ms, observation in self._observations(plan):
            collector.clock.take(time_ms)  # corners have a time of their own
            collector.add(observation)
        found = flight_of_collector(collector, str(self.path), lambda: ())
        return Replayed(found.flight, found.legs, found.collector, (self._note(plan, len(found.legs)),))

    def _note(self, plan: LegPlan | None, legs: int) -> str:
        if self.series.place_m is None:
            return (
                f"{self.path.name}: no places: the plan is taken as flown at constant speed from first to last reading"
            )
        source = "the straight pieces of its track" if plan is None else "where its track passes the plan's vertices"
        return f"{self.path.name}: {count(legs, 'leg')} found by {source}; directions are not used"

    def _observations(self, plan: LegPlan | None) -> Iterator[tuple[int, Observation]]:
        """(ms since the first reading, what was seen then), in order."""
        time_ms = np.rint(1000.0 * (self.series.time_s - self.series.time_s[0])).astype(np.int64)
        if (np.diff(time_ms) <= 0).any():
            raise BadInputError(f"{self.path}: time_s: expected at most one reading a millisecond")
        track = self._track(time_ms)
        corners = self._corners(time_ms, plan)
        for n, at_ms in enumerate(time_ms.tolist()):
            while corners and corners[0][0] <= at_ms:
                corner_ms, seq = corners.pop(0)
                yield from track[n : n + 1]  # the last place of one leg, and the first of the next
                yield corner_ms, Progress(seq, reached=True)
            yield from track[n : n + 1]
            yield at_ms, Reading(at_ms, float(self.series.value[n]))

    def _track(self, time_ms: NDArray[np.int64]) -> list[tuple[int, Observation]]:
        """A place for every reading, where they are known; x north, y east as dead reckoning has them."""
        place_m = self.series.place_m
        if place_m is None:
            return []
        velocity_m_s = np.gradient(place_m, time_ms / 1000.0, axis=0)
        rows = zip(time_ms.tolist(), place_m.tolist(), velocity_m_s.tolist(), strict=True)
        return [(t, Odometry(t, north, east, v_north, v_east)) for t, (east, north), (v_east, v_north) in rows]

    def _corners(self, time_ms: NDArray[np.int64], plan: LegPlan | None) -> list[tuple[int, int]]:
        """(ms, sequence number) of the legs' ends."""
        place_m = self.series.place_m
        if plan is None:
            corners = straight_pieces(place_m) if place_m is not None else np.empty(0, dtype=np.int64)
            return [(int(time_ms[n]), seq) for seq, n in enumerate(corners, 1)]
        if place_m is None:
            flown = np.concatenate([[0.0], np.cumsum(plan.lengths_m)])
            at_ms = np.rint(flown / flown[-1] * time_ms[-1]).astype(np.int64)
            return list(zip(at_ms.tolist(), plan.sequence, strict=True))
        if len(place_m) < len(plan.sequence):
            raise BadInputError(f"{self.path}: expected at least {len(plan.sequence)} places, one for each vertex")
        corners, off_m = passes(place_m, plan.vertices_m)
        worst = int(np.argmax(off_m))
        if off_m[worst] > NEAR_SHARE * plan.lengths_m.min():
            raise BadInputError(
                f"{self.path}: east_m, north_m: the track passes item {plan.sequence[worst]} of the plan "
                f"{off_m[worst]:.3g} m off; expected metres from the plan's home"
            )
        return list(zip(time_ms[corners].tolist(), plan.sequence, strict=True))
