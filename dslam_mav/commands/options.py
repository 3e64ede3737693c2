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


RECORDINGS = ".mcap, .tlog, ArduPilot's .bin, or .csv"

POSITIVE = number(float, 0.0, "a positive number", above=True)
NOT_NEGATIVE = number(float, 0.0, "0 or more")
ANY = number(float, -1e300, "a number")
COUNT = number(int, 1, "a whole number, 1 or more")
SEED = number(int, 0, "a whole number, 0 or more")
N_SOURCES = number(int, 1, f"a whole number from 1 to {MAX_SOURCES}, or auto", most=MAX_SOURCES)


def or_auto(parse: Callable[[str], float], *others: str) -> Callable[[str], float | str]:
    """What `parse` takes, or the word auto, or one of `others`."""
    return lambda text: text if text in ("auto", *others) else parse(text)


AMBIENT = or_auto(number(float, -1e300, "a number, auto or hover"), "hover")
DRIFT = or_auto(number(float, -1e300, "a number, or auto"))
LAG = or_auto(number(float, 0.0, "0 or more, or auto"))


def assumptions(parser: argparse.ArgumentParser) -> None:
    """What the estimator may take for granted; see `commands.assume`."""
    group = parser.add_argument_group("assumptions (what is not given is estimated)")
    group.add_argument("--sources", metavar="N|auto", type=or_auto(N_SOURCES), help="how many (default: auto)")
    group.add_argument("--spread", metavar="M", type=POSITIVE, help="√C of a static field, for μ and τ")
    group.add_argument("--diffusivity", metavar="M2_S", type=POSITIVE, help="μ of the medium")
    group.add_argument("--activation", metavar="S", type=ANY, help="τ, seconds from the start of the first leg")
    group.add_argument(
        "--ambient", metavar="VALUE|auto|hover", type=AMBIENT,
        help="ambient level; hover: as read where the vehicle stood before its first leg, out of the sources' reach "
        "(default: auto)",
    )  # fmt: skip
    group.add_argument(
        "--noise", choices=("legs", "hover"),
        help="hover: the readings' noise as the vehicle stood before its first leg tells it, too (default: legs alone)",
    )  # fmt: skip
    group.add_argument(
        "--ambient-drift",
        metavar="PER_S|auto",
        type=DRIFT,
        help="of the ambient level, in reading units a second: a sensor that warms up (default: 0)",
    )
    group.add_argument("--lag", metavar="S|auto", type=LAG, help="time constant of a slow sensor (default: 0)")
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


def recording(parser: argparse.ArgumentParser) -> None:
    """What a recording somebody else made does not say of itself."""
    parser.add_argument("--plan", metavar="FILE", help="the mission flown (default: the log's)")
    columns(parser)


def columns(parser: argparse.ArgumentParser) -> None:
    """Where the columns of a CSV file are called otherwise."""
    parser.add_argument(
        "--columns",
        metavar="LIST",
        help="of a CSV: FIELD=NAME[*FACTOR][:UNIT],… with FIELD time_s, value, east_m or north_m, "
        "e.g. time_s=Time:ms,value=Gas*-1,east_m=X,north_m=Y",
    )


def settings(parser: argparse._ActionsContainer, help_text: str) -> None:
    """Assumptions changed one by one; see `commands.settings`."""
    parser.add_argument("--set", metavar="KEY=VALUE", action="append", help=help_text)


def export(parser: argparse.ArgumentParser) -> None:
    """What is taken out of a log, and where an answer lies on the map."""
    formats = ("csv", "tlog", "parquet", "kml", "geojson")
    parser.add_argument("--to", required=True, choices=formats, help="readings, raw packets, readings, or maps")
    parser.add_argument("-o", "--output", metavar="OUT", help="(default: beside the log)")
    parser.add_argument("--overwrite", action="store_true", help="replace OUT if it is there")
    recording(parser)
    settings(parser, "an assumption of the answer, repeatable; see replay --help (default: the log's own answer)")
    place = parser.add_argument_group("place of a map's answer (default: the plan's)")
    place.add_argument("--home", metavar="LAT,LON", help="degrees; without a plan where leg 1 begins")
    place.add_argument("--heading", metavar="DEG", type=ANY, help="of leg 1, clockwise from north")
    place.add_argument("--turn", choices=("left", "right"), help="side of the first turn (unknown: both are exported)")


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


def vehicle_link(
    parser: argparse.ArgumentParser, *, required: bool = True, several: bool = False, help_text: str = CONNECT_HELP
) -> None:
    """The connection to a vehicle; `several`: it may be given again."""
    parser.add_argument(
        "--connect", metavar="URL", required=required, action="append" if several else "store", help=help_text
    )
    parser.add_argument(
        "--timeout", metavar="S", type=POSITIVE, default=10.0, help="how long to wait for it (default: 10)"
    )
    parser.add_argument(
        "--profile", choices=("ardupilot", "px4", "generic"), help="how it behaves (default: as its HEARTBEAT says)"
    )
    signing_key(parser)


def truth_from(parser: argparse.ArgumentParser) -> None:
    """Where the bridge has the vehicle's true place from."""
    parser.add_argument(
        "--truth-from",
        choices=("sim", "vehicle"),
        help="read the field where the vehicle's simulator has it, or where it believes to be (default: the first it "
        "offers)",
    )


def feed_odometry(parser: argparse.ArgumentParser) -> None:
    """Stand in for a camera that the simulated vehicle navigates by."""
    parser.add_argument(
        "--feed-odometry",
        action="store_true",
        help="send the vehicle ODOMETRY from its simulator's truth: for one set to navigate by it",
    )


def send_odometry(parser: argparse.ArgumentParser) -> None:
    """Tell the vehicle where the answer has it; see `commands.odometry`."""
    parser.add_argument(
        "--send-odometry",
        action="store_true",
        help="send the vehicle ODOMETRY of where the answer has it, once there is one; with --heading vehicle or plan, "
        "and not while somebody else sends some",
    )


def signing_key(parser: argparse.ArgumentParser) -> None:
    """The key for MAVLink's message signing; see `commands.signing`."""
    parser.add_argument(
        "--signing-key-file",
        metavar="FILE",
        help="sign all packets, and heed only those signed with the same key: 32 bytes as 64 hexadecimal digits",
    )
