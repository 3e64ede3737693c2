"""Options of `plan`: a mission to look at or to make, and what is known of the sources before it is flown."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable

from dslam_mav.commands.options import ANY, COUNT, MAX_SOURCES, NOT_NEGATIVE, POSITIVE, SEED, number

Parse = Callable[[str], float]


def within(least: float, most: float, unit: str, *, or_none: bool = False) -> Parse:
    """A number within limits, said with its unit where it is not; `or_none`: or 0."""
    parse = number(float, least, f"{'0 or ' if or_none else ''}{least:g} to {most:g} {unit}".rstrip(), most=most)

    def parse_or_none(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        return 0.0 if value == 0.0 else parse(text)

    return parse_or_none if or_none else parse


# Beyond these nothing is sensed or flown, and squares of squares no longer fit a float.
SHORTEST_M, LONGEST_M = 1e-6, 1e7
LENGTH = within(SHORTEST_M, LONGEST_M, "m")
LENGTH_OR_NONE = within(SHORTEST_M, LONGEST_M, "m", or_none=True)
SPEED = within(0.01, 100.0, "m/s")
SNR = within(-60.0, 200.0, "dB")
READING = within(1e-15, 1e15, "")
RATE = within(1e-6, 1e6, "Hz")
HEADING_SD = within(1e-6, 360.0, "degrees")
DIFFUSIVITY = within(1e-12, 1e12, "m²/s")
LEAST_AGE_S, MOST_AGE_S = 1e-6, 1e12
DRAWN = number(int, 1, "a whole number from 1 to 100000", most=100_000)

LAYOUTS = 200
ONE_OR_RANGE = f"a whole number from 1 to {MAX_SOURCES}, or a range such as 2-4"
STEEPEST_DEG = 80.0


def add_plan(parser: argparse.ArgumentParser) -> None:
    """All of them."""
    parser.add_argument("plan", nargs="?", metavar="FILE", help="a .plan or .waypoints to look at")
    parser.add_argument(
        "-o", "--output", metavar="FILE", help="write it: .plan (QGroundControl) or .waypoints (WPL 110)"
    )
    _made(parser.add_argument_group("a new mission"))
    _best(parser.add_argument_group("--pattern best: the mission that sees best, of a given length"))
    _sources(parser.add_argument_group("what is known of the sources"))
    _sensor(parser.add_argument_group("what is known of sensor and vehicle"))
    tried = parser.add_argument_group("predicted accuracy")
    tried.add_argument(
        "--layouts", metavar="N", type=DRAWN, default=LAYOUTS, help=f"of sources, drawn at random (default: {LAYOUTS})"
    )
    tried.add_argument("--simulate", metavar="N", type=DRAWN, help="fly N simulated missions through the estimator too")
    tried.add_argument("--workers", metavar="N", type=COUNT, help="processes (default: as many as cores)")
    tried.add_argument("--target-sd", metavar="M", type=LENGTH, help="the median error that is wanted, or exit 2")
    tried.add_argument("--seed", metavar="N", type=SEED, default=0, help="of layouts, noise, random turns (default: 0)")


def _made(group: argparse._ArgumentGroup) -> None:
    # Defaults are in commands.plan: with FILE none of these may be given.
    group.add_argument("--pattern", help="star7 (default), star5, triangle, square, lawnmower, spiral, random or best")
    group.add_argument("--leg", metavar="M", type=POSITIVE, help="leg length (default: 32)")
    group.add_argument("--legs", metavar="N", type=COUNT, help="number of legs (default: the pattern's own)")
    group.add_argument("--home", metavar="LAT,LON[,ALT]", help="where it is flown, degrees and metres")
    group.add_argument("--centre", metavar="E,N", help="middle of it in metres from home (default: begins there)")
    group.add_argument("--first-heading", metavar="DEG", type=ANY, help="counter-clockwise from east (default 0)")
    group.add_argument("--altitude", metavar="M", type=POSITIVE, help="above home (default: 20)")
    group.add_argument("--climb", metavar="DEG", type=_climb, help="legs climb and descend in turn (3-D, barometer)")
    group.add_argument("--speed", metavar="M_S", type=SPEED, help="(default: 5)")
    group.add_argument("--hold", metavar="S", type=NOT_NEGATIVE, help="wait at each corner (default: 0)")


def _best(group: argparse._ArgumentGroup) -> None:
    group.add_argument("--length", metavar="M", type=POSITIVE, help="in all (default: 22.4 √C, or 4.48 √C a leg)")
    group.add_argument("--fence", metavar="FILE", help="stay within the geofence of a .plan, out of its keep-out zones")
    group.add_argument("--margin", metavar="M", type=LENGTH_OR_NONE, help="from the fence (default: 0)")
    group.add_argument("--turn", metavar="DEG..DEG", type=span(0.0, 180.0), help="corners (default: 0..180)")


def _sources(group: argparse._ArgumentGroup) -> None:
    group.add_argument("--sources", metavar="K|K-K", type=_sources_range, default=(2, 2), help="how many (default: 2)")
    group.add_argument(
        "--area",
        metavar="E,N[,UP]",
        help="where they may be: a box in metres about the mission's middle (default: the fence, or the path's extent)",
    )
    group.add_argument(
        "--spread", metavar="M|M..M", type=span(SHORTEST_M, LONGEST_M),
        help="√C; a range is estimated in flight (default: the longest leg over 3.2)",
    )  # fmt: skip
    group.add_argument("--diffusivity", metavar="M2_S", type=DIFFUSIVITY, help="μ of a field that evolves; with --age")
    group.add_argument("--age", metavar="S|S..S", type=span(LEAST_AGE_S, MOST_AGE_S), help="t − τ at the start")
    group.add_argument("--ambient", choices=("known", "auto"), default="known", help="auto: estimated in flight")


def _sensor(group: argparse._ArgumentGroup) -> None:
    noise = group.add_mutually_exclusive_group()
    noise.add_argument("--snr", metavar="DB", type=SNR, help="of readings on a star that fills the area (default: 20)")
    noise.add_argument("--noise-sd", metavar="SD", type=READING, help="of a reading, in its unit; beside --peak")
    group.add_argument("--peak", metavar="R", type=READING, default=1.0, help="a usual source's peak (default: 1)")
    often = group.add_mutually_exclusive_group()
    often.add_argument("--spacing", metavar="M", type=LENGTH, help="between readings (default: √C/20)")
    often.add_argument("--rate", metavar="HZ", type=RATE, help="readings a second, at --speed")
    group.add_argument("--heading-sd", metavar="DEG", type=HEADING_SD, help="of the compass (default: none aboard)")
    group.add_argument("--leg-sd", metavar="M", type=LENGTH_OR_NONE, default=0.0, help="of a leg's length (default: 0)")
    group.add_argument("--closed", action="store_true", help="the estimator may take the path to close")
    group.add_argument("--dimensions", type=int, choices=(2, 3), help="3: climbs as the plan has them, known")


def span(least: float, most: float) -> Callable[[str], tuple[float, float]]:
    """One number or LOW..HIGH within limits."""

    def parse(text: str) -> tuple[float, float]:
        parts = text.split("..")
        try:
            values = [float(part) for part in parts]
        except ValueError:
            values = []
        if len(values) not in (1, 2) or not least <= values[0] <= values[-1] <= most:
            raise argparse.ArgumentTypeError(f"{text!r}: expected a number or LOW..HIGH, {least:g} to {most:g}")
        return (values[0], values[-1])

    return parse


def _sources_range(text: str) -> tuple[int, int]:
    try:
        values = [int(part) for part in text.split("-")]
    except ValueError:
        values = []
    if len(values) not in (1, 2) or not 1 <= values[0] <= values[-1] <= MAX_SOURCES:
        raise argparse.ArgumentTypeError(f"{text!r}: expected {ONE_OR_RANGE}")
    return values[0], values[-1]


def _climb(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not 0.0 < value <= STEEPEST_DEG:
        raise argparse.ArgumentTypeError(f"{text!r}: expected degrees above 0, at most {STEEPEST_DEG:g}")
    return value
