"""Fig. 14: a triangle over a recorded spot; what it reads, and where the source is found."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dslam_mav.experiments.experiment import Result
from dslam_mav.experiments.pictures.style import FIELD_MAP, SERIES, new_figure, tidy
from dslam_mav.experiments.trials import generator

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LEGS = ("#0072B2", "#D55E00", "#E69F00")


def recordings(result: Result, seed: int) -> Figure:
    """A row of panels a recording: readings along each leg, the frame with the flight, errors over all trials."""
    figure = new_figure(11.0, 3.3 * len(result.rows))
    panels = figure.subplots(len(result.rows), 3, squeeze=False)
    for i, row in enumerate(result.rows):
        rng = generator(result.experiment.name, i, 0, seed)
        world = row.world.placed(rng)
        flight = world.flight(rng)
        left, middle, right = panels[i]
        for j, leg in enumerate(flight.legs):
            left.plot(leg.distance_m, leg.reading, color=LEGS[j], label=f"leg {j + 1}")
        left.set(xlabel="distance (√C)", ylabel="reading", title=row.label[0])
        left.legend(fontsize=7)
        tidy(left)
        recorded = world.image
        if recorded is not None:
            middle.imshow(recorded[0], extent=recorded[1], cmap=FIELD_MAP, origin="upper")
        b = world.truth.vertices_m
        for j, colour in enumerate(LEGS):
            middle.plot(*b[j : j + 2].T, color=colour, linewidth=2.0)
        middle.plot(0.0, 0.0, "*", color="#ffffff", markeredgecolor="#000000", markersize=12, label="true source")
        middle.set(xlabel="x (√C)", ylabel="y (√C)", xlim=(-2.8, 2.8), ylim=(-2.8, 2.8), title="one of the flights")
        middle.legend(fontsize=7)
        _errors(right, result, i)
    return figure


def _errors(axes: Axes, result: Result, row: int) -> None:
    methods = ("printed", "paper", "joint")
    for m, method in enumerate(methods):
        look = SERIES[method]
        values = [result.value(row, method, shown) for shown in result.experiment.shown]
        at = np.arange(len(values)) + 0.26 * (m - 1)
        label = "the paper's, by leg length" if method == "printed" else look["label"]
        axes.bar(at, values, 0.24, color=look["color"], label=label)
    axes.set_xticks(range(len(result.experiment.shown)), [f"τ {s.error}" for s in result.experiment.shown])
    axes.set(ylabel="mean distance ε (√C)", title="error")
    axes.set_ylim(top=1.45 * axes.get_ylim()[1])
    axes.legend(fontsize=7)
    tidy(axes)
