"""`plan`: make a mission, or look at one somebody else drew, and say how well it will see."""

from __future__ import annotations

import math
from argparse import Namespace
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dslam_mav.commands.plan_prior import expectation
from dslam_mav.commands.screen import Screen
from dslam_mav.commands.vehicle import parse_home
from dslam_mav.errors import BadInputError
from dslam_mav.mission import CMD_CHANGE_SPEED, Home, Mission, home_of, leg_plan
from dslam_mav.records.arrays import Array
from missions.fence import Fence
from missions.patterns import PATTERN_NAMES, pattern
from missions.plan import Profile, plan_mission
from missions.plan_fence import GeoFence, read_fence
from missions.plan_file import read_plan, write_plan
from sim_bridge.vehicle import DEFAULT_HOME

if TYPE_CHECKING:
    from dslam_mav.commands.plan_prior import Expectation
    from dslam_mav.commands.plan_simulate import Simulated
    from dslam_mav.dslam.layouts import Prior
    from dslam_mav.dslam.outlook import Outlook

BEST = "best"
DEFAULTS = {
    "pattern": "star7",
    "leg": 32.0,
    "first_heading": 0.0,
    "altitude": 20.0,
    "speed": 5.0,
    "hold": 0.0,
}
READ_ONLY = ("legs", "home", "centre", "climb", "length", "margin", "turn")
MAKING = tuple(name for name in (*DEFAULTS, *READ_ONLY) if name != "speed")
"""Options of a mission that is made; with a FILE none of them says anything."""


@dataclass(frozen=True, slots=True)
class _Planned:
    """A mission, what it is called, its speed, its fence in metres and as its file has it, its home if that is not the
    usual one, and the sources it was made for.
    """

    mission: Mission
    name: str
    speed_m_s: float
    fence: Fence | None = None
    raw_fence: dict[str, Any] | None = None
    home: str | None = None
    prior: Prior | None = None


def run(options: Namespace) -> int:
    """Write the plan and say what it is."""
    screen = Screen(json_only=options.json)
    planned = _planned(options, screen)
    path = _path(planned, options)
    legs = np.diff(path, axis=0)
    lengths_m = np.linalg.norm(legs, axis=1)
    expected = expectation(options, path, planned.prior, planned.fence, planned.speed_m_s)
    seen = _seen(path, expected)
    _reach(options, seen, float(lengths_m.sum()))
    _tell_legs(screen, planned.name, legs, lengths_m)
    flown = _simulated(options, path, expected, screen)
    instead = _judge(screen, planned, path, seen, expected)
    if flown is not None:
        from dslam_mav.commands.plan_words import realised

        screen.say(realised(flown))
    if planned.fence is not None and not planned.fence.lets_pass(path[:, :2]):
        screen.warn(f"{planned.name} leaves the geofence of {options.fence}")
    if options.output:
        write_plan(Path(options.output), planned.mission, planned.raw_fence)
        screen.say(f"written {options.output}")
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


def _seen(path: Array, expected: Expectation) -> Outlook:
    from dslam_mav.dslam.outlook import outlook

    try:
        return outlook(path, expected.groups, expected.sensing)
    except ValueError as problem:
        raise BadInputError(f"--spread: {problem}") from None


def _judge(screen: Screen, planned: _Planned, path: Array, seen: Outlook, expected: Expectation) -> dict[str, Any]:
    """Say figures and verdict; of a poor plan why, and what to fly instead."""
    from dslam_mav.commands.plan_words import instead_json, predicted, verdict, warning
    from dslam_mav.dslam.outlook import reason
    from missions.nearest import nearest_that_sees

    screen.say(predicted(seen, expected))
    screen.say(verdict(seen))
    if not seen.poor:
        return {"reason": None, "instead": None}
    middle = expected.prior.region.middle
    why = reason(path, expected.groups, expected.sensing)
    instead = nearest_that_sees(path, seen, expected.groups, expected.sensing, (float(middle[0]), float(middle[1])))
    screen.warn(f"{planned.name} sees badly: {warning(why, instead, planned.home)}")
    return {"reason": why, "instead": instead_json(instead, planned.home)}


def _simulated(options: Namespace, path: Array, expected: Expectation, screen: Screen) -> Simulated | None:
    if options.simulate is None:
        return None
    from dslam_mav.commands.plan_simulate import simulate

    with screen.progress("simulated missions") as advance:
        return simulate(path, expected, options.simulate, options.workers, options.seed, advance)


def _reach(options: Namespace, seen: Outlook, length_m: float) -> None:
    """BadInputError where the accuracy wanted is not to be expected."""
    if options.target_sd is None or seen.source.median_m <= options.target_sd:
        return
    sees = seen.source.median_m
    told = "cannot place the sources at all"
    if math.isfinite(sees):
        told = f"sees to {sees:.2g} m in the median; about {length_m * (sees / options.target_sd) ** 2:.0f} m would"
    raise BadInputError(f"--target-sd {options.target_sd:g}: out of reach: a mission of {length_m:.0f} m {told}")


def _tell_legs(screen: Screen, name: str, legs: Array, lengths_m: Array) -> None:
    from dslam_mav.commands.plan_words import turn

    screen.say(f"{name}: {len(legs)} legs, {lengths_m.sum():.1f} m")
    turns = np.degrees(np.diff(np.arctan2(legs[:, 1], legs[:, 0])))
    turns = (turns + 180.0) % 360.0 - 180.0
    for j, leg_m in enumerate(lengths_m):
        rise = f", {legs[j, 2]:+.2f} m up" if legs.shape[1] == 3 else ""
        screen.say(f"  leg {j + 1}: {leg_m:.2f} m{rise}{turn(turns[j]) if j < len(turns) else ''}")


def _path(planned: _Planned, options: Namespace) -> Array:
    """(L+1, 2 or 3) vertices; heights where the estimator is to count with them."""
    legs = leg_plan(planned.mission)
    if len(legs.lengths_m) < 1:
        raise BadInputError(f"{options.plan}: {len(legs.sequence)} waypoints: expected 2 or more, to fly legs between")
    if (options.dimensions or (3 if options.climb else 2)) == 2:
        return legs.vertices_m
    heights = np.array([planned.mission.items[q].z for q in legs.sequence])
    return np.column_stack([legs.vertices_m, heights - heights.min()])


def _planned(options: Namespace, screen: Screen) -> _Planned:
    """The plan read or made, and its name."""
    geofence = read_fence(options.fence) if options.fence else None
    given = [name for name in MAKING if getattr(options, name) is not None]
    if options.plan and given:
        raise BadInputError(
            f"--{given[0].replace('_', '-')} with {options.plan}: expected one of them: a plan is made or read"
        )
    if options.plan:
        return _read(options, geofence, screen)
    options.given_first_heading, options.given_climb = options.first_heading is not None, options.climb is not None
    return _make(options, geofence, screen)


def _read(options: Namespace, geofence: GeoFence | None, screen: Screen) -> _Planned:
    file = read_plan(Path(options.plan))
    for note in file.notes:
        screen.warn(note)
    home = home_of(file.mission)
    speeds = [i.params[1] for i in file.mission.items if i.command == CMD_CHANGE_SPEED and i.params[1] > 0.0]
    return _Planned(
        file.mission,
        Path(options.plan).name,
        options.speed or (float(speeds[0]) if speeds else DEFAULTS["speed"]),  # type: ignore[arg-type]
        geofence.around(home) if geofence and home else None,
        home=f"{home.latitude_deg:.7f},{home.longitude_deg:.7f}" if home else None,
    )


def _make(options: Namespace, geofence: GeoFence | None, screen: Screen) -> _Planned:
    from dslam_mav.commands.plan_best import ALONE, best

    if options.pattern != BEST:
        for name in ALONE:
            if getattr(options, name) is not None:
                raise BadInputError(f"--{name}: expected with --pattern {BEST} only")
    leg = options.leg
    for name, value in DEFAULTS.items():
        if getattr(options, name) is None:
            setattr(options, name, value)
    if options.pattern not in (BEST, *PATTERN_NAMES):
        raise BadInputError(f"pattern {options.pattern!r}: expected one of {', '.join((*PATTERN_NAMES, BEST))}")
    profile = Profile(altitude_m=options.altitude, speed_m_s=options.speed, hold_s=options.hold)
    home = _home(options, geofence)
    fence = geofence.around(home) if geofence else None
    centre = _pair(options.centre, "--centre") if options.centre else None
    prior: Prior | None = None
    if options.pattern == BEST:
        options.leg = leg
        vertices, prior = best(options, centre, fence, screen)
    else:
        vertices = pattern(
            options.pattern,
            options.leg,
            legs=options.legs,
            heading_rad=math.radians(options.first_heading),
            centre_m=centre,
            rng=np.random.default_rng(options.seed),
        )
    if options.climb:
        vertices = _climbing(vertices, options.climb)
    mission = plan_mission(vertices, home, profile)
    return _Planned(
        mission, str(options.pattern), options.speed, fence, geofence.raw if geofence else None, options.home, prior
    )


def _climbing(vertices: Array, climb_deg: float) -> Array:
    """(L+1, 3) the same on the ground, its legs up and down in turn so steeply."""
    rise = np.linalg.norm(np.diff(vertices, axis=0), axis=1) * math.tan(math.radians(climb_deg))
    up = np.concatenate([[0.0], np.cumsum(rise * (-1.0) ** np.arange(len(rise)))])
    return np.column_stack([vertices, up - up.min()])


def _home(options: Namespace, geofence: GeoFence | None) -> Home:
    if options.home:
        return parse_home(options.home)
    if geofence is not None:
        return geofence.home or geofence.anywhere()
    return DEFAULT_HOME


def _pair(text: str, option: str) -> tuple[float, float]:
    try:
        east_m, north_m = (float(part) for part in text.split(","))
    except ValueError:
        raise BadInputError(f"{option} {text}: expected EAST_M,NORTH_M") from None
    return east_m, north_m
