"""`paper`: the paper's experiments, its figures beside ours."""

from __future__ import annotations

import importlib.util
from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dslam_mav.commands.paper_options import WHAT
from dslam_mav.commands.screen import Screen
from dslam_mav.errors import unwritable
from dslam_mav.files import check_folder
from dslam_mav.records.words import count

if TYPE_CHECKING:
    from dslam_mav.commands.paper_run import Trials
    from dslam_mav.experiments.experiment import Result

NO_PICTURES = "no pictures: they need matplotlib: pip install 'dslam-mav[plots]'"
INTERRUPTED = 130


def run(options: Namespace) -> int:
    """Run one experiment or all; 130 where Ctrl-C ended it, with what there was until then."""
    from dslam_mav.commands.paper_run import trials_in

    screen = Screen(json_only=options.json)
    check_folder(Path(options.out))
    names = [name for name in WHAT if name != "all"] if options.experiment == "all" else [options.experiment]
    results: dict[str, Any] = {}
    complete = True
    with trials_in(options.workers) as trials:
        for name in names:
            complete = _one(name, options, screen, trials, results)
            if not complete:
                break
    screen.result(results)
    return 0 if complete else INTERRUPTED


def _one(name: str, options: Namespace, screen: Screen, trials: Trials, results: dict[str, Any]) -> bool:
    """Run, print and draw one experiment; whether it came to its end."""
    from dslam_mav.commands.paper_run import Course
    from dslam_mav.commands.paper_table import as_json, notes, table
    from dslam_mav.commands.paper_world import find_world
    from dslam_mav.experiments.catalogue import EXPERIMENTS

    experiment = EXPERIMENTS[name]
    worlds = {w: world for w in experiment.worlds if (world := find_world(w)) is not None}
    missing = [w for w in experiment.worlds if w not in worlds]
    if missing:
        screen.say(f"{name}: skipped {', '.join(missing)}: no such recording in ../shared/data")
    rows = experiment.rows(worlds)
    course, complete = Course(experiment, rows, options.trials), True
    if rows:
        try:
            with screen.progress(name) as advance:

                def done(piece: Any, measured: Any) -> None:
                    course.take(piece, measured)
                    advance(name, course.done, course.total, f"{course.done} of {count(course.total, 'trial')}")

                trials.run(name, rows, course.todo, options.seed, done)
        except KeyboardInterrupt:
            complete = False
    result = course.result()
    screen.table(table(result))
    if not complete:
        screen.say(f"{name}: interrupted after {course.done} of {count(course.total, 'trial')}")
    for line in notes(result):
        screen.say(line)
    pictures = [] if not (complete and rows) else _pictures(result, options, screen)
    results[name] = as_json(result, missing, pictures, complete=complete)
    return complete


def _pictures(result: Result, options: Namespace, screen: Screen) -> list[str]:
    """Draw and save; the files' names."""
    if importlib.util.find_spec("matplotlib") is None:
        screen.say(NO_PICTURES)
        return []
    path = Path(options.out) / f"{result.experiment.name}.png"
    figure = result.experiment.picture(result, options.seed)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(path)
    except OSError as problem:
        raise unwritable(path, problem) from None
    screen.say(f"Written {path}")
    return [str(path)]
