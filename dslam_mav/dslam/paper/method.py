"""estimate_by_paper(): the paper's algebra, read aloud.

    every leg's centres (III-A) → pairing (III-B) → geometry (III-C, Appendices C, D, E) → refinement (IV-D)
    → judged by all readings → gauge (Remark 3)

IV-A sets each leg's C before, IV-B finds spreads and centres together where activation times are unknown, IV-C takes
flights along curves. Failure is a value: a `Verdict` with a reason; only misuse of the arguments raises `ValueError`.
The paper has no covariances: they are NaN.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dslam_mav.dslam.paper import closed as closure
from dslam_mav.dslam.paper.answer import Levels, assemble, nothing, parameters
from dslam_mav.dslam.paper.candidates import Candidate, candidate, polished, standing, with_refined
from dslam_mav.dslam.paper.checks import check, check_parametric, too_few
from dslam_mav.dslam.paper.geometry import layouts
from dslam_mav.dslam.paper.layout import Failure, Projections
from dslam_mav.dslam.paper.options import PaperOptions
from dslam_mav.dslam.paper.pairing import chains
from dslam_mav.dslam.paper.parametric import estimate_parametric
from dslam_mav.dslam.paper.peaks import FlightPeaks, count_sources, peaks_of
from dslam_mav.dslam.paper.scenery import Scenery, scenery
from dslam_mav.dslam.paper.stretch import extended, stretch_of, stretches
from dslam_mav.records import Estimate, Flight, Medium, Verdict

Array = NDArray[np.float64]
KnownPoints = Mapping[int, ArrayLike]

_DEFAULTS = PaperOptions()
MOST_EXTENDED = 4  # layouts of a stretch that are put together with the other legs


def estimate_by_paper(
    flight: Flight,
    medium: Medium,
    n_sources: int | None,
    max_sources: int,
    options: PaperOptions = _DEFAULTS,
    *,
    closed: bool = False,
    known_points: KnownPoints | None = None,
) -> Estimate:
    """Sources and path by the paper's algebra.

    `n_sources` None: counted (Remark 4), at most `max_sources`. `closed`: the path ends where it began (also where the
    flight says so; used for one source, Appendix D). `known_points` {vertex index: (d,)}, two or more, anchor the
    answer. `diagnostics["conditioning"]` says how many digits the legs lose. ValueError names a misused argument.
    """
    if flight.parametric is not None:
        check_parametric(medium, n_sources, known_points)
        return estimate_parametric(flight, flight.parametric, medium, n_sources, max_sources, options)
    check(flight, medium, n_sources, max_sources, known_points)
    lacking = too_few(flight, n_sources or 1)
    if lacking is not None:
        return nothing(flight, medium, n_sources or 1, Verdict.TOO_FEW_DATA, lacking)
    scene = scenery(flight, medium)
    tried = [n_sources] if n_sources is not None else count_sources(scene, max_sources, options)
    if tried[-1] == 0 or not any(y.any() for y in scene.reading):
        reason = "No reading differs from the ambient level by more than its noise: no source is in reach."
        return nothing(flight, medium, max(tried[-1], 1), Verdict.NOT_IDENTIFIABLE, reason)
    question = _Question(flight, medium, scene, options, closed or flight.closed, known_points)
    for k in tried[:-1]:
        result = _along_legs(question, k)
        if result.diagnostics.get("rounded"):
            return result
    return _along_legs(question, tried[-1])


class _Question(NamedTuple):
    flight: Flight
    medium: Medium
    scene: Scenery
    options: PaperOptions
    closed: bool
    known_points: KnownPoints | None


def _along_legs(question: _Question, k: int) -> Estimate:
    """The algorithm for K sources: centres, then paths, then the answer."""
    flight, medium, scene = question.flight, question.medium, question.scene
    peaks = peaks_of(scene, medium, k, question.options)
    if isinstance(peaks, Failure):
        return nothing(flight, medium, k, Verdict.NOT_CONVERGED, peaks.reason)
    found = _solve(scene, peaks, question.closed, question.options)
    told: dict[str, Any] = {"conditioning": peaks.conditioning(), "samples": peaks.how}
    if isinstance(found, Failure):
        verdict = Verdict.NOT_CONVERGED if found.searched else Verdict.NOT_IDENTIFIABLE
        return replace(nothing(flight, medium, k, verdict, found.reason), diagnostics=told)
    levels = Levels(_rms(np.concatenate(scene.reading)), peaks.noise, told["conditioning"]["digits_lost"])
    result = assemble(flight, medium, scene, found, levels, question.known_points)
    return replace(result, diagnostics=result.diagnostics | told | _closure(peaks, scene, question.closed))


def _solve(scene: Scenery, peaks: FlightPeaks, closed: bool, options: PaperOptions) -> list[Candidate] | Failure:
    """Every answer that stands: of all pairings and all their layouts, by the residual over all readings."""
    found, why = _found(scene, peaks, closed, options)
    found = _polished(scene, peaks, found, options)
    kept = standing(scene, found, parameters(len(peaks.legs[0].y), scene.length.size, scene.dimensions))
    if found and not kept:
        return Failure("Every path the algebra finds has a source out of all reach.", searched=True)
    return kept or why or Failure("No pairing of the legs' centres leads to a path.", searched=True)


def _found(
    scene: Scenery, peaks: FlightPeaks, closed: bool, options: PaperOptions
) -> tuple[list[Candidate], Failure | None]:
    """All layouts of all pairings, and why the first pairing without one has none."""
    found: list[Candidate] = []
    why: Failure | None = None
    for p in _paired(scene, peaks):
        answer = layouts(p, closed)
        if isinstance(answer, Failure):
            why = why or answer
            continue
        for layout in answer:
            found += with_refined(scene, p, layout, options)
    return found, why


def _polished(scene: Scenery, peaks: FlightPeaks, found: list[Candidate], options: PaperOptions) -> list[Candidate]:
    """Without noise: brought down to rounding, from stretches of the path where no layout of the whole can be."""
    if not (options.polish and peaks.quiet and scene.c_first is not None and len(peaks.legs[0].y) > 1):
        return found
    found = polished(scene, found)
    if scene.dimensions != 2:
        return found
    for first, last in stretches(peaks.condition):
        if any(c.layout.rounded for c in found):
            break
        part = stretch_of(scene, first, last)
        own = peaks._replace(legs=peaks.legs[first:last], condition=peaks.condition[first:last])
        some = polished(part, _found(part, own, closed=False, options=options)[0])
        whole = [candidate(scene, extended(scene, c.layout, first), c.c_first) for c in some[:MOST_EXTENDED]]
        found = polished(scene, whole) + found
    return found


def _paired(scene: Scenery, peaks: FlightPeaks) -> list[Projections]:
    """Pairings with the spreads known; where each source has its own (IV-B), legs are read again with it pooled."""
    paired = chains(peaks.legs, scene.length, scene.dimensions)
    return paired if peaks.repeat is None else [peaks.repeat(p) for p in paired]


def _closure(peaks: FlightPeaks, scene: Scenery, closed: bool) -> dict[str, float]:
    """What (33) leaves of a closed triangle with one source, metres."""
    if not closed or len(peaks.legs[0].y) != 1 or scene.length.size != 3:
        return {}
    p = chains(peaks.legs, scene.length, scene.dimensions)[0]
    return {"closure_defect_m": closure.defect(p) * scene.unit_m}


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
