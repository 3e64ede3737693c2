"""A flight log as a person opens it: all that `log` reads, with the flight's legs and its mission."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, fields
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

import numpy as np

from dslam_mav.errors import BadInputError
from dslam_mav.export.table import ReadingTable, reading_table
from dslam_mav.legs import Distance
from dslam_mav.log import reader
from dslam_mav.log.recovered import Recovered
from dslam_mav.mission import DEGREES_E7, GLOBAL_FRAMES, Home, Mission, MissionItem, without_home_item
from dslam_mav.observations import Progress
from dslam_mav.recordings import Assumed, kind_of, open_recording, our_log
from dslam_mav.records import Flight, Leg, Prediction, Truth
from dslam_mav.records.words import count
from dslam_mav.replay import Replayed

if TYPE_CHECKING:
    from pandas import DataFrame

_MISSION_ATTACHMENT = "mission.waypoints"
_CONFIGURATION_ATTACHMENT = "configuration.json"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class LoggedFlight:
    """All that a log holds, and what follows from it.

    `readings`: NumPy arrays `time_s`, `value`, `leg`, `distance_m`, of all readings (see `export.table`).
    `legs`: as the estimator on board had them, made with the mission's help and with the distance it was told to use;
    none where the log ends before the first. `mission`: as the vehicle held it, None where the log has none. All else
    as in `log.reader.FlightLog`. The `..._frame` methods need pandas.
    """

    readings: ReadingTable
    legs: tuple[Leg, ...]
    estimates: tuple[reader.LoggedEstimate, ...]
    truth: Truth | None
    prediction: Prediction | None
    mission: Mission | None
    frames: tuple[tuple[int, bytes], ...]
    progress: tuple[tuple[int, Progress], ...]
    texts: tuple[tuple[int, int, str], ...]
    attachments: dict[str, bytes]
    topics: dict[str, int]
    duration_s: float
    complete: bool
    recovered: Recovered | None

    def __repr__(self) -> str:
        """One line: all that it holds would be thousands."""
        there = [
            count(self.readings.value.size, "reading"),
            count(len(self.legs), "leg"),
            count(len(self.estimates), "estimate"),
            f"{self.duration_s:.1f} s",
            "complete" if self.complete else "cut short or damaged",
        ]
        return f"<{type(self).__name__}: {', '.join(there)}>"

    def readings_frame(self) -> DataFrame:
        """A row a reading: time_s, value, leg (nullable), distance_m (NaN outside legs)."""
        pandas = _pandas()
        leg = pandas.array(self.readings.leg, dtype="Int64")
        leg[self.readings.leg == 0] = pandas.NA
        columns = {"time_s": self.readings.time_s, "value": self.readings.value, "leg": leg}
        frame: DataFrame = pandas.DataFrame({**columns, "distance_m": self.readings.distance_m})
        return frame

    def legs_frame(self) -> DataFrame:
        """A row a leg: leg, length_m, n_readings, begin_s and end_s (of its readings), mean (their mean)."""
        pandas = _pandas()
        names = ["leg", "length_m", "n_readings", "begin_s", "end_s", "mean"]
        rows = []
        for number, leg in enumerate(self.legs, 1):
            told = (leg.time_s[0], leg.time_s[-1], leg.reading.mean()) if leg.reading.size else (math.nan,) * 3
            rows.append((number, leg.length_m, leg.reading.size, *told))
        frame: DataFrame = pandas.DataFrame(rows, columns=names)
        return frame

    def estimates_frame(self) -> DataFrame:
        """A row a source of each estimate: legs_flown, final, verdict, source, x_m, y_m, amplitude, peak_reading,
        sd_m.
        """
        pandas = _pandas()
        names = ["legs_flown", "final", "verdict", "source", "x_m", "y_m", "amplitude", "peak_reading", "sd_m"]
        rows = []
        for each in self.estimates:
            sources, sd_m = each.estimate.sources, each.estimate.sd_m
            which = (each.legs_flown, each.final, each.estimate.verdict.name)
            for k, (x_m, y_m) in enumerate(sources.position_m[:, :2]):
                rows.append((*which, k + 1, x_m, y_m, sources.amplitude[k], sources.peak_reading[k], sd_m[k]))
        frame: DataFrame = pandas.DataFrame(rows, columns=names)
        return frame

    def truth_frame(self) -> DataFrame:
        """A row a true source: source, east_m, north_m, amplitude; none where the truth is not known."""
        pandas = _pandas()
        names = ["source", "east_m", "north_m", "amplitude"]
        rows = []
        if self.truth is not None:
            places = self.truth.source_position_m[:, :2]
            rows = [(k + 1, *places[k], amplitude) for k, amplitude in enumerate(self.truth.amplitude)]
        frame: DataFrame = pandas.DataFrame(rows, columns=names)
        return frame


def read_log(path: Path | str) -> LoggedFlight:
    """The whole of a flight log, cut or complete; BadInputError in one line for what is none."""
    log, flown = _opened(Path(path))
    held = {field.name: getattr(log, field.name) for field in fields(log) if field.name != "readings"}
    try:
        found = flown.flight(Path(path), log)
        legs, readings = found.flight.legs, reading_table(found.legs, *found.collector.readings())
    except BadInputError:  # says what is lacking for legs; all else in the log is worth having without them
        time_ms = np.array([reading.time_boot_ms for _, reading in log.readings], dtype=np.int64)
        value = np.array([reading.value for _, reading in log.readings], dtype=np.float64)
        legs, readings = (), reading_table((), time_ms, value)
    return LoggedFlight(**held, readings=readings, legs=legs, mission=flown.mission)


def read_flight(path: Path | str, *, columns: str | None = None) -> Flight:
    """The flight in a .mcap log, its legs as on board, in a .tlog, ArduPilot's .bin, or a CSV file with the places its
    readings were taken at, its `columns` as in `replay --columns`; BadInputError says what it lacks.
    """
    path = Path(path)
    if kind_of(path) == "mcap":
        log, flown = _opened(path)
        return flown.flight(path, log).flight
    recording = open_recording(path, columns)
    return recording.flight(recording.mission, Assumed()).flight


def _pandas() -> Any:
    try:
        return import_module("pandas")
    except ModuleNotFoundError:
        raise BadInputError("data frames need pandas; install it with: pip install 'dslam-mav[pandas]'") from None


@dataclass(frozen=True, slots=True)
class _Flown:
    """How a log says it was flown: the `mission` as the vehicle held it, and what its configuration assumes."""

    mission: Mission | None
    system: int | None = None
    distance: Distance | None = None

    def flight(self, path: Path, log: reader.FlightLog) -> Replayed:
        """The flight in it; BadInputError says what it lacks."""
        return our_log(path, log).flight(self.mission, Assumed(self.distance, system=self.system))


def _opened(path: Path) -> tuple[reader.FlightLog, _Flown]:
    log = reader.read_log(path)
    system, distance, home_item = _configured(log.attachments.get(_CONFIGURATION_ATTACHMENT, b""))
    if _MISSION_ATTACHMENT not in log.attachments:
        return log, _Flown(None, system, distance)
    try:
        mission = _mission(log.attachments[_MISSION_ATTACHMENT].decode())
    except (ValueError, OverflowError) as problem:
        raise BadInputError(f"{path}: attachment {_MISSION_ATTACHMENT}: {problem}") from None
    return log, _Flown(mission if home_item else without_home_item(mission), system, distance)


def _configured(configuration: bytes) -> tuple[int | None, Distance | None, bool]:
    """The vehicle's system, the distances told to use, and whether the vehicle's mission began with home; of a
    configuration that is missing or none: nothing.
    """
    try:
        body = json.loads(configuration)
        system, distance = body.get("vehicle_system"), body["assumptions"].get("distance")
    except (ValueError, KeyError, TypeError, AttributeError):
        return None, None, True
    return (
        system if type(system) is int else None,
        distance if distance in get_args(Distance) else None,
        body.get("home_item") is not False,
    )


def _mission(text: str) -> Mission:
    """The mission in QGC WPL 110 as our logs carry it, home first; ValueError for anything else."""
    header, *lines = text.splitlines() or [""]
    if header != "QGC WPL 110" or not lines:
        raise ValueError(f"{header!r}: expected QGC WPL 110 and a home item")
    items = []
    for number, line in enumerate(lines):
        sequence, _, frame, command, *numbers, autocontinue = line.split("\t")
        if int(sequence) != number:
            raise ValueError(f"sequence {sequence}: expected {number}")
        p1, p2, p3, p4, x, y, z = map(float, numbers)
        unit = DEGREES_E7 if int(frame) in GLOBAL_FRAMES else 1.0
        place = round(x * unit), round(y * unit)
        items.append(MissionItem(int(command), int(frame), (p1, p2, p3, p4), *place, z, autocontinue == "1"))
    return Mission(tuple(items), Home(items[0].x / DEGREES_E7, items[0].y / DEGREES_E7, items[0].z))
