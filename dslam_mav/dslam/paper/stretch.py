"""Where a source is lost on some legs: the algebra on the legs between, and the other legs' directions from readings.

PAPER DEVIATION: the paper takes every centre of every leg. Without noise a path of a few legs already has the sources,
and C-A5 finds the direction of each leg further from where the sources are; here by the readings, not by the centres.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.paper.layout import Layout, vertices
from dslam_mav.dslam.paper.logarithms import ln_sum, logarithms
from dslam_mav.dslam.paper.polish import spread2
from dslam_mav.dslam.paper.scenery import Scenery

Array = NDArray[np.float64]

SURE = (1e6, 1e9)  # condition up to which a leg's centres are used
LEAST_LEGS = 3
HEADINGS = 720
FINER = 30  # halvings of the grid's spacing


def stretches(condition: Array) -> list[tuple[int, int]]:
    """Runs [first, last) of legs whose centres are sure, and the surest three, none being all legs."""
    found = [_longest(condition <= most) for most in SURE]
    worst = np.array([condition[i : i + LEAST_LEGS].max() for i in range(len(condition) - LEAST_LEGS + 1)])
    first = int(np.argmin(worst))
    found.append((first, first + LEAST_LEGS))
    whole = (0, len(condition))
    return [x for x in dict.fromkeys(found) if x[1] - x[0] >= LEAST_LEGS and x != whole]


def _longest(sure: NDArray[np.bool_]) -> tuple[int, int]:
    best, first = (0, 0), 0
    for j, good in enumerate([*sure.tolist(), False]):
        if not good:
            best, first = max(best, (first, j), key=lambda x: x[1] - x[0]), j + 1
    return best


def stretch_of(scene: Scenery, first: int, last: int) -> Scenery:
    """The scene of legs `first` … `last` − 1 alone."""
    own = slice(first, last)
    return replace(
        scene, s=scene.s[own], reading=scene.reading[own], growth=scene.growth[own], length=scene.length[own]
    )


def extended(scene: Scenery, layout: Layout, first: int) -> Layout:
    """The layout of a stretch that begins at leg `first`, with all other legs put on in the plane, one by one."""
    b = vertices(layout.direction, scene.length[first : first + len(layout.direction)])
    direction = list(layout.direction)
    end = b[-1]
    for j in range(first + len(direction), scene.length.size):
        direction.append(_heading(scene, layout, j, end, 0.0))
        end = end + scene.length[j] * direction[-1]
    begin = b[0]
    for j in reversed(range(first)):
        direction.insert(0, _heading(scene, layout, j, begin, float(scene.length[j])))
        begin = begin - scene.length[j] * direction[0]
    return layout._replace(direction=np.array(direction), source=layout.source - begin, how=f"{layout.how}, extended")


def _heading(scene: Scenery, layout: Layout, j: int, corner: Array, at: float) -> Array:
    """(2,) the direction of leg `j` that fits its readings best, given the place `corner` at distance `at` along it."""
    ln = logarithms(scene.s[j], scene.reading[j], scene.offset)
    spread = spread2(scene, j, ln)[:, None]

    def cost(angle: float) -> float:
        c = np.array([np.cos(angle), np.sin(angle)])
        off = layout.source - (corner + (ln.s[:, None] - at) * c)[:, None, :]
        value = ln_sum(layout.ln_amplitude - np.log(np.pi * spread) - (off**2).sum(axis=2) / spread)[0]
        return float((((ln.value - value) * ln.weight) ** 2).sum())

    spacing = 2.0 * np.pi / HEADINGS
    best = min((spacing * i for i in range(HEADINGS)), key=cost)
    for _ in range(FINER):
        spacing *= 0.5
        best = min((best - spacing, best, best + spacing), key=cost)
    return np.array([np.cos(best), np.sin(best)])
