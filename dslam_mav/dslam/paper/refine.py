"""IV-D: refinement under noise. Amplitudes anew from readings, distances from amplitudes, then the path in turn."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.paper.layout import Failure, Layout, Projections, vertices
from dslam_mav.dslam.paper.options import RefinePoints
from dslam_mav.dslam.paper.scenery import Scenery

Array = NDArray[np.float64]


def refine(scene: Scenery, p: Projections, layout: Layout, points: RefinePoints) -> Layout | Failure:
    """The layout refined once; in 3-D and with one source only its amplitudes, since (22) is planar and takes two."""
    amplitude = amplitudes(scene, p, layout, points)
    if not (amplitude > 0.0).all():
        return Failure("The refined amplitudes are not all positive.")
    ln_a = np.log(amplitude)
    refined = layout._replace(ln_amplitude=ln_a, how=f"{layout.how}, refined")
    if p.dimensions != 2 or len(p.y) < 2:
        return refined
    side = _sides(layout, p.length)
    # d̃_kj = √(C ln(ã_k / ((πC)^{d/2} A_kj))) by (8), with π and C kept
    offset = side * np.sqrt(p.c * np.maximum(ln_a[:, None] - p.ln_height, 0.0))
    c1 = layout.direction[0]
    c2 = _turn(p, offset) @ c1  # C-A2
    x = float(c1 @ c2)
    if abs(x) > 1.0 - 1e-9:
        return Failure("The first two legs are parallel: (31) has no solution.")
    right = np.column_stack((p.y[:, 0], p.y[:, 1] + p.length[0] * x))
    source = np.linalg.solve(np.array([c1, c2]), right.T).T  # (31)
    direction = [c1, c2]
    for j in range(2, p.length.size):  # C-A5: (S_k − b_j)ᵀ c_j = Y_kj
        b = vertices(np.array(direction), p.length[:j])[-1]
        c = np.linalg.lstsq(source - b, p.y[:, j], rcond=None)[0]
        size = float(np.linalg.norm(c))
        if not size > 0.0:
            return Failure(f"Leg {j + 1} has no direction.")
        direction.append(c / size)
    return refined._replace(direction=np.array(direction), source=source)


def amplitudes(scene: Scenery, p: Projections, layout: Layout, points: RefinePoints) -> Array:
    """(K,) ã: the field re-synthesized at points equals the readings there, least squares (display of IV-D).

    P_kj = b_j + Y_kj c_j; the paper's further factor l_j is a misprint. Points no reading lies on either side of drop
    out. "readings" takes all places of readings instead (footnote 3).
    """
    b = vertices(layout.direction, scene.length)
    rows, right = [], []
    for j, (s, reading) in enumerate(zip(scene.s, scene.reading, strict=True)):
        at, measured = s, reading
        if points == "projections":
            order = np.argsort(s, kind="stable")
            inside = (p.y[:, j] >= s.min()) & (p.y[:, j] <= s.max())
            at = p.y[inside, j]
            measured = np.interp(at, s[order], reading[order])  # ĝ(P_kj), linear interpolation
        place = b[j] + at[:, None] * layout.direction[j]
        distance2 = ((place[:, None, :] - layout.source[None]) ** 2).sum(axis=2)
        rows.append(np.exp(-distance2 / p.c[:, j]) * (np.pi * p.c[:, j]) ** (-0.5 * p.dimensions))
        right.append(measured)
    return np.asarray(np.linalg.lstsq(np.vstack(rows), np.concatenate(right), rcond=None)[0])


def _sides(layout: Layout, length: Array) -> Array:
    """(K, L) ±1: on which side of each leg a source lies."""
    b, c = vertices(layout.direction, length)[:-1], layout.direction
    to_source = layout.source[:, None, :] - b
    return np.where(c[:, 0] * to_source[:, :, 1] - c[:, 1] * to_source[:, :, 0] < 0.0, -1.0, 1.0)


def _turn(p: Projections, offset: Array) -> Array:
    """(2, 2) the turn from leg 1 to leg 2 that (22) asks for, fitted to all sources."""
    before = np.column_stack((p.y[:, 0] - p.length[0], offset[:, 0]))
    after = np.column_stack((p.y[:, 1], offset[:, 1]))
    sine = (after[:, 0] * before[:, 1] - after[:, 1] * before[:, 0]).sum()
    cosine = (before * after).sum()
    size = max(float(np.hypot(sine, cosine)), 1e-300)
    return np.array([[cosine, -sine], [sine, cosine]]) / size
