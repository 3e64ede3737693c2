"""What a path sees, as a map: the path, the area sources are in, the error to expect of one wherever it lies."""

from __future__ import annotations

from io import BytesIO
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dslam_mav.experiments.pictures.style import new_figure
from dslam_mav.experiments.sight import Sight

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

LEVELS_M = (0.0, 1.0, 1.5, 2.0, 3.0, 5.0, 10.0, 20.0)
COLOURS = ("#00204c", "#213d6b", "#555b6c", "#7b7a77", "#a59c74", "#d3c064", "#ffe945")  # cividis: dark sees well
UNSEEN = "#ffffff"
PALETTE = 48  # colours of the file


def sight_png(seen: Sight, path: Array, area_m: tuple[Array, Array], title: str) -> bytes:
    """A PNG of few colours; `path` (L+1, 2), `area_m` its lowest and highest corner (2,)."""
    from matplotlib.colors import BoundaryNorm, ListedColormap
    from matplotlib.patches import Patch, Rectangle

    figure = new_figure(5.2, 4.3)
    axes: Axes = figure.add_subplot()
    colours = ListedColormap(COLOURS)
    error = np.where(seen.error_m < LEVELS_M[-1], seen.error_m, np.nan)
    axes.set_facecolor(UNSEEN)
    low, high = (seen.x_m[0], seen.y_m[0]), (seen.x_m[-1], seen.y_m[-1])
    axes.add_patch(
        Rectangle(low, high[0] - low[0], high[1] - low[1], facecolor=UNSEEN, edgecolor="#999999", hatch="////")
    )
    drawn = axes.pcolormesh(
        seen.x_m, seen.y_m, error, cmap=colours, norm=BoundaryNorm(LEVELS_M, len(COLOURS)), shading="nearest"
    )
    bar = figure.colorbar(drawn, ax=axes, ticks=LEVELS_M[:-1], shrink=0.9)
    bar.set_label("90 % error of a source there (m)")
    corner, far = area_m
    axes.add_patch(
        Rectangle(tuple(corner), *(far - corner), fill=False, edgecolor="#d55e00", linewidth=1.6, linestyle="--")
    )
    axes.plot(*path.T, color="#ffffff", linewidth=4.2)
    axes.plot(*path.T, color="#000000", linewidth=1.8)
    axes.plot(*path[0], "o", color="#000000", markeredgecolor="#ffffff", markersize=8)
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_aspect("equal")
    axes.set_xlabel("east (m)")
    axes.set_ylabel("north (m)")
    axes.set_title(title, fontsize=10)
    axes.legend(
        handles=[Patch(facecolor=UNSEEN, edgecolor="#999999", hatch="////", label="not seen")],
        loc="lower right", fontsize=8, framealpha=1.0,
    )  # fmt: skip
    return _few_colours(figure)


def _few_colours(figure: Figure) -> bytes:
    """As an indexed PNG."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from PIL import Image

    canvas: Any = FigureCanvasAgg(figure)  # matplotlib's canvas carries no types
    canvas.draw()
    picture = (
        Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB").quantize(PALETTE, dither=Image.Dither.NONE)
    )
    file = BytesIO()
    picture.save(file, "PNG", optimize=True)
    return file.getvalue()
