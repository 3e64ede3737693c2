"""A log on disk -> flight, plan, assumptions and truth: what `replay`, `report` and `info` begin with."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from dslam_mav.assumed import estimator, visible_plan
from dslam_mav.assumptions import Assumptions
from dslam_mav.commands.assume import Recorded, assumptions_from, in_words, recorded_configuration, stood
from dslam_mav.commands.attached import CONFIGURATION_ATTACHMENT, MISSION_ATTACHMENT, logged_mission
from dslam_mav.commands.outcome import Outcome, known_then, truth_of
from dslam_mav.commands.settings import with_settings
from dslam_mav.errors import BadInputError
from dslam_mav.log.reader import FlightLog, read_log
from dslam_mav.log.recovered import in_words as recovered_in_words
from dslam_mav.log.topics import ESTIMATE, PREDICTION, RAW, TRUTH
from dslam_mav.mission import Mission
from dslam_mav.recordings import Assumed, Recording, kind_of, open_recording, our_log
from dslam_mav.records import Estimate, Truth
from dslam_mav.records.words import count
from dslam_mav.replay import Replayed
from missions.plan_file import read_plan

_CLOCK_SET_S = datetime(2000, 1, 1, tzinfo=UTC).timestamp()  # clocks that nobody set begin in 1970 or 1980
_TOPICS = (RAW, ESTIMATE, PREDICTION, TRUTH)  # all that is used here; an hour's readings take a second to decode


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
    recording: Recording
    recorded: Recorded | None = None
    assumed_anew: bool = False


def open_logged(path: Path, options: Namespace) -> Logged:
    """Read a recording under the options' assumptions, over those it was recorded with."""
    log = read_log(path, _TOPICS) if kind_of(path) == "mcap" else None
    recorded = None
    if log is not None and CONFIGURATION_ATTACHMENT in log.attachments:
        recorded = recorded_configuration(log.attachments[CONFIGURATION_ATTACHMENT], str(path))
    base = None if recorded is None else recorded.assumptions
    asked = assumptions_from(options, base=base) if "sources" in options else base or Assumptions()
    assumptions = with_settings(asked, getattr(options, "set", None) or ())
    columns = getattr(options, "columns", None)
    recording = open_recording(path, columns) if log is None else our_log(path, log, columns)
    mission = _mission(path, log, recording, recorded, getattr(options, "plan", None))
    system = None if recorded is None else recorded.vehicle_system
    heading = assumptions.heading
    replayed = recording.flight(mission, Assumed(assumptions.distance, heading == "vehicle", system, heading == "plan"))
    truth = None if log is None else log.truth
    return Logged(path, replayed, mission, assumptions, truth, log, recording, recorded, assumptions != base)


def _mission(
    path: Path, log: FlightLog | None, recording: Recording, recorded: Recorded | None, plan: str | None
) -> Mission | None:
    if plan is not None:
        return read_plan(Path(plan)).mission
    if log is None or MISSION_ATTACHMENT not in log.attachments:
        return recording.mission
    name = f"{path}: attachment {MISSION_ATTACHMENT}"
    home_item = recorded is None or recorded.home_item
    return logged_mission(log.attachments[MISSION_ATTACHMENT], name, home_item=home_item)


def estimate_again(logged: Logged, start: Estimate | None = None) -> Outcome:
    """The estimator on the log's readings, as it ran on board; begun from `start`, where one is given."""
    collector = logged.replayed.collector
    plan = None if logged.mission is None else visible_plan(logged.assumptions, logged.mission)
    run = estimator(logged.assumptions, collector, plan, start)
    try:
        result = run(logged.replayed.flight, logged.replayed.legs)
    except BadInputError as problem:
        raise BadInputError(f"{logged.path}: {problem}") from None
    return outcome_of(logged).with_estimate(result)


def as_flown(logged: Logged) -> Outcome:
    """The answer the flight ended with, where the log has it and nothing else is assumed now; else a fresh one."""
    final = [e for e in logged.log.estimates if e.final] if logged.log is not None else []
    same = final and final[-1].estimate.residual.size == logged.replayed.flight.n_readings
    if same and not logged.assumed_anew:
        return outcome_of(logged).with_estimate(final[-1].estimate)
    return estimate_again(logged)


def _begun_s(recording: Recording) -> float | None:
    """When it was flown, seconds since 1970; None where no clock that was set tells."""
    begun_ns = recording.begun_ns
    return None if begun_ns is None or begun_ns < _CLOCK_SET_S * 1e9 else begun_ns / 1e9


def outcome_of(logged: Logged) -> Outcome:
    """The flight's outcome, still without an estimate."""
    replayed = logged.replayed
    warnings = [*replayed.notes, *replayed.collector.notes(replayed.legs)]
    if logged.log is not None and not logged.log.complete:
        warnings.insert(0, f"{logged.path}: the log is cut short or damaged; what could be read is used")
    recovered = None if logged.log is None else logged.log.recovered
    if recovered is not None and (recovered["lost"] or not recovered["exact"]):
        warnings.insert(0, f"{logged.path}: {recovered_in_words(recovered)}")
    modes = {leg.mode for leg in replayed.legs}
    facts = {
        "readings": f"{replayed.flight.n_readings:,} on {count(len(replayed.legs), 'leg')}, from {logged.path.name}",
        **in_words(logged.assumptions),
        **stood(replayed.collector, replayed.legs),
        "distance along a leg": ", ".join(sorted(modes)),
    }
    truth = truth_of(logged.truth, logged.mission, replayed.legs)
    then = None if logged.assumed_anew else logged.log
    known = () if then is None else tuple((e.legs_flown, e.estimate) for e in then.estimates if not e.final)
    return Outcome(
        replayed.flight,
        None,
        truth,
        logged.path,
        facts,
        tuple(warnings),
        begun_s=_begun_s(logged.recording),
        assumptions=logged.assumptions,
        mission=logged.mission,
        prediction=None if then is None else then.prediction,
        under_way=known_then(known, replayed.legs),
    )
