"""What all pictures share. Colours: Okabe and Ito's, for colour-blind eyes; every series has its own mark."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

TRUTH: dict[str, Any] = {"color": "#000000"}
SERIES: dict[str, dict[str, Any]] = {
    "printed": {"color": "#000000", "marker": "D", "label": "printed in the paper"},
    "paper": {"color": "#D55E00", "marker": "o", "label": "the paper's method"},
    "fitted": {"color": "#CC79A7", "marker": "^", "label": "the same, fitted to the leg"},
    "joint": {"color": "#0072B2", "marker": "s", "label": "joint"},
    "bound": {"color": "#009E73", "marker": "_", "label": "Cramér–Rao bound"},
}
FIELD_MAP = "Greys"


def new_figure(width_in: float, height_in: float) -> Figure:
    """A figure that is not registered anywhere: no window, no global state."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width_in, height_in), dpi=150, layout="constrained")


def tidy(axes: Axes) -> None:
    """Light grid, no frame above and to the right."""
    axes.grid(True, which="major", color="#dddddd", linewidth=0.6)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
