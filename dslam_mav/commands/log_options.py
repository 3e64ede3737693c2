"""Options of the commands that read a log."""

from __future__ import annotations

from dslam_mav.commands import options as shared
from dslam_mav.commands.command import Commands, add_command
from dslam_mav.commands.live_options import live
from dslam_mav.commands.options import NOT_NEGATIVE, RECORDINGS


def add_logs(commands: Commands) -> None:
    """Add them to the command line."""
    for add in (_replay, _report, _info, _export, _recover, _layout):
        add(commands)


def _replay(commands: Commands) -> None:
    parser = add_command(
        commands, "replay", "the same estimator on a log's readings", "logs/latest/flight.mcap", ("replay", "run")
    )
    parser.add_argument("log", metavar="LOG", help=RECORDINGS)
    shared.recording(parser)
    parser.add_argument("--report", metavar="FILE", help="write the page too")
    shared.settings(parser, "change one assumption, repeatable: writes LOG.set-N.mcap, shows both answers")
    live(parser, "then play the log to Foxglove, from its first viewer on, and serve it until Ctrl-C")
    parser.add_argument(
        "--speed", metavar="X", type=NOT_NEGATIVE, help="of --live, times the flight's; 0: without waiting (default: 1)"
    )
    shared.assumptions(parser)


def _report(commands: Commands) -> None:
    parser = add_command(
        commands, "report", "one self-contained page on a flight, or one that compares many",
        "logs/*/flight.mcap -o comparison.html", ("report", "run"),
    )  # fmt: skip
    parser.add_argument("logs", nargs="+", metavar="LOG", help=RECORDINGS)
    shared.recording(parser)
    parser.add_argument(
        "-o", "--output", metavar="FILE", help="(default: beside the log; of many, comparison.html here)"
    )
    shared.assumptions(parser)


def _info(commands: Commands) -> None:
    parser = add_command(commands, "info", "what is in a log", "logs/latest/flight.mcap", ("info", "run"))
    parser.add_argument("log", metavar="LOG", help=RECORDINGS)
    shared.columns(parser)


def _export(commands: Commands) -> None:
    parser = add_command(
        commands, "export", "take readings, packets or the answer out of a log",
        "logs/latest/flight.mcap --to geojson -o sources.geojson", ("export", "run"),
    )  # fmt: skip
    parser.add_argument("log", metavar="LOG", help=RECORDINGS)
    shared.export(parser)


def _recover(commands: Commands) -> None:
    parser = add_command(
        commands, "recover", "write what a damaged log still holds as a whole one (exit code 3: something is lost)",
        "logs/latest/flight.mcap -o recovered.mcap", ("recover", "run"),
    )  # fmt: skip
    parser.add_argument("log", metavar="LOG", help=".mcap")
    parser.add_argument("-o", "--output", metavar="OUT", required=True, help="the log to write (.mcap)")


def _layout(commands: Commands) -> None:
    parser = add_command(
        commands, "layout", "how Foxglove is to show a flight log", "-o dslam-mav.json", ("layout", "run")
    )
    parser.add_argument("-o", "--output", metavar="FILE", help="(default: standard output)")
