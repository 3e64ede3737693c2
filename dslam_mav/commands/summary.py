"""The result on a terminal: a headline, the table of sources, and what else there is to know, line by line."""

from __future__ import annotations

from pathlib import Path

from rich import box
from rich.table import Table

from dslam_mav.dslam.scoring import Score, has_positions, score
from dslam_mav.records import Estimate, Truth
from dslam_mav.records.words import count
from dslam_mav.report.numbers import significant, with_sd
from dslam_mav.report.rows import alternative_rows, parameter_sd
from dslam_mav.report.table import result_table

_NAME_WIDTH = 16


def headline(estimate: Estimate) -> str:
    """The verdict in words; without positions the reason is left to whoever ends the command with it."""
    text = f"{estimate.verdict.name}: {estimate.verdict.sentence}"
    return f"{text} {estimate.reason}".rstrip() if has_positions(estimate) else text


def table(estimate: Estimate, truth: Truth | None) -> Table:
    """The table of sources, narrow enough for 80 columns: units go below the names."""
    sources = result_table(estimate, truth)
    sources.title = None
    sources.box = box.SIMPLE_HEAD
    sources.pad_edge = sources.show_edge = False
    sources.padding = (0, 1, 0, 0)
    for column in sources.columns:
        column.header = "\n".join(str(column.header).rsplit(" ", 1))
        column.vertical = "bottom"
        column.overflow = "fold"
    return sources


def summary(estimate: Estimate, truth: Truth | None, log: Path, report: Path | None) -> list[str]:
    """Path, medium, noise, alternatives and files, a line each."""
    lines: list[tuple[str, str]] = []
    if has_positions(estimate):
        result = None if truth is None else score(estimate, truth)
        lines += [("positions", _gauge(estimate)), ("path", _path(estimate, result)), *_fitted(estimate)]
        if truth is not None and result is not None and not result.same_number:
            lines.append(("truth", f"has {count(len(truth.amplitude), 'source')}, not {len(estimate.sources)}"))
        for row in alternative_rows(estimate):
            words = f"{row.likelihood} times as likely; sources moved by {row.sources_m} m, path by {row.path_m} m"
            lines.append((row.name.lower(), words))
    lines += [("unseen", direction) for direction in estimate.unseen_directions]
    lines.append(("log", str(log)))
    if report is not None:
        lines.append(("report", str(report)))
    return [f"{name:<{_NAME_WIDTH}}{text}" for name, text in lines]


def under_way(estimate: Estimate, leg: int, n_legs: int) -> str:
    """An estimate in the middle of a flight, in one line."""
    begin = f"after leg {leg} of {n_legs}:  {estimate.verdict.name:<16}"
    if not has_positions(estimate):
        return f"{begin}  {estimate.reason}"
    widest = significant(float(estimate.sd_m.max()), 2)
    known = f"{count(len(estimate.sources), 'source')} to ± {widest} m, √C {significant(estimate.spread_m)} m"
    others = f", {count(len(estimate.alternatives), 'alternative')}" if estimate.alternatives else ""
    return f"{begin}  {known}{others}"


def _gauge(estimate: Estimate) -> str:
    if estimate.gauge == "anchored":
        return "metres east and north of home"
    return "metres from the start of leg 1: x along it, y to the side of the first turn"


def _path(estimate: Estimate, result: Score | None) -> str:
    legs = count(estimate.path.heading_rad.size, "leg")
    if result is None:
        return legs
    farthest = significant(float(result.vertex_error_m.max()), 2)
    return f"error {significant(result.path_error_rms_m, 2)} m rms over {legs}, {farthest} m at the farthest corner"


def _fitted(estimate: Estimate) -> list[tuple[str, str]]:
    spread_sd = 0.5 * estimate.spread_m * parameter_sd(estimate, {"ln C": 1.0})
    spread = "given" if not spread_sd > 0.0 else "at the first reading"
    lines = [("spread √C", f"{with_sd(estimate.spread_m, spread_sd)} m, {spread}")]
    ambient = estimate.medium.ambient
    if ambient is not None:
        sd = parameter_sd(estimate, {"ambient": 1.0})
        lines.append(("ambient", with_sd(ambient, sd) if sd > 0.0 else f"{ambient:g}, given"))
    drift = estimate.medium.ambient_drift_per_s
    if drift:
        sd = parameter_sd(estimate, {"ambient drift": 1.0})
        lines.append(("ambient drift", f"{with_sd(drift, sd) if sd > 0.0 else f'{drift:g}, given,'} a second"))
    lag = estimate.medium.sensor_lag_s
    if lag:
        sd = lag * parameter_sd(estimate, {"ln lag": 1.0})
        lines.append(("sensor lag", f"{with_sd(lag, sd) if sd > 0.0 else f'{lag:g}, given,'} s"))
    lines.append(("noise sd", significant(estimate.noise_sd)))
    return lines
