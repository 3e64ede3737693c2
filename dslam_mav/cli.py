"""The command line: argument parsing, exit codes, and nothing else."""

from __future__ import annotations

import argparse
import importlib
import os
import sys
from collections.abc import Callable, Sequence
from typing import NoReturn

from dslam_mav.errors import BadInputError, DslamError

BAD_INPUT = 2
FAILED = 1
INTERRUPTED = 130

_CONNECT_HELP = "udpout:HOST:PORT, udpin:HOST:PORT, tcp:HOST:PORT or /dev/ttyX,BAUD"


class _Parser(argparse.ArgumentParser):
    """Bad usage is one line on standard error; the help stays behind --help."""

    def error(self, message: str) -> NoReturn:
        raise BadInputError(f"{self.prog}: {message} (see {self.prog} --help)")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; its exit code."""
    try:
        options = _parser().parse_args(arguments)
        module, function = options.run
        command: Callable[[argparse.Namespace], int] = getattr(
            importlib.import_module(f"dslam_mav.commands.{module}"), function
        )
        return command(options)
    except DslamError as problem:
        sys.stderr.write(f"dslam-mav: {problem}\n")
        return BAD_INPUT if isinstance(problem, BadInputError) else FAILED
    except KeyboardInterrupt:
        sys.stderr.write("dslam-mav: interrupted\n")
        return INTERRUPTED
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return FAILED


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="dslam-mav",
        description="Find the sources of a diffusing field, and the drone's own path, from one scalar sensor.",
    )
    commands = parser.add_subparsers(metavar="COMMAND", required=True, parser_class=_Parser)
    for add in (_plan, _transfer, _vehicle, _bridge, _onboard, _fly, _replay, _report, _info):
        add(commands)
    return parser


Commands = argparse._SubParsersAction


def _add(
    commands: Commands[_Parser], name: str, text: str, example: str, run: tuple[str, str]
) -> argparse.ArgumentParser:
    parser = commands.add_parser(
        name,
        help=text,
        description=f"{text[0].upper()}{text[1:]}.",
        epilog=f"example: dslam-mav {name} {example}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.set_defaults(run=run)
    parser.add_argument("--json", action="store_true", help="print one JSON object and nothing else")
    return parser


def _number(kind: type[float] | type[int], least: float, what: str, *, above: bool = False) -> Callable[[str], float]:
    """A number with a lower limit, for argparse; a failure names what was expected."""

    def parse(text: str) -> float:
        try:
            value = kind(text)
        except ValueError:
            value = float("nan")
        if not (least < value if above else least <= value) or value == float("inf"):
            raise argparse.ArgumentTypeError(f"{text!r}: expected {what}")
        return value

    return parse


_POSITIVE = _number(float, 0.0, "a positive number", above=True)
_NOT_NEGATIVE = _number(float, 0.0, "0 or more")
_ANY = _number(float, -1e300, "a number")
_COUNT = _number(int, 1, "a whole number, 1 or more")
_SEED = _number(int, 0, "a whole number, 0 or more")


def _or_auto(parse: Callable[[str], float]) -> Callable[[str], float | str]:
    return lambda text: "auto" if text == "auto" else parse(text)


def _assumptions(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("assumptions (what is not given is estimated)")
    group.add_argument("--sources", metavar="N|auto", type=_or_auto(_COUNT), help="number of sources (default: auto)")
    group.add_argument("--spread", metavar="M", type=_POSITIVE, help="√C of a static field, for μ and τ")
    group.add_argument("--diffusivity", metavar="M2_S", type=_POSITIVE, help="μ of the medium")
    group.add_argument("--activation", metavar="S", type=_ANY, help="τ, seconds from the start of the first leg")
    group.add_argument("--ambient", metavar="VALUE|auto", type=_or_auto(_ANY), help="ambient level (default: auto)")
    moving = group.add_mutually_exclusive_group()
    moving.add_argument("--static", action="store_true", help="the field stands still during the flight (default)")
    moving.add_argument("--evolving", action="store_true", help="it spreads during the flight: C = 4μ(t − τ)")
    group.add_argument("--dimensions", type=int, choices=(2,), help="2: sources and path in one plane")
    group.add_argument("--heading", choices=("none", "vehicle", "plan"), help="headings it may see (default: none)")
    group.add_argument("--heading-sd", metavar="DEG", type=_POSITIVE, help="how far they are trusted (default: 5)")
    group.add_argument(
        "--distance", choices=("odometry", "speed", "plan"), help="along a leg (default: the first the vehicle offers)"
    )
    group.add_argument("--closed", action="store_true", help="the path ends where it began")
    group.add_argument("--method", choices=("joint",), help="joint: one fit over all readings")
    group.add_argument("--seed", metavar="N", type=_SEED, help="of the search, the noise and the vehicle")


def _source_of_readings(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("readings")
    group.add_argument("--scene", metavar="FILE", help="synthetic readings from a scene (JSON)")
    group.add_argument("--readings", metavar="FILE", help="logged readings: .csv, .mcap, .tlog, or .npz frames")
    group.add_argument(
        "--columns",
        metavar="LIST",
        help="FIELD=NAME[*FACTOR],… with FIELD time_s, value, east_m or north_m: a CSV's columns (default "
        "time_s,value), or a tlog's message field, e.g. value=SCALED_PRESSURE2.temperature*0.01",
    )
    group.add_argument("--frames", metavar="N|A:B", help="of a .npz: the frame held, or the film run (default: 2)")
    group.add_argument("--copies", metavar="K", type=_COUNT, help="of a .npz: shifted copies added (default: 2)")


def _vehicle_options(parser: argparse.ArgumentParser, *, required: bool) -> None:
    parser.add_argument("--connect", metavar="URL", required=required, help=_CONNECT_HELP)
    parser.add_argument(
        "--timeout", metavar="S", type=_POSITIVE, default=10.0, help="how long to wait for it (default: 10)"
    )


def _plan(commands: Commands[_Parser]) -> None:
    parser = _add(
        commands, "plan", "make a mission, or look at one somebody drew",
        "--pattern star7 --leg 32 --home 47.3977,8.5456,488 -o star.plan", ("plan", "run"),
    )  # fmt: skip
    parser.add_argument("plan", nargs="?", metavar="FILE", help="a .plan or .waypoints to look at")
    parser.add_argument("--pattern", default="star7", help="star7, star5, triangle, square, lawnmower, spiral, random")
    parser.add_argument("--leg", metavar="M", type=_POSITIVE, default=32.0, help="leg length (default: 32)")
    parser.add_argument("--legs", metavar="N", type=_COUNT, help="number of legs (default: the pattern's own)")
    parser.add_argument("--home", metavar="LAT,LON[,ALT]", help="where it is flown, degrees and metres")
    parser.add_argument(
        "--centre", metavar="E,N", help="middle of the pattern in metres from home (default: begins there)"
    )
    parser.add_argument("--first-heading", metavar="DEG", type=_ANY, default=0.0, help="counter-clockwise from east")
    parser.add_argument("--altitude", metavar="M", type=_POSITIVE, default=20.0, help="above home (default: 20)")
    parser.add_argument("--speed", metavar="M_S", type=_POSITIVE, default=5.0, help="(default: 5)")
    parser.add_argument("--hold", metavar="S", type=_NOT_NEGATIVE, default=0.0, help="wait at each corner (default: 0)")
    parser.add_argument("--seed", metavar="N", type=_SEED, help="of the pattern random")
    parser.add_argument(
        "-o", "--output", metavar="FILE", help="write it: .plan (QGroundControl) or .waypoints (WPL 110)"
    )


def _transfer(commands: Commands[_Parser]) -> None:
    upload = _add(
        commands, "upload", "send a mission to a vehicle, read it back and compare",
        "star.plan --connect udpout:127.0.0.1:14550", ("transfer", "run_upload"),
    )  # fmt: skip
    upload.add_argument("plan", metavar="PLAN", help=".plan or .waypoints")
    _vehicle_options(upload, required=True)
    download = _add(
        commands, "download", "fetch a vehicle's mission",
        "--connect udpout:127.0.0.1:14550 -o held.plan", ("transfer", "run_download"),
    )  # fmt: skip
    download.add_argument("-o", "--output", metavar="FILE", required=True, help=".plan or .waypoints")
    _vehicle_options(download, required=True)
    clear = _add(
        commands, "clear", "make a vehicle forget its mission",
        "--connect udpout:127.0.0.1:14550", ("transfer", "run_clear"),
    )  # fmt: skip
    _vehicle_options(clear, required=True)


def _vehicle(commands: Commands[_Parser]) -> None:
    parser = _add(
        commands, "vehicle", "a MAVLink autopilot stand-in that flies missions in straight legs",
        "--listen udpin:127.0.0.1:14550 --speedup 10", ("vehicle", "run"),
    )  # fmt: skip
    parser.add_argument(
        "--listen", metavar="URL", action="append", help="udpin:HOST:PORT or tcpin:HOST:PORT, repeatable"
    )
    parser.add_argument("--speedup", metavar="X", type=_POSITIVE, default=1.0, help="times real time (default: 1)")
    parser.add_argument("--system", metavar="ID", type=_COUNT, default=1, help="MAVLink system id (default: 1)")
    parser.add_argument("--home", metavar="LAT,LON[,ALT]", help="where it stands, degrees and metres")
    parser.add_argument(
        "--cruise-speed", metavar="M_S", type=_POSITIVE, default=5.0, help="unless the mission says (5)"
    )
    parser.add_argument("--seed", metavar="N", type=_SEED, help="repeats a flight exactly")


def _bridge(commands: Commands[_Parser]) -> None:
    parser = _add(
        commands, "bridge", "inject readings into a vehicle's flight as NAMED_VALUE_FLOAT THERMAL",
        "--scene scene.json --connect udpout:127.0.0.1:14550", ("bridge", "run"),
    )  # fmt: skip
    parser.add_argument("--plan", metavar="FILE", help="the mission flown (default: asked of the vehicle)")
    _source_of_readings(parser)
    parser.add_argument("--sources", type=_COUNT, help=argparse.SUPPRESS)
    parser.add_argument("--seed", metavar="N", type=_SEED, help="of the noise (default: the scene's)")
    _vehicle_options(parser, required=True)


def _onboard(commands: Commands[_Parser]) -> None:
    parser = _add(
        commands, "onboard", "the estimator, live and GPS-denied",
        "--connect udpout:127.0.0.1:14550 --out flight.mcap --sources 2", ("onboard", "run"),
    )  # fmt: skip
    parser.add_argument("--out", metavar="FILE", required=True, help="the log to write (.mcap)")
    parser.add_argument("--plan", metavar="FILE", help="the mission flown (default: asked of the vehicle)")
    _assumptions(parser)
    _vehicle_options(parser, required=True)


def _fly(commands: Commands[_Parser]) -> None:
    parser = _add(
        commands, "fly", "fly a mission and reconstruct sources and path",
        "star.plan --scene scene.json --sources 3", ("fly", "run"),
    )  # fmt: skip
    parser.add_argument("plan", nargs="?", metavar="PLAN", help="(default: the path of the scene)")
    _source_of_readings(parser)
    _assumptions(parser)
    parser.add_argument("--connect", metavar="URL", help=f"(default: a loopback vehicle of its own) {_CONNECT_HELP}")
    parser.add_argument("--out", metavar="DIR", default="logs", help="parent of the flight's folder (default: logs)")
    parser.add_argument("--speedup", metavar="X", type=_POSITIVE, default=10.0, help="of the loopback vehicle (10)")


def _replay(commands: Commands[_Parser]) -> None:
    parser = _add(
        commands, "replay", "the same estimator on a log's readings", "logs/latest/flight.mcap", ("replay", "run")
    )
    parser.add_argument("log", metavar="LOG", help=".mcap or .tlog")
    parser.add_argument("--plan", metavar="FILE", help="the mission flown (default: the log's)")
    parser.add_argument("--report", metavar="FILE", help="write the page too")
    _assumptions(parser)


def _report(commands: Commands[_Parser]) -> None:
    parser = _add(
        commands, "report", "one self-contained page on a flight", "logs/latest/flight.mcap", ("report", "run")
    )
    parser.add_argument("logs", nargs="+", metavar="LOG", help=".mcap or .tlog")
    parser.add_argument("-o", "--output", metavar="FILE", help="(default: beside the log)")
    _assumptions(parser)


def _info(commands: Commands[_Parser]) -> None:
    parser = _add(commands, "info", "what is in a log", "logs/latest/flight.mcap", ("info", "run"))
    parser.add_argument("log", metavar="LOG", help=".mcap")
