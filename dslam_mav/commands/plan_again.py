"""The command that plans what to fly instead: all that was asked of the poor plan goes with it, and its figures are
those the command prints.
"""

from __future__ import annotations

import argparse
import math
import shlex
from argparse import Namespace
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from dslam_mav.commands.command import Parser
from dslam_mav.commands.plan_making import DEFAULTS, Planned, find_plan, path_of
from dslam_mav.commands.plan_options import add_plan
from dslam_mav.commands.plan_prior import expectation
from dslam_mav.commands.screen import Screen

if TYPE_CHECKING:
    from dslam_mav.commands.plan_prior import Expectation
    from dslam_mav.dslam.outlook import Outlook
    from missions.nearest import Instead

_THE_STARS_OWN = frozenset(
    {"help", "plan", "pattern", "leg", "legs", "centre", "first_heading", "climb", "home", "length", "margin", "turn"}
)
"""What the star itself decides, or was held to where it was found."""


@dataclass(frozen=True, slots=True)
class Suggestion:
    """A star, the command that plans it, and what that command says it sees."""

    star: Instead
    command: str
    seen: Outlook


def suggestion(star: Instead, options: Namespace, planned: Planned, expected: Expectation) -> Suggestion:
    """What to type for the star, to be told of the same sources and the same sensor."""
    from dslam_mav.dslam.outlook import outlook

    words = [*_star(star, planned.home), *_given(options), *_implied(options, planned, expected)]
    parser = Parser()
    add_plan(parser)
    asked = parser.parse_args(words)
    again = find_plan(asked, Screen(json_only=True))
    path = path_of(again, asked)
    known = expectation(asked, path, again.prior, again.fence, again.speed_m_s)
    return Suggestion(star, shlex.join(["plan", *words]), outlook(path, known.groups, known.sensing))


def _star(star: Instead, home: str | None) -> Iterator[str]:
    yield from ("--pattern", star.pattern, "--leg", f"{star.leg_m:g}", "--legs", str(star.legs))
    yield from ("--centre", ",".join(f"{metres + 0.0:.1f}" for metres in star.centre_m))  # without -0.0
    if heading_deg := round(math.degrees(star.first_heading_rad), 1):
        yield from ("--first-heading", f"{heading_deg:g}")
    if star.climb_rad:
        yield from ("--climb", f"{math.degrees(star.climb_rad):.1f}")
    if home:
        yield from ("--home", home)


def _given(options: Namespace) -> Iterator[str]:
    """Options that were given, as they were."""
    parser = argparse.ArgumentParser(add_help=False)
    add_plan(parser)
    for action in parser._actions:
        value = getattr(options, action.dest)
        usual = DEFAULTS.get(action.dest, action.default)
        if action.dest in _THE_STARS_OWN or value is None or value == usual:
            continue
        yield action.option_strings[-1]
        if value is not True:
            yield _text(action.dest, value)


def _implied(options: Namespace, planned: Planned, expected: Expectation) -> Iterator[str]:
    """What was taken from the poor plan, and another plan would say otherwise."""
    if options.area is None and (planned.fence is None or not planned.fence.within):
        yield from ("--area", ",".join(f"{metres:.4g}" for metres in expected.prior.region.extent))
    if planned.own_fence is not None:
        yield from ("--fence", str(options.plan))
    if options.spread is None and options.diffusivity is None:
        yield from ("--spread", f"{expected.prior.usual_spread_m:.4g}")
    if options.speed is None and planned.speed_m_s != DEFAULTS["speed"]:
        yield from ("--speed", f"{planned.speed_m_s:.5g}")


def _text(name: str, value: Any) -> str:
    """As the option takes it."""
    if not isinstance(value, tuple):
        return format(value, ".15g") if isinstance(value, float) else str(value)
    between = "-" if name == "sources" else ".."
    return between.join(_text(name, one) for one in dict.fromkeys(value))
