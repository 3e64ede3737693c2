"""`report`: the page of a log already flown, or one that compares many."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from dslam_mav.commands.logged import Logged, estimate_again, open_logged, outcome_of
from dslam_mav.commands.outcome import Outcome, write_report
from dslam_mav.commands.screen import Screen


def run(options: Namespace) -> int:
    """The page of one log beside it, or of many in the folder one is in, unless `-o` says where."""
    screen = Screen(json_only=options.json)
    if len(options.logs) > 1:
        from dslam_mav.commands.compare import compare

        return compare(options, screen, _outcome)
    path = Path(options.logs[0])
    page = Path(options.output) if options.output else path.with_name(_page_name(path))
    with screen.progress(f"{path} -> {page}"):
        write_report(_outcome(open_logged(path, options)), page)
    screen.say(str(page))
    screen.result({"reports": [{"log": str(path), "report": str(page)}]})
    return 0


def _outcome(logged: Logged) -> Outcome:
    """The answer the flight ended with, where the log has it and nothing else is assumed now; else a fresh one."""
    final = [e for e in logged.log.estimates if e.final] if logged.log is not None else []
    same = final and final[-1].estimate.residual.size == logged.replayed.flight.n_readings
    if same and not logged.assumed_anew:
        return outcome_of(logged).with_estimate(final[-1].estimate)
    return estimate_again(logged)


def _page_name(path: Path) -> str:
    return "report.html" if path.name == "flight.mcap" else f"{path.stem}.html"
