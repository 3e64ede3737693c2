"""`report`: the page of a log already flown, or one that compares many."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from dslam_mav.commands.compass import with_compass
from dslam_mav.commands.logged import as_flown, open_logged
from dslam_mav.commands.outcome import write_report
from dslam_mav.commands.screen import Screen


def run(options: Namespace) -> int:
    """The page of one log beside it, or of many in the folder one is in, unless `-o` says where."""
    screen = Screen(json_only=options.json)
    if len(options.logs) > 1:
        from dslam_mav.commands.compare import compare

        return compare(options, screen, as_flown)
    path = Path(options.logs[0])
    page = Path(options.output) if options.output else path.with_name(_page_name(path))
    with screen.progress(f"{path} -> {page}"):
        logged = open_logged(path, options)
        write_report(with_compass(logged, as_flown(logged)), page)
    screen.say(str(page))
    screen.result({"reports": [{"log": str(path), "report": str(page)}]})
    return 0


def _page_name(path: Path) -> str:
    return "report.html" if path.name == "flight.mcap" else f"{path.stem}.html"
