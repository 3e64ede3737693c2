"""From the options of `plan` to what is known of sources and sensor, and the layouts an accuracy is predicted over."""

from __future__ import annotations

import math
from argparse import Namespace
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dslam_mav.commands.plan_options import LONGEST_M, SHORTEST_M
from dslam_mav.errors import BadInputError
from dslam_mav.records.arrays import Array
from dslam_mav.records.prediction import FAINTEST, LEG_SPREADS, READINGS_PER_SPREAD, SNR_DB, layouts_for
from missions.fence import Fence

if TYPE_CHECKING:
    from dslam_mav.dslam.expected import Sensing
    from dslam_mav.dslam.layouts import Layouts, Prior, Region


@dataclass(frozen=True, slots=True)
class Expectation:
    """What is known before the flight, and random layouts of it."""

    prior: Prior
    sensing: Sensing
    groups: list[Layouts]


def spread_of(options: Namespace) -> tuple[float, float] | None:
    """√C at the start from … to, where anything is said of it."""
    ages = options.age
    if (ages is None) != (options.diffusivity is None):
        given, missing = ("age", "diffusivity") if ages else ("diffusivity", "age")
        raise BadInputError(f"--{given}: expected --{missing} as well: C = 4μ(t − τ)")
    if ages and options.spread:
        raise BadInputError("--spread with --diffusivity and --age: expected one of them")
    if ages:
        mu = float(options.diffusivity)
        low, high = (math.sqrt(4.0 * mu * age) for age in ages)
        if not SHORTEST_M <= low <= high <= LONGEST_M:
            raise BadInputError(
                f"--diffusivity {mu:g} --age {ages[0]:g}..{ages[1]:g}: √C is {low:.3g} to {high:.3g} m: "
                f"expected {SHORTEST_M:g} to {LONGEST_M:g} m"
            )
        return low, high
    return (float(options.spread[0]), float(options.spread[1])) if options.spread else None


def expectation(
    options: Namespace, path: Array, known: Prior | None, fence: Fence | None, speed_m_s: float
) -> Expectation:
    """Of a path (L+1, d): for the sources it was made for (`known`), or those the options speak of; without a spread
    said, the longest leg over 3.2 is taken.
    """
    count = layouts_for(options.layouts, len(path) - 1)
    if known is not None:
        return expected_in(options, known.region, known.spread_m, speed_m_s, count)
    spread = spread_of(options)
    if spread is None:
        usual = float(np.linalg.norm(np.diff(path, axis=0), axis=1).max()) / LEG_SPREADS
        spread = (usual, usual)
    return expected_in(options, region_of(options, path, fence), spread, speed_m_s, count)


def expected_in(
    options: Namespace, region: Region, spread: tuple[float, float], speed_m_s: float, count: int
) -> Expectation:
    """Of any mission over the region."""
    from dslam_mav.dslam.expected import Sensing
    from dslam_mav.dslam.layouts import Prior, drawn, noise_below

    rate = 4.0 * options.diffusivity if options.diffusivity else 0.0
    prior = Prior(options.sources, spread, region, rate, options.peak)
    try:
        groups = drawn(prior, count, np.random.default_rng(options.seed))
    except ValueError as problem:
        low, high = options.sources
        asked = f"{low}" if low == high else f"{low}-{high}"
        raise BadInputError(f"--sources {asked}: {problem}; give a larger --area or less --spread") from None
    snr_db = SNR_DB if options.snr is None else options.snr
    noise_sd = options.noise_sd or noise_below(groups, region, snr_db)
    if options.noise_sd is None and not noise_sd >= FAINTEST * options.peak:
        wide = " × ".join(f"{side:.3g}" for side in region.extent)
        raise BadInputError(
            f"--snr {snr_db:g}: on a star that fills {wide} m next to nothing is read for √C {prior.usual_spread_m:.3g}"
            " m: expected a larger --spread, a smaller --area, or --noise-sd"
        )
    sensing = Sensing(
        noise_sd=noise_sd,
        readings_per_m=_density(options, prior.usual_spread_m, speed_m_s),
        speed_m_s=speed_m_s,
        heading_sd_rad=None if options.heading_sd is None else math.radians(options.heading_sd),
        length_sd_m=options.leg_sd,
        closed=options.closed,
        ambient_unknown=options.ambient == "auto",
        spread_unknown=spread[0] < spread[1],
    )
    return Expectation(prior, sensing, groups)


def region_of(options: Namespace, path: Array, fence: Fence | None) -> Region:
    """The box given, about the middle of the path (V, d); else the fence; else the path's own extent."""
    from dslam_mav.dslam.layouts import Region

    low, high = path.min(axis=0), path.max(axis=0)
    if options.area:
        extent = np.array(_lengths(options.area, path.shape[1]))
        extent = np.append(extent, np.ptp(path[:, 2])) if extent.size < path.shape[1] else extent
        middle = 0.5 * (low + high)
        return Region(tuple(middle - 0.5 * extent), tuple(middle + 0.5 * extent))
    if fence is None or not fence.within:
        return Region(tuple(low), tuple(high))
    bottom, top = fence.extent()
    outer = Fence(fence.within)  # sources may well lie where the vehicle must not fly
    return Region((*bottom, *low[2:]), (*top, *high[2:]), outer.allows)


def _lengths(text: str, dimensions: int) -> tuple[float, ...]:
    try:
        lengths = tuple(float(part) for part in text.split(","))
    except ValueError:
        lengths = ()
    if not 2 <= len(lengths) <= dimensions or not all(0.0 <= side <= LONGEST_M for side in lengths):
        kind = "EAST_M,NORTH_M" if dimensions == 2 else "EAST_M,NORTH_M or EAST_M,NORTH_M,UP_M"
        raise BadInputError(f"--area {text}: expected {kind}, 0 to {LONGEST_M:g}")
    return lengths


def _density(options: Namespace, spread_m: float, speed_m_s: float) -> float:
    if options.spacing:
        return 1.0 / float(options.spacing)
    if options.rate:
        return float(options.rate) / speed_m_s
    return READINGS_PER_SPREAD / spread_m
