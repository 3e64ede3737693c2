"""What the joint estimate is to do for a given number of sources."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from dslam_mav.dslam.priors import Priors
from dslam_mav.dslam.problem import Problem
from dslam_mav.dslam.starts import Starts
from dslam_mav.dslam.units import Units
from dslam_mav.records import Estimate


class Patience(Enum):
    """What is tried where an answer leaves more than noise: nothing, freer fits of it, or another search as well."""

    NONE = 0
    FITS = 1
    ALL = 2


@dataclass(frozen=True, slots=True, eq=False)
class Task:
    """A problem in units of its own, how many sources to find, what is known besides, and where to begin.

    What an answer that leaves more than noise is tried with is `patience`; `loose`, legs may begin beside the corners:
    past them above 0, before them below, and so many times as far off as is usual. `begun`: what the search found, if
    it was made before.
    """

    problem: Problem
    k_sources: int
    priors: Priors
    unit: Units
    extent_free: bool
    start: Estimate | None = None
    patience: Patience = Patience.ALL
    loose: float = 0.0
    begun: Starts | None = None
