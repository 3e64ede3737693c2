"""From records to what the page shows: every number formatted, every picture as drawing units. Pure."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from dslam_mav.dslam.growth import Growth, growth
from dslam_mav.dslam.scoring import Score, has_positions, score, truth_in_gauge
from dslam_mav.records import Estimate, Flight, Truth
from dslam_mav.records.words import count
from dslam_mav.report import rows, words
from dslam_mav.report.beside import Beside
from dslam_mav.report.field_map import FieldMap, common_window, field_map
from dslam_mav.report.foreseen import Background, Foreseen, foreseen, realised
from dslam_mav.report.growth_plot import GrowthPlot, growth_plot
from dslam_mav.report.leg_plots import LegPlots, leg_plots
from dslam_mav.report.numbers import significant

MAX_ALTERNATIVES = 8  # drawn; the table lists them all


@dataclass(frozen=True, slots=True, eq=False)
class ReportData:
    """One flight and what became of it. `truth` is in the scene's frame; `facts` are shown as they are."""

    flight: Flight
    estimate: Estimate
    truth: Truth | None
    title: str
    facts: Mapping[str, str] = field(default_factory=dict)
    warnings: Sequence[str] = ()
    background: Background | None = None
    compass: Beside | None = None


@dataclass(frozen=True, slots=True)
class Tile:
    """One number of the headline."""

    label: str
    value: str
    unit: str = ""
    note: str = ""


@dataclass(frozen=True, slots=True)
class Solution:
    """One arrangement of sources and legs: the best, or an alternative."""

    tab: str
    note: str
    picture: FieldMap
    sources: tuple[rows.SourceRow, ...]
    legs: tuple[rows.LegRow, ...]
    errors: tuple[tuple[str, str], ...]


@dataclass(frozen=True, slots=True)
class Page:
    """All that the template needs."""

    title: str
    tone: words.Tone
    verdict: str
    verdict_name: str
    sentence: str
    reason: str
    meaning: str
    unseen: tuple[str, ...]
    warnings: tuple[str, ...]
    tiles: tuple[Tile, ...]
    gauge_note: str
    axes: tuple[str, ...]
    has_truth: bool
    solutions: tuple[Solution, ...]
    foreseen: Foreseen | None
    growth: GrowthPlot | None
    readings: LegPlots | None
    noise_sd: str
    alternatives: tuple[rows.AlternativeRow, ...]
    fit: tuple[tuple[str, str], ...]
    facts: tuple[tuple[str, str], ...]
    compass: Beside | None


def page_of(data: ReportData) -> Page:
    """What the page of a flight shows."""
    estimate, truth = data.estimate, data.truth
    result = score(estimate, truth) if truth is not None else None
    anchored = estimate.gauge == "anchored"
    background, grown = data.background, _grown(data)
    return Page(
        title=data.title,
        tone=words.TONES[estimate.verdict],
        verdict=estimate.verdict.name,
        verdict_name=words.NAMES[estimate.verdict],
        sentence=estimate.verdict.sentence,
        reason=estimate.reason,
        meaning=words.MEANINGS[estimate.verdict],
        unseen=tuple(estimate.unseen_directions),
        warnings=(*data.warnings, *_truth_warnings(data, result)),
        tiles=_tiles(data, result),
        gauge_note=_gauge_note(anchored),
        axes=rows.axis_names(estimate),
        has_truth=result is not None,
        solutions=_solutions(data),
        foreseen=None if background is None else foreseen(background, realised(estimate, result, grown)),
        growth=growth_plot(grown, estimate, () if background is None else background.under_way),
        readings=leg_plots(data.flight, estimate),
        noise_sd=significant(estimate.noise_sd, 2),
        alternatives=rows.alternative_rows(estimate) if has_positions(estimate) else (),
        fit=rows.fit_rows(estimate),
        facts=tuple((_capital(str(name)), str(value)) for name, value in data.facts.items()),
        compass=data.compass,
    )


def _grown(data: ReportData) -> Growth | None:
    background = data.background
    if background is None:
        return None
    return growth(data.flight, data.estimate, background.medium, background.heading_sd_rad)


def _solutions(data: ReportData) -> tuple[Solution, ...]:
    if not has_positions(data.estimate):
        return ()
    best = data.estimate
    shown = [best, *[e for e in best.alternatives if has_positions(e)][:MAX_ALTERNATIVES]]
    truths = [None if data.truth is None else truth_in_gauge(e, data.truth) for e in shown]
    scores = [None if data.truth is None else score(e, data.truth) for e in shown]
    window = common_window(shown, truths)
    solutions = []
    for i, (estimate, truth, result) in enumerate(zip(shown, truths, scores, strict=True)):
        delta = 2.0 * (best.log_likelihood - estimate.log_likelihood)
        solutions.append(
            Solution(
                tab="Most likely" if i == 0 else f"Alternative {i}",
                note="" if i == 0 else f"2 Δ log-likelihood {significant(delta, 2)}",
                picture=field_map(estimate, truth, window),
                sources=rows.source_rows(estimate, result),
                legs=rows.leg_rows(data.flight, estimate, result),
                errors=() if result is None else rows.error_rows(result),
            )
        )
    return tuple(solutions)


def _tiles(data: ReportData, result: Score | None) -> tuple[Tile, ...]:
    estimate, flight = data.estimate, data.flight
    spread = estimate.spread_m
    tiles = [
        Tile("Sources", str(len(estimate.sources)), note=_number_note(data)),
        Tile("Spread √C", significant(spread), "m" if math.isfinite(spread) else "", "at the first reading"),
        Tile("Noise", significant(estimate.noise_sd, 3), "", _snr_note(flight, estimate)),
        Tile(
            "Readings",
            f"{flight.n_readings:,}",
            "",
            f"{count(len(flight.legs), 'leg')}, {_length(flight)}{_time(flight)}",
        ),
    ]
    if result is not None:
        source, path = result.source_error_rms_m, result.path_error_rms_m
        tiles += [
            Tile("Source error", significant(source), "m", _in_spreads(source, spread)),
            Tile("Path error", significant(path), "m", _in_spreads(path, spread)),
        ]
    return tuple(tiles)


def _number_note(data: ReportData) -> str:
    if not has_positions(data.estimate):
        return "looked for"
    if data.truth is None:
        return _peaks(data.estimate.sources.peak_reading)
    true_number = len(data.truth.amplitude)
    return "as many as in truth" if len(data.estimate.sources) == true_number else f"truth has {true_number}"


def _peaks(peak: NDArray[np.float64]) -> str:
    low, high = significant(float(peak.min()), 2), significant(float(peak.max()), 2)
    return f"peak reading {high}" if low == high else f"peak readings {low} to {high}"


def _snr_note(flight: Flight, estimate: Estimate) -> str:
    """The signal-to-noise ratio of the resynthesised readings without ambient, as scene files define it."""
    if estimate.residual.size != flight.n_readings or not flight.n_readings or not estimate.noise_sd > 0.0:
        return "standard deviation"
    reading = np.concatenate([leg.reading for leg in flight.legs])
    signal = reading - estimate.residual - (estimate.medium.ambient or 0.0)
    power = float(np.mean(signal**2))
    if not (math.isfinite(power) and power > 0.0):
        return "standard deviation"
    return f"sd; SNR {10.0 * math.log10(power / estimate.noise_sd**2):.0f} dB"


def _length(flight: Flight) -> str:
    return f"{significant(float(flight.lengths_m.sum()), 3)} m" if flight.legs else "0 m"


def _time(flight: Flight) -> str:
    """From the first reading to the last."""
    legs = [leg.time_s for leg in flight.legs if leg.time_s.size]
    if not legs:
        return ""
    seconds = float(legs[-1][-1] - legs[0][0])
    return f" in {significant(seconds)}\u00a0s" if seconds < 600.0 else f" in {significant(seconds / 60.0)}\u00a0min"


def _in_spreads(error_m: float, spread_m: float) -> str:
    if not (math.isfinite(spread_m) and spread_m > 0.0 and math.isfinite(error_m)):
        return "rms"
    return f"rms, {significant(error_m / spread_m, 2)}\u00a0√C"


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def _truth_warnings(data: ReportData, result: Score | None) -> tuple[str, ...]:
    if data.truth is None or result is not None or not has_positions(data.estimate):
        return ()
    return ("Truth is recorded but cannot be aligned with this estimate, so no errors are given.",)


def _gauge_note(anchored: bool) -> str:
    if anchored:
        return "Anchored: metres east and north of home. Uncertainties are relative to leg 1."
    return (
        "Canonical gauge: the path starts at (0, 0), leg 1 runs along +x and the first turn is towards +y. "
        "Readings alone cannot tell where on Earth that is. Uncertainties are relative to leg 1."
    )
