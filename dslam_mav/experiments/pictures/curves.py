"""Figs. 5, 6, 11 and 12: an error over one number."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dslam_mav.experiments.experiment import Result
from dslam_mav.experiments.measures import readings_held_still
from dslam_mav.experiments.pictures.style import SERIES, new_figure, tidy

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def field_held_still(result: Result, seed: int) -> Figure:
    """Fig. 5: readings along the line, of the field as it evolves and held still at the middle sample."""
    figure = new_figure(8.0, 3.2)
    for axes, index in zip(figure.subplots(1, 2), (0, len(result.rows) - 1), strict=True):
        row = result.rows[index]
        flight = row.world.flight(np.random.default_rng(seed))
        actual, still = readings_held_still(flight, row.world)
        s = flight.legs[0].distance_m
        axes.plot(s, actual, color=SERIES["joint"]["color"], linewidth=2.0, label="evolving field")
        axes.plot(s, still, color=SERIES["paper"]["color"], linestyle="--", label="held still at the middle sample")
        axes.set(xlabel="distance along the line (m)", ylabel="reading", title=f"T = {row.label[0]} s")
        axes.legend(fontsize=8, loc="upper left")
        axes.set_ylim(top=1.35 * max(actual.max(), still.max()))
        tidy(axes)
    return figure


def over_speed(result: Result, seed: int) -> Figure:  # noqa: ARG001 - nothing to draw by chance
    """Fig. 6: relative error against the speed."""
    figure = new_figure(5.6, 3.8)
    axes = figure.subplots()
    _lines(axes, result, logx=True)
    axes.axvline(11.0, color="#999999", linewidth=1.0, linestyle=":")
    axes.text(
        11.4, 0.97, "the paper: negligible above 11 m/s", fontsize=7, transform=axes.get_xaxis_transform(), va="top"
    )
    axes.set(xlabel="speed v = Ts/T (m/s)", ylabel="relative error of $Y_{k,1}$")
    axes.legend(fontsize=8)
    return figure


def over_snr(result: Result, seed: int) -> Figure:  # noqa: ARG001
    """Fig. 11: setting, and error against the noise."""
    figure = new_figure(9.0, 3.8)
    left, right = figure.subplots(1, 2, width_ratios=(1.0, 1.4))
    _setting(left, result)
    _lines(right, result)
    right.set(xlabel="SNR (dB)", ylabel="RMS error of $Y_{k,1}$ (m)")
    right.legend(fontsize=8)
    return figure


def over_distance(result: Result, seed: int) -> Figure:  # noqa: ARG001
    """Fig. 12: error against the distance between the sources."""
    figure = new_figure(5.6, 3.8)
    axes = figure.subplots()
    _lines(axes, result)
    axes.axvline(0.3, color="#999999", linewidth=1.0, linestyle=":")
    axes.text(0.31, 0.02, "the paper: difficult below 0.3 m", fontsize=7, transform=axes.get_xaxis_transform())
    axes.set(xlabel="distance between the sources (m)", ylabel="RMS error of $Y_{k,1}$ (m)")
    axes.legend(fontsize=8)
    return figure


def _lines(axes: Axes, result: Result, *, logx: bool = False) -> None:
    shown = result.experiment.shown[0]
    at = [float(row.label[0]) for row in result.rows]
    for method in (*shown.methods, "bound"):
        values = [result.value(i, method, shown) for i in range(len(at))]
        if not np.isfinite(values).any():
            continue
        look = dict(SERIES[method])
        if method == "bound":
            alone = ", this line" if "Y_all" in result.rows[0].limits else ""
            look |= {"linestyle": "--", "marker": "", "label": f"Cramér–Rao bound{alone}"}
        axes.plot(at, values, markersize=5, **look)
    whole = [row.limits.get("Y_all", np.nan) for row in result.rows]
    if np.isfinite(whole).any():
        axes.plot(at, whole, color=SERIES["bound"]["color"], linestyle=":", label="Cramér–Rao bound, whole flight")
    axes.set_yscale("log")
    if logx:
        axes.set_xscale("log")
        axes.set_xticks(at, [f"{x:g}" for x in at])
        axes.minorticks_off()
    tidy(axes)


def _setting(axes: Axes, result: Result) -> None:
    truth = result.rows[0].world.truth
    b = truth.vertices_m
    axes.plot(*b.T, color="#999999", linewidth=1.0, label="rest of the flight")
    axes.plot(*b[:2].T, color="#000000", linewidth=2.0, label="the line")
    axes.plot(*truth.source_position_m.T, "*", color=SERIES["paper"]["color"], markersize=12, label="sources")
    axes.set(xlabel="x (m)", ylabel="y (m)", aspect="equal")
    axes.margins(y=0.2)
    axes.legend(fontsize=7, loc="upper center", ncols=3)
    tidy(axes)
