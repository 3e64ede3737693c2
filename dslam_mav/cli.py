"""The command line: argument parsing, exit codes, and nothing else."""

from __future__ import annotations

import argparse
import contextlib
import errno
import gc
import importlib
import io
import os
import signal
import stat
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from importlib.metadata import version
from types import FrameType

from dslam_mav.commands.command import Commands, Parser, add_command
from dslam_mav.commands.log_options import add_logs
from dslam_mav.commands.paper_options import add_paper
from dslam_mav.commands.plan_options import add_plan
from dslam_mav.commands.sweep_options import add_sweep
from dslam_mav.commands.vehicle_options import add_vehicle
from dslam_mav.errors import BadInputError, DslamError

BAD_INPUT = 2
FAILED = 1
INTERRUPTED = 130
TERMINAL_GONE = 129
TOLD_TO_END = {"SIGTERM": "terminated", "SIGHUP": "the terminal is gone"}  # by signal; the code is 128 and its number

_EXIT_CODES = (
    "exit codes: 0 done, 1 failed while running, 2 bad usage or input, 3 recovered with losses,\n"
    "130 Ctrl-C, 143 SIGTERM, 129 the terminal is gone (log closed)"
)


class _Ended(KeyboardInterrupt):
    """A signal that ends a command as Ctrl-C does, with the log closed."""

    def __init__(self, number: int) -> None:
        super().__init__()
        self.code = 128 + number
        self.words = TOLD_TO_END[signal.Signals(number).name]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; its exit code."""
    gc.set_threshold(50_000, 20, 100)  # a log is a million objects and no garbage: looked through less often
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal without √ is no reason to lose a result
    try:
        with _signals_raise():
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
    except _Ended as end:
        sys.stderr.write(f"dslam-mav: {end.words}\n")
        return end.code
    except KeyboardInterrupt:
        sys.stderr.write("dslam-mav: interrupted\n")
        return INTERRUPTED
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return FAILED
    except OSError as problem:
        if problem.errno != errno.EIO or not _terminal_gone():
            raise
        _without_terminal()  # a background job is not told by SIGHUP
        sys.stderr.write(f"dslam-mav: {TOLD_TO_END['SIGHUP']}\n")
        return TERMINAL_GONE


@contextlib.contextmanager
def _signals_raise() -> Iterator[None]:
    if threading.current_thread() is not threading.main_thread():
        yield  # only the main thread may set handlers
        return

    def handler(number: int, frame: FrameType | None) -> None:  # noqa: ARG001 - what signal demands
        if signal.Signals(number).name == "SIGHUP":
            _without_terminal()
        raise _Ended(number)

    numbers = [getattr(signal, name) for name in TOLD_TO_END if hasattr(signal, name)]  # Windows has no SIGHUP
    heard = [number for number in numbers if signal.getsignal(number) is not signal.SIG_IGN]  # nohup ignores SIGHUP
    before = {number: signal.signal(number, handler) for number in heard}
    try:
        yield
    finally:
        for number, was in before.items():
            signal.signal(number, was)


def _terminal_gone() -> bool:
    """Whether output goes to a terminal that is no more: like the null device, a character device and no terminal."""
    null = os.stat(os.devnull).st_rdev
    devices = [(output, os.fstat(output)) for output in (1, 2)]
    return any(stat.S_ISCHR(s.st_mode) and s.st_rdev != null and not os.isatty(output) for output, s in devices)


def _without_terminal() -> None:
    """What is still said on a terminal that is gone goes nowhere, instead of ending what closes log and report."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for output in (1, 2):
        if stat.S_ISCHR(os.fstat(output).st_mode):  # isatty denies one that is gone
            os.dup2(nowhere, output)


def _parser() -> argparse.ArgumentParser:
    parser = Parser(
        prog="dslam-mav",
        description="Find the sources of a diffusing field, and the drone's own path, from one scalar sensor.",
        epilog=f"example: dslam-mav fly --sources 3 --ambient auto\n\n{_EXIT_CODES}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"dslam-mav {version('dslam-mav')}")
    commands = parser.add_subparsers(metavar="COMMAND", required=True, parser_class=Parser)
    _plan(commands)
    add_vehicle(commands)
    add_logs(commands)
    add_paper(commands, argparse.RawDescriptionHelpFormatter)
    add_sweep(commands, argparse.RawDescriptionHelpFormatter)
    return parser


def _plan(commands: Commands) -> None:
    parser = add_command(
        commands, "plan", "make a mission, or look at one somebody drew, and say how well it will see",
        "--pattern best --sources 2-4 --spread 10 --home 47.3977,8.5456,488 -o best.plan", ("plan", "run"),
    )  # fmt: skip
    add_plan(parser)
