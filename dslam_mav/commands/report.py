"""`report`: the page of a log already flown, or one that compares many."""

from __future__ import annotations

import re
from argparse import Namespace
from pathlib import Path

from dslam_mav.commands.compass import with_compass
from dslam_mav.commands.logged import Logged, as_flown, open_logged
from dslam_mav.commands.outcome import PAGES, page_beside, write_report
from dslam_mav.commands.screen import Screen
from dslam_mav.commands.settings import changed
from dslam_mav.files import check_output


def run(options: Namespace) -> int:
    """The page of one log beside it, or of many in the folder one is in, unless `-o` says where."""
    screen = Screen(json_only=options.json)
    if options.output:
        check_output(Path(options.output), PAGES)
    if len(options.logs) > 1:
        from dslam_mav.commands.compare import compare

        return compare(options, screen, as_flown)
    path = Path(options.logs[0])
    with screen.progress(f"the page of {path}"):
        logged = open_logged(path, options)
        page = Path(options.output) if options.output else page_beside(path, _said_otherwise(logged, options))
        check_output(page)
        replaced = page.exists()
        write_report(with_compass(logged, as_flown(logged)), page)
    screen.say(f"{page}, in place of the one that was there" if replaced else str(page))
    screen.result({"reports": [{"log": str(path), "report": str(page)}]})
    return 0


def _said_otherwise(logged: Logged, options: Namespace) -> str:
    """What the options assume that the log does not, as a part of a file's name; nothing of a file of others, which
    says nothing of what to assume.
    """
    if logged.recorded is None:
        return ""
    said = changed(logged.recorded.assumptions, logged.assumptions)
    if options.plan:
        said.append(f"plan={Path(options.plan).stem}")
    return ".".join(re.sub(r"[^\w.+-]+", "-", setting) for setting in said)
