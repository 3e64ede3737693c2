"""Tables II and III as pictures: every row's errors by method, one panel an error."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dslam_mav.experiments.experiment import Result
from dslam_mav.experiments.pictures.style import SERIES, new_figure, tidy

if TYPE_CHECKING:
    from matplotlib.figure import Figure

METHODS = ("printed", "paper", "joint", "bound")


def error_bars(result: Result, seed: int) -> Figure:  # noqa: ARG001 - nothing to draw by chance
    """One mark a method, rows down the page."""
    shown = result.experiment.shown
    figure = new_figure(3.6 + 2.6 * len(shown), 1.6 + 0.3 * len(result.rows))
    names = result.experiment.columns
    labels = [" · ".join(row.label) for row in result.rows]
    for index, (axes, one) in enumerate(zip(figure.subplots(1, len(shown), sharey=True), shown, strict=True)):
        for method in METHODS:
            values = np.array([result.value(i, method, one) for i in range(len(labels))])
            look = SERIES[method] | (
                {"marker": "|", "markersize": 13, "markeredgewidth": 2} if method == "bound" else {}
            )
            axes.plot(values, np.arange(len(labels)), linestyle="none", **look)
        axes.set_xscale("log")
        axes.set_xlabel(f"{one.error}{f' ({one.unit})' if one.unit else ''}")
        if not index:
            axes.set_yticks(range(len(labels)), labels, fontsize=8)
            axes.set_ylabel(" · ".join(names), fontsize=8)
            axes.invert_yaxis()
            figure.legend(loc="outside lower center", ncols=4, fontsize=8)
        tidy(axes)
    return figure
