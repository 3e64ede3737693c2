"""estimate(): from readings along straight legs to sources and path.

    compress → search → joint fit → certify → canonical gauge

Each step is a file of this folder. Failure is a value: a `Verdict` with a reason, never an exception; only misuse of
the arguments raises `ValueError`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from threadpoolctl import ThreadpoolController

from dslam_mav.dslam.arguments import check, check_count, usable
from dslam_mav.dslam.asked import Question, answered, whole
from dslam_mav.dslam.counting import counted
from dslam_mav.dslam.paper.options import PaperOptions
from dslam_mav.dslam.priors import measured, priors_of
from dslam_mav.dslam.reconsider import reconsidered
from dslam_mav.records import Estimate, Flight, Medium

Array = NDArray[np.float64]

MAX_SOURCES = 8


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
    question = Question(flight, medium, priors, usable(start), seed)
    # Sums in another order end in other bits: one BLAS thread, whatever the machine has. It is also faster here.
    with _threads().limit(limits=1, user_api="blas"), np.errstate(over="ignore", invalid="ignore"):
        found = answered(question, int(n_sources)) if n_sources is not None else counted(question, max_sources)
        return reconsidered(question, whole(question, found))


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
