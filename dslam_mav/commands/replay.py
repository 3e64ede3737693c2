"""`replay`: the same estimator on a log's readings."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from dslam_mav.commands.logged import estimate_again, open_logged
from dslam_mav.commands.outcome import show, write_report
from dslam_mav.commands.screen import Screen


def run(options: Namespace) -> int:
    """Replay; with `--report FILE` the page is written too."""
    screen = Screen(json_only=options.json)
    with screen.progress("reading the log"):
        logged = open_logged(Path(options.log), options)
    with screen.progress("estimating"):
        outcome = estimate_again(logged)
    if options.report:
        outcome = write_report(outcome, Path(options.report))
    return show(screen, outcome)
