"""Layouts against the readings: which fits best, which others stand beside it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.paper.gauge import canonical
from dslam_mav.dslam.paper.layout import Failure, Layout, Projections, vertices
from dslam_mav.dslam.paper.options import PaperOptions
from dslam_mav.dslam.paper.polish import polish
from dslam_mav.dslam.paper.refine import refine
from dslam_mav.dslam.paper.scenery import Scenery, residual

Array = NDArray[np.float64]

WINDOW = 9.0  # 2Δ log-likelihood
ROUNDING = 1e-8  # sd of a reading, over the largest, below which differences between fits say nothing
HIGHEST = 1e8  # reading at a source, over the largest that was read
MOST_POLISHED = 6
SAME = 1e-3  # layouts nearer than this everywhere are one, in √C


class Candidate(NamedTuple):
    """A layout in the canonical gauge, C at the first reading (K,), and measured − model (N,)."""

    layout: Layout
    c_first: Array
    residual: Array

    @property
    def cost(self) -> float:
        """Squared residual over all readings."""
        with np.errstate(over="ignore"):  # a wrong pairing may ask for any amplitude
            return float(self.residual @ self.residual)


def candidate(scene: Scenery, layout: Layout, c_first: Array) -> Candidate:
    """The layout turned into the canonical gauge, sources by amplitude, judged by all readings."""
    move = canonical(layout.direction)
    order = np.argsort(-layout.ln_amplitude, kind="stable")
    turned = layout._replace(
        direction=layout.direction @ move.rotation.T,
        source=(layout.source @ move.rotation.T)[order],
        ln_amplitude=layout.ln_amplitude[order],
    )
    return Candidate(turned, c_first[order], residual(scene, turned, c_first[order]))


def with_refined(scene: Scenery, p: Projections, layout: Layout, options: PaperOptions) -> list[Candidate]:
    """The layout, or its refinement (IV-D) where that fits the readings better.

    PAPER DEVIATION: the paper refines always; without noise its linear interpolation only adds error.
    """
    plain = candidate(scene, layout, p.c_first)
    if not options.refine:
        return [plain]
    better = refine(scene, p, layout, options.refine_points)
    if isinstance(better, Failure):
        return [plain]
    refined = candidate(scene, better, p.c_first)
    return [refined if refined.cost < plain.cost else plain]


def polished(scene: Scenery, found: list[Candidate]) -> list[Candidate]:
    """Candidates, the nearest to the readings first, those polished that can be brought down to rounding.

    A field of known spread, free of noise, two sources or more: one leaves a direction free that no reading tells.

    PAPER DEVIATION: in an evolving field the paper stops at the approximation (IV-A); this takes the field as it is.
    """
    ranked = sorted((c for c in found if np.isfinite(c.cost)), key=lambda c: c.cost)
    done = []
    for c in ranked[:MOST_POLISHED]:
        better = polish(scene, c.layout)
        done.append(c if better is None else candidate(scene, better, c.c_first))
    return done + ranked[MOST_POLISHED:]


def standing(scene: Scenery, found: list[Candidate], n_parameters: int) -> list[Candidate]:
    """The best candidate and every different one within the window of it, best first."""
    finite = sorted((c for c in found if np.isfinite(c.cost) and _in_reach(c)), key=lambda c: c.cost)
    if not finite:
        return []
    if any(c.layout.rounded for c in finite):  # the others leave more than rounding of readings that have no noise
        finite = [c for c in finite if c.layout.rounded]
    variance = max(finite[0].cost / max(scene.n_readings - n_parameters, 1), ROUNDING**2)
    kept: list[Candidate] = []
    for c in finite:
        if (c.cost - finite[0].cost) / variance >= WINDOW:
            break
        if all(_apart(scene, c, other) > SAME for other in kept):
            kept.append(c)
    return kept


def _in_reach(c: Candidate) -> bool:
    """Whether no source is far off and beyond all measure."""
    ln_peak = c.layout.ln_amplitude - 0.5 * c.layout.source.shape[1] * np.log(np.pi * c.c_first)
    return bool((ln_peak < np.log(HIGHEST)).all())


def _apart(scene: Scenery, a: Candidate, b: Candidate) -> float:
    """The largest distance between sources of two candidates, whatever their order, or corners of their paths."""
    nearest = np.linalg.norm(a.layout.source[:, None] - b.layout.source[None], axis=2).min(axis=1).max()
    corners = vertices(a.layout.direction, scene.length) - vertices(b.layout.direction, scene.length)
    return float(max(nearest, np.linalg.norm(corners, axis=1).max()))
