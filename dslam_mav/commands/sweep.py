"""`sweep`: thousands of estimates over processes or a Dask cluster, resumable, with a table and pictures."""

from __future__ import annotations

import importlib.util
import math
import os
import time
from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from dslam_mav.commands.paper import NO_PICTURES
from dslam_mav.commands.screen import Screen
from dslam_mav.errors import BadInputError, DslamError
from dslam_mav.files import write_whole
from dslam_mav.records.words import agree, count

if TYPE_CHECKING:
    from dslam_mav.commands.sweep_points import Points
    from dslam_mav.sweep.engine import Swept
    from dslam_mav.sweep.job import Workers

OUT = Path("logs") / "sweep"
MOST_NAMED = 10  # failed points, on the screen


def run(options: Namespace) -> int:
    """Compute what is not there yet, write the table, draw; 1 where points failed."""
    from dslam_mav.commands.sweep_file import read_sweep
    from dslam_mav.commands.sweep_points import points_of
    from dslam_mav.commands.sweep_table import as_json
    from dslam_mav.sweep import parquet

    screen = Screen(json_only=options.json)
    file = Path(options.file)
    if options.scheduler and options.workers:
        raise BadInputError("--workers with --scheduler: expected one of them: a cluster has workers of its own")
    sweep = read_sweep(file)
    text = file.read_bytes().decode()  # as it is, whatever becomes of the file meanwhile
    points = points_of(sweep, file)
    if not parquet.available():
        raise DslamError(parquet.MISSING)
    out = Path(options.out) if options.out else OUT / file.stem
    screen.say(f"{file.name}: {points.words}")
    begun_s = time.monotonic()
    swept = _swept(points, out, options, screen)
    took_s = time.monotonic() - begun_s
    results = out / "results.parquet"
    write_whole(results, parquet.parquet_bytes(points.columns, swept.rows, {"sweep.toml": text}))
    _show(points, swept, took_s, screen)
    screen.say(f"Written {results}")
    pictures = _pictures(swept, out, screen)
    screen.result(as_json(swept, points.groups(swept.rows), took_s, {"results": str(results), "pictures": pictures}))
    if swept.failed:
        raise DslamError(
            f"{len(swept.failed)} of {count(len(swept.rows), 'point')} failed: why is in column failure of {results}"
        )
    return 0


def _show(points: Points, swept: Swept, took_s: float, screen: Screen) -> None:
    """The table, what its columns are, and what failed."""
    from dslam_mav.commands.sweep_table import log_table, sentences, table

    screen.table(log_table(swept.rows) if points.of_logs else table(points.groups(swept.rows)))
    for line in sentences(swept, took_s, logs=points.of_logs):
        screen.say(line)
    for row in swept.failed[:MOST_NAMED]:
        screen.say(f"Failed: {', '.join(str(row[name]) for name in points.jobs[0].coordinates)}: {row['failure']}")


def _swept(points: Points, out: Path, options: Namespace, screen: Screen) -> Swept:
    """The rows; on Ctrl-C says what is kept."""
    from dslam_mav.sweep.engine import sweep, unfinished
    from dslam_mav.sweep.journal import Journal

    total = len(points.jobs)
    with Journal(out / "points.jsonl") as journal:
        todo = len(unfinished(points.jobs, journal))
        if todo < total:
            screen.say(
                f"{total - todo} of {count(total, 'point')} {agree(total - todo, 'is', 'are')} there from before"
            )
        try:
            with screen.progress("sweep") as advance:

                def tell(done: int, all_of_them: int, left_s: float) -> None:
                    left = "" if math.isnan(left_s) else f", {_in_words(left_s)} left"
                    advance("sweep", done, all_of_them, f"{done} of {all_of_them}{left}")

                return sweep(points.jobs, points.columns, journal, _workers(options, screen, todo), tell)
        except KeyboardInterrupt:
            kept = total - len(unfinished(points.jobs, journal))
            screen.say(f"{_part(kept, total)} kept in {out}: the same command goes on from there")
            raise


def _workers(options: Namespace, screen: Screen, todo: int) -> Workers:
    if options.scheduler and todo:
        from dslam_mav.sweep.cluster import DaskWorkers

        workers = DaskWorkers(options.scheduler, screen.warn)
        if not workers.threads:
            screen.warn(f"--scheduler {options.scheduler}: it has no workers; points wait until it has")
        return workers
    from dslam_mav.sweep.local import LocalWorkers

    return LocalWorkers(options.workers or os.cpu_count() or 1, screen.warn)


def _part(some: int, total: int) -> str:
    return f"{some} of {count(total, 'point')} {agree(some, 'is', 'are')}"


def _in_words(seconds: float) -> str:
    """A time to wait, as exact as anybody needs it."""
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    if seconds < 5400.0:
        return f"{seconds / 60.0:.0f} min"
    return f"{seconds / 3600.0:.1f} h"


def _pictures(swept: Swept, out: Path, screen: Screen) -> list[str]:
    """Draw and save; the files' names."""
    if importlib.util.find_spec("matplotlib") is None:
        screen.say(NO_PICTURES)
        return []
    from dslam_mav.sweep.pictures import pictures

    paths = []
    for name, png in pictures(swept.rows):
        write_whole(out / name, png)
        screen.say(f"Written {out / name}")
        paths.append(str(out / name))
    return paths
