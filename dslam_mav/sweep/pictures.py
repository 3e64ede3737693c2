"""Pictures of a sweep (matplotlib, extra `plots`): errors over noise beside the bound, and the share of verdicts."""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from dslam_mav.experiments.pictures.style import SERIES, new_figure, tidy
from dslam_mav.records import Verdict
from dslam_mav.records.words import count
from dslam_mav.sweep.points.columns import Row
from dslam_mav.sweep.points.summary import FAILED, Group, grouped, numbers

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Okabe and Ito's, from sure to nothing; hatched in turn for eyes that tell no colours
VERDICTS = dict(
    zip(
        [verdict.name for verdict in Verdict] + [FAILED],
        [("#009E73", ""), ("#56B4E9", "//"), ("#E69F00", ""), ("#CC79A7", "\\\\"), ("#D55E00", ""),
         ("#999999", ".."), ("#000000", "")],
        strict=True,
    )
)  # fmt: skip
ACROSS = 3


def pictures(rows: Sequence[Row]) -> Iterator[tuple[str, bytes]]:
    """(file name, PNG) of each there is something to draw for."""
    if "noise" in rows[0] and numbers(rows, "source_error_rms_m").size:
        yield "error.png", _png(errors(rows))
    yield "verdicts.png", _png(verdicts(rows))


def errors(rows: Sequence[Row]) -> Figure:
    """A panel for each mission: sources' error over the noise by method, in the median and of 90 %, and the bound."""
    missions = list(dict.fromkeys(str(row["mission"]) for row in rows))
    across = min(ACROSS, len(missions))
    down = -(-len(missions) // across)
    figure = new_figure(1.2 + 3.4 * across, 0.6 + 3.0 * down)
    axes = figure.subplots(down, across, sharex=True, sharey=True, squeeze=False)
    in_db = all(str(row["noise"]).endswith(" dB") for row in rows)
    for i, mission in enumerate(missions):
        _panel(axes.flat[i], [row for row in rows if row["mission"] == mission], in_db)
        axes.flat[i].set_title(mission, fontsize=9)
    for spare in axes.flat[len(missions) :]:
        spare.set_visible(False)
    for lowest in axes.flat[max(0, len(missions) - across) : len(missions)]:
        lowest.tick_params(labelbottom=True)
    figure.supxlabel("signal-to-noise ratio (dB)" if in_db else "noise sd of a reading", fontsize=9)
    figure.supylabel("error of the sources, RMS (m)", fontsize=9)
    axes.flat[0].legend(fontsize=7)
    return figure


def _panel(axes: Axes, rows: Sequence[Row], in_db: bool) -> None:
    methods = list(dict.fromkeys(str(row["method"]) for row in rows))
    for n, method in enumerate(methods):
        own = [row for row in rows if row["method"] == method]
        groups = grouped(own, ("noise",))
        at = [_level([row for row in own if row["noise"] == group.labels["noise"]], in_db) for group in groups]
        order = np.argsort(at)
        x = np.array(at)[order]
        _lines(axes, x, [groups[i] for i in order], SERIES[method], bound=n == 0)
    axes.set_yscale("log")
    if not in_db and numbers(rows, "noise_sd").min(initial=1.0) > 0.0:
        axes.set_xscale("log")
    tidy(axes)


def _lines(axes: Axes, x: Any, groups: Sequence[Group], look: dict[str, Any], *, bound: bool) -> None:
    if bound:
        least = SERIES["bound"] | {"marker": "", "linestyle": "--", "label": "Cramér–Rao bound on the RMS"}
        axes.plot(x, [group.bound_m for group in groups], linewidth=2.0, **least)
    axes.plot(x, [group.error_m for group in groups], markersize=5, **look | {"label": f"{look['label']}, median"})
    wide = look | {"label": f"{look['label']}, 90 %", "linestyle": ":", "markerfacecolor": "none"}
    axes.plot(x, [group.error_p90_m for group in groups], markersize=5, **wide)


def _level(rows: Sequence[Row], in_db: bool) -> float:
    values = numbers(rows, "noise_snr_db" if in_db else "noise_sd")
    return float(np.median(values)) if values.size else float("nan")


def verdicts(rows: Sequence[Row]) -> Figure:
    """A bar for each mission, noise level and method, or for each method over logs."""
    by = [name for name in ("mission", "noise", "method") if name in rows[0]]
    groups = grouped(rows, by)
    figure = new_figure(7.0, 1.2 + 0.24 * len(groups))
    axes = figure.subplots()
    at = np.arange(len(groups))
    left = np.zeros(len(groups))
    for name, (colour, hatch) in VERDICTS.items():
        share = np.array([100.0 * group.verdicts.get(name, 0) / group.points for group in groups])
        if share.any():
            axes.barh(at, share, left=left, color=colour, hatch=hatch, edgecolor="white", linewidth=0.5, label=name)
        left += share
    labels = [", ".join(group.labels.values()) for group in groups]
    axes.set_yticks(at, labels, fontsize=7)
    ends = (len(groups) - 0.4, -0.6)  # the first on top
    axes.set(xlabel=f"share of verdicts (%), {count(len(rows), 'point')}", xlim=(0.0, 100.0), ylim=ends)
    figure.legend(loc="outside upper center", ncols=4, fontsize=7)
    tidy(axes)
    return figure


def _png(figure: Figure) -> bytes:
    stream = io.BytesIO()
    figure.savefig(stream, format="png")
    return stream.getvalue()
