"""An answer in a column, to be held beside another: by `replay --set` on a terminal, with and without compass on the
page. Pure.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dslam_mav.dslam.align import to_canonical
from dslam_mav.dslam.scoring import has_positions, score
from dslam_mav.records import Estimate, Path, Truth
from dslam_mav.records.words import count
from dslam_mav.report.numbers import significant

EMPTY = "–"


@dataclass(frozen=True, slots=True)
class Beside:
    """A table of answers and what is to be said of it: `rows` are names with a cell for each of `heads`."""

    heads: tuple[str, ...]
    rows: tuple[tuple[str, tuple[str, ...]], ...]
    words: str = ""


def beside(answers: Sequence[Estimate], truth: Truth | None, heads: tuple[str, ...], words: str = "") -> Beside:
    """A row for each thing the answers say, a column for each answer."""
    columns = [_column(each, truth) for each in answers]
    names = _in_one_order(columns)
    rows = tuple((name, tuple(column.get(name, EMPTY) for column in columns)) for name in names)
    return Beside(heads, rows, words)


def _in_one_order(columns: Sequence[dict[str, str]]) -> list[str]:
    """All rows' names: what only one column has stands behind what it stands behind there."""
    names: list[str] = []
    for column in sorted(columns, key=len, reverse=True):
        at = 0
        for name in column:
            if name not in names:
                names.insert(at, name)
            at = names.index(name) + 1
    return names


def with_and_without(without: Estimate, with_it: Estimate, truth: Truth | None) -> Beside:
    """What the compass does to an answer: both in the gauge of leg 1 and with the uncertainty that is left aligned on
    the path, so that they can be compared: on the map the compass's own counts.
    """
    answers = _comparable(without), _comparable(with_it)
    return beside(answers, truth, ("without compass", "with compass"), _added(*answers))


def _comparable(estimate: Estimate) -> Estimate:
    estimate = replace(estimate, position_covariance_m2=estimate.path_aligned_covariance_m2)
    if not has_positions(estimate) or estimate.gauge != "anchored":
        return estimate
    gauge = to_canonical(estimate.path.vertices_m)
    path = gauge.apply(estimate.path.vertices_m)
    step = np.diff(path, axis=0)
    return replace(
        estimate,
        gauge="canonical",
        sources=replace(estimate.sources, position_m=gauge.apply(estimate.sources.position_m)),
        path=Path(path, np.arctan2(step[:, 1], step[:, 0])),
    )


def _added(without: Estimate, with_it: Estimate) -> str:
    """What the compass adds, in words."""
    if not has_positions(with_it):
        return f"With the compass there is no answer. {with_it.reason}"
    said = ["The compass tells which way round the answer lies on the map, and which of two mirror images it is."]
    if not has_positions(without):
        said.append("Without it there is no answer.")
    else:
        sd, was = (float(np.sqrt(np.mean(each.sd_m**2))) for each in (with_it, without))
        alike = abs(sd / was - 1.0) < 0.05
        said.append(
            f"Places are as sure as without it, ± {significant(was, 2)} m." if alike
            else f"Places are known to ± {significant(sd, 2)} m instead of ± {significant(was, 2)} m."
        )  # fmt: skip
        if len(with_it.alternatives) != len(without.alternatives):
            others = count(len(with_it.alternatives), "other solution")
            said.append(f"It leaves {others} instead of {len(without.alternatives)}.")
    if with_it.verdict is not without.verdict:
        said.append(with_it.reason)
    return " ".join(each for each in said if each)


def _column(estimate: Estimate, truth: Truth | None) -> dict[str, str]:
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
        rows["source error"] = f"{significant(result.source_error_rms_m, 2)} m rms"
        rows["path error"] = f"{significant(result.path_error_rms_m, 2)} m rms"
    return rows
