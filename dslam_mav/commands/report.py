"""`report`: the page of a log already flown."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from dslam_mav.commands.logged import Logged, estimate_again, open_logged, outcome_of
from dslam_mav.commands.outcome import Outcome, write_report
from dslam_mav.commands.screen import Screen
from dslam_mav.errors import BadInputError


def run(options: Namespace) -> int:
    """One page a log, beside the log unless `-o` says where."""
    if options.output and len(options.logs) > 1:
        raise BadInputError(
            f"-o {options.output}: expected one log, got {len(options.logs)}: a page is written for each"
        )
    screen = Screen(json_only=options.json)
    pages = []
    for name in options.logs:
        path = Path(name)
        page = Path(options.output) if options.output else path.with_name(_page_name(path))
        with screen.progress(f"{path} -> {page}"):
            write_report(_outcome(open_logged(path, options)), page)
        pages.append({"log": str(path), "report": str(page)})
        screen.say(str(page))
    screen.result({"reports": pages})
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
