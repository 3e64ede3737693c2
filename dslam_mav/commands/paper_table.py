"""An experiment's result as a table, as sentences and as JSON."""

from __future__ import annotations

import math
from typing import Any

from rich import box
from rich.table import Table

from dslam_mav.experiments.experiment import Result, Shown
from dslam_mav.report.numbers import UNKNOWN, significant

HEADERS = {
    "printed": "paper\nprints",
    "paper": "its\nmethod",
    "fitted": "fitted",
    "joint": "joint",
    "bound": "bound",
}


def table(result: Result) -> Table:
    """One line a row and error: what the paper prints, its method, the joint one, the bound, and their ratios."""
    experiment = result.experiment
    made = Table(title=experiment.title, title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    made.padding = (0, 1, 0, 0)
    for name in (*experiment.columns, "error"):
        made.add_column(name.replace(" (", "\n("), vertical="bottom", no_wrap=True)
    methods = _methods(result)
    for method in methods:
        made.add_column(HEADERS[method], justify="right", vertical="bottom", no_wrap=True)
        if method == "paper" and "printed" in methods:
            made.add_column("over\nprinted", justify="right", vertical="bottom", no_wrap=True)
        if method == "joint" and "printed" in methods:
            made.add_column("printed\nover it", justify="right", vertical="bottom", no_wrap=True)
    most = max((one.trials for found in result.statistics for one in found.values()), default=0)
    made.add_column(f"answers\nof {most}", justify="right", vertical="bottom", no_wrap=True)
    for i, row in enumerate(result.rows):
        for n, shown in enumerate(experiment.shown):
            label = row.label if n == 0 else ("",) * len(row.label)
            made.add_row(*label, _named(shown), *_cells(result, i, shown, methods))
    return made


def notes(result: Result) -> list[str]:
    """What the experiment states, and where its scenes are."""
    scenes = ", ".join(result.experiment.worlds)
    return [*result.experiment.notes, f"flown over: {scenes} (dslam_mav/experiments/scenes, or recordings)"]


def as_json(result: Result, missing: list[str], pictures: list[str], *, complete: bool) -> dict[str, Any]:
    """One experiment's object: rows with errors, each by method."""
    experiment = result.experiment
    return {
        "title": experiment.title,
        "notes": list(experiment.notes),
        "worlds": list(experiment.worlds),
        "missing": missing,
        "complete": complete,
        "pictures": pictures,
        "rows": [
            {
                "label": dict(zip(experiment.columns, row.label, strict=True)),
                "errors": {shown.error: _error(result, i, shown) for shown in experiment.shown},
            }
            for i, row in enumerate(result.rows)
        ],
    }


def _error(result: Result, row: int, shown: Shown) -> dict[str, Any]:
    found: dict[str, Any] = {"unit": shown.unit, "average": shown.average}
    for method in ("printed", "bound"):
        found[method] = _finite(result.value(row, method, shown))
    for method in shown.methods:
        statistic = result.statistics[row].get(f"{method}.{shown.error}")
        found[method] = _finite(result.value(row, method, shown))
        found[f"{method}_median"] = None if statistic is None else _finite(statistic.median)
        found[f"{method}_answered"] = 0 if statistic is None else statistic.answered
        found["trials"] = 0 if statistic is None else statistic.trials
    return found


def _methods(result: Result) -> list[str]:
    """Those that have something to show, and the two methods in any case."""
    shown = result.experiment.shown
    own = dict.fromkeys(method for one in shown for method in one.methods)
    printed = ["printed"] if any(row.printed for row in result.rows) else []
    bound = ["bound"] if any(one.error in row.limits for row in result.rows for one in shown) else []
    return [*printed, *own, *bound]


def _cells(result: Result, row: int, shown: Shown, methods: list[str]) -> list[str]:
    printed = result.value(row, "printed", shown)
    cells = []
    for method in methods:
        value = result.value(row, method, shown)
        cells.append(_number(value))
        if method == "paper" and "printed" in methods:
            cells.append(_number(value / printed, 2))
        if method == "joint" and "printed" in methods:
            cells.append(_number(printed / value, 2) if value else UNKNOWN)
    found = [result.statistics[row].get(f"{method}.{shown.error}") for method in shown.methods]
    told = [f"{one.answered}" for one in found if one is not None]
    return [*cells, ", ".join(told) if told else UNKNOWN]


def _named(shown: Shown) -> str:
    return f"{shown.error} ({shown.unit})" if shown.unit else shown.error


def _number(value: float, digits: int = 3) -> str:
    if math.isfinite(value) and value != 0.0 and not 1e-3 <= abs(value) < 1e4:
        mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
        return f"{mantissa}e{int(exponent)}"
    return significant(value, digits)


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
