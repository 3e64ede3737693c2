"""IV-C, Table I rows 4 and 5: separated sources and the path of a flight along r(t) = Σ_i c_i φ_i(t), static field.

With C known the answer is unique up to a turn and a mirror image. With unknown activation times (row 5) it is unique up
to scale only: (c, S, C, a) → (λc, λS, λ²C, λ^d a) changes no reading; the shape is then in `diagnostics["shape"]`, in
units of √C. Gauge: where a constant is among the φ_i the path begins at 0, otherwise its own origin stays; its first
step points along +x, and it first leaves that line towards +y.
"""

from __future__ import annotations

from dataclasses import replace
from math import comb
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.paper import curve as algebra
from dslam_mav.dslam.paper.answer import MISFIT, UNEXPLAINED, nothing
from dslam_mav.dslam.paper.candidates import ROUNDING, WINDOW
from dslam_mav.dslam.paper.curve import Shape
from dslam_mav.dslam.paper.frozen import known_activation, known_spread2_m2
from dslam_mav.dslam.paper.layout import Failure
from dslam_mav.dslam.paper.options import PaperOptions
from dslam_mav.dslam.paper.separated import split
from dslam_mav.records import Estimate, Flight, Medium, ParametricPath, Path, Sources, Verdict

Array = NDArray[np.float64]
Index = NDArray[np.intp]

SHARES = (0.1, 0.05, 0.2, 0.02, 0.35)  # of the largest reading, tried as ε
ALONE = 0.05  # share of a part's largest reading from which its source is taken to be alone
CLEAR_SDS = 10.0  # readings nearer to the noise have no logarithm worth having
SAME_SOURCE = 0.5  # two parts' sources nearer than this are one, in √C, where K is not known
HIGHEST = 1e4  # reading at a source, over the largest that was read
LEAVES = 1e-3  # share of the path's extent by which it leaves its first line


class Told(NamedTuple):
    """A shape and what it leaves of the readings (N,), both without units; whether they settle it."""

    shape: Shape
    residual: Array
    settled: bool

    @property
    def cost(self) -> float:
        """Squared residual."""
        return float(self.residual @ self.residual)


def estimate_parametric(
    flight: Flight, path: ParametricPath, medium: Medium, n_sources: int | None, max_sources: int, options: PaperOptions
) -> Estimate:
    """Sources and path of a parametric flight; for unknown activation times only their shape."""
    k = n_sources or 1
    reading = path.reading - (medium.ambient or 0.0)
    if reading.size < path.basis.shape[1] + 3 * k:
        return nothing(flight, medium, k, Verdict.TOO_FEW_DATA, f"Too few readings for this path: {reading.size}.")
    unit = float(reading.max())
    if not unit > 0.0:
        return nothing(flight, medium, k, Verdict.NOT_IDENTIFIABLE, "No reading is above the ambient level.")
    found = _told(algebra.independent(path.basis), reading / unit, n_sources, max_sources, options)
    if isinstance(found, Failure):
        return nothing(flight, medium, k, Verdict.NOT_IDENTIFIABLE, found.reason)
    verdict, reason = _verdict(found, reading / unit)
    best, *others = [_answer(flight, path, medium, told, unit, (verdict, reason)) for told in found]
    return replace(best, alternatives=tuple(others) if verdict is not Verdict.NOT_CONVERGED else ())


def _told(
    basis: algebra.Basis, reading: Array, n_sources: int | None, most: int, options: PaperOptions
) -> list[Told] | Failure:
    """The shapes that stand, over all ε, best first."""
    found: list[Told] = []
    why: Failure | None = None
    rng = np.random.default_rng(0)  # starts only; the same flight has the same answer
    shares = SHARES if options.separation_epsilon is None else (options.separation_epsilon,)
    for share in shares:
        parts = _parts(reading, share)
        shapes = _shapes(basis, reading, parts, n_sources, most, rng)
        if isinstance(shapes, Failure):
            why = why or shapes
            continue
        found += [told for told in (Told(*algebra.polish(basis, reading, s)) for s in shapes) if _sensible(told)]
        if found and min(told.cost for told in found) <= reading.size * max(MISFIT * _jitter(reading), ROUNDING) ** 2:
            break
    found.sort(key=lambda told: told.cost)
    if not found:
        return why or Failure("No path with sources in reach has these readings.")
    variance = max(found[0].cost / reading.size, ROUNDING**2)
    kept: list[Told] = []
    for told in found:
        same = any(algebra.alike(told.shape, other.shape) for other in kept)
        if (told.cost - found[0].cost) / variance < WINDOW and not same:
            kept.append(told)
    return kept


def _sensible(told: Told) -> bool:
    """Whether no source is far off and beyond all measure, which fits any smooth remainder."""
    return bool(
        np.isfinite(told.residual).all()
        and np.abs(told.residual).max() < HIGHEST
        and (told.shape.ln_height < np.log(HIGHEST)).all()
    )


def _jitter(reading: Array) -> float:
    """Noise from differences along the flight, of the order that sees the field least; never less than it."""
    orders = range(3, min(9, reading.size))
    return min(float(np.sqrt(np.mean(np.diff(reading, n) ** 2) / comb(2 * n, n))) for n in orders)


def _parts(reading: Array, share: float) -> list[Index]:
    """Groups of readings above ε, each without its faint edges."""
    floor = CLEAR_SDS * _jitter(reading)
    runs = split(np.arange(float(reading.size)), reading, share)
    return [run[reading[run] > max(ALONE * reading[run].max(), floor)].astype(np.intp) for run in runs]


def _shapes(
    basis: algebra.Basis,
    reading: Array,
    parts: list[Index],
    n_sources: int | None,
    most: int,
    rng: np.random.Generator,
) -> list[Shape] | Failure:
    """Regression with one source a part; parts of the same source joined, and regression again."""
    if len(parts) < (n_sources or 1):
        return Failure(f"{len(parts)} separate groups of readings, {n_sources} sources expected (IV-C).")
    each = algebra.regress(basis, reading, parts)
    if isinstance(each, Failure):
        return each
    found = algebra.shapes(each, rng)
    if isinstance(found, Failure) or len(parts) == 1:
        return found
    joined = _joined(found[0].source, n_sources, most)
    if len(joined) == len(parts):
        return found
    again = algebra.regress(basis, reading, [np.concatenate([parts[i] for i in c]) for c in joined])
    return again if isinstance(again, Failure) else algebra.shapes(again, rng)


def _joined(place: Array, n_sources: int | None, most: int) -> list[list[int]]:
    """Parts (G, 2) put together by their sources' places: down to K of them, or as long as they are near."""
    clusters = [[i] for i in range(len(place))]
    while len(clusters) > 1:
        gap, m, n = min(
            (float(np.linalg.norm(place[a].mean(axis=0) - place[b].mean(axis=0))), m, n)
            for m, a in enumerate(clusters)
            for n, b in enumerate(clusters[:m])
        )
        if len(clusters) <= (n_sources or most) and (n_sources is not None or gap > SAME_SOURCE):
            break
        clusters[n] += clusters.pop(m)
    return clusters


def _answer(
    flight: Flight, path: ParametricPath, medium: Medium, told: Told, unit: float, said: tuple[Verdict, str]
) -> Estimate:
    k, d = len(told.shape.source), medium.dimensions
    c_m2 = known_spread2_m2(float(path.time_s[0]), medium)
    basis = algebra.independent(path.basis)
    turn = _gauge(basis.functions @ told.shape.coefficient)
    order = np.argsort(-told.shape.ln_height, kind="stable")
    places = basis.functions @ told.shape.coefficient @ turn.T  # in √C, as all that follows
    source = (told.shape.source @ turn.T)[order]
    coefficients = np.asarray(np.linalg.lstsq(path.basis, places, rcond=None)[0], dtype=np.float64)
    peak = np.exp(told.shape.ln_height[order]) * unit
    verdict, reason = said
    free = max(path.reading.size - basis.functions.shape[1] * d - k * (d + 1) + 1, 1)
    noise = float(np.sqrt(told.cost / free)) * unit
    common: dict[str, Any] = {"residual": told.residual * unit, "noise_sd": noise}
    if c_m2 is None and verdict not in (Verdict.NOT_CONVERGED, Verdict.NOT_IDENTIFIABLE):
        shape = {"unit": "√C", "source": source, "places": places, "coefficients": coefficients, "peak_reading": peak}
        reason = "Without the activation time the readings tell the shape but not its scale (Table I, row 5)."
        empty = nothing(flight, medium, k, Verdict.NOT_IDENTIFIABLE, reason)
        return replace(empty, **common, unseen_directions=("scale",), diagnostics={"shape": shape})
    empty = nothing(flight, medium, k, verdict, reason)
    if c_m2 is None or verdict in (Verdict.NOT_CONVERGED, Verdict.NOT_IDENTIFIABLE):
        return replace(empty, **common)
    scale = float(np.sqrt(c_m2))
    step = np.diff(places, axis=0)
    tau = known_activation(medium)
    amplitude = peak * (np.pi * c_m2) ** (0.5 * d)
    n = path.reading.size
    return replace(
        empty,
        **common,
        sources=Sources(source * scale, amplitude, peak, np.full(k, np.nan if tau is None else tau)),
        path=Path(places * scale, np.arctan2(step[:, 1], step[:, 0]), coefficients * scale),
        spread_m=scale,
        log_likelihood=float(-0.5 * free - n * (0.5 * np.log(2.0 * np.pi) + np.log(max(noise, np.finfo(float).tiny)))),
    )


def _gauge(places: Array) -> Array:
    """(2, 2): the turn, or turn and mirror image, that fixes a curve's gauge."""
    step = places[1] - places[0]
    size = float(np.linalg.norm(step))
    c, s = step / size if size > 0.0 else (1.0, 0.0)
    off = (places - places[0]) @ np.array([-s, c])
    leaves = np.flatnonzero(np.abs(off) > LEAVES * np.ptp(places, axis=0).max())
    side = -1.0 if leaves.size and off[leaves[0]] < 0.0 else 1.0
    return np.array([[c, s], [-side * s, side * c]])


def _verdict(found: list[Told], reading: Array) -> tuple[Verdict, str]:
    rms, level = float(np.sqrt(np.mean(found[0].residual ** 2))), float(np.sqrt(np.mean(reading**2)))
    jitter = _jitter(reading)
    if rms > max(UNEXPLAINED * level, MISFIT * jitter):
        return Verdict.NOT_CONVERGED, f"The best path leaves {100.0 * rms / level:.0f} % of the readings unexplained."
    if rms > max(MISFIT * jitter, ROUNDING) and found[0].settled:
        return (
            Verdict.MODEL_MISFIT,
            "The best path leaves more than the readings' noise: sources overlap, or the field is another.",
        )
    if not found[0].settled:
        return Verdict.NOT_IDENTIFIABLE, "The readings leave the path's shape open: its functions allow others too."
    if len(found) > 1:
        return Verdict.AMBIGUOUS, f"{len(found)} paths fit the readings alike."
    return Verdict.IDENTIFIED, "One answer, by the Gram matrix of the path's coefficients."
