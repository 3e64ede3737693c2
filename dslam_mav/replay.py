"""A recorded flight -> its legs, through the same gate and the same collector as on board."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

from dslam_mav.errors import BadInputError
from dslam_mav.legs import Distance, FlownLeg, LegCollector, PlanFacts, flight_of
from dslam_mav.mav.decode import READING_NAME, autopilot_system, decode, names_heard
from dslam_mav.mav.frames import Frame, parse_frame
from dslam_mav.mav.packets import Gate, Stored, system_frames
from dslam_mav.observations import Observation
from dslam_mav.records import Flight
from dslam_mav.records.words import count


@dataclass(frozen=True, slots=True, eq=False)
class Replayed:
    """A flight as a log tells it: `legs` say where its legs came from, `collector` what was set aside.

    `notes`: what else a person must know of where its legs come from.
    """

    flight: Flight
    legs: tuple[FlownLeg, ...]
    collector: LegCollector
    notes: tuple[str, ...] = ()


def flight_from_packets(
    packets: Sequence[Stored],
    name: str,
    *,
    plan: PlanFacts | None = None,
    distance: Distance | None = None,
    yaw: bool = False,
    system: int | None = None,
) -> Replayed:
    """The flight in the packets that a log called `name` stored: as `flight_from_frames`, but much faster.

    `system` None: the autopilot heard most, of those with readings. BadInputError, one line, says what the log lacks.
    """
    system = autopilot_system(system_frames(packets)) if system is None else system
    if system is None:
        raise BadInputError(f"{name}: {_NO_AUTOPILOT}")
    collector = LegCollector(plan, distance=distance)
    collector.add_recorded(*Gate(system, yaw=yaw).recorded(packets))
    return flight_of_collector(collector, name, lambda: names_heard(_frames(packets), system))


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
        raise BadInputError(f"{name}: {_NO_AUTOPILOT}")
    seen = (decode(frame, system, yaw=yaw) for frame in frames)
    return flight_from_observations(
        (observation for observation in seen if observation is not None),
        name, plan=plan, distance=distance, heard=lambda: names_heard(frames, system),
    )  # fmt: skip


def flight_from_observations(
    observations: Iterable[Observation],
    name: str,
    *,
    plan: PlanFacts | None,
    distance: Distance | None,
    heard: Callable[[], Sequence[str]],
) -> Replayed:
    """The flight that observations tell, in their order; `heard` gives the names of values that were no readings."""
    collector = LegCollector(plan, distance=distance)
    collector.add_all(observations)
    return flight_of_collector(collector, name, heard)


def flight_of_collector(collector: LegCollector, name: str, heard: Callable[[], Sequence[str]]) -> Replayed:
    """The flight that a collector heard all of; BadInputError says what it lacks."""
    legs = collector.legs(final=True)
    if not legs:
        raise BadInputError(f"{name}: {_lack(collector, heard)}")
    return Replayed(flight_of(legs), legs, collector)


_NO_AUTOPILOT = "no autopilot: expected HEARTBEAT of a vehicle's component 1"


def _frames(packets: Iterable[Stored]) -> Iterator[Frame]:
    stored = (parse_frame(raw, received_ns) for received_ns, raw in packets)
    return (frame for frame in stored if frame is not None)


def _lack(collector: LegCollector, heard: Callable[[], Sequence[str]]) -> str:
    """Why there is no leg, in words."""
    if not collector.names:
        return f"no {READING_NAME} readings; names of NAMED_VALUE_FLOAT heard: {', '.join(heard()) or 'none'}"
    if collector.last_event is None:
        return "no MISSION_ITEM_REACHED, nor MISSION_CURRENT going on: the legs cannot be told apart"
    if collector.counts["readings"] == 0:
        if collector.counts["off the clock"]:
            return f"the times of the {READING_NAME} readings are not of the vehicle's clock"
        return f"none of the {READING_NAME} readings is a finite number"
    if collector.legs_counts["legs lost"]:
        wanted = collector.distance or "LOCAL_POSITION_NED or VFR_HUD"
        return f"the distance flown cannot be told on {count(collector.legs_counts['legs lost'], 'leg')}: no {wanted}"
    return "no leg with readings: none was taken between two items reached"
