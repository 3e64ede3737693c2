"""What a sweep came to, as a table, as sentences and as JSON."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from rich import box
from rich.table import Table

from dslam_mav.records import Verdict
from dslam_mav.records.words import count
from dslam_mav.report.numbers import UNKNOWN, significant
from dslam_mav.sweep.engine import Swept
from dslam_mav.sweep.points.columns import Row, Scalar
from dslam_mav.sweep.points.summary import FAILED, Group


def table(groups: Sequence[Group]) -> Table:
    """A line for each mission, noise level and method; columns of what there is but one or none of are left out."""
    made = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    made.padding = (0, 0, 0, 0)
    names = [n for n in groups[0].labels if n != "method" or len({group.labels[n] for group in groups}) > 1]
    for name in names:
        made.add_column(name, vertical="bottom", no_wrap=name != "mission", min_width=5 if name != "mission" else 10)
    failed = any(FAILED in group.verdicts for group in groups)
    heads = ("points", "error\nm", "90 %\nm", "bound\nm", "error/\nbound", "found", "or\nlisted", "IDENT-\nIFIED",
             "AMBIG-\nUOUS", "other", *([FAILED] if failed else []))  # fmt: skip
    for head in heads:
        made.add_column(head, justify="right", vertical="bottom", no_wrap=True)
    for group in groups:
        counts = [group.verdicts.get(name, 0) for name in (Verdict.IDENTIFIED.name, Verdict.AMBIGUOUS.name, FAILED)]
        made.add_row(
            *(group.labels[name] for name in names),
            str(group.points),
            *(_short(value) for value in (group.error_m, group.error_p90_m, group.bound_m, group.over_bound)),
            _percent(group.found_share),
            _percent(group.listed_share),
            *(_percent(count / group.points) for count in (*counts[:2], group.points - sum(counts))),
            *([str(counts[2])] if failed else []),
        )
    return made


def _short(value: float) -> str:
    """Two digits, in as little room as can be."""
    if math.isfinite(value) and value != 0.0 and not 1e-3 <= abs(value) < 1e4:
        mantissa, exponent = f"{value:.1e}".split("e")
        return f"{mantissa}e{int(exponent)}"
    return significant(value, 2)


def log_table(rows: Sequence[Row]) -> Table:
    """A line for each log and method."""
    made = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    made.padding = (0, 1, 0, 0)
    for name in ("log", "method", "verdict"):
        made.add_column(name, vertical="bottom", no_wrap=name != "log")
    for head in ("sources", "sd\nm", "error\nm", "path\nerror m", "noise\nsd", "legs", "s"):
        made.add_column(head, justify="right", vertical="bottom", no_wrap=True)
    for row in rows:
        told = [str(row[name] or UNKNOWN) for name in ("log", "method")]
        numbers = [_number(row[name]) for name in ("sd_m", "source_error_rms_m", "path_error_m", "noise_sd")]
        counts = [str(row[name] or UNKNOWN) for name in ("k_found", "legs")]
        verdict = str(row["verdict"] or FAILED)
        made.add_row(*told, verdict, counts[0], *numbers, counts[1], _number(row["seconds"]))
    return made


def _number(value: Scalar) -> str:
    return _short(value) if isinstance(value, float) else UNKNOWN


def sentences(swept: Swept, took_s: float, *, logs: bool) -> list[str]:
    """What the table's columns are, and what was done."""
    lines = [
        "sd: what the answer says of its sources, error: from the truth where the log has it, both RMS over the "
        "sources and relative to leg 1"
        if logs
        else "error: of the sources, RMS, relative to leg 1, median and 90 %; bound: Cramér–Rao, on that RMS, median; "
        "error/bound: RMS where the truth is found, 1 is efficient; found: the answer is the truth; listed: the answer "
        "or one of its alternatives is"
    ]
    if swept.computed:
        lines.append(f"{count(swept.computed, 'point')} computed in {took_s:.1f} s")
    return lines


def as_json(swept: Swept, groups: Sequence[Group], took_s: float, files: dict[str, Any]) -> dict[str, Any]:
    """The one object of --json; NaN is null."""
    return {
        "points": len(swept.rows),
        "computed": swept.computed,
        "failed": len(swept.failed),
        "seconds": took_s,
        "groups": [{name: _finite(value) for name, value in asdict(group).items()} for group in groups],
        **files,
    }


def _percent(share: float) -> str:
    return UNKNOWN if math.isnan(share) else f"{100.0 * share:.0f} %"


def _finite(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value
