"""The rows of the tables, as text."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from dslam_mav.dslam.scoring import Score, line_rms_m, match
from dslam_mav.records import Estimate, Flight
from dslam_mav.report.leg_plots import residual_by_leg
from dslam_mav.report.numbers import UNKNOWN, degrees, degrees_with_sd, fixed, significant, with_sd


@dataclass(frozen=True, slots=True)
class SourceRow:
    """One source; `position` has one text per axis, `truth` is empty where it is not known."""

    name: str
    position: tuple[str, ...]
    sd_m: str
    sd_path_m: str
    peak: str
    amplitude: str
    activation_s: str
    error_m: str
    truth: str


@dataclass(frozen=True, slots=True)
class LegRow:
    """One leg; `turn` is the turn at its start, `end` its last vertex, `end_error_m` that vertex' error."""

    number: int
    length_m: str
    heading: str
    turn: str
    end: str
    end_error_m: str
    readings: str
    residual_rms: str


@dataclass(frozen=True, slots=True)
class AlternativeRow:
    """One solution beside the best; distances are between its sources and path and the best's."""

    name: str
    delta: str
    likelihood: str
    sources_m: str
    path_m: str


def axis_names(estimate: Estimate) -> tuple[str, ...]:
    """The names of the axes of the estimate's gauge, one per dimension."""
    names = ("east", "north", "up") if estimate.gauge == "anchored" else ("x", "y", "z")
    return names[: estimate.sources.position_m.shape[1]]


def parameter_sd(estimate: Estimate, weights: Mapping[str, float]) -> float:
    """The standard deviation of Σ weight · parameter over named parameters; NaN if none was estimated."""
    weight = np.array([weights.get(name, 0.0) for name in estimate.parameter_names])
    if not weight.any():
        return math.nan
    return math.sqrt(max(0.0, float(weight @ estimate.parameter_covariance @ weight)))


def source_rows(estimate: Estimate, result: Score | None) -> tuple[SourceRow, ...]:
    """A row for each source, in the estimate's order."""
    rows = []
    sources, d = estimate.sources, estimate.sources.position_m.shape[1]
    whole = np.sqrt(np.trace(estimate.path_aligned_covariance_m2, axis1=1, axis2=2) / d)
    for k in range(len(sources)):
        axis_sd = np.sqrt(np.diag(estimate.position_covariance_m2[k]))
        real = result.matching[k] if result is not None else None
        amplitude, peak = float(sources.amplitude[k]), float(sources.peak_reading[k])
        name = f"ln amplitude {k + 1}"
        amplitude_sd = abs(amplitude) * parameter_sd(estimate, {name: 1.0})
        # peak = a (πC)^(−d/2): an uncertain spread makes the peak surer than the amplitude.
        peak_sd = abs(peak) * parameter_sd(estimate, {name: 1.0, "ln C": -0.5 * d})
        truth = () if result is None or real is None else result.truth.source_position_m[real]
        rows.append(
            SourceRow(
                name=f"S{k + 1}",
                position=tuple(with_sd(p, s) for p, s in zip(sources.position_m[k], axis_sd, strict=True)),
                sd_m=significant(float(estimate.sd_m[k]), 2),
                sd_path_m=significant(float(whole[k]), 2),
                peak=with_sd(peak, peak_sd),
                amplitude=with_sd(amplitude, amplitude_sd),
                activation_s=significant(float(sources.activation_s[k]), 4),
                error_m=UNKNOWN if result is None else significant(float(result.source_error_m[k]), 2),
                truth=", ".join(fixed(float(p), 2) for p in truth),
            )
        )
    return tuple(rows)


def leg_rows(flight: Flight, estimate: Estimate, result: Score | None) -> tuple[LegRow, ...]:
    """A row for each leg of the path."""
    residuals = residual_by_leg(flight, estimate)
    headings, vertices = estimate.path.heading_rad, estimate.path.vertices_m
    errors = result.vertex_error_m if result is not None else np.empty(0)
    rows = []
    for j, heading in enumerate(headings):
        residual = residuals[j] if residuals is not None and j < len(residuals) else np.empty(0)
        rows.append(
            LegRow(
                number=j + 1,
                length_m=significant(float(np.linalg.norm(vertices[j + 1] - vertices[j])), 4),
                heading=degrees_with_sd(heading, parameter_sd(estimate, {f"heading of leg {j + 1}": 1.0})),
                turn=degrees(heading - headings[j - 1]) if j else UNKNOWN,
                end=", ".join(fixed(float(p), 2) for p in vertices[j + 1]),
                end_error_m=_distance(float(errors[j + 1])) if j + 1 < errors.size else UNKNOWN,
                readings=f"{flight.legs[j].reading.size:,}" if j < len(flight.legs) else UNKNOWN,
                residual_rms=significant(float(np.sqrt(np.mean(residual**2))), 2) if residual.size else UNKNOWN,
            )
        )
    return tuple(rows)


def alternative_rows(estimate: Estimate) -> tuple[AlternativeRow, ...]:
    """A row for each alternative: how much less likely, and how far away."""
    rows = []
    for i, other in enumerate(estimate.alternatives):
        delta = 2.0 * (estimate.log_likelihood - other.log_likelihood)
        mine, theirs = match(estimate.sources.position_m, other.sources.position_m)
        moved = np.linalg.norm(estimate.sources.position_m[mine] - other.sources.position_m[theirs], axis=1)
        same_path = estimate.path.vertices_m.shape == other.path.vertices_m.shape
        offset = other.path.vertices_m - estimate.path.vertices_m if same_path else np.empty((0, 2))
        rows.append(
            AlternativeRow(
                name=f"Alternative {i + 1}",
                delta=significant(delta, 3),
                likelihood=significant(math.exp(-0.5 * delta), 2),
                sources_m=", ".join(_distance(float(m)) for m in moved),
                path_m=significant(line_rms_m(offset, estimate.path.vertices_m), 2) if same_path else UNKNOWN,
            )
        )
    return tuple(rows)


def fit_rows(estimate: Estimate) -> tuple[tuple[str, str], ...]:
    """The medium as fitted, and how well."""
    medium = estimate.medium
    activation = medium.activation_s
    spread_sd = 0.5 * estimate.spread_m * parameter_sd(estimate, {"ln C": 1.0})
    ambient = math.nan if medium.ambient is None else medium.ambient
    mu = medium.diffusivity_m2_s
    known = estimate.residual.size > 0
    rows = [
        ("Field", "static: still at the first reading" if medium.static else "evolving during the flight"),
        ("Spread √C at the first reading", f"{with_sd(estimate.spread_m, spread_sd)} m"),
        ("Diffusivity μ", "not told apart from age" if mu is None else f"{significant(mu, 4)} m²/s"),
        (
            "Activation",
            f"{significant(activation, 4)} s" if isinstance(activation, (int, float)) else "not known",
        ),
        ("Ambient reading", with_sd(ambient, parameter_sd(estimate, {"ambient": 1.0}))),
        ("Noise, standard deviation", significant(estimate.noise_sd, 3)),
        ("Residuals, rms", significant(float(np.sqrt(np.mean(estimate.residual**2))), 3) if known else UNKNOWN),
        ("Log-likelihood", fixed(estimate.log_likelihood, 2)),
        ("Dimensions", str(medium.dimensions)),
    ]
    if medium.ambient_drift_per_s:
        sd = parameter_sd(estimate, {"ambient drift": 1.0})
        rows.append(("Ambient drift", f"{with_sd(medium.ambient_drift_per_s, sd)} a second"))
    if medium.sensor_lag_s:
        rows.append(("Sensor lag", f"{significant(medium.sensor_lag_s, 3)} s"))
    return tuple(rows)


def error_rows(result: Score) -> tuple[tuple[str, str], ...]:
    """Errors against truth, ours in metres and the paper's relative ones."""
    amplitudes = ", ".join(_percent(e) for e in result.amplitude_relative_error)
    lines = significant(result.paper_lines, 3)
    if math.isinf(result.paper_lines):
        lines += ": the path meets home"
    return (
        ("Number of sources", "agrees with truth" if result.same_number else "does not agree with truth"),
        ("Sources, rms", f"{significant(result.source_error_rms_m, 3)} m"),
        ("Path along its whole length, rms", f"{significant(result.path_error_rms_m, 3)} m"),
        ("Farthest corner of the path", f"{significant(float(result.vertex_error_m.max()), 3)} m"),
        ("Amplitudes", amplitudes),
        (f"The paper’s E_sources ({result.paper_frame})", significant(result.paper_sources, 3)),
        (f"The paper’s E_lines ({result.paper_frame})", lines),
        ("The paper’s E_amp", significant(result.paper_amplitudes, 3)),
    )


def _distance(value_m: float) -> str:
    """A distance between two places; what is left of rounding, in the estimate or on the wire, is no distance."""
    if value_m < 1e-9:
        return "0"
    return "<\u00a00.001" if value_m < 5e-4 else significant(value_m, 2)


def _percent(share: float) -> str:
    if math.isnan(share):
        return UNKNOWN
    return "<\u00a00.01\u00a0%" if share < 1e-4 else f"{significant(100.0 * share, 2)}\u00a0%"
