"""`plan`: make a mission, or look at one somebody else drew."""

from __future__ import annotations

import math
from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dslam_mav.commands.screen import Screen
from dslam_mav.commands.vehicle import parse_home
from dslam_mav.errors import BadInputError
from dslam_mav.mission import Mission, leg_plan
from dslam_mav.records import Medium
from dslam_mav.records.arrays import Array
from missions.patterns import pattern
from missions.plan import Profile, plan_mission
from missions.plan_file import PlanFile, read_plan, write_plan
from sim_bridge.vehicle import DEFAULT_HOME

if TYPE_CHECKING:
    from dslam_mav.dslam.predict import Outlook

LEG_SPREADS = 3.2  # the leg the figures of star {7/3} are for
POOR_SPREADS = 0.3

DEFAULTS = {
    "pattern": "star7",
    "leg": 32.0,
    "first_heading": 0.0,
    "altitude": 20.0,
    "speed": 5.0,
    "hold": 0.0,
    "seed": 0,
}
MAKING = (*DEFAULTS, "legs", "home", "centre")
"""Options of a mission that is made; with a FILE none of them says anything."""


def run(options: Namespace) -> int:
    """Write the plan and say what it is."""
    screen = Screen(json_only=options.json)
    plan, name = _plan(options)
    legs = leg_plan(plan.mission)
    if len(legs.lengths_m) < 1:
        raise BadInputError(f"{options.plan}: {len(legs.sequence)} waypoints: expected 2 or more, to fly legs between")
    for note in plan.notes:
        screen.warn(note)
    if options.output:
        write_plan(Path(options.output), plan.mission)
    length_m = float(legs.lengths_m.sum())
    screen.say(f"{name}: {len(legs.lengths_m)} legs, {length_m:.1f} m")
    turns = np.degrees(np.diff(legs.headings_rad))
    turns = (turns + 180.0) % 360.0 - 180.0
    for j, leg_m in enumerate(legs.lengths_m):
        screen.say(f"  leg {j + 1}: {leg_m:.2f} m{_then(turns[j]) if j < len(turns) else ''}")
    seen, spread_m = _predicted(options, legs.vertices_m)
    verdict = _verdict(seen, spread_m)
    screen.say(_in_words(seen, spread_m, options))
    screen.say(verdict)
    if options.output:
        screen.say(f"written {options.output}")
    said = {"legs": len(legs.lengths_m), "length_m": length_m, "plan": options.output}
    screen.result({"predicted": _as_json(seen), "verdict": verdict, **said})
    return 0


def _predicted(options: Namespace, vertices_m: Array) -> tuple[Outlook, float]:
    """The outlook, and the spread it is for."""
    from dslam_mav.dslam.predict import Layouts, outlook

    longest_m = float(np.linalg.norm(np.diff(vertices_m, axis=0), axis=1).max())
    spread_m = options.spread or longest_m / LEG_SPREADS
    low, high = vertices_m.min(axis=0), vertices_m.max(axis=0)
    area_m = _pair(options.area, "--area") if options.area else (float(high[0] - low[0]), float(high[1] - low[1]))
    if min(area_m) < 0.0:
        raise BadInputError(f"--area {options.area}: expected lengths in metres")
    middle = 0.5 * (low + high)
    layouts = Layouts(options.sources, spread_m, area_m, (float(middle[0]), float(middle[1])), options.snr)
    try:
        seen = outlook(vertices_m, Medium(spread_m=spread_m, static=True), layouts, np.random.default_rng(0))
    except ValueError as problem:
        raise BadInputError(f"--sources {options.sources}: {problem}; give a larger --area or less --spread") from None
    return seen, spread_m


def _in_words(seen: Outlook, spread_m: float, options: Namespace) -> str:
    if not np.isfinite(seen.source_median_m):
        return f"predicted for {options.sources} sources, √C {spread_m:.3g} m: no source can be placed"
    return (
        f"predicted for {options.sources} sources, √C {spread_m:.3g} m, {options.snr:g} dB: "
        f"sources to {seen.source_median_m:.2g} m rms (90 % of layouts {seen.source_p90_m:.2g} m), "
        f"path to {seen.path_median_m:.2g} m"
    )


def _verdict(seen: Outlook, spread_m: float) -> str:
    share = seen.unidentifiable_share
    if share > 0.5:
        return "Blind: on this path most layouts of sources cannot be told. Fly a star: its legs cross the middle."
    if share > 0.05 or seen.source_median_m > POOR_SPREADS * spread_m:
        return (
            f"Sees badly: {100.0 * share:.0f} % of layouts cannot be told, half of all to worse than "
            f"{seen.source_median_m / spread_m:.2f} √C. "
            f"star5 with legs of {4.5 * spread_m:.3g} m sees several times better."
        )
    return "Sees well, for sources within the area; a second answer may still fit as well, which no bound shows."


def _as_json(seen: Outlook) -> dict[str, Any]:
    def finite(value: float) -> float | None:
        return value if np.isfinite(value) else None

    return {
        "source_error_m": {"median": finite(seen.source_median_m), "p90": finite(seen.source_p90_m)},
        "path_error_m": {"median": finite(seen.path_median_m), "p90": finite(seen.path_p90_m)},
        "unidentifiable_share": seen.unidentifiable_share,
    }


def _pair(text: str, option: str) -> tuple[float, float]:
    try:
        east_m, north_m = (float(part) for part in text.split(","))
    except ValueError:
        raise BadInputError(f"{option} {text}: expected EAST_M,NORTH_M") from None
    return east_m, north_m


def _plan(options: Namespace) -> tuple[PlanFile, str]:
    """The plan read or made, and its name."""
    given = [name for name in MAKING if getattr(options, name) is not None]
    if options.plan and given:
        raise BadInputError(
            f"--{given[0].replace('_', '-')} with {options.plan}: expected one of them: a plan is made or read"
        )
    if options.plan:
        return read_plan(Path(options.plan)), Path(options.plan).name
    for name, value in DEFAULTS.items():
        if getattr(options, name) is None:
            setattr(options, name, value)
    return PlanFile(_make(options)), str(options.pattern)


def _then(turn_deg: float) -> str:
    if abs(turn_deg) < 0.05:
        return ", then straight on"
    return f", then {abs(turn_deg):.1f}° {'left' if turn_deg > 0 else 'right'}"


def _make(options: Namespace) -> Mission:
    centre = _pair(options.centre, "--centre") if options.centre else None
    vertices = pattern(
        options.pattern,
        options.leg,
        legs=options.legs,
        heading_rad=math.radians(options.first_heading),
        centre_m=centre,
        rng=np.random.default_rng(options.seed),
    )
    home = parse_home(options.home) if options.home else DEFAULT_HOME
    profile = Profile(altitude_m=options.altitude, speed_m_s=options.speed, hold_s=options.hold)
    return plan_mission(vertices, home, profile)
