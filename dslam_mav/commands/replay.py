"""`replay`: the same estimator on a log's readings."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import replace
from pathlib import Path

from dslam_mav.assumptions import Assumptions
from dslam_mav.commands.compass import with_compass
from dslam_mav.commands.live import check, play, served
from dslam_mav.commands.logged import as_flown, estimate_again, open_logged
from dslam_mav.commands.outcome import PAGES, show, write_report
from dslam_mav.commands.screen import Screen
from dslam_mav.commands.settings import with_settings
from dslam_mav.errors import DslamError
from dslam_mav.files import check_output
from dslam_mav.recordings import kind_of
from dslam_mav.report.table import result_json


def run(options: Namespace) -> int:
    """Replay; with `--report FILE` the page is written too."""
    screen = Screen(json_only=options.json)
    check(options)
    if options.report:
        check_output(Path(options.report), PAGES)
    with served(options, screen) as live:
        log = _with_settings(screen, options) if options.set else _again(screen, options)
        if live is not None:
            play(live, log, 1.0 if options.speed is None else options.speed, screen)
    return 0


def _again(screen: Screen, options: Namespace) -> Path:
    """The answer; the log it is of."""
    with screen.progress("reading the log"):
        logged = open_logged(Path(options.log), options)
    with screen.progress("estimating"):
        outcome = estimate_again(logged)
    if options.report:
        outcome = write_report(with_compass(logged, outcome), Path(options.report))
    try:
        show(screen, outcome)
    except DslamError as problem:
        if options.live is None:
            raise
        screen.warn(str(problem))  # a flight without an answer is looked at all the more
    return outcome.log


def _with_settings(screen: Screen, options: Namespace) -> Path:
    """The answer as it was beside the one under `--set`, which goes to a log of its own: that log."""
    from dslam_mav.commands.derived import derived_name, write_derived
    from dslam_mav.commands.side_by_side import comparison

    path = Path(options.log)
    with_settings(Assumptions(), options.set)  # refused before the log is read
    kind_of(path)
    check_output(derived_name(path))
    with screen.progress("estimating as before"):
        before = as_flown(open_logged(path, Namespace(**{**vars(options), "set": None})))
    with screen.progress("estimating as set"):
        logged = open_logged(path, options)
        after = estimate_again(logged)
    was, now = before.estimate, after.estimate
    if was is None or now is None:
        raise DslamError(f"{path}: no leg with readings was flown: nothing to estimate")
    after = replace(after, log=write_derived(logged, now, options.set, options.columns))
    if options.report:
        after = write_report(after, Path(options.report))
    for warning in after.warnings:
        screen.warn(warning)
    screen.table(comparison(was, now, after.truth, ("before", ", ".join(options.set))))
    screen.say()
    screen.say(f"log     {after.log}")
    if after.report is not None:
        screen.say(f"report  {after.report}")
    told = result_json(now, after.truth, after.log, after.report)
    given = dict(setting.split("=", 1) for setting in options.set)
    screen.result({**told, "set": given, "before": result_json(was, before.truth, path, None)})
    return after.log
