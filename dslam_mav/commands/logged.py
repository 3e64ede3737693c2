"""A log on disk -> flight, plan, assumptions and truth: what `replay`, `report` and `info` begin with."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import dataclass
from pathlib import Path

from dslam_mav.assumed import estimator, visible_plan
from dslam_mav.assumptions import Assumptions
from dslam_mav.commands.assume import Recorded, assumptions_from, in_words, recorded_configuration
from dslam_mav.commands.attached import CONFIGURATION_ATTACHMENT, MISSION_ATTACHMENT, logged_mission
from dslam_mav.commands.outcome import Outcome, truth_of
from dslam_mav.errors import BadInputError
from dslam_mav.legs import plan_facts
from dslam_mav.log.reader import FlightLog, read_log
from dslam_mav.log.recovered import in_words as recovered_in_words
from dslam_mav.mission import Mission
from dslam_mav.records import Truth
from dslam_mav.replay import Replayed, flight_from_frames, frames_in, frames_of
from missions.plan_file import read_plan


@dataclass(frozen=True, slots=True, eq=False)
class Logged:
    """What a log says of its flight; of a .tlog only the flight itself is known.

    `assumed_anew`: the options assume something else than the log was recorded with.
    """

    path: Path
    replayed: Replayed
    mission: Mission | None
    assumptions: Assumptions
    truth: Truth | None
    log: FlightLog | None
    assumed_anew: bool = False


def open_logged(path: Path, options: Namespace) -> Logged:
    """Read a log (.mcap or .tlog) under the options' assumptions, over those it was recorded with."""
    log = None if path.suffix.lower() == ".tlog" or not _begins_as_mcap(path) else read_log(path)
    recorded = None
    if log is not None and CONFIGURATION_ATTACHMENT in log.attachments:
        recorded = recorded_configuration(log.attachments[CONFIGURATION_ATTACHMENT], str(path))
    mission = _mission(path, log, recorded, getattr(options, "plan", None))
    base = None if recorded is None else recorded.assumptions
    assumptions = assumptions_from(options, base=base)
    replayed = flight_from_frames(
        list(frames_of(path) if log is None else frames_in(log.frames)),
        str(path),
        plan=None if mission is None else plan_facts(mission),
        distance=assumptions.distance,
        yaw=assumptions.heading == "vehicle",
        system=None if recorded is None else recorded.vehicle_system,
    )
    truth = None if log is None else log.truth
    return Logged(path, replayed, mission, assumptions, truth, log, assumptions != base)


def _begins_as_mcap(path: Path) -> bool:
    """Whether it is to be read as our log: whatever is not there or not readable is left to the reader to refuse."""
    if path.suffix.lower() == ".mcap":
        return True
    try:
        with path.open("rb") as file:
            return file.read(5) == b"\x89MCAP"
    except OSError:
        return False


def _mission(path: Path, log: FlightLog | None, recorded: Recorded | None, plan: str | None) -> Mission | None:
    if plan is not None:
        return read_plan(Path(plan)).mission
    if log is None or MISSION_ATTACHMENT not in log.attachments:
        return None
    name = f"{path}: attachment {MISSION_ATTACHMENT}"
    home_item = recorded is None or recorded.home_item
    return logged_mission(log.attachments[MISSION_ATTACHMENT], name, home_item=home_item)


def estimate_again(logged: Logged) -> Outcome:
    """The estimator on the log's readings, as it ran on board."""
    collector = logged.replayed.collector
    plan = None if logged.mission is None else visible_plan(logged.assumptions, logged.mission)
    run = estimator(logged.assumptions, collector, plan)
    try:
        result = run(logged.replayed.flight, logged.replayed.legs)
    except BadInputError as problem:
        raise BadInputError(f"{logged.path}: {problem}") from None
    return outcome_of(logged).with_estimate(result)


def outcome_of(logged: Logged) -> Outcome:
    """The flight's outcome, still without an estimate."""
    replayed = logged.replayed
    warnings = list(replayed.collector.notes(replayed.legs))
    if logged.log is not None and not logged.log.complete:
        warnings.insert(0, f"{logged.path}: the log is cut short or damaged; what could be read is used")
    recovered = None if logged.log is None else logged.log.recovered
    if recovered is not None and (recovered["lost"] or not recovered["exact"]):
        warnings.insert(0, f"{logged.path}: {recovered_in_words(recovered)}")
    modes = {leg.mode for leg in replayed.legs}
    facts = {
        "readings": f"{replayed.flight.n_readings} on {len(replayed.legs)} legs, from {logged.path.name}",
        **in_words(logged.assumptions),
        "distance along a leg": ", ".join(sorted(modes)),
    }
    truth = truth_of(logged.truth, logged.mission, replayed.legs)
    then = None if logged.assumed_anew else logged.log
    return Outcome(
        replayed.flight,
        None,
        truth,
        logged.path,
        facts,
        tuple(warnings),
        assumptions=logged.assumptions,
        mission=logged.mission,
        prediction=None if then is None else then.prediction,
        under_way=() if then is None else tuple((e.legs_flown, e.estimate) for e in then.estimates if not e.final),
    )
