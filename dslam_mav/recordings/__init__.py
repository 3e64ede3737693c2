"""A flight somebody recorded, in any of the files people keep: `open_recording` or `our_log`, then `flight`.

.mcap is our own log, .tlog a ground station's, .bin ArduPilot's own, .csv (.txt, .tsv) a table.
"""

from __future__ import annotations

import contextlib
import json
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

from dslam_mav.errors import BadInputError, unreadable
from dslam_mav.legs import plan_facts
from dslam_mav.log.reader import FlightLog
from dslam_mav.mav import dataflash
from dslam_mav.mav.decode import READING_NAME, autopilot_system
from dslam_mav.mav.frames import Frame
from dslam_mav.mav.mission.heard import mission_heard
from dslam_mav.mav.tlog import begins_as_tlog, read_tlog
from dslam_mav.mission import Mission
from dslam_mav.observations import Yaw
from dslam_mav.recordings.recording import Assumed, Recording
from dslam_mav.recordings.table import Table
from dslam_mav.replay import Replayed, flight_from_frames, flight_from_observations, flight_from_packets
from dslam_mav.series import read_csv

__all__ = ["Assumed", "OurLog", "Recording", "Telemetry", "kind_of", "open_recording", "our_log"]

PROVENANCE_ATTACHMENT = "provenance.json"
RECORDING_ATTACHMENT = "recording"
"""Followed by the ending of a file of others that a log of ours was made of."""

KINDS = "a .mcap, a .tlog, ArduPilot's .bin or a .csv"
_BY_NAME = {".mcap": "mcap", ".bin": "dataflash", ".tlog": "tlog", ".csv": "csv", ".txt": "csv", ".tsv": "csv"}


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
    """The recording in a log of ours: its packets, or the file of others that it was made of."""
    name = next((name for name in log.attachments if name.startswith(RECORDING_ATTACHMENT)), None)
    if name is None:
        if columns is not None:
            raise BadInputError(_columns_of_a_csv(columns, path))
        return OurLog(path, log)
    if columns is None:
        with contextlib.suppress(ValueError):
            columns = json.loads(log.attachments.get(PROVENANCE_ATTACHMENT, b"{}")).get("columns")
    with TemporaryDirectory() as folder:
        held = Path(folder) / name
        held.write_bytes(log.attachments[name])
        return open_recording(held, columns)


def _columns_of_a_csv(columns: str, path: Path) -> str:
    return (
        f"--columns {columns}: expected with a CSV file, got {path.name}: of other recordings the readings are "
        f"{READING_NAME}; a .tlog's other fields are readings for fly --readings and bridge --readings"
    )


def kind_of(path: Path) -> str:
    """ "mcap", "dataflash", "tlog" or "csv", by a file's first bytes and its name; BadInputError if it is unreadable,
    empty or none of them.
    """
    try:
        with path.open("rb") as file:
            begin = file.read(16)
    except OSError as problem:
        raise unreadable(path, problem) from None
    suffix = path.suffix.lower()
    if not begin:
        raise BadInputError(f"{path}: is empty; expected {KINDS}")
    if begin.startswith(b"\x89MCAP"):
        return "mcap"
    if begin.startswith(dataflash.MAGIC):
        return "dataflash"
    if suffix in _BY_NAME:
        return _BY_NAME[suffix]
    if begins_as_tlog(begin):
        return "tlog"
    field = " (a recorded field is flown over: fly --readings)" if suffix == ".npz" else ""
    raise BadInputError(f"{path}: is no recording of a flight{field}; expected {KINDS}")


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
        found = flight_from_observations(
            seen, str(self.path), plan=plan, distance=assumed.distance, heard=lambda: self.log.names
        )
        if not self.log.bad_bytes:
            return found
        damaged = f"{self.path.name}: damaged, {self.log.bad_bytes:,} bytes are in no record; the others are used"
        return replace(found, notes=(damaged, *found.notes))
