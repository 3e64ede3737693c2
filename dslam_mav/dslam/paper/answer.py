"""From candidates to the public `Estimate`: gauge, order, units, verdict."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dslam_mav.dslam.field import peak_reading
from dslam_mav.dslam.paper.candidates import ROUNDING, Candidate
from dslam_mav.dslam.paper.frozen import known_activation
from dslam_mav.dslam.paper.gauge import Move, procrustes
from dslam_mav.dslam.paper.layout import vertices
from dslam_mav.dslam.paper.scenery import Scenery
from dslam_mav.records import Estimate, Flight, Medium, Path, Sources, Verdict

Array = NDArray[np.float64]

MISFIT = 2.0  # residual over the legs' own noise, from which the readings are said not to fit
LARGEST_ROUNDING = 1e-3  # residual over the largest reading, never more is taken for rounding
UNEXPLAINED = 0.3  # share of the readings' RMS left over, from which nothing is said to be found


NO_SDS = " The paper's method gives no standard deviations."
HELD_STILL = " The field evolves; each leg is read as if it stood still at its middle (IV-A): an approximation."
FAITHFUL_DIGITS = 6.0  # digits lost by the legs up to which rounding is no matter


class Levels(NamedTuple):
    """RMS of the readings and the noise of the legs, both without units, and the digits the worst leg loses."""

    readings: float
    noise: float
    digits_lost: float

    @property
    def rounding(self) -> float:
        """What rounding may leave of the readings: the legs lose digits, the geometry two or three more."""
        return float(min(max(ROUNDING, 1e-13 * 10.0 ** min(self.digits_lost, 300.0)), LARGEST_ROUNDING))

    @property
    def words(self) -> str:
        """A warning where the legs lose so much that it shows."""
        if self.digits_lost <= FAITHFUL_DIGITS:
            return ""
        return f" The worst leg loses {self.digits_lost:.0f} of its readings' 16 digits: a source is faint there."


def nothing(flight: Flight, medium: Medium, k: int, verdict: Verdict, reason: str) -> Estimate:
    """An estimate without an answer: shapes kept, positions NaN."""
    d = medium.dimensions
    curve = flight.parametric
    places = curve.reading.size if curve is not None else len(flight.legs) + 1
    coefficients = None if curve is None else np.full((curve.basis.shape[1], d), np.nan)
    return Estimate(
        sources=Sources(np.full((k, d), np.nan), *(np.full(k, np.nan) for _ in range(3))),
        path=Path(np.full((places, d), np.nan), np.full(places - 1, np.nan), coefficients),
        medium=medium,
        verdict=verdict,
        reason=reason,
        spread_m=float("nan") if medium.spread_m is None else float(medium.spread_m),
        position_covariance_m2=np.full((k, d, d), np.nan),
        path_aligned_covariance_m2=np.full((k, d, d), np.nan),
        parameter_covariance=np.empty((0, 0)),
        parameter_names=(),
        noise_sd=float("nan"),
        log_likelihood=float("nan"),
        residual=np.full(flight.n_readings, np.nan),
    )


def parameters(k: int, n_legs: int, d: int) -> int:
    """Free numbers of K sources and L legs in the canonical gauge."""
    turns = (n_legs - 1) if d == 2 else 2 * n_legs - 3
    return k * (d + 1) + turns


def assemble(
    flight: Flight,
    medium: Medium,
    scene: Scenery,
    found: list[Candidate],
    levels: Levels,
    known_points: Mapping[int, ArrayLike] | None,
) -> Estimate:
    """The best candidate with the others that stand as alternatives, and the verdict in words."""
    best, *others = [_one(flight, medium, scene, c, known_points) for c in found]
    verdict, reason = _verdict(found, scene, levels)
    if any(g.any() for g in scene.growth) and not found[0].layout.rounded:
        reason += HELD_STILL
    if verdict is Verdict.NOT_CONVERGED:
        empty = nothing(flight, medium, len(best.sources), verdict, reason)
        return replace(empty, residual=best.residual, noise_sd=best.noise_sd, diagnostics=best.diagnostics)
    alternatives = tuple(replace(e, verdict=verdict) for e in others)
    return replace(best, verdict=verdict, reason=f"{reason}{NO_SDS}", alternatives=alternatives)


def _verdict(found: list[Candidate], scene: Scenery, levels: Levels) -> tuple[Verdict, str]:
    rms = float(np.sqrt(found[0].cost / scene.n_readings))
    how, words = found[0].layout.how, "" if found[0].layout.rounded else levels.words
    if rms > max(UNEXPLAINED * levels.readings, MISFIT * levels.noise):
        share = rms / max(levels.readings, 1e-300)
        return (
            Verdict.NOT_CONVERGED,
            f"The best answer by {how} leaves {100.0 * share:.0f} % of the readings unexplained.",
        )
    if rms > max(MISFIT * levels.noise, levels.rounding):
        words = f"{rms / levels.noise:.2g} times the legs' own noise" if levels.noise > 0.0 else "more than nothing"
        reason = f"The answer by {how} leaves {words}: the algebra loses it on the way, or the field is another."
        return Verdict.MODEL_MISFIT, reason
    if len(found) > 1:
        return Verdict.AMBIGUOUS, f"{len(found)} answers by {how} fit the readings alike.{words}"
    return Verdict.IDENTIFIED, f"One answer, by {how}.{words}"


def _one(
    flight: Flight, medium: Medium, scene: Scenery, c: Candidate, known_points: Mapping[int, ArrayLike] | None
) -> Estimate:
    layout, d, unit = c.layout, scene.dimensions, scene.unit_m
    k, n = len(layout.source), scene.n_readings
    points, source = vertices(layout.direction, scene.length) * unit, layout.source * unit
    anchor = None if not known_points else _anchor(points, known_points)
    if anchor is not None:
        points, source = anchor.points(points), anchor.points(source)
    step = np.diff(points, axis=0)
    c_m2 = c.c_first * unit**2
    amplitude = np.exp(layout.ln_amplitude) * scene.unit_reading * unit**d
    activation = _activation(flight, medium, c_m2)
    free = max(n - parameters(k, len(step), d), 1)
    noise = float(np.sqrt(c.cost / free))
    floor = max(noise, np.finfo(float).tiny)
    return Estimate(
        sources=Sources(source, amplitude, peak_reading(amplitude, c_m2, d), activation),
        path=Path(points, np.arctan2(step[:, 1], step[:, 0])),
        medium=_fitted(medium, c_m2, activation),
        verdict=Verdict.IDENTIFIED,
        reason="",
        spread_m=float(np.sqrt(c_m2.mean())),
        position_covariance_m2=np.full((k, d, d), np.nan),
        path_aligned_covariance_m2=np.full((k, d, d), np.nan),
        parameter_covariance=np.empty((0, 0)),
        parameter_names=(),
        noise_sd=noise * scene.unit_reading,
        log_likelihood=float(
            -0.5 * free - n * (0.5 * np.log(2.0 * np.pi) + np.log(floor) + np.log(scene.unit_reading))
        ),
        residual=c.residual * scene.unit_reading,
        gauge="canonical" if anchor is None else "anchored",
        diagnostics={
            "how": layout.how,
            "cost": c.cost * scene.unit_reading**2,
            "n_readings": n,
            "rounded": layout.rounded,
        }
        | _mirror(anchor),
    )


def _anchor(points: Array, known_points: Mapping[int, ArrayLike]) -> Move:
    index = sorted(known_points)
    return procrustes(points[index], np.array([known_points[i] for i in index], dtype=np.float64))


def _mirror(anchor: Move | None) -> dict[str, Any]:
    return {} if anchor is None else {"mirror_known": anchor.mirror_known}


def _activation(flight: Flight, medium: Medium, c_m2: Array) -> Array:
    """(K,) τ: as known, or from C = 4μ(t_0 − τ) (IV-B, without its misprinted π); NaN where μ is not known."""
    tau = known_activation(medium)
    if tau is not None:
        return np.full(len(c_m2), tau)
    if medium.diffusivity_m2_s is None:
        return np.full(len(c_m2), np.nan)
    return np.asarray(flight.legs[0].time_s[0] - c_m2 / (4.0 * medium.diffusivity_m2_s))


def _fitted(medium: Medium, c_m2: Array, activation: Array) -> Medium:
    """The medium with what was found filled in."""
    if known_activation(medium) is not None or medium.spread_m is not None:
        return medium
    if np.isfinite(activation).all():
        return replace(medium, activation_s=tuple(activation.tolist()))
    one = bool(np.ptp(c_m2) <= 1e-12 * c_m2.max())
    return replace(medium, spread_m=float(np.sqrt(c_m2[0]))) if one else medium
