"""`info`: what is in a log."""

from __future__ import annotations

from argparse import Namespace
from collections import Counter
from pathlib import Path

from dslam_mav.commands.screen import Screen
from dslam_mav.log.reader import LogInfo, log_info
from dslam_mav.log.recovered import in_words
from dslam_mav.mav.dataflash import read_dataflash
from dslam_mav.mav.tlog import read_tlog
from dslam_mav.recordings import kind_of
from dslam_mav.series import read_csv

_INCOMPLETE = {
    "mcap": "cut short or damaged, see dslam-mav recover",
    "tlog": "without the bytes in it that are no packets",
    "dataflash": "without the bytes in it that are no records",
}


def run(options: Namespace) -> int:
    """Topics, duration, and whether the log was closed properly; of others' recordings what is there of each kind."""
    screen = Screen(json_only=options.json)
    path = Path(options.log)
    info = _info(path, options.columns)
    screen.say(f"{path}: {info['duration_s']:.1f} s, {_state(path, info)}")
    width = max((len(topic) for topic in info["topics"]), default=0)
    for topic, count in sorted(info["topics"].items()):
        screen.say(f"  {topic:<{width}}  {count}")
    if "recovered" in info:
        screen.say(f"  {in_words(info['recovered'])}")
    screen.result(info)
    return 0


def _state(path: Path, info: LogInfo) -> str:
    """What is meant: the file is whole, or it is whole but does not hold the whole flight, or it is neither."""
    if not info["complete"]:
        return _INCOMPLETE[kind_of(path)]
    salvaged = info.get("recovered")
    if salvaged is not None and (salvaged["lost"] or not salvaged["exact"]):
        return "a whole file, but not the whole flight"
    return "complete"


def _info(path: Path, columns: str | None) -> LogInfo:
    kind = kind_of(path)
    if kind == "tlog":
        return _telemetry(path)
    if kind == "dataflash":
        log = read_dataflash(path)
        return LogInfo(topics=log.records, duration_s=log.duration_s, complete=not log.bad_bytes)
    if kind == "csv":
        series = read_csv(path, columns)
        topics = {"readings": int(series.value.size)}
        if series.place_m is not None:
            topics["places"] = len(series.place_m)
        return LogInfo(topics=topics, duration_s=series.duration_s, complete=True)
    return log_info(path)


def _telemetry(path: Path) -> LogInfo:
    tlog = read_tlog(path)
    counts: Counter[str] = Counter()
    first_ns = last_ns = None
    for frame in tlog:
        counts[frame.message.get_type()] += 1
        first_ns = frame.received_ns if first_ns is None else min(first_ns, frame.received_ns)
        last_ns = frame.received_ns if last_ns is None else max(last_ns, frame.received_ns)
    duration_s = 0.0 if first_ns is None or last_ns is None else (last_ns - first_ns) / 1e9
    return LogInfo(topics=dict(counts), duration_s=duration_s, complete=not tlog.bad_bytes)
