"""`report`: the page of a log already flown."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from dslam_mav.commands.logged import as_flown, open_logged
from dslam_mav.commands.outcome import write_report
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
            write_report(as_flown(open_logged(path, options)), page)
        pages.append({"log": str(path), "report": str(page)})
        screen.say(str(page))
    screen.result({"reports": pages})
    return 0


def _page_name(path: Path) -> str:
    return "report.html" if path.name == "flight.mcap" else f"{path.stem}.html"
