"""An answer that leaves more than noise, held against models nobody asked for: a field that stands still, an ambient
level that drifts, sources that cool.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dslam_mav.dslam.asked import Question, answered, whole
from dslam_mav.dslam.certify import MISFIT_P_VALUE
from dslam_mav.dslam.counting import more_is_better
from dslam_mav.dslam.task import Patience
from dslam_mav.records import Estimate, Flight, Verdict

STANDS = "The field was found to stand still."
CONTRADICTED = "A field that stands still fits them better than one that evolves with the μ or τ given."
LITTLE_LEFT = MISFIT_P_VALUE**2  # that distances which drift leave so little is no sign of another model
DRIFTING = (
    "An ambient level that drifts would explain what is left (--ambient-drift auto; ambient_drift_per_s=None in "
    "Python); so may legs that were not flown as measured."
)
COOLING = "Readings fit better upside down: sources that cool are not in the model."


def reconsidered(question: Question, result: Estimate) -> Estimate:
    """The answer, held against models nobody asked for where it leaves more than noise: a field that stands still,
    sources that cool.
    """
    told = result.diagnostics
    if "cost" not in told:
        return result
    doubtful = result.verdict is Verdict.NOT_CONVERGED or told["whiteness_p"] < MISFIT_P_VALUE
    if doubtful and not question.medium.static:
        return _or_standing(question, result)
    if result.verdict is Verdict.NOT_IDENTIFIABLE:
        return result
    if doubtful and result.verdict is not Verdict.NOT_CONVERGED and _drifts(question, result):
        others = tuple(replace(other, verdict=Verdict.MODEL_MISFIT) for other in result.alternatives)
        return replace(result, verdict=Verdict.MODEL_MISFIT, reason=DRIFTING, alternatives=others)
    return _or_cooling(question, result, doubtful)


def _drifts(question: Question, result: Estimate) -> bool:
    """Whether an ambient level that drifts explains what is left, and nothing else is left then."""
    medium = question.medium
    if medium.ambient is not None or medium.ambient_drift_per_s is None or question.flight.parametric is not None:
        return False
    if result.diagnostics["corners_loose"] and result.diagnostics["whiteness_p"] > LITTLE_LEFT:
        return False
    drifting = replace(question, medium=replace(medium, ambient_drift_per_s=None), start=result)
    told = answered(drifting, len(result.sources), _patience(question)).diagnostics
    return bool(told.get("whiteness_p", 0.0) >= MISFIT_P_VALUE and told["cost"] < result.diagnostics["cost"])


def _patience(question: Question) -> Patience:
    """Another model is right only where it leaves nothing, and needs no more than corners that are loose where they
    may be.
    """
    return Patience.NONE if question.priors.corner_sd_m is None else Patience.FITS


def _or_standing(question: Question, result: Estimate) -> Estimate:
    """A field that stands still is the limit of one that evolves ever more slowly: the search at rates above may miss
    it. Where μ or τ are known there is no such limit, and a still field that fits better contradicts them.
    """
    medium = question.medium
    still = replace(medium, static=True, diffusivity_m2_s=None, activation_s="shared")
    still_asked = replace(question, medium=still)
    standing = whole(still_asked, answered(still_asked, len(result.sources)))
    if "cost" not in standing.diagnostics or more_is_better(standing, result):
        return result
    if medium.diffusivity_m2_s is None and not isinstance(medium.activation_s, (float, tuple)):
        return replace(standing, reason=f"{standing.reason} {STANDS}")
    return replace(result, reason=f"{result.reason} {CONTRADICTED}") if _called_right(standing) else result


def _called_right(result: Estimate) -> bool:
    return result.verdict in (Verdict.IDENTIFIED, Verdict.AMBIGUOUS)


def _or_cooling(question: Question, result: Estimate, doubtful: bool) -> Estimate:
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
    told = answered(upside_down, len(result.sources), _patience(question)).diagnostics
    if told.get("whiteness_p", 0.0) < MISFIT_P_VALUE or told["cost"] >= result.diagnostics["cost"]:
        return result
    others = tuple(replace(other, verdict=Verdict.MODEL_MISFIT) for other in result.alternatives)
    return replace(result, verdict=Verdict.MODEL_MISFIT, reason=COOLING, alternatives=others)
