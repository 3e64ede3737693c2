"""The mission `plan` speaks of: read from a file, or made."""

from __future__ import annotations

import math
from argparse import Namespace
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dslam_mav.commands.screen import Screen
from dslam_mav.commands.vehicle import parse_home
from dslam_mav.errors import BadInputError
from dslam_mav.mission import CMD_CHANGE_SPEED, Home, Mission, home_of, leg_plan
from dslam_mav.records.arrays import Array
from dslam_mav.records.words import count
from missions.fence import Fence
from missions.patterns import PATTERN_NAMES, pattern
from missions.plan import Profile, plan_mission
from missions.plan_fence import GeoFence, read_fence
from missions.plan_file import read_plan
from sim_bridge.vehicle import DEFAULT_HOME

if TYPE_CHECKING:
    from dslam_mav.dslam.layouts import Prior

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
class Planned:
    """A mission, what it is called, its speed, its fence in metres and as its file has it, its home if that is not the
    usual one, and the sources it was made for. `own_fence`: that of the plan's own file where `--fence` names none:
    what is advised keeps to it, but it says nothing of where the sources are.
    """

    mission: Mission
    name: str
    speed_m_s: float
    fence: Fence | None = None
    raw_fence: dict[str, Any] | None = None
    home: str | None = None
    prior: Prior | None = None
    own_fence: Fence | None = None

    @property
    def kept(self) -> Fence | None:
        """The fence that what is flown has to keep to."""
        return self.fence or self.own_fence

    @property
    def fenced(self) -> bool:
        """Whether its file has any zone to keep in or out of."""
        return any((self.raw_fence or {}).get(zones) for zones in ("polygons", "circles"))


def find_plan(options: Namespace, screen: Screen) -> Planned:
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


def path_of(planned: Planned, options: Namespace) -> Array:
    """(L+1, 2 or 3) vertices; heights where the estimator is to count with them."""
    legs = leg_plan(planned.mission)
    if len(legs.lengths_m) < 1:
        raise BadInputError(
            f"{options.plan}: {count(len(legs.sequence), 'waypoint')}: expected 2 or more, to fly legs between"
        )
    if (options.dimensions or (3 if options.climb else 2)) == 2:
        return legs.vertices_m
    heights = np.array([planned.mission.items[q].z for q in legs.sequence])
    return np.column_stack([legs.vertices_m, heights - heights.min()])


def _read(options: Namespace, geofence: GeoFence | None, screen: Screen) -> Planned:
    file = read_plan(Path(options.plan))
    for note in file.notes:
        screen.warn(note)
    home = home_of(file.mission)
    speeds = [i.params[1] for i in file.mission.items if i.command == CMD_CHANGE_SPEED and i.params[1] > 0.0]
    planned = Planned(
        file.mission,
        Path(options.plan).name,
        options.speed or (float(speeds[0]) if speeds else DEFAULTS["speed"]),  # type: ignore[arg-type]
        geofence.around(home) if geofence and home else None,
        geofence.raw if geofence else file.fence,
        home=_place(home) if home else None,
    )
    if geofence is None and home is not None and planned.fenced:
        return replace(planned, own_fence=_own_fence(options.plan, home, screen))
    return planned


def _own_fence(file: str, home: Home, screen: Screen) -> Fence | None:
    """Of a plan somebody drew; one that cannot be understood is no reason not to look at the plan."""
    try:
        return read_fence(file).around(home)
    except BadInputError as problem:
        screen.warn(f"{problem}: what is advised does not keep to this geofence")
        return None


def _make(options: Namespace, geofence: GeoFence | None, screen: Screen) -> Planned:
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
    raw, where = (geofence.raw, _place(home)) if geofence else (None, None)
    return Planned(mission, str(options.pattern), options.speed, fence, raw, options.home or where, prior)


def _place(home: Home) -> str:
    """As --home takes it."""
    return f"{home.latitude_deg:.7f},{home.longitude_deg:.7f}"


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
