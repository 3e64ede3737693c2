"""A recorded flight -> its legs, through the same gate and the same collector as on board."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from dslam_mav.errors import BadInputError
from dslam_mav.legs import Distance, FlownLeg, LegCollector, PlanFacts, flight_of
from dslam_mav.log.reader import read_log
from dslam_mav.mav.decode import READING_NAME, autopilot_system, decode, names_heard
from dslam_mav.mav.frames import Frame, parse_frame
from dslam_mav.mav.tlog import read_tlog
from dslam_mav.records import Flight

_MCAP_MAGIC = b"\x89MCAP"


@dataclass(frozen=True, slots=True, eq=False)
class Replayed:
    """A flight as a log tells it: `legs` say where its legs came from, `collector` what was set aside."""

    flight: Flight
    legs: tuple[FlownLeg, ...]
    collector: LegCollector


def flight_from_log(
    path: Path,
    *,
    plan: PlanFacts | None = None,
    distance: Distance | None = None,
    yaw: bool = False,
    system: int | None = None,
) -> Replayed:
    """The flight in a flight log (.mcap) or a ground station's telemetry log (.tlog).

    `system` None: the autopilot heard most, of those with readings. BadInputError, one line, says what the log lacks.
    """
    path = Path(path)
    return flight_from_frames(list(frames_of(path)), str(path), plan=plan, distance=distance, yaw=yaw, system=system)


def flight_from_frames(
    frames: list[Frame],
    name: str,
    *,
    plan: PlanFacts | None = None,
    distance: Distance | None = None,
    yaw: bool = False,
    system: int | None = None,
) -> Replayed:
    """The flight in frames that came from `name`, in the order they were received."""
    system = autopilot_system(frames) if system is None else system
    if system is None:
        raise BadInputError(f"{name}: no autopilot: expected HEARTBEAT of a vehicle's component 1")
    collector = LegCollector(plan, distance=distance)
    for frame in frames:
        observation = decode(frame, system, yaw=yaw)
        if observation is not None:
            collector.add(observation)
    legs = collector.legs(final=True)
    if not legs:
        raise BadInputError(f"{name}: {_lack(collector, frames, system)}")
    return Replayed(flight_of(legs), legs, collector)


def frames_of(path: Path) -> Iterator[Frame]:
    """The MAVLink frames of a .mcap or .tlog file, whichever it is by its first bytes."""
    try:
        with path.open("rb") as file:
            is_mcap = file.read(len(_MCAP_MAGIC)) == _MCAP_MAGIC
    except OSError as problem:
        raise BadInputError(f"{path}: cannot be read: {(problem.strerror or str(problem)).lower()}") from None
    if not is_mcap:
        return iter(read_tlog(path))
    return frames_in(read_log(path).frames)


def frames_in(packets: Iterable[tuple[int, bytes]]) -> Iterator[Frame]:
    """The MAVLink frames of a log's packets (time received, bytes)."""
    stored = (parse_frame(raw, received_ns) for received_ns, raw in packets)
    return (frame for frame in stored if frame is not None)


def _lack(collector: LegCollector, frames: Iterable[Frame], system: int) -> str:
    """Why there is no leg, in words."""
    if not collector.names:
        heard = ", ".join(names_heard(frames, system)) or "none"
        return f"no {READING_NAME} readings; names of NAMED_VALUE_FLOAT heard: {heard}"
    if collector.last_event is None:
        return "no MISSION_ITEM_REACHED, nor MISSION_CURRENT going on: the legs cannot be told apart"
    if collector.counts["readings"] == 0:
        return f"none of the {READING_NAME} readings is a finite number"
    if collector.legs_counts["legs lost"]:
        wanted = collector.distance or "LOCAL_POSITION_NED or VFR_HUD"
        return f"the distance flown cannot be told on {collector.legs_counts['legs lost']} legs: no {wanted}"
    return "no leg with readings: none was taken between two items reached"
