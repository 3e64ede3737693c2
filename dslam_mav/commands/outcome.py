"""The end of a flight or replay: table, JSON and report from one record."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from dslam_mav.assumptions import Assumptions
from dslam_mav.commands.screen import Screen
from dslam_mav.commands.summary import headline, summary, table
from dslam_mav.dslam.scoring import has_positions
from dslam_mav.errors import DslamError
from dslam_mav.files import write_whole
from dslam_mav.legs import FlownLeg
from dslam_mav.mission import Mission, leg_plan
from dslam_mav.records import Estimate, Flight, Prediction, Truth
from dslam_mav.report.table import result_json

if TYPE_CHECKING:
    from dslam_mav.report.beside import Beside
    from dslam_mav.report.foreseen import Background

PAGES = (".html", ".htm")


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """What a flight came to. `stopped` is what ended it early; what was learnt until then is shown first.

    `prediction` is what the log says was expected of it; `under_way` are legs flown and what was known after them.
    `compass`: the answer with it and without. `begun_s`: when, since 1970, where a log tells.
    """

    flight: Flight
    estimate: Estimate | None
    truth: Truth | None
    log: Path
    facts: Mapping[str, str]
    warnings: tuple[str, ...] = ()
    stopped: DslamError | KeyboardInterrupt | None = None
    report: Path | None = None
    assumptions: Assumptions | None = None
    mission: Mission | None = None
    prediction: Prediction | None = None
    under_way: tuple[tuple[int, Estimate], ...] = ()
    compass: Beside | None = None
    begun_s: float | None = None

    def with_estimate(self, estimate: Estimate) -> Outcome:
        """The same with this estimate."""
        return replace(self, estimate=estimate)


def truth_of(truth: Truth | None, mission: Mission | None, legs: Sequence[FlownLeg]) -> Truth | None:
    """The truth of the legs used alone, so that it begins where the estimate does: truth's vertices are the plan's.

    None where legs before them are left out and nobody knows the plan: errors would be of other legs.
    """
    if truth is None or not legs:
        return truth
    place = {} if mission is None else {seq: j for j, seq in enumerate(leg_plan(mission).sequence)}
    passed = [*(leg.start_seq for leg in legs), legs[-1].end_seq]
    if len(place) != len(truth.vertices_m) or not all(seq in place for seq in passed):
        return None if legs[0].few and legs[0].number > 1 else truth
    return replace(truth, vertices_m=truth.vertices_m[[place[seq] for seq in passed]])


def known_then(under_way: Sequence[tuple[int, Estimate]], legs: Sequence[FlownLeg]) -> tuple[tuple[int, Estimate], ...]:
    """What was known under way of these legs; nothing where others were used until one without readings ended them."""
    few = legs[0].few if legs else ()
    before = sum(number < legs[0].number for number, _ in few)
    return () if before and legs[0].number - 1 > before else tuple(under_way)


def background_of(outcome: Outcome, estimate: Estimate) -> Background | None:
    """What was expected and how it grew; where the log does not say what was expected, what would have been."""
    from dslam_mav.report.foreseen import Background

    assumed = outcome.assumptions
    if assumed is None:
        return None
    prediction = outcome.prediction or _expected(outcome, estimate, assumed)
    return Background(
        medium=assumed.medium(),
        heading_sd_rad=None if assumed.heading == "none" else assumed.heading_sd_rad,
        prediction=prediction,
        predicted_then=outcome.prediction is not None,
        under_way=outcome.under_way,
    )


def _expected(outcome: Outcome, estimate: Estimate, assumed: Assumptions) -> Prediction | None:
    from dslam_mav.forecast import Sensor, forecast

    path = estimate.path.vertices_m[:, :2] if outcome.mission is None else leg_plan(outcome.mission).vertices_m
    length_m = float(outcome.flight.lengths_m.sum())
    return forecast(path, assumed, Sensor(outcome.flight.n_readings / length_m)) if length_m else None


def page_beside(log: Path, said: str = "") -> Path:
    """Where a log's page is, or that of what was `said` otherwise than the log says."""
    stem = "report" if log.name == "flight.mcap" else log.stem
    return log.with_name(f"{stem}{said and '.'}{said}.html")


def write_report(outcome: Outcome, path: Path) -> Outcome:
    """Write the page; without an estimate there is none to write."""
    if outcome.estimate is None:
        return outcome
    from dslam_mav.report.data import ReportData
    from dslam_mav.report.page import render
    from dslam_mav.report.words import title_of

    facts = {**outcome.facts, "log": str(outcome.log)}
    warnings = outcome.warnings
    if outcome.stopped is not None:
        warnings = (f"the flight ended early: {outcome.stopped or 'it was interrupted'}", *warnings)
    title = title_of(outcome.log, outcome.begun_s)
    background = background_of(outcome, outcome.estimate)
    data = ReportData(outcome.flight, outcome.estimate, outcome.truth, title, facts, warnings, background)
    page = render(replace(data, compass=outcome.compass))
    write_whole(path, page.encode())
    return replace(outcome, report=path)


def show(screen: Screen, outcome: Outcome) -> int:
    """Print the result; 0 where there are positions. Raises what ended the flight early, or why there are none."""
    estimate = outcome.estimate
    if estimate is None:
        if outcome.stopped is not None:
            raise outcome.stopped
        why = f" ({'; '.join(outcome.warnings)})" if outcome.warnings else ""
        raise DslamError(f"{outcome.log}: no leg with readings was flown: nothing to estimate{why}")
    for warning in outcome.warnings:
        screen.warn(warning)
    screen.say()
    screen.say(headline(estimate))
    if has_positions(estimate):
        screen.say()
        screen.table(table(estimate, outcome.truth))
        screen.say()
    for line in summary(estimate, outcome.truth, outcome.log, outcome.report):
        screen.say(line)
    screen.result(result_json(estimate, outcome.truth, outcome.log, outcome.report))
    if outcome.stopped is not None:
        raise outcome.stopped
    if not has_positions(estimate):
        raise DslamError(f"no position can be given: {estimate.reason}")
    return 0
