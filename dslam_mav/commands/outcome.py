"""The end of a flight or replay: table, JSON and report from one record."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from dslam_mav.commands.folder import write_whole
from dslam_mav.commands.screen import Screen
from dslam_mav.dslam.scoring import has_positions
from dslam_mav.errors import DslamError
from dslam_mav.records import Estimate, Flight, Truth
from dslam_mav.report.data import ReportData
from dslam_mav.report.page import render
from dslam_mav.report.table import result_json, result_lines, result_table


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """What a flight came to. `error` is what ended it early; what was learnt until then is shown first."""

    flight: Flight
    estimate: Estimate | None
    truth: Truth | None
    log: Path
    facts: Mapping[str, str]
    warnings: tuple[str, ...] = ()
    error: DslamError | None = None
    report: Path | None = None

    def with_estimate(self, estimate: Estimate) -> Outcome:
        """The same with this estimate."""
        return replace(self, estimate=estimate)


def write_report(outcome: Outcome, path: Path) -> Outcome:
    """Write the page; without an estimate there is none to write."""
    if outcome.estimate is None:
        return outcome
    facts = {**outcome.facts, "log": str(outcome.log)}
    title = f"Flight {outcome.log.parent.name}"
    data = ReportData(outcome.flight, outcome.estimate, outcome.truth, title, facts, outcome.warnings)
    write_whole(path, render(data))
    return replace(outcome, report=path)


def show(screen: Screen, outcome: Outcome) -> int:
    """Print the result; 0 where there are positions, 1 where not. Raises what ended the flight early."""
    for warning in outcome.warnings:
        screen.warn(warning)
    estimate = outcome.estimate
    if estimate is None:
        if outcome.error is not None:
            raise outcome.error
        raise DslamError(f"{outcome.log}: no leg with readings was flown: nothing to estimate")
    screen.say()
    screen.table(result_table(estimate, outcome.truth))
    for line in result_lines(estimate, outcome.truth)[1:]:
        screen.say(line)
    screen.say(f"log     {outcome.log}")
    if outcome.report is not None:
        screen.say(f"report  {outcome.report}")
    screen.result(result_json(estimate, outcome.truth, outcome.log, outcome.report))
    if outcome.error is not None:
        raise outcome.error
    if not has_positions(estimate):
        raise DslamError(f"{estimate.verdict.name}: {estimate.reason}")
    return 0
