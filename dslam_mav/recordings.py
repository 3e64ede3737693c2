"""A flight somebody recorded, in any of the files people keep: `open_recording`, then `flight`.

.mcap is our own log, .tlog a ground station's, .bin ArduPilot's own, anything else that is text a CSV file.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from dslam_mav.errors import BadInputError, unreadable
from dslam_mav.legs import Distance, LegCollector, PlanFacts, plan_facts
from dslam_mav.legs.places import NEAR_SHARE, passes, straight_pieces
from dslam_mav.log.reader import FlightLog
from dslam_mav.mav import dataflash
from dslam_mav.mav.decode import READING_NAME, autopilot_system
from dslam_mav.mav.frames import Frame
from dslam_mav.mav.mission.heard import mission_heard
from dslam_mav.mav.tlog import read_tlog
from dslam_mav.mission import LegPlan, Mission, leg_plan
from dslam_mav.observations import Observation, Odometry, Progress, Reading, Yaw
from dslam_mav.records.words import count
from dslam_mav.replay import (
    Replayed,
    flight_from_frames,
    flight_from_observations,
    flight_from_packets,
    flight_of_collector,
)
from dslam_mav.series import Series, read_csv


@dataclass(frozen=True, slots=True)
class Assumed:
    """What a person says of a recording: as `LegCollector` and `decode` take it; `system` None is found out. `planned`:
    the plan's directions are used.
    """

    distance: Distance | None = None
    yaw: bool = False
    system: int | None = None
    planned: bool = False

    def plan(self, mission: Mission | None, held: Mission | None) -> PlanFacts | None:
        """What legs may know of the mission. One that the recording itself `held` is not needed to tell legs apart, and
        has none from where a rover starts to its first waypoint: it is used where nothing else will do.
        """
        if mission is None or (mission is held and not self.planned and self.distance != "plan"):
            return None
        return plan_facts(mission)


class Recording(Protocol):
    """What a file holds of a flight. `mission`: as the vehicle held it, None where the file has none. `begun_ns`: when
    its first packet came, since 1970; None where the file does not tell.
    """

    @property
    def mission(self) -> Mission | None: ...  # noqa: D102
    @property
    def begun_ns(self) -> int | None: ...  # noqa: D102

    def flight(self, mission: Mission | None, assumed: Assumed) -> Replayed:
        """The flight along `mission`; BadInputError says in one line what the file lacks."""


def open_recording(path: Path, columns: str | None = None) -> Recording:
    """The recording in a .tlog, .bin or CSV file; BadInputError in one line for what cannot be read."""
    kind = kind_of(path)
    if columns is not None and kind != "csv":
        raise BadInputError(_columns_of_a_csv(columns, path))
    if kind == "csv":
        return Table(path, read_csv(path, columns))
    if kind == "dataflash":
        return OnBoard(path)
    frames = list(read_tlog(path))
    system = autopilot_system(frames)
    return Telemetry(path, frames, None if system is None else mission_heard(frames, system))


def our_log(path: Path, log: FlightLog, columns: str | None = None) -> Recording:
    """The recording in a log of ours."""
    if columns is not None:
        raise BadInputError(_columns_of_a_csv(columns, path))
    return OurLog(path, log)


def _columns_of_a_csv(columns: str, path: Path) -> str:
    return (
        f"--columns {columns}: expected with a CSV file, got {path.name}: of other recordings the readings are "
        f"{READING_NAME}; a .tlog's other fields are readings for fly --readings and bridge --readings"
    )


def kind_of(path: Path) -> str:
    """ "mcap", "dataflash", "tlog" or "csv", by a file's first bytes and its name; BadInputError if unreadable."""
    try:
        with path.open("rb") as file:
            begin = file.read(8)
    except OSError as problem:
        raise unreadable(path, problem) from None
    suffix = path.suffix.lower()
    if begin.startswith(b"\x89MCAP"):
        return "mcap"
    if begin.startswith(dataflash.MAGIC) or suffix == ".bin":
        return "dataflash"
    return "csv" if suffix in (".csv", ".txt", ".tsv") else "mcap" if suffix == ".mcap" else "tlog"


@dataclass(frozen=True, slots=True)
class OurLog:
    """A log of ours. Its mission is an attachment, which only `missions` can read."""

    path: Path
    log: FlightLog
    mission: Mission | None = None

    @property
    def begun_ns(self) -> int | None:
        """By the clock on board."""
        return self.log.frames[0][0] if self.log.frames else None

    def flight(self, mission: Mission | None, assumed: Assumed) -> Replayed:
        """The flight in its packets."""
        plan = None if mission is None else plan_facts(mission)
        return flight_from_packets(
            self.log.frames, str(self.path), plan=plan,
            distance=assumed.distance, yaw=assumed.yaw, system=assumed.system,
        )  # fmt: skip


@dataclass(frozen=True, slots=True)
class Telemetry:
    """A ground station's log."""

    path: Path
    frames: list[Frame]
    mission: Mission | None

    @property
    def begun_ns(self) -> int | None:
        """By the ground station's clock."""
        return self.frames[0].received_ns if self.frames else None

    def flight(self, mission: Mission | None, assumed: Assumed) -> Replayed:
        """The flight in its frames."""
        plan = assumed.plan(mission, self.mission)
        return flight_from_frames(
            self.frames, str(self.path), plan=plan,
            distance=assumed.distance, yaw=assumed.yaw, system=assumed.system,
        )  # fmt: skip


class OnBoard:
    """ArduPilot's own log, whose clock begins at power-on."""

    begun_ns = None

    def __init__(self, path: Path) -> None:
        """BadInputError: it cannot be read."""
        self.path = path
        self.log = dataflash.read_dataflash(path)

    @property
    def mission(self) -> Mission | None:
        """As the vehicle held it."""
        return self.log.mission

    def flight(self, mission: Mission | None, assumed: Assumed) -> Replayed:
        """The flight in its records."""
        lack = dataflash.lack(self.log)
        if lack is not None:
            raise BadInputError(f"{self.path}: {lack}")
        plan = assumed.plan(mission, self.mission)
        seen = [o for o in self.log.observations if assumed.yaw or not isinstance(o, Yaw)]
        return flight_from_observations(
            seen, str(self.path), plan=plan, distance=assumed.distance, heard=lambda: self.log.names
        )


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
