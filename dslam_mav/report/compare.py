"""Many flights on one page: a table to sort, accuracy against prediction, trends from flight to flight. No markup."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np

from dslam_mav.records import Verdict
from dslam_mav.records.words import count
from dslam_mav.report import compare_plots as plots
from dslam_mav.report.foreseen import Realised, metres
from dslam_mav.report.numbers import UNKNOWN, significant
from dslam_mav.report.words import NAMES, TONES


@dataclass(frozen=True, slots=True, eq=False)
class Flown:
    """One log: what came of it, or `problem`, one line that says why it cannot be read. `link`: its own page.

    `predicted_m`: median and 90 % of the sources' RMS error; `realised` in the same measure.
    """

    log: str
    problem: str | None = None
    link: str | None = None
    start_s: float | None = None
    verdict: Verdict | None = None
    n_sources: int | None = None
    length_m: float = math.nan
    noise_sd: float = math.nan
    predicted_m: tuple[float, float] = (math.nan, math.nan)
    realised: Realised | None = None
    duration_s: float = math.nan

    @property
    def own_m(self) -> float:
        """What the result says of its sources' error."""
        return math.nan if self.realised is None else self.realised.own_m[0]

    @property
    def error_m(self) -> float:
        """The sources' error against truth."""
        return math.nan if self.realised is None else self.realised.error_m[0]

    @property
    def best_known_m(self) -> float:
        """The error where truth is known, else what the result says of itself."""
        return math.nan if self.realised is None else self.realised.best_known_m[0]


@dataclass(frozen=True, slots=True)
class Cell:
    """A cell as text, and the number or text it is sorted by ("" comes last)."""

    text: str
    order: str


@dataclass(frozen=True, slots=True)
class FlightRow:
    """One line of the table; `tone` of its verdict."""

    number: int
    log: str
    link: str | None
    problem: str | None
    tone: str
    cells: tuple[Cell, ...]


@dataclass(frozen=True, slots=True)
class Comparison:
    """All that the page of many flights shows."""

    title: str
    sentences: tuple[str, ...]
    columns: tuple[tuple[str, str], ...]
    rows: tuple[FlightRow, ...]
    scatter: plots.Scatter | None
    trends: tuple[plots.Trend, ...]


COLUMNS = (
    ("Date, UTC", ""),
    ("Verdict", ""),
    ("K", ""),
    ("Length", "m"),
    ("Noise sd", ""),
    ("Own ±", "rms m"),
    ("Predicted", "rms m"),
    ("Error", "rms m"),
    ("Time", "s"),
)


def comparison(flights: Sequence[Flown], title: str) -> Comparison:
    """The page of the flights, in the order given."""
    in_time = sorted(
        (i for i, f in enumerate(flights) if f.problem is None),
        key=lambda i: (flights[i].start_s is None, flights[i].start_s or 0.0, i),
    )
    return Comparison(
        title=title,
        sentences=_sentences(flights),
        columns=COLUMNS,
        rows=tuple(_row(i + 1, flight) for i, flight in enumerate(flights)),
        scatter=plots.scatter([_dot(i, f) for i, f in enumerate(flights)]),
        trends=_trends(flights, in_time),
    )


def _dot(i: int, flight: Flown) -> plots.Dot:
    true = math.isfinite(flight.error_m)
    return plots.Dot(i + 1, flight.log, flight.predicted_m, flight.best_known_m, true)


def _trends(flights: Sequence[Flown], in_time: Sequence[int]) -> tuple[plots.Trend, ...]:
    shown = [flights[i] for i in in_time]
    numbers, dates = [i + 1 for i in in_time], [_date(f.start_s)[:16] for f in shown]
    series = (
        plots.Line("error against truth", "error", tuple(f.error_m for f in shown)),
        plots.Line("the result’s own ±", "own", tuple(f.own_m for f in shown)),
        plots.Line("predicted median", "bound", tuple(f.predicted_m[0] for f in shown)),
    )
    noise = (plots.Line("noise sd", "own", tuple(f.noise_sd for f in shown)),)
    made = (
        plots.trend("Sources’ error, rms (m)", numbers, dates, series),
        plots.trend("Noise, sd of a reading", numbers, dates, noise),
    )
    return tuple(one for one in made if one is not None)


def _sentences(flights: Sequence[Flown]) -> tuple[str, ...]:
    read = [f for f in flights if f.problem is None]
    lines = [f"{count(len(flights), 'log')}, {len(read)} read."]
    named = [(verdict, sum(f.verdict is verdict for f in read)) for verdict in Verdict]
    words = [f"{number} {NAMES[verdict].lower()}" for verdict, number in named if number]
    if words:
        lines.append(f"Verdicts: {', '.join(words)}.")
    pairs = [(f.best_known_m, *f.predicted_m) for f in read if math.isfinite(f.best_known_m)]
    pairs = [pair for pair in pairs if math.isfinite(pair[1])]
    if pairs:
        got, median, p90 = np.array(pairs).T
        lines.append(
            f"Of {len(pairs)} with a prediction, {int((got <= p90).sum())} came out within what nine of ten flights "
            f"were expected to reach; half of them at {significant(float(np.median(got / median)), 2)} times the "
            "predicted median or better."
        )
    return tuple(lines)


def _row(number: int, flight: Flown) -> FlightRow:
    if flight.problem is not None or flight.verdict is None:
        return FlightRow(number, flight.log, None, flight.problem or UNKNOWN, "bad", ())
    predicted = flight.predicted_m[0]
    cells = (
        Cell(_date(flight.start_s), "" if flight.start_s is None else f"{flight.start_s:.3f}"),
        Cell(NAMES[flight.verdict], str(int(flight.verdict))),
        _number(float(flight.n_sources or 0), "{:.0f}"),
        Cell(significant(flight.length_m, 3), _order(flight.length_m)),
        Cell(significant(flight.noise_sd, 2), _order(flight.noise_sd)),
        Cell(significant(flight.own_m, 2), _order(flight.own_m)),
        Cell(metres(predicted), _order(predicted)),
        Cell(significant(flight.error_m, 2), _order(flight.error_m)),
        _number(flight.duration_s, "{:.1f}"),
    )
    return FlightRow(number, flight.log, flight.link, None, TONES[flight.verdict], cells)


def _number(value: float, form: str) -> Cell:
    return Cell(form.format(value) if math.isfinite(value) else UNKNOWN, _order(value))


def _order(value: float) -> str:
    return "" if math.isnan(value) else "1e999" if math.isinf(value) else repr(float(value))


def _date(start_s: float | None) -> str:
    return UNKNOWN if start_s is None else f"{datetime.fromtimestamp(start_s, UTC):%Y-%m-%d %H:%M:%S}"
