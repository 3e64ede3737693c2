"""`plan --pattern best`: from the options to the wish, and the search with its progress."""

from __future__ import annotations

import math
from argparse import Namespace
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from dslam_mav.commands.plan_prior import expected_in, region_of, spread_of
from dslam_mav.commands.screen import Screen
from dslam_mav.errors import BadInputError
from dslam_mav.records.arrays import Array
from dslam_mav.records.prediction import LEG_SPREADS
from dslam_mav.records.words import count
from missions.fence import Fence, area_m2
from missions.patterns import LONGEST_LEG_M, SHORTEST_LEG_M

if TYPE_CHECKING:
    from dslam_mav.commands.plan_prior import Expectation
    from dslam_mav.dslam.layouts import Prior
    from missions.best import Wish

USUAL_SPREAD_M = 10.0
USUAL_LENGTH_SPREADS = 22.4
USUAL_LEG_SPREADS = 4.48
MOST_LEGS = 20
LEAST_ROOM_SPREADS2 = 0.5  # of C: in less no two places differ to a sensor
SEARCH_SEED = 1  # layouts the plan is made on are none of those it is then judged by
LENGTHS = tuple(8.0 * 1.15**i for i in range(20))  # √C: how long a mission might have to be

ALONE = ("length", "margin", "turn")
"""Options that only a search for the best has a use for."""


def best(
    options: Namespace, centre_m: tuple[float, float] | None, fence: Fence | None, screen: Screen
) -> tuple[Array, Prior]:
    """(L+1, 2) vertices of the best mission, and for which sources; BadInputError where what is asked cannot be."""
    from missions.best import best_path

    spread = spread_of(options) or (USUAL_SPREAD_M, USUAL_SPREAD_M)
    usual_m = math.sqrt(spread[0] * spread[1])
    _check(options, fence, usual_m)
    expected = expected_in(
        options, region_of(options, _anchor(centre_m, fence, usual_m), fence), spread, options.speed, 200
    )
    if options.closed:
        raise BadInputError("--closed with --pattern best: expected another pattern: the best does not close")
    wish = _wish(options, fence, usual_m, expected)
    rng = np.random.default_rng((options.seed, SEARCH_SEED))
    with screen.progress("looking for the best mission") as advance:

        def tell(done: int, steps: int) -> None:
            advance("looking for the best mission", done, steps)

        try:
            path = best_path(wish, expected.prior, expected.sensing, rng, tell)
        except ValueError as problem:
            raise BadInputError(f"--sources: {problem}; give a larger --area or less --spread") from None
    if path is None:
        raise BadInputError(_nowhere(options, wish))
    return path, expected.prior


def _check(options: Namespace, fence: Fence | None, spread_m: float) -> None:
    if options.leg is not None:
        raise BadInputError(f"--leg {options.leg:g} with --pattern best: expected --length, of the whole, or --legs")
    for name in ("first_heading", "climb"):
        if getattr(options, f"given_{name}"):
            text = name.replace("_", "-")
            raise BadInputError(f"--{text} with --pattern best: expected it left out: the search decides")
    if options.legs is not None and not 3 <= options.legs <= MOST_LEGS:
        raise BadInputError(f"--legs {options.legs}: expected 3 to {MOST_LEGS} for --pattern best")
    low, high = options.turn or (0.0, 180.0)
    if high < 30.0:
        raise BadInputError(
            f"--turn {low:g}..{high:g}: a path that turns less than 30° at its corners sees nothing: expected more"
        )
    if fence is not None and fence.within:
        room, least = min(area_m2(polygon) for polygon in fence.within), LEAST_ROOM_SPREADS2 * spread_m**2
        if room < least:
            raise BadInputError(
                f"--fence {options.fence}: too small: {room:.3g} m², expected {least:.3g} m² or more for "
                f"√C {spread_m:.3g} m"
            )
        _check_margin(options, fence)


def _check_margin(options: Namespace, fence: Fence) -> None:
    margin_m = options.margin or 0.0
    room_m = fence.room(margin_m)
    if room_m < margin_m:
        most = f"at most {room_m:.3g}" if room_m > 0.0 else "a fence with room in it"
        raise BadInputError(
            f"--fence {options.fence}: --margin {margin_m:g}: no place lies so far from its bounds: expected {most}"
        )


def _anchor(centre_m: tuple[float, float] | None, fence: Fence | None, spread_m: float) -> Array:
    """(2, 2) corners of the box sources are in if nothing is said: about the centre given, the fence's, or home."""
    middle = np.zeros(2)
    if centre_m is not None:
        middle = np.array(centre_m)
    elif fence is not None and fence.within:
        low, high = fence.extent()
        middle = 0.5 * (low + high)
    half = 0.5 * LEG_SPREADS * spread_m
    return np.array([middle - half, middle + half])


def _wish(options: Namespace, fence: Fence | None, spread_m: float, expected: Expectation) -> Wish:
    from missions.best import Wish

    low, high = options.turn or (0.0, 180.0)
    usual = options.legs * USUAL_LEG_SPREADS if options.legs else USUAL_LENGTH_SPREADS
    length_m = options.length or usual * spread_m
    limit_m = LONGEST_LEG_M * (options.legs or MOST_LEGS)
    least_m = max(SHORTEST_LEG_M, 0.05 * spread_m)
    if least_m * (options.legs or 3) > limit_m:
        raise BadInputError(f"--spread {spread_m:g}: no leg may be longer than {LONGEST_LEG_M:g} m: expected less")
    if not least_m * (options.legs or 3) <= length_m <= limit_m:
        raise BadInputError(f"--length {length_m:g}: expected {least_m * (options.legs or 3):g} to {limit_m:g} m")
    wish = Wish(
        length_m, options.legs, fence or Fence(), options.margin or 0.0,
        (math.radians(low), math.radians(high)), least_m,
    )  # fmt: skip
    if options.target_sd and not (options.length or options.legs):
        return _long_enough(options, wish, spread_m, expected)
    return wish


def _long_enough(options: Namespace, wish: Wish, spread_m: float, expected: Expectation) -> Wish:
    """The shortest length at which a star reaches the accuracy wanted: the best mission then does."""
    from missions.best import best_star_error_m

    reached = math.inf
    for spreads in LENGTHS:
        longer = replace(wish, length_m=spreads * spread_m)
        error_m = best_star_error_m(longer, expected.prior, expected.groups, expected.sensing)
        reached = min(reached, error_m)
        if error_m <= options.target_sd:
            return longer
    raise BadInputError(
        f"--target-sd {options.target_sd:g}: out of reach: {LENGTHS[-1] * spread_m:.0f} m of star see to "
        f"{reached:.2g} m in the median"
    )


def _nowhere(options: Namespace, wish: Wish) -> str:
    """Why there is no mission, in one line."""
    legs = f"{count(wish.legs, 'leg')}, " if wish.legs else ""
    low, high = (math.degrees(turn) for turn in wish.turn_rad)
    asked = f"{legs}{wish.length_m:.0f} m in all, turns of {low:.0f}° to {high:.0f}°"
    margin = f", {wish.margin_m:g} m from its bounds" if wish.margin_m else ""
    if wish.fence.polygons:
        return (
            f"--fence {options.fence}: no path of {asked} found within it{margin}: expected more room, or other turns"
        )
    return f"--turn {low:.0f}..{high:.0f}: no path of {asked} found"
