"""`report` on many logs: one page that compares them, a row for each, whatever became of it."""

from __future__ import annotations

import math
import os
from argparse import Namespace
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any
from urllib.parse import quote

from dslam_mav.commands.logged import Logged, open_logged
from dslam_mav.commands.outcome import Outcome, background_of, page_beside
from dslam_mav.commands.screen import Screen
from dslam_mav.dslam.growth import growth
from dslam_mav.dslam.scoring import score
from dslam_mav.errors import BadInputError, DslamError
from dslam_mav.files import check_output, write_whole
from dslam_mav.records.words import count
from dslam_mav.report.compare import Flown
from dslam_mav.report.foreseen import realised
from dslam_mav.report.page import render_comparison

PAGE = "comparison.html"

Judge = Callable[[Logged], Outcome]


def compare(options: Namespace, screen: Screen, judge: Judge) -> int:
    """Write the page of all logs; a log named twice is one. BadInputError where not one can be read."""
    once: dict[Path, Path] = {}
    for path in map(Path, options.logs):
        once.setdefault(path.resolve(), path)
    paths = list(once.values())
    page = Path(options.output or PAGE)
    check_output(page)
    flights = []
    with screen.progress("reading logs") as advance:
        for i, path in enumerate(paths):
            advance("reading logs", i, len(paths), str(path))
            flights.append(_flown(path, options, judge, page))
    problems = [flight.problem for flight in flights if flight.problem is not None]
    if len(problems) == len(flights):
        raise BadInputError(f"none of {count(len(flights), 'log')} can be read, the first because: {problems[0]}")
    title = f"{count(len(flights), 'log')} compared"
    replaced = page.exists()
    write_whole(page, render_comparison(flights, title).encode())
    for problem in problems:
        screen.warn(problem)
    screen.say(f"{page}, in place of the one that was there" if replaced else str(page))
    screen.result({"report": str(page), "flights": [_json(*pair) for pair in zip(paths, flights, strict=True)]})
    return 0


def _flown(path: Path, options: Namespace, judge: Judge, page: Path) -> Flown:
    """A log's row; what cannot be read is one that says so."""
    try:
        logged = open_logged(path, options)
        outcome = judge(logged)
    except DslamError as problem:
        return Flown(log=_name(path), problem=str(problem))
    estimate, flight = outcome.estimate, outcome.flight
    assert estimate is not None
    background = background_of(outcome, estimate)
    grown = None if background is None else growth(flight, estimate, background.medium, background.heading_sd_rad)
    prediction = None if background is None else background.prediction
    readings_s = [leg.time_s for leg in flight.legs if leg.time_s.size]
    return Flown(
        log=_name(path),
        link=_link(path, page),
        start_s=outcome.begun_s,
        verdict=estimate.verdict,
        n_sources=len(estimate.sources),
        length_m=float(flight.lengths_m.sum()),
        noise_sd=estimate.noise_sd,
        predicted_m=(math.nan, math.nan) if prediction is None else prediction.source_error_m,
        realised=realised(estimate, None if outcome.truth is None else score(estimate, outcome.truth), grown),
        duration_s=float(readings_s[-1][-1] - readings_s[0][0]) if readings_s else math.nan,
    )


def _name(path: Path) -> str:
    """As short as tells logs apart: the folder of a flight.mcap, else the file's name."""
    return path.absolute().parent.name if path.name == "flight.mcap" else path.name


def _link(path: Path, page: Path) -> str | None:
    """The log's own page as an address seen from this one, where it has one."""
    own = page_beside(path)
    if not own.is_file():
        return None
    try:
        return quote(Path(os.path.relpath(own.absolute(), page.absolute().parent)).as_posix())
    except ValueError:
        return None


def _json(path: Path, flight: Flown) -> dict[str, Any]:
    """A flight as `--json` has it; what is not a finite number is null."""

    def number(value: float) -> float | None:
        return float(value) if math.isfinite(value) else None

    date = None if flight.start_s is None else datetime.fromtimestamp(flight.start_s, UTC)
    return {
        "log": str(path),
        "problem": flight.problem,
        "date": None if date is None else date.isoformat(timespec="milliseconds"),
        "verdict": None if flight.verdict is None else flight.verdict.name,
        "sources": flight.n_sources,
        "length_m": number(flight.length_m),
        "noise_sd": number(flight.noise_sd),
        "source_sd_m": number(flight.own_m),
        "predicted_source_error_m": {"median": number(flight.predicted_m[0]), "p90": number(flight.predicted_m[1])},
        "source_error_m": number(flight.error_m),
        "duration_s": number(flight.duration_s),
    }
