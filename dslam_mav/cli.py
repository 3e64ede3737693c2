"""The command line: argument parsing, exit codes, and nothing else."""

from __future__ import annotations

import argparse
import contextlib
import importlib
import io
import os
import re
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from importlib.metadata import version
from types import FrameType
from typing import NoReturn

from dslam_mav.commands import options as shared
from dslam_mav.commands.options import COUNT, POSITIVE, SEED
from dslam_mav.commands.paper_options import add_paper
from dslam_mav.commands.plan_options import add_plan
from dslam_mav.errors import BadInputError, DslamError

BAD_INPUT = 2
FAILED = 1
INTERRUPTED = 130
TERMINATED = 143

_EXIT_CODES = "exit codes: 0 done, 1 failed while running, 2 bad usage or input, 130 Ctrl-C, 143 SIGTERM (log closed)"


class _Terminated(KeyboardInterrupt):
    """SIGTERM: ends a command as Ctrl-C does, with the log closed."""


class _Parser(argparse.ArgumentParser):
    """Bad usage is one line on standard error; the help stays behind --help. Options are not abbreviated."""

    def __init__(self, **settings: object) -> None:
        super().__init__(**{"allow_abbrev": False, **settings})  # type: ignore[arg-type]
        # -33.5,151.2 is a place in the south, no option
        self._negative_number_matcher = re.compile(r"-[\d.]")

    def error(self, message: str) -> NoReturn:
        raise BadInputError(f"{self.prog}: {message} (see {self.prog} --help)")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; its exit code."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal without √ is no reason to lose a result
    try:
        with _sigterm_raises():
            options = _parser().parse_args(arguments)
            module, function = options.run
            command: Callable[[argparse.Namespace], int] = getattr(
                importlib.import_module(f"dslam_mav.commands.{module}"), function
            )
            return command(options)
    except DslamError as problem:
        text = str(problem)
        sys.stderr.write(text + "\n" if text.startswith(("dslam-mav ", "dslam-mav:")) else f"dslam-mav: {text}\n")
        return BAD_INPUT if isinstance(problem, BadInputError) else FAILED
    except _Terminated:
        sys.stderr.write("dslam-mav: terminated\n")
        return TERMINATED
    except KeyboardInterrupt:
        sys.stderr.write("dslam-mav: interrupted\n")
        return INTERRUPTED
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return FAILED


@contextlib.contextmanager
def _sigterm_raises() -> Iterator[None]:
    if threading.current_thread() is not threading.main_thread():
        yield  # only the main thread may set handlers
        return

    def handler(number: int, frame: FrameType | None) -> None:  # noqa: ARG001 - what signal demands
        raise _Terminated

    before = signal.signal(signal.SIGTERM, handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="dslam-mav",
        description="Find the sources of a diffusing field, and the drone's own path, from one scalar sensor.",
        epilog=f"example: dslam-mav fly --sources 3 --ambient auto\n\n{_EXIT_CODES}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"dslam-mav {version('dslam-mav')}")
    commands = parser.add_subparsers(metavar="COMMAND", required=True, parser_class=_Parser)
    for add in (_plan, _transfer, _vehicle, _bridge, _onboard, _fly, _replay, _report, _info):
        add(commands)
    add_paper(commands, argparse.RawDescriptionHelpFormatter)
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


def _plan(commands: Commands[_Parser]) -> None:
    parser = _add(
        commands, "plan", "make a mission, or look at one somebody drew, and say how well it will see",
        "--pattern best --sources 2-4 --spread 10 --home 47.3977,8.5456,488 -o best.plan", ("plan", "run"),
    )  # fmt: skip
    add_plan(parser)


def _transfer(commands: Commands[_Parser]) -> None:
    upload = _add(
        commands, "upload", "send a mission to a vehicle, read it back and compare",
        "star.plan --connect udpout:127.0.0.1:14550 --start", ("transfer", "run_upload"),
    )  # fmt: skip
    upload.add_argument("plan", metavar="PLAN", help=".plan or .waypoints")
    upload.add_argument("--start", action="store_true", help="then arm the vehicle and start the mission")
    shared.vehicle_link(upload)
    download = _add(
        commands, "download", "fetch a vehicle's mission",
        "--connect udpout:127.0.0.1:14550 -o held.plan", ("transfer", "run_download"),
    )  # fmt: skip
    download.add_argument("-o", "--output", metavar="FILE", required=True, help=".plan or .waypoints")
    shared.vehicle_link(download)
    clear = _add(
        commands, "clear", "make a vehicle forget its mission",
        "--connect udpout:127.0.0.1:14550", ("transfer", "run_clear"),
    )  # fmt: skip
    shared.vehicle_link(clear)


def _vehicle(commands: Commands[_Parser]) -> None:
    parser = _add(
        commands, "vehicle", "a MAVLink autopilot stand-in that flies missions in straight legs",
        "--listen udpin:127.0.0.1:14550 --speedup 10", ("vehicle", "run"),
    )  # fmt: skip
    parser.add_argument(
        "--listen", metavar="URL", action="append", help="udpin:HOST:PORT or tcpin:HOST:PORT, repeatable"
    )
    parser.add_argument("--speedup", metavar="X", type=POSITIVE, default=1.0, help="times real time (default: 1)")
    parser.add_argument("--system", metavar="ID", type=COUNT, default=1, help="MAVLink system id (default: 1)")
    parser.add_argument("--home", metavar="LAT,LON[,ALT]", help="where it stands, degrees and metres")
    parser.add_argument("--cruise-speed", metavar="M_S", type=POSITIVE, default=5.0, help="unless the mission says (5)")
    parser.add_argument("--seed", metavar="N", type=SEED, help="repeats a flight exactly")


def _bridge(commands: Commands[_Parser]) -> None:
    parser = _add(
        commands, "bridge", "inject readings into a vehicle's flight as NAMED_VALUE_FLOAT THERMAL",
        "--scene scene.json --connect udpout:127.0.0.1:14550", ("bridge", "run"),
    )  # fmt: skip
    parser.add_argument("--plan", metavar="FILE", help="the mission flown (default: asked of the vehicle)")
    shared.source_of_readings(parser)
    parser.set_defaults(sources=None)
    parser.add_argument("--seed", metavar="N", type=SEED, help="of the noise (default: the scene's)")
    shared.vehicle_link(parser)


def _onboard(commands: Commands[_Parser]) -> None:
    parser = _add(
        commands, "onboard", "the estimator, live and GPS-denied",
        "--connect udpout:127.0.0.1:14550 --out flight.mcap --sources 2", ("onboard", "run"),
    )  # fmt: skip
    parser.add_argument("--out", metavar="FILE", required=True, help="the log to write (.mcap)")
    parser.add_argument("--plan", metavar="FILE", help="the mission flown (default: asked of the vehicle)")
    shared.assumptions(parser)
    shared.adaptive(parser)
    shared.vehicle_link(parser)


def _fly(commands: Commands[_Parser]) -> None:
    parser = _add(
        commands, "fly", "fly a mission and reconstruct sources and path",
        "star.plan --scene scene.json --sources 3", ("fly", "run"),
    )  # fmt: skip
    parser.add_argument("plan", nargs="?", metavar="PLAN", help="(default: the path of the scene)")
    shared.source_of_readings(parser)
    shared.assumptions(parser)
    shared.adaptive(parser)
    shared.vehicle_link(
        parser, required=False, help_text="udpout:HOST:PORT or tcp:HOST:PORT (default: a loopback vehicle of its own)"
    )
    parser.add_argument("--out", metavar="DIR", default="logs", help="parent of the flight's folder (default: logs)")
    parser.add_argument(
        "--speedup", metavar="X", type=POSITIVE, default=10.0, help="of the loopback vehicle (default: 10)"
    )


def _replay(commands: Commands[_Parser]) -> None:
    parser = _add(
        commands, "replay", "the same estimator on a log's readings", "logs/latest/flight.mcap", ("replay", "run")
    )
    parser.add_argument("log", metavar="LOG", help=".mcap or .tlog")
    parser.add_argument("--plan", metavar="FILE", help="the mission flown (default: the log's)")
    parser.add_argument("--report", metavar="FILE", help="write the page too")
    shared.assumptions(parser)


def _report(commands: Commands[_Parser]) -> None:
    parser = _add(
        commands, "report", "one self-contained page on a flight", "logs/latest/flight.mcap", ("report", "run")
    )
    parser.add_argument("logs", nargs="+", metavar="LOG", help=".mcap or .tlog")
    parser.add_argument("-o", "--output", metavar="FILE", help="(default: beside the log)")
    shared.assumptions(parser)


def _info(commands: Commands[_Parser]) -> None:
    parser = _add(commands, "info", "what is in a log", "logs/latest/flight.mcap", ("info", "run"))
    parser.add_argument("log", metavar="LOG", help=".mcap")
