"""The estimator as a person set it up: flight in, estimate out, with the headings they allowed it to see."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from dslam_mav.assumptions import Assumptions
from dslam_mav.calibrated import Calibrated, calibrated_answer
from dslam_mav.dslam.estimator import estimate
from dslam_mav.errors import BadInputError
from dslam_mav.legs import FlownLeg, LegCollector, PlanFacts, plan_headings_rad
from dslam_mav.mission import Mission, leg_plan
from dslam_mav.records import Estimate, Flight, Path
from dslam_mav.records.arrays import Array

Estimator = Callable[[Flight, tuple[FlownLeg, ...]], Estimate]
"""A flight, and the legs it was made of: one snapshot, so that headings and readings are of the same legs."""


NOT_CLOSED = "The legs used are not the whole path, so they are not taken to end where they began."
NOT_FROM_HOME = "Places are metres east and north of where leg {} began, not of home: the legs before it are left out."


def visible_plan(assumptions: Assumptions, mission: Mission) -> Mission | None:
    """What `estimator` may be given of the mission: nothing, unless a heading anchors the answer to it."""
    return mission if assumptions.heading != "none" else None


def estimator(
    assumptions: Assumptions, collector: LegCollector, mission: Mission | None, earlier: Estimate | None = None
) -> Estimator:
    """The function that live flight and replay call alike.

    With `heading` "none" it sees nothing but the flight. "vehicle" adds the legs' mean compass headings from the
    collector, "plan" the planned directions; the answer is then anchored, where the plan is known at its vertex at
    which the legs begin. Ambient or noise "hover" adds what the collector has of before the first leg. `earlier`: an
    answer to begin from. `closed` holds for the whole path only. BadInputError: assumptions that contradict each other
    or the flight.
    """
    try:
        medium = assumptions.medium()
    except ValueError as problem:
        raise BadInputError(f"assumptions: {problem}") from None

    def run(flight: Flight, legs: tuple[FlownLeg, ...]) -> Estimate:
        closed = assumptions.closed and whole(legs, collector.plan)
        flown = replace(flight, closed=closed)
        prior = None
        if assumptions.heading != "none":
            prior = (_headings(assumptions, collector, mission, legs), assumptions.heading_sd_rad)

        def answer(calibrated: Calibrated) -> Estimate:
            return estimate(
                flown,
                medium,
                assumptions.n_sources,
                method=assumptions.method,
                heading_prior=prior,
                ambient_prior=calibrated.ambient,
                noise_prior=calibrated.noise,
                start=earlier,
                seed=assumptions.seed,
            )

        try:
            result = calibrated_answer(assumptions, collector.standing(legs), answer)
        except ValueError as problem:
            raise BadInputError(f"assumptions: {problem}") from None
        if assumptions.closed and not closed:
            result = _said(result, NOT_CLOSED)
        return result if prior is None else _placed(result, mission, legs)

    return run


def whole(legs: tuple[FlownLeg, ...], plan: PlanFacts | None) -> bool:
    """Whether these legs are the path from its begin to its end, as far as it is known."""
    if not legs or plan is None:
        return not (legs and legs[0].few)
    return (legs[0].start_seq, legs[-1].end_seq) == (plan.vertices[0], plan.vertices[-1])


def _headings(
    assumptions: Assumptions, collector: LegCollector, mission: Mission | None, flown: tuple[FlownLeg, ...]
) -> Array:
    if assumptions.heading == "vehicle":
        headings = collector.headings_rad(flown)
        if not np.isfinite(headings).all():
            leg = int(np.flatnonzero(~np.isfinite(headings))[0]) + 1
            raise BadInputError(f"--heading vehicle: no ATTITUDE was heard on leg {leg}; use --heading none")
        return headings
    if mission is None:
        raise BadInputError("--heading plan: no plan is known; give one, or use --heading none")
    planned = plan_headings_rad(mission)
    pairs = [(leg.start_seq, leg.end_seq) for leg in flown]
    missing = [pair for pair in pairs if pair not in planned]
    if missing:
        start, end = missing[0]
        raise BadInputError(f"--heading plan: the flight from item {start} to {end} is no leg of the plan")
    return np.array([planned[pair] for pair in pairs])


def _placed(result: Estimate, mission: Mission | None, legs: tuple[FlownLeg, ...]) -> Estimate:
    """The answer where the plan has the legs' begin; without a plan at (0, 0), which is said where it is not home."""
    plan = None if mission is None else leg_plan(mission)
    start = legs[0].start_seq if legs else None
    if plan is not None and start in plan.sequence:
        return _moved(result, plan.vertices_m[plan.sequence.index(start)])
    left_out = legs and legs[0].few and legs[0].number > 1
    return _said(result, NOT_FROM_HOME.format(legs[0].number)) if left_out else result


def _said(result: Estimate, more: str) -> Estimate:
    return replace(result, reason=f"{result.reason} {more}".lstrip())


def _moved(result: Estimate, origin_m: Array) -> Estimate:
    """The answer with its first vertex at `origin_m` instead of (0, 0)."""
    return replace(
        result,
        sources=replace(result.sources, position_m=result.sources.position_m + origin_m),
        path=Path(result.path.vertices_m + origin_m, result.path.heading_rad),
        alternatives=tuple(_moved(other, origin_m) for other in result.alternatives),
    )
