"""`export`: a log's readings, packets or answer for other programs."""

from __future__ import annotations

import math
from argparse import Namespace
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from dslam_mav.commands.logged import Logged, as_flown, open_logged
from dslam_mav.commands.screen import Screen
from dslam_mav.commands.vehicle import parse_home
from dslam_mav.dslam.scoring import has_positions
from dslam_mav.errors import BadInputError
from dslam_mav.export.anchor import Anchor, Solution, solutions
from dslam_mav.export.geojson import geojson_bytes
from dslam_mav.export.kml import kml_bytes
from dslam_mav.export.table import csv_bytes, parquet_bytes, reading_table
from dslam_mav.files import check_output, write_whole
from dslam_mav.log.reader import read_log
from dslam_mav.log.topics import RAW
from dslam_mav.mav.tlog import read_tlog, tlog_bytes
from dslam_mav.mission import Home, LegPlan, has_home_item, leg_plan
from dslam_mav.mission import home_of as home_of_mission
from dslam_mav.recordings import kind_of
from dslam_mav.records import Estimate
from dslam_mav.records.words import count

ANCHORS = ("home", "heading", "turn")
ENDINGS = {
    "csv": (".csv", ".txt"),
    "tlog": (".tlog",),
    "parquet": (".parquet",),
    "kml": (".kml",),
    "geojson": (".geojson", ".json"),
}


def run(options: Namespace) -> int:
    """One file, beside the log unless `-o` says where."""
    screen = Screen(json_only=options.json)
    path = Path(options.log)
    out = Path(options.output) if options.output else path.with_suffix(f".{options.to}")
    if out.exists() and not options.overwrite:
        raise BadInputError(f"{out}: exists already; give another -o, or --overwrite")
    if out.exists() and out.samefile(path):
        raise BadInputError(f"-o {out}: is the log itself")
    check_output(out, ENDINGS[options.to])
    for name in ANCHORS:
        if getattr(options, name) is not None and options.to not in ("kml", "geojson"):
            raise BadInputError(f"--{name} {getattr(options, name)}: expected with --to kml or geojson")
    with screen.progress(f"{path} -> {out}"):
        data, told = _packets(path) if options.to == "tlog" else _of_flight(path, options)
        write_whole(out, data)
    screen.say(f"{out}: {told}")
    screen.result({"log": str(path), "to": options.to, "output": str(out), "bytes": len(data)})
    return 0


def _packets(path: Path) -> tuple[bytes, str]:
    kind = kind_of(path)
    if kind not in ("mcap", "tlog"):
        raise BadInputError(f"{path}: has no MAVLink packets to export as tlog; expected a .mcap or .tlog")
    if kind == "mcap":
        packets = list(read_log(path, (RAW,)).frames)
    else:
        packets = [(frame.received_ns, frame.raw) for frame in read_tlog(path)]
    if not packets:
        raise BadInputError(f"{path}: has no MAVLink packets")
    return tlog_bytes(packets), count(len(packets), "packet")


def _of_flight(path: Path, options: Namespace) -> tuple[bytes, str]:
    logged = open_logged(path, Namespace(plan=options.plan, columns=options.columns, set=options.set))
    if options.to in ("csv", "parquet"):
        table = reading_table(logged.replayed.legs, *logged.replayed.collector.readings())
        told = (
            f"{count(table.value.size, 'reading')}, {int((table.leg > 0).sum()):,} of them on "
            f"{count(len(logged.replayed.legs), 'leg')}"
        )
        return (csv_bytes if options.to == "csv" else parquet_bytes)(table), told
    estimate = _estimate(logged)
    home, anchor = _anchor(logged, estimate, options)
    found = list(solutions(estimate, anchor))
    facts: dict[str, Any] = {"log": path.name, "verdict": estimate.verdict.name}
    data = geojson_bytes(found, home, facts) if options.to == "geojson" else kml_bytes(found, home, path.stem, facts)
    return data, _in_words(found)


def _in_words(found: list[Solution]) -> str:
    sources = len(found[0].sources)
    words = f"{count(sources, 'source')} with 95 % circles, path"
    if any(solution.mirrored for solution in found):
        words += ", and their mirror image: --turn left|right tells which"
    others = sum(solution.name.startswith("alternative") and not solution.mirrored for solution in found)
    return f"{words}; {count(others, 'other solution')}" if others else words


def _estimate(logged: Logged) -> Estimate:
    estimate = as_flown(logged).estimate
    if estimate is None or not has_positions(estimate):
        reason = "" if estimate is None else estimate.reason
        raise BadInputError(f"{logged.path}: there is no position to export: {reason}")
    return estimate


def _anchor(logged: Logged, estimate: Estimate, options: Namespace) -> tuple[Home, Anchor | None]:
    """Home and where leg 1 begins and goes: what is given, else what the plan says, else one line that asks for it."""
    mission = logged.mission
    home = parse_home(options.home) if options.home else None if mission is None else home_of_mission(mission)
    if home is None:
        raise BadInputError(f"{logged.path}: has no plan, so home is not known: give --home LAT,LON where leg 1 begins")
    if estimate.gauge == "anchored":
        given = [name for name in ("heading", "turn") if getattr(options, name) is not None]
        if given:
            raise BadInputError(
                f"--{given[0]} {getattr(options, given[0])}: the answer is anchored to its plan already"
            )
        return home, None
    planned = None if mission is None else _planned(logged, home)
    if planned is None and options.heading is None:
        raise BadInputError(
            f"{logged.path}: the answer is not anchored: give --heading DEG, leg 1's direction clockwise from north"
        )
    anchor = planned or Anchor(home, np.zeros(2), 0.0, None)
    if options.heading is not None:
        anchor = replace(anchor, heading_rad=math.radians(90.0 - options.heading))
    return home, anchor if options.turn is None else replace(anchor, left=options.turn == "left")


def _planned(logged: Logged, home: Home) -> Anchor | None:
    """Leg 1 as the plan has it."""
    plan = leg_plan(logged.mission) if logged.mission is not None else None
    start = logged.replayed.legs[0].start_seq
    if (
        logged.mission is not None and plan is not None and start == 0 and has_home_item(logged.mission)
    ):  # a rover's first leg begins at home
        plan = LegPlan((0, *plan.sequence), np.vstack([np.zeros(2), plan.vertices_m]))
    if plan is None or start not in plan.sequence[:-1]:
        return None
    first = plan.sequence.index(start)
    headings = plan.headings_rad[first : first + len(logged.replayed.legs)]
    turns = [math.sin(b - a) for a, b in pairwise(headings)]
    side = next((turn > 0.0 for turn in turns if abs(turn) > 1e-3), None)
    return Anchor(home, plan.vertices_m[first], float(headings[0]), side)
