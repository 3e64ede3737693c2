"""The answer with the compass beside the one without, for the report: where a log has headings."""

from __future__ import annotations

import contextlib
from argparse import Namespace
from dataclasses import replace

import numpy as np

from dslam_mav.commands.logged import Logged, estimate_again, open_logged
from dslam_mav.commands.outcome import Outcome
from dslam_mav.dslam.scoring import has_positions
from dslam_mav.errors import BadInputError, DslamError
from dslam_mav.recordings import Assumed
from dslam_mav.report.beside import with_and_without


def compared(outcome: Outcome) -> Outcome:
    """The outcome of a flight just flown with the comparison, by its log."""
    if outcome.estimate is None:
        return outcome
    with contextlib.suppress(DslamError):  # the flight's own answer is what counts
        return with_compass(open_logged(outcome.log, Namespace()), outcome)
    return outcome


def with_compass(logged: Logged, outcome: Outcome) -> Outcome:
    """The outcome with the comparison, or a line on why there is none.

    The other answer has as many sources as the flight's, and begins its search there: nothing else differs.
    """
    mine, assumed = outcome.estimate, logged.assumptions
    if mine is None or not has_positions(mine) or assumed.heading == "plan" or assumed.method == "paper":
        return outcome
    used = assumed.heading == "vehicle"
    system = None if logged.recorded is None else logged.recorded.vehicle_system
    other = replace(assumed, heading="none" if used else "vehicle", n_sources=len(mine.sources))
    try:
        replayed = logged.recording.flight(logged.mission, Assumed(assumed.distance, True, system))
    except BadInputError:  # a table of readings
        replayed = None
    if replayed is None or not np.isfinite(replayed.collector.headings_rad(replayed.legs)).all():
        return replace(outcome, facts={**outcome.facts, "compass": "no heading was recorded on every leg"})
    rival = estimate_again(replace(logged, replayed=replayed, assumptions=other), start=mine).estimate
    if rival is None:
        return outcome
    pair = (rival, mine) if used else (mine, rival)
    return replace(outcome, compass=with_and_without(*pair, outcome.truth))
