"""estimate(): from readings along straight legs to sources and path.

    compress → search → joint fit → certify → canonical gauge

Each step is a file of this folder. Failure is a value: a `Verdict` with a reason, never an exception; only misuse of
the arguments raises `ValueError`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from threadpoolctl import ThreadpoolController

from dslam_mav.dslam.answer import Answers, assemble, nothing
from dslam_mav.dslam.arguments import check, check_count, hopeless, usable
from dslam_mav.dslam.certify import MISFIT_MATTERS, MISFIT_P_VALUE, too_few
from dslam_mav.dslam.doubt import doubted
from dslam_mav.dslam.paper.options import PaperOptions
from dslam_mav.dslam.priors import Priors, measured, priors_of
from dslam_mav.dslam.problem import problem, steadied
from dslam_mav.dslam.solve import Task, solve
from dslam_mav.dslam.state import layout
from dslam_mav.dslam.units import normalised, units_of
from dslam_mav.records import Estimate, Flight, Medium, Verdict

Array = NDArray[np.float64]

MAX_SOURCES = 8
DOUBTFUL_P = 0.05
STANDS = "The field was found to stand still."
CONTRADICTED = "A field that stands still fits them better than one that evolves with the μ or τ given."
LITTLE_LEFT = MISFIT_P_VALUE**2  # that distances which drift leave so little is no sign of another model
DRIFTING = (
    "An ambient level that drifts would explain what is left (--ambient-drift auto; ambient_drift_per_s=None in "
    "Python); so may legs that were not flown as measured."
)
COOLING = "Readings fit better upside down: sources that cool are not in the model."


@dataclass(frozen=True, slots=True, eq=False)
class _Question:
    """What was asked, but for the number of sources."""

    flight: Flight
    medium: Medium
    priors: Priors
    start: Estimate | None
    seed: int


def estimate(
    flight: Flight,
    medium: Medium,
    n_sources: int | None = None,
    *,
    max_sources: int = 5,
    method: Literal["joint", "paper"] = "joint",
    paper: PaperOptions | None = None,
    closed_sd_m: float | None = None,
    known_points: Mapping[int, ArrayLike] | None = None,
    heading_prior: tuple[ArrayLike, float] | None = None,
    ambient_prior: tuple[float, float] | None = None,
    noise_prior: tuple[float, float] | None = None,
    start: Estimate | None = None,
    seed: int = 0,
) -> Estimate:
    """Sources and path of a flight, in the canonical gauge (theory, section 8).

    `n_sources` None: found by BIC, at most `max_sources`. `closed_sd_m`: the path ends where it began, give or take
    this (for `flight.closed` the default is a thousandth of the path). `known_points`: vertex index -> its place (d,).
    `heading_prior`: headings (L,) in radians, counter-clockwise from east, and their standard deviation; the answer
    is then anchored to them, its first vertex at (0, 0) unless points are known. `ambient_prior`: the ambient level and
    its standard deviation, where `medium.ambient` is None. `noise_prior`: a reading's standard deviation as measured
    where no source changes it, and its degrees of freedom; left out where the legs contradict it. `start`: an earlier
    estimate of the same flight, with fewer legs or as many, to begin from. `seed` makes the search repeatable bit for
    bit. `method` "paper" is the paper's algebra step by step, with its options `paper`; it knows no such priors. Raises
    ValueError for impossible arguments.
    """
    check(flight, medium, method, start, seed)
    check_count("max_sources", max_sources, MAX_SOURCES)
    if n_sources is not None:
        check_count("n_sources", n_sources, MAX_SOURCES)
    elif isinstance(medium.activation_s, tuple) and len(medium.activation_s) > 1:
        count = len(medium.activation_s)
        raise ValueError(f"n_sources: expected {count}, one for each time in medium.activation_s, got None")
    if paper is not None and not isinstance(paper, PaperOptions):
        raise ValueError(f"paper: expected PaperOptions or None, got {type(paper).__name__}")
    if method == "paper":
        for name, prior in (
            ("heading_prior", heading_prior), ("ambient_prior", ambient_prior), ("noise_prior", noise_prior)
        ):  # fmt: skip
            if prior is not None:
                raise ValueError(f'{name}: the paper\'s algebra has none; expected None with method="paper"')
        return _by_paper(flight, medium, n_sources, max_sources, paper, closed_sd_m is not None, known_points)
    priors = priors_of(flight, medium.dimensions, closed_sd_m, known_points, heading_prior)
    if ambient_prior is not None and medium.ambient is not None:
        raise ValueError(f"ambient_prior: expected None with medium.ambient {medium.ambient:g} known")
    level, noise = measured("ambient_prior", ambient_prior), measured("noise_prior", noise_prior)
    priors = replace(priors, ambient=level, noise=noise)
    question = _Question(flight, medium, priors, usable(start), seed)
    # Sums in another order end in other bits: one BLAS thread, whatever the machine has. It is also faster here.
    with _threads().limit(limits=1, user_api="blas"), np.errstate(over="ignore", invalid="ignore"):
        result = _with_k(question, int(n_sources)) if n_sources is not None else _choose_k(question, max_sources)
        return _reconsidered(question, result)


def _by_paper(
    flight: Flight,
    medium: Medium,
    n_sources: int | None,
    max_sources: int,
    options: PaperOptions | None,
    closed: bool,
    known_points: Mapping[int, ArrayLike] | None,
) -> Estimate:
    with _threads().limit(limits=1, user_api="blas"):
        from dslam_mav.dslam.paper.method import estimate_by_paper

        return estimate_by_paper(
            flight, medium, n_sources, max_sources, options or PaperOptions(), closed=closed, known_points=known_points
        )


@cache
def _threads() -> ThreadpoolController:
    return ThreadpoolController()  # type: ignore[no-untyped-call]


def _with_k(question: _Question, k_sources: int, *, patient: bool = True) -> Estimate:
    """The estimate for a given number of sources; not `patient`, nothing is tried to mend a misfit."""
    flight, medium = question.flight, question.medium
    tau = medium.activation_s
    if isinstance(tau, tuple) and len(tau) not in (1, k_sources):
        raise ValueError(f"medium.activation_s: expected one time or {k_sources}, got {len(tau)}")
    if not flight.n_readings:
        return nothing(flight, medium, k_sources, Verdict.TOO_FEW_DATA, "No reading lies on any leg.")
    raw = problem(flight, medium)
    reason = too_few(flight, layout(raw, k_sources).size, k_sources)
    if reason is not None:
        return nothing(flight, medium, k_sources, Verdict.TOO_FEW_DATA, reason)
    reason = hopeless(raw)
    if reason is not None:
        return nothing(flight, medium, k_sources, Verdict.NOT_IDENTIFIABLE, reason)
    unit = units_of(raw)
    task = Task(normalised(raw, unit), k_sources, question.priors, unit, medium.extent is None, question.start, patient)
    solved = solve(task, np.random.default_rng(question.seed))
    if solved is None:
        return nothing(flight, medium, k_sources, Verdict.NOT_CONVERGED, "The search found no start.")
    answers = Answers(
        solved.problem, solved.fits, solved.level, solved.freedom_inside, unit, question.priors, solved.loose
    )  # fmt: skip
    result = assemble(flight, medium, answers)
    return doubted(result, steadied(flight, result.medium.ambient_drift_per_s or 0.0), question.priors)


def _reconsidered(question: _Question, result: Estimate) -> Estimate:
    """The answer, held against models nobody asked for where it leaves more than noise: a field that stands still,
    sources that cool.
    """
    told = result.diagnostics
    if "cost" not in told or result.verdict is Verdict.NOT_IDENTIFIABLE:
        return result
    doubtful = result.verdict is Verdict.NOT_CONVERGED or told["whiteness_p"] < MISFIT_P_VALUE
    if doubtful and not question.medium.static:
        return _or_standing(question, result)
    if doubtful and result.verdict is not Verdict.NOT_CONVERGED and _drifts(question, result):
        others = tuple(replace(other, verdict=Verdict.MODEL_MISFIT) for other in result.alternatives)
        return replace(result, verdict=Verdict.MODEL_MISFIT, reason=DRIFTING, alternatives=others)
    return _or_cooling(question, result, doubtful)


def _drifts(question: _Question, result: Estimate) -> bool:
    """Whether an ambient level that drifts explains what is left, and nothing else is left then."""
    medium = question.medium
    if medium.ambient is not None or medium.ambient_drift_per_s is None or question.flight.parametric is not None:
        return False
    if result.diagnostics["corners_loose"] and result.diagnostics["whiteness_p"] > LITTLE_LEFT:
        return False
    drifting = replace(question, medium=replace(medium, ambient_drift_per_s=None), start=result)
    told = _with_k(drifting, len(result.sources), patient=_beside_corners(question)).diagnostics
    return bool(told.get("whiteness_p", 0.0) >= MISFIT_P_VALUE and told["cost"] < result.diagnostics["cost"])


def _beside_corners(question: _Question) -> bool:
    """Whether legs may begin beside their corners: that takes patience. Another model is right only where it leaves
    nothing, and what else patience mends it need not.
    """
    return question.priors.corner_sd_m is not None


def _or_standing(question: _Question, result: Estimate) -> Estimate:
    """A field that stands still is the limit of one that evolves ever more slowly: the search at rates above may miss
    it. Where μ or τ are known there is no such limit, and a still field that fits better contradicts them.
    """
    medium = question.medium
    still = replace(medium, static=True, diffusivity_m2_s=None, activation_s="shared")
    standing = _with_k(replace(question, medium=still), len(result.sources))
    if "cost" not in standing.diagnostics or _more_is_better(standing, result):
        return result
    if medium.diffusivity_m2_s is None and not isinstance(medium.activation_s, (float, tuple)):
        return replace(standing, reason=f"{standing.reason} {STANDS}")
    return replace(result, reason=f"{result.reason} {CONTRADICTED}") if _called_right(standing) else result


def _called_right(result: Estimate) -> bool:
    return result.verdict in (Verdict.IDENTIFIED, Verdict.AMBIGUOUS)


def _or_cooling(question: _Question, result: Estimate, doubtful: bool) -> Estimate:
    """Readings that fit better upside down are of sources that cool, which the model has not: tried where more than
    noise is left and most readings are high, or where the ambient level lies far below all readings.
    """
    flight, level = question.flight, result.medium.ambient
    if question.medium.ambient is not None or level is None or not flight.legs or not _called_right(result):
        return result
    readings = np.concatenate([leg.reading for leg in flight.legs])
    low, middle, high = np.quantile(readings, [0.0, 0.5, 1.0])
    if low - level < high - low and not (doubtful and high - middle < middle - low):
        return result
    turned = Flight(tuple(replace(leg, reading=-leg.reading) for leg in flight.legs), closed=flight.closed)
    drift = question.medium.ambient_drift_per_s
    medium = replace(question.medium, ambient_drift_per_s=None if drift is None else -drift)
    upside_down = replace(question, flight=turned, medium=medium, start=None)
    told = _with_k(upside_down, len(result.sources), patient=_beside_corners(question)).diagnostics
    if told.get("whiteness_p", 0.0) < MISFIT_P_VALUE or told["cost"] >= result.diagnostics["cost"]:
        return result
    others = tuple(replace(other, verdict=Verdict.MODEL_MISFIT) for other in result.alternatives)
    return replace(result, verdict=Verdict.MODEL_MISFIT, reason=COOLING, alternatives=others)


def _choose_k(question: _Question, max_sources: int) -> Estimate:
    """K = 1, 2, … until the Bayesian information criterion rises (theory, section 8) from an answer that leaves no
    more than noise, or a spot's own shape.

    Too few sources leave a misfit that no patience mends: they are held against the answer only where it is as small
    as what a shape leaves.
    """
    best, mended = _with_k(question, 1, patient=False), False
    for k_sources in range(2, max_sources + 1):
        more = _with_k(question, k_sources, patient=False)
        if "cost" not in more.diagnostics:
            break  # too few data for so many
        if _more_is_better(best, more) and _mendable(best):
            best, mended = _with_k(question, len(best.sources)), True
        if _more_is_better(best, more):
            best, mended = more, False
        elif best.diagnostics["whiteness_p"] >= MISFIT_P_VALUE or _mendable(best):
            break
    white = "cost" in best.diagnostics and best.diagnostics["whiteness_p"] >= MISFIT_P_VALUE
    done = mended or (white and question.priors.corner_sd_m is None)
    return best if done else _with_k(question, len(best.sources))


def _mendable(result: Estimate) -> bool:
    """Whether more is left than noise, yet so little that an extent of the sources may be behind it."""
    told = result.diagnostics
    return "cost" in told and told["whiteness_p"] < MISFIT_P_VALUE and told["systematic_share"] < MISFIT_MATTERS


def _more_is_better(few: Estimate, more: Estimate) -> bool:
    """Whether n ln(cost) + P ln(n/K) is lower with more sources, both with the larger model's n and K: an unknown is
    told by its own source's share of the readings.

    Residuals that may not be white (the larger model's, at 5 %) count as the numbers the legs can carry, not as
    readings: otherwise sources are added to mend the model's own misfit.
    """
    a, b = few.diagnostics, more.diagnostics
    if "cost" not in a:
        return True
    n = float(b["n_readings"])
    if b["whiteness_p"] < DOUBTFUL_P:
        n = min(n, float(b["freedom_inside"]))
    extra = (_free(more) - _free(few)) * np.log(n / len(more.sources))
    return bool(n * np.log(max(b["cost"], 1e-300) / max(a["cost"], 1e-300)) + extra < 0.0)


def _free(result: Estimate) -> int:
    """Unknowns that no prior holds: where legs begin is known but for a little."""
    return sum(not name.startswith("corner ") for name in result.parameter_names)
