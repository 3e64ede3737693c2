"""The result for the terminal and for scripts: a rich table, and the `--json` object."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.scoring import Score, score
from dslam_mav.records import Estimate, Truth
from dslam_mav.report.rows import axis_names, source_rows

if TYPE_CHECKING:
    from rich.table import Table


def result_table(estimate: Estimate, truth: Truth | None) -> Table:
    """A row for each source: position, peak reading, amplitude, ± sd, and the error where truth is known."""
    from rich.table import Table
    from rich.text import Text

    result = score(estimate, truth) if truth is not None else None
    d = estimate.sources.position_m.shape[1]
    table = Table(title=Text(f"{estimate.verdict.name}: {estimate.verdict.sentence}"), title_justify="left")
    table.add_column("source")
    axes = [f"{name} m" for name in axis_names(estimate)]
    for name in (*axes, "± sd m", "peak reading", f"amplitude reading·m{'²³'[d - 2]}"):
        table.add_column(name, justify="right")
    if result is not None:
        table.add_column("error m", justify="right")
    for row in source_rows(estimate, result):
        cells = [row.name, *row.position, row.sd_m, row.peak, row.amplitude]
        table.add_row(*(Text(cell) for cell in (cells if result is None else [*cells, row.error_m])))
    return table


def result_json(
    estimate: Estimate, truth: Truth | None, log: Path | str | None, report: Path | str | None
) -> dict[str, Any]:
    """The `--json` object: what is not a finite number is None, positions are lists in metres."""
    result = score(estimate, truth) if truth is not None else None
    return {
        **_solution_json(estimate),
        "reason": estimate.reason,
        "noise_sd": _number(estimate.noise_sd),
        "unseen_directions": list(estimate.unseen_directions),
        "alternatives": [
            {
                **_solution_json(other),
                "delta_log_likelihood": _number(estimate.log_likelihood - other.log_likelihood),
            }
            for other in estimate.alternatives
        ],
        "errors": None if result is None else _errors_json(result),
        "log": None if log is None else str(log),
        "report": None if report is None else str(report),
    }


def _solution_json(estimate: Estimate) -> dict[str, Any]:
    sources = estimate.sources
    columns = (
        sources.position_m,
        sources.amplitude,
        sources.peak_reading,
        sources.activation_s,
        estimate.sd_m,
    )
    names = ("position_m", "amplitude", "peak_reading", "activation_s", "sd_m")
    medium = estimate.medium
    return {
        "verdict": estimate.verdict.name,
        "gauge": estimate.gauge,
        "sources": [
            {name: _plain(column[k]) for name, column in zip(names, columns, strict=True)} for k in range(len(sources))
        ],
        "path": {
            "vertices_m": _plain(estimate.path.vertices_m),
            "heading_rad": _plain(estimate.path.heading_rad),
        },
        "medium": {
            "diffusivity_m2_s": medium.diffusivity_m2_s,
            "activation_s": medium.activation_s,
            "spread_m": _number(estimate.spread_m),
            "ambient": medium.ambient,
            "static": medium.static,
            "dimensions": medium.dimensions,
            "sensor_lag_s": medium.sensor_lag_s,
            "ambient_drift_per_s": medium.ambient_drift_per_s,
        },
        "log_likelihood": _number(estimate.log_likelihood),
    }


def _errors_json(result: Score) -> dict[str, Any]:
    return {
        "sources_m": _plain(result.source_error_m),
        "sources_rms_m": _number(result.source_error_rms_m),
        "matching": list(result.matching),
        "amplitude_relative": _plain(result.amplitude_relative_error),
        "path_rms_m": _number(result.path_error_rms_m),
        "vertices_m": _plain(result.vertex_error_m),
        "same_number_of_sources": result.same_number,
        "paper": {
            "frame": result.paper_frame,
            "E_sources": _number(result.paper_sources),
            "E_lines": _number(result.paper_lines),
            "E_amp": _number(result.paper_amplitudes),
        },
    }


def _number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _plain(value: NDArray[np.float64] | float) -> Any:
    """Nested lists of numbers, None where not finite."""
    array = np.asarray(value, dtype=np.float64)
    return _number(float(array)) if array.ndim == 0 else [_plain(item) for item in array]
