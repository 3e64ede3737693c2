"""Groups of options that several commands share, and numbers with limits."""

from __future__ import annotations

import argparse
from collections.abc import Callable

MAX_SOURCES = 8  # of the estimator, which is slow to import

CONNECT_HELP = "udpout:HOST:PORT, udpin:HOST:PORT, tcp:HOST:PORT or /dev/ttyX,BAUD"


def number(
    kind: type[float] | type[int], least: float, what: str, *, most: float = 1e300, above: bool = False
) -> Callable[[str], float]:
    """A number within limits, for argparse; a failure names what was expected."""

    def parse(text: str) -> float:
        try:
            value = kind(text)
        except ValueError:
            value = float("nan")
        if not ((least < value if above else least <= value) and value <= most):
            raise argparse.ArgumentTypeError(f"{text!r}: expected {what}")
        return value

    return parse


POSITIVE = number(float, 0.0, "a positive number", above=True)
NOT_NEGATIVE = number(float, 0.0, "0 or more")
ANY = number(float, -1e300, "a number")
COUNT = number(int, 1, "a whole number, 1 or more")
SEED = number(int, 0, "a whole number, 0 or more")
N_SOURCES = number(int, 1, f"a whole number from 1 to {MAX_SOURCES}, or auto", most=MAX_SOURCES)


def or_auto(parse: Callable[[str], float]) -> Callable[[str], float | str]:
    """What `parse` takes, or the word auto."""
    return lambda text: "auto" if text == "auto" else parse(text)


def assumptions(parser: argparse.ArgumentParser) -> None:
    """What the estimator may take for granted; see `commands.assume`."""
    group = parser.add_argument_group("assumptions (what is not given is estimated)")
    group.add_argument("--sources", metavar="N|auto", type=or_auto(N_SOURCES), help="how many (default: auto)")
    group.add_argument("--spread", metavar="M", type=POSITIVE, help="√C of a static field, for μ and τ")
    group.add_argument("--diffusivity", metavar="M2_S", type=POSITIVE, help="μ of the medium")
    group.add_argument("--activation", metavar="S", type=ANY, help="τ, seconds from the start of the first leg")
    group.add_argument("--ambient", metavar="VALUE|auto", type=or_auto(ANY), help="ambient level (default: auto)")
    moving = group.add_mutually_exclusive_group()
    moving.add_argument("--static", action="store_true", help="the field stands still during the flight (default)")
    moving.add_argument("--evolving", action="store_true", help="it spreads during the flight: C = 4μ(t − τ)")
    group.add_argument("--dimensions", type=int, choices=(2,), help="2: sources and path in one plane")
    group.add_argument("--heading", choices=("none", "vehicle", "plan"), help="headings it may see (default: none)")
    group.add_argument("--heading-sd", metavar="DEG", type=POSITIVE, help="how far they are trusted (default: 5)")
    group.add_argument(
        "--distance", choices=("odometry", "speed", "plan"), help="along a leg (default: the first the vehicle offers)"
    )
    group.add_argument("--closed", action="store_true", help="the path ends where it began")
    group.add_argument(
        "--method",
        choices=("joint", "paper"),
        help="one fit over all readings, or the paper's algebra (default: joint)",
    )
    group.add_argument("--seed", metavar="N", type=SEED, help="of the search, the noise and the vehicle")


def adaptive(parser: argparse.ArgumentParser) -> None:
    """A mission decided as it is flown; see `commands.adaptive`."""
    group = parser.add_argument_group("the mission in flight")
    group.add_argument(
        "--adaptive", action="store_true",
        help="after each leg choose the legs to come by what the readings so far leave open, and send them to the "
        "vehicle as it flies; the mission's length stays, its first leg is flown as planned",
    )  # fmt: skip
    group.add_argument(
        "--target-sd", metavar="M", type=POSITIVE,
        help="with --adaptive: end the legs once no other answer fits and every source is this sure",
    )  # fmt: skip


def source_of_readings(parser: argparse.ArgumentParser) -> None:
    """Where a simulated sensor's readings come from; see `commands.readings`."""
    group = parser.add_argument_group("readings")
    group.add_argument("--scene", metavar="FILE", help="synthetic readings from a scene (JSON)")
    group.add_argument("--readings", metavar="FILE", help="logged readings: .csv, .mcap, .tlog, or .npz frames")
    group.add_argument(
        "--columns",
        metavar="LIST",
        help="FIELD=NAME[*FACTOR],… with FIELD time_s, value, east_m or north_m: a CSV's columns (default "
        "time_s,value), or a tlog's message field, e.g. value=SCALED_PRESSURE2.temperature*0.01",
    )
    group.add_argument("--frames", metavar="N|A:B", help="of a .npz: the frame held, or the film run (default: 0:4)")
    group.add_argument(
        "--copies",
        metavar="K",
        type=COUNT,
        help="of a .npz: shifted copies added (default: as many as --sources, or 2)",
    )


def vehicle_link(parser: argparse.ArgumentParser, *, required: bool = True, help_text: str = CONNECT_HELP) -> None:
    """The connection to a vehicle."""
    parser.add_argument("--connect", metavar="URL", required=required, help=help_text)
    parser.add_argument(
        "--timeout", metavar="S", type=POSITIVE, default=10.0, help="how long to wait for it (default: 10)"
    )
