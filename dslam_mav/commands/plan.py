"""`plan`: make a mission, or look at one somebody else drew, and say how well it will see."""

from __future__ import annotations

import math
from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dslam_mav.commands.plan_advice import advice
from dslam_mav.commands.plan_making import Planned, find_plan, path_of
from dslam_mav.commands.plan_prior import expectation
from dslam_mav.commands.screen import Screen
from dslam_mav.errors import BadInputError
from dslam_mav.records.arrays import Array
from dslam_mav.records.words import count
from missions.plan_file import check_plan_output, write_plan

if TYPE_CHECKING:
    from dslam_mav.commands.plan_prior import Expectation
    from dslam_mav.commands.plan_simulate import Simulated
    from dslam_mav.dslam.outlook import Outlook

MOST_READINGS = 1e6  # of a simulated flight
MUCH_LONGER = 30.0  # times: no advice


def run(options: Namespace) -> int:
    """Write the plan and say what it is."""
    screen = Screen(json_only=options.json)
    if options.output:
        check_plan_output(options.output)
    planned = find_plan(options, screen)
    path = path_of(planned, options)
    legs = np.diff(path, axis=0)
    lengths_m = np.linalg.norm(legs, axis=1)
    expected = expectation(options, path, planned.prior, planned.fence, planned.speed_m_s)
    seen = _seen(path, expected)
    _reach(options, seen, float(lengths_m.sum()))
    _readings(options, expected.sensing.readings_per_m * float(lengths_m.sum()))
    _write(options, planned, screen)
    _tell_legs(screen, planned.name, legs, lengths_m)
    flown = _simulated(options, path, expected, screen)
    instead = _judge(options, screen, planned, path, seen, expected)
    if flown is not None:
        from dslam_mav.commands.plan_words import realised

        screen.say(realised(flown))
    if planned.kept is not None and not planned.kept.lets_pass(path[:, :2]):
        screen.warn(
            f"{planned.name} leaves {f'the geofence of {options.fence}' if options.fence else 'its own geofence'}"
        )
    if options.output:
        screen.say(f"Written {options.output}")
    from dslam_mav.commands import plan_words as words

    screen.result(
        {
            "predicted": words.as_json(seen),
            "verdict": words.verdict(seen),
            **instead,
            "simulated": words.simulated_json(flown),
            "for": words.prior_json(expected, options),
            "legs": len(legs),
            "length_m": float(lengths_m.sum()),
            "vertices_m": path.tolist(),
            "plan": options.output,
        }
    )
    return 0


def _write(options: Namespace, planned: Planned, screen: Screen) -> None:
    if not options.output:
        return
    write_plan(Path(options.output), planned.mission, planned.raw_fence)
    if planned.fenced and Path(options.output).suffix.lower() != ".plan":
        screen.warn(f"{options.output} cannot hold the geofence: a .plan does")


def _seen(path: Array, expected: Expectation) -> Outlook:
    from dslam_mav.dslam.outlook import outlook

    try:
        return outlook(path, expected.groups, expected.sensing)
    except ValueError as problem:
        raise BadInputError(f"--spread: {problem}") from None


def _judge(
    options: Namespace, screen: Screen, planned: Planned, path: Array, seen: Outlook, expected: Expectation
) -> dict[str, Any]:
    """Say figures and verdict; of a poor plan why, and what to fly instead."""
    from dslam_mav.commands.plan_again import suggestion
    from dslam_mav.commands.plan_words import instead_json, predicted, verdict, warning

    screen.say(predicted(seen, expected))
    screen.say(verdict(seen))
    if not seen.poor:
        return {"reason": None, "instead": None}
    why, star = advice(options, planned, path, seen, expected)
    instead = None if star is None else suggestion(star, options, planned, expected)
    limited = bool(options.turn) or bool(planned.kept)
    screen.warn(f"{planned.name} sees badly: {warning(why, instead, limited)}")
    return {"reason": why, "instead": instead_json(instead)}


def _simulated(options: Namespace, path: Array, expected: Expectation, screen: Screen) -> Simulated | None:
    if options.simulate is None:
        return None
    from dslam_mav.commands.plan_simulate import simulate

    with screen.progress("simulated missions") as advance:
        return simulate(path, expected, options.simulate, options.workers, options.seed, advance)


def _readings(options: Namespace, count: float) -> None:
    """BadInputError where a flight has more than can be simulated."""
    if options.simulate is not None and count > MOST_READINGS:
        raise BadInputError(
            f"--simulate {options.simulate}: {count:.2g} readings a flight: expected at most {MOST_READINGS:g}; "
            "give a larger --spacing or a lower --rate"
        )


def _reach(options: Namespace, seen: Outlook, length_m: float) -> None:
    """BadInputError where the accuracy wanted is not to be expected."""
    if options.target_sd is None or seen.source.median_m <= options.target_sd:
        return
    sees = seen.source.median_m
    told = "cannot place the sources at all"
    if math.isfinite(sees):
        longer = (sees / options.target_sd) ** 2
        told = f"sees to {sees:.2g} m in the median"
        told += f"; about {longer * length_m:.0f} m would" if longer < MUCH_LONGER else ""
    raise BadInputError(f"--target-sd {options.target_sd:g}: out of reach: a mission of {length_m:.0f} m {told}")


def _tell_legs(screen: Screen, name: str, legs: Array, lengths_m: Array) -> None:
    from dslam_mav.commands.plan_words import turn

    screen.say(f"{name}: {count(len(legs), 'leg')}, {lengths_m.sum():.1f} m")
    turns = np.degrees(np.diff(np.arctan2(legs[:, 1], legs[:, 0])))
    turns = (turns + 180.0) % 360.0 - 180.0
    for j, leg_m in enumerate(lengths_m):
        rise = f", {legs[j, 2]:+.2f} m up" if legs.shape[1] == 3 else ""
        screen.say(f"  leg {j + 1}: {leg_m:.2f} m{rise}{turn(turns[j]) if j < len(turns) else ''}")
