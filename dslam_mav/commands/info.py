"""`info`: what is in a log."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from dslam_mav.commands.screen import Screen
from dslam_mav.log.reader import log_info
from dslam_mav.log.recovered import in_words


def run(options: Namespace) -> int:
    """Topics, duration, and whether the log was closed properly."""
    screen = Screen(json_only=options.json)
    path = Path(options.log)
    info = log_info(path)
    state = "complete" if info["complete"] else "cut short or damaged, see dslam-mav recover"
    screen.say(f"{path}: {info['duration_s']:.1f} s, {state}")
    width = max((len(topic) for topic in info["topics"]), default=0)
    for topic, count in sorted(info["topics"].items()):
        screen.say(f"  {topic:<{width}}  {count}")
    if "recovered" in info:
        screen.say(f"  {in_words(info['recovered'])}")
    screen.result(info)
    return 0
