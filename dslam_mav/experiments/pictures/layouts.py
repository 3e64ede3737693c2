"""Figs. 7–10 and 13: where everything is, what was read, what was reconstructed, what that would read."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dslam_mav.experiments.errors import in_scene
from dslam_mav.experiments.experiment import Result
from dslam_mav.experiments.measures import AS_PRINTED, estimates, readings_of
from dslam_mav.experiments.pictures.style import SERIES, new_figure, tidy
from dslam_mav.experiments.trials import Row, generator
from dslam_mav.records import Estimate

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]


def scene_picture(result: Result, seed: int) -> Figure:
    """Truth, readings, both methods' reconstructions over the truth, and resynthesised readings; one flight."""
    row = result.rows[0]
    flight = row.world.flight(generator(result.experiment.name, 0, 0, seed))
    options = row.measure.keywords if isinstance(row.measure, partial) else {}
    found = estimates(
        flight, row.world, options=options.get("options", AS_PRINTED), unknown=options.get("unknown", False)
    )
    figure = new_figure(9.5, 7.6)
    space = row.world.truth.vertices_m.shape[1] == 3
    kind = {"projection": "3d"} if space else {}
    readings = readings_of(flight)
    _map(figure.add_subplot(2, 2, 1, **kind), row, {}, "(a) true sources and trajectory")
    _series(figure.add_subplot(2, 2, 2), readings, {}, "(b) readings")
    _map(figure.add_subplot(2, 2, 3, **kind), row, found, "(c) reconstruction, over the truth")
    _series(figure.add_subplot(2, 2, 4), readings, found, "(d) resynthesised readings")
    return figure


def _map(axes: Any, row: Row, found: dict[str, Estimate], title: str) -> None:
    truth = row.world.truth
    thick = 3.5 if found else 1.5
    axes.plot(*truth.vertices_m.T, color="#bbbbbb" if found else "#000000", linewidth=thick, label="true trajectory")
    places = truth.source_position_m.T
    axes.plot(*places, "*", color="#bbbbbb" if found else SERIES["paper"]["color"], markersize=15, label="true sources")
    if not found:
        axes.plot(*truth.vertices_m[:1].T, "o", color="#000000", markersize=5, label="start")
    for name, estimate in reversed(found.items()):  # the paper's dashes over the joint's line
        placed = in_scene(estimate, row.world)
        look = SERIES[name]
        if placed is None:
            axes.plot([], [], color=look["color"], label=f"{look['label']}: no answer")
            continue
        sources, vertices, _ = placed
        dash = "--" if name == "paper" else "-"
        axes.plot(*vertices.T, color=look["color"], linewidth=1.3, linestyle=dash)
        mark = {"markerfacecolor": "none"} if name == "paper" else {}
        axes.plot(*sources.T, color=look["color"], marker=look["marker"], linestyle="none", **mark, label=look["label"])
    axes.set(xlabel="x (m)", ylabel="y (m)", title=title, aspect="equal")
    if truth.vertices_m.shape[1] == 3:
        axes.set(zlabel="z (m)")
    else:
        axes.set_aspect("equal", adjustable="datalim")
        tidy(axes)
    axes.legend(fontsize=7, loc="best")


def _series(axes: Any, readings: Array, found: dict[str, Estimate], title: str) -> None:
    n = np.arange(readings.size)
    if not found:
        axes.plot(n, readings, ".", color="#000000", markersize=2.0)
    else:
        axes.plot(n, readings, ".", color="#bbbbbb", markersize=3.0, label="measured")
    for name, estimate in reversed(found.items()):  # the paper's dashes over the joint's line
        if estimate.residual.size == readings.size and np.isfinite(estimate.residual).all():
            dash = "--" if name == "paper" else "-"
            look = SERIES[name]
            axes.plot(n, readings - estimate.residual, dash, color=look["color"], linewidth=1.1, label=look["label"])
    axes.set(xlabel="reading", ylabel="value", title=title)
    if found:
        axes.legend(fontsize=7)
    tidy(axes)
