"""How many sources there are: joint fits for K = 1, 2, … and the Bayesian information criterion (theory, section 8)."""

from __future__ import annotations

from typing import Any

import numpy as np

from dslam_mav.dslam.answers import Answers
from dslam_mav.dslam.asked import Question, answered
from dslam_mav.dslam.certify import MISFIT_MATTERS, MISFIT_P_VALUE
from dslam_mav.dslam.task import Patience
from dslam_mav.records import Estimate

DOUBTFUL_P = 0.05
A_SOURCE = 3  # unknowns of a source, at least
OUTSIDE = 4.0  # times as many numbers outside the legs' bases as inside, as with some 64 readings a leg
UNLUCKY_SD = 1.7  # by which noise may hide what one more source would explain
Found = Answers | Estimate


def counted(question: Question, max_sources: int) -> Found:
    """K = 1, 2, … until the Bayesian information criterion rises (theory, section 8) from an answer that leaves no
    more than noise, or a spot's own shape.

    Too few sources leave a misfit that no patience mends: they are held against the answer only where it is as small
    as what a shape leaves.
    """
    best, k_best, mended = answered(question, 1, Patience.NONE), 1, False
    for k_sources in range(2, max_sources + 1):
        if _white(best) and not _room_for_more(best):
            break
        more = answered(question, k_sources, Patience.NONE)
        if "cost" not in more.diagnostics:
            break  # too few data for so many
        if more_is_better(best, more) and _mendable(best):
            # the search for one source misses nothing that another search would find
            mended = k_best > 1
            best = answered(question, k_best, Patience.ALL if mended else Patience.FITS)
        if more_is_better(best, more):
            best, k_best, mended = more, k_sources, False
        elif _white(best) or _mendable(best):
            break
    if mended or (_white(best) and question.priors.corner_sd_m is None):
        return best
    again = best.begun if isinstance(best, Answers) and k_best > 1 else None  # one source is fitted from random starts
    return answered(question, k_best, begun=again)


def _white(found: Found) -> bool:
    told = found.diagnostics
    return "cost" in told and told["whiteness_p"] >= MISFIT_P_VALUE


def _mendable(found: Found) -> bool:
    """Whether more is left than noise, yet so little that an extent of the sources may be behind it."""
    told = found.diagnostics
    return "cost" in told and told["whiteness_p"] < MISFIT_P_VALUE and told["systematic_share"] < MISFIT_MATTERS


def _room_for_more(found: Found) -> bool:
    """Whether what is left inside the legs' bases, noise taken off, is as much as one more source has to explain.

    With many readings a source has to explain far more than noise leaves there, and no search is needed to say no.
    """
    told = found.diagnostics
    freedom = told["freedom_inside"] - told["free_unknowns"]
    noise = max(told["residual_outside_sd"], 1e-300)
    beyond = freedom * ((told["residual_inside_sd"] / noise) ** 2 - 1.0)
    asked = A_SOURCE * np.log(told["n_readings"] / (told["n_sources"] + 1.0))
    return bool(beyond + UNLUCKY_SD * np.sqrt(2.0 * max(freedom, 0.0)) > asked)


def more_is_better(few: Found, more: Found) -> bool:
    """Whether n ln(cost) + P ln(n/K) is lower with more sources, both with the larger model's n and K: an unknown is
    told by its own source's share of the readings. The cost is the priors' too: noise is often best explained by a
    monstrous source far away.

    Residuals that may not be white (the larger model's, at 5 %) count as the numbers the legs can carry, not as
    readings: otherwise sources are added to mend the model's own misfit.
    """
    a, b = few.diagnostics, more.diagnostics
    if "cost" not in a:
        return True
    n, white = float(b["n_readings"]), b["whiteness_p"] >= DOUBTFUL_P
    if not white:
        n = min(n, float(b["freedom_inside"]))
    extra = (b["free_unknowns"] - a["free_unknowns"]) * np.log(n / b["n_sources"])
    before, after = (max(_left(told, white), 1e-300) for told in (a, b))
    return bool(n * np.log(after / before) + extra < 0.0)


def _left(told: dict[str, Any], white: bool) -> float:
    """The cost, priors' included. Residuals that are not white: with no more noise from outside the legs' bases than a
    few readings bring, for that would hide whatever is inside where readings are many.
    """
    total = float(told["cost"] + told["priors_cost"])
    beyond = told["n_readings"] - told["freedom_inside"]
    if white or beyond <= OUTSIDE * told["freedom_inside"]:
        return total
    outside = beyond * told["residual_outside_sd"] ** 2
    inside = (told["freedom_inside"] - told["free_unknowns"]) * told["residual_inside_sd"] ** 2
    left_out = 1.0 - OUTSIDE * told["freedom_inside"] / beyond
    return total - float(told["cost"] * left_out * outside / max(outside + inside, 1e-300))
