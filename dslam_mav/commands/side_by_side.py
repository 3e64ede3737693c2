"""Two answers of one flight beside each other."""

from __future__ import annotations

from rich import box
from rich.table import Table

from dslam_mav.dslam.scoring import has_positions, score
from dslam_mav.records import Estimate, Truth
from dslam_mav.report.numbers import significant

EMPTY = "–"


def comparison(before: Estimate, after: Estimate, truth: Truth | None, heads: tuple[str, str]) -> Table:
    """A row for each thing the answers say, a column for each answer."""
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False, padding=(0, 2, 0, 0))
    table.add_column("")
    for head in heads:
        table.add_column(head, overflow="fold")
    rows = [_rows(each, truth) for each in (before, after)]
    for name in dict.fromkeys(name for row in rows for name in row):  # the order of both
        table.add_row(name, *(row.get(name, EMPTY) for row in rows))
    return table


def _rows(estimate: Estimate, truth: Truth | None) -> dict[str, str]:
    rows = {"verdict": estimate.verdict.name}
    if not has_positions(estimate):
        return {**rows, "why": estimate.reason}
    rows["sources"] = str(len(estimate.sources))
    for k, (x, y) in enumerate(estimate.sources.position_m[:, :2].tolist()):
        sd = float(estimate.sd_m[k])
        peak = significant(float(estimate.sources.peak_reading[k]))
        place = f"{significant(x, 4)}, {significant(y, 4)} ± {significant(sd, 2)} m"
        rows[f"S{k + 1}"] = f"{place}, peak {peak}"
    rows["spread √C"] = f"{significant(estimate.spread_m, 4)} m"
    medium = estimate.medium
    rows["ambient"] = EMPTY if medium.ambient is None else significant(medium.ambient, 5)
    rows["noise sd"] = significant(estimate.noise_sd)
    rows["log-likelihood"] = significant(estimate.log_likelihood, 6)
    rows["other solutions"] = str(len(estimate.alternatives))
    result = None if truth is None else score(estimate, truth)
    if result is not None:
        rows["path error"] = f"{significant(result.path_error_rms_m, 2)} m rms"
    return rows
