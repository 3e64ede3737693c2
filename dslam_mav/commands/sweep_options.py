"""Options of `sweep`, and every key of its file."""

from __future__ import annotations

import argparse
from typing import Any

from dslam_mav.commands.options import COUNT

KEYS = """\
the file (TOML); what is not said has the value in brackets, and an unknown key is refused:

  seeds = [0]                 flights of every combination, each with noise of its own

  [scenes]                    either scene files …
    files = ["*.json"]        beside the sweep's file, * and ** allowed
                              … or scenes drawn at random about (0, 0):
    random = 100              so many of each number of sources
    sources = [2, 3]          numbers of sources (2)
    spread_m = 10.0           √C at the first reading, or [least, most] (10)
    area_m = [32, 32]         where sources lie: east, north (3.2 √C each)
    min_separation_m = 8.0    between two sources (0.8 √C)
    amplitude_ratio = 4.0     at most, of one source to another (4)
    peak = 1.0                a usual source's peak reading, for a noise sd (1)
    ambient = 0.0             reading without sources (0)
    diffusivity_m2_s = 0.5    the field spreads during the flight (it stands still)
    seed = 0                  of the layouts (0)

  [[missions]]                of each: a pattern, a plan or the scene's path (of scene files: their path)
    pattern = "star7"         as of plan, about centre_m
    leg_m = [24, 32]          its legs; a list makes a mission of each
    legs = 7                  how many (the pattern's)
    heading_deg = 0.0         of the first leg, from east (0)
    centre_m = [0, 0]         middle of its extent, east and north (0, 0)
    plan = "best.plan"        .plan or .waypoints beside the sweep's file
    path = "scene"            each scene file's own path
    name = "star"             in the results (pattern and leg, or the file's name)

  [noise]                     (of scene files: their own)
    snr_db = [10, 20, 30]     mean squared reading of a flight over the noise's variance, or
    sd = [0.1, 0.2]           standard deviation of a reading

  [sampling]                  (of scene files: their own)
    speed_m_s = 5.0           of the flight (5)
    spacing_m = 0.5           from reading to reading (√C/20), or
    interval_s = 0.1          from reading to reading

  [estimate]                  what the estimator is told, as in dslam_mav.estimate
    methods = ["joint"]       joint, paper or both, on the same readings (joint)
    n_sources = "true"        the true number, "auto" to have it found, or a number ("true")
    max_sources = 5           of auto (5)
    known = ["spread"]        of spread, diffusivity, activation, ambient (all there is)
    closed = false            missions that end where they began are told to (false)
    heading_sd_deg = 5.0      a compass with errors of this sd (none)

or, instead of all these, logs, one row each:

  [logs]
    folder = "logs"           beside the sweep's file; all .mcap, .tlog and .bin below it
    methods = ["joint"]       a row for each (joint)

  [assume]                    options of replay by their names, e.g. sources = 2, ambient = "auto",
                              closed = true, heading_sd = 5 (as the log was recorded with)

in --out: results.parquet, error.png, verdicts.png, and points.jsonl, from which the same command goes on after a crash
or Ctrl-C; points that failed are tried again. Errors are relative to the first leg."""


def add_sweep(commands: Any, example_of: type[argparse.HelpFormatter]) -> None:
    """`sweep FILE.toml`."""
    text = "Monte-Carlo over scenes, missions, noise and methods, or over a folder of logs"
    parser = commands.add_parser(
        "sweep",
        help=text,
        description=f"{text}: results as Parquet, with pictures.",
        epilog=f"example: dslam-mav sweep docs/examples/sweep.toml\n\n{KEYS}",
        formatter_class=example_of,
    )
    parser.set_defaults(run=("sweep", "run"))
    parser.add_argument("--json", action="store_true", help="print one JSON object and nothing else")
    parser.add_argument("file", metavar="FILE", help="what to fly, .toml; see below")
    parser.add_argument(
        "--scheduler", metavar="URL", help="of a Dask cluster with dslam_mav on it, e.g. tcp://host:8786"
    )
    parser.add_argument("--workers", metavar="N", type=COUNT, help="processes here (default: as many as cores)")
    parser.add_argument("--out", metavar="DIR", help="(default: logs/sweep/ and the file's name)")
