"""Serving a flight to Foxglove, as it is flown or as it was logged."""

from __future__ import annotations

import time
from argparse import Namespace
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NoReturn

from dslam_mav.commands.screen import Screen
from dslam_mav.errors import BadInputError
from dslam_mav.log.live import Live
from dslam_mav.log.reader import read_messages
from dslam_mav.recordings import kind_of

_SUBSCRIBING_S = 0.5  # a viewer asks for its topics panel by panel
_AHEAD = 500  # messages that may wait in the server: as fast as possible, but none lost
_STEP_S = 0.02


@contextmanager
def served(options: Namespace, screen: Screen) -> Iterator[Live | None]:
    """The server that `--live` asks for; None where it does not. BadInputError where it cannot be."""
    if options.live is None:
        yield None
        return
    with Live(*options.live) as live:
        screen.say(f"Live     {live.url}, in Foxglove: Open connection, Foxglove WebSocket")
        yield live


def check(options: Namespace) -> None:
    """BadInputError, one line, for what does not go together in a replay."""
    if options.live is None:
        if options.speed is not None:
            raise BadInputError(f"--speed {options.speed:g}: only with --live")
    elif not options.set and kind_of(Path(options.log)) != "mcap":
        raise BadInputError(f"{options.log}: --live plays an .mcap log; --set KEY=VALUE makes one of this file")


def play(live: Live, log: Path, speed: float, screen: Screen) -> NoReturn:
    """The log's messages, `speed` times as fast as they were logged (0: without waiting), from the first viewer on;
    then the last of them for whoever comes, until Ctrl-C.
    """
    messages = read_messages(log)
    with screen.progress("waiting for Foxglove") as advance:
        while not live.watched.wait(_STEP_S):
            pass
        time.sleep(_SUBSCRIBING_S)
        first_ns = messages[0][0] if messages else 0
        last_s = (messages[-1][0] - first_ns) / 1e9 if messages else 0.0
        begun_s = time.monotonic()
        for time_ns, topic, data in messages:
            flown_s = (time_ns - first_ns) / 1e9
            while live.waiting > _AHEAD or (speed and time.monotonic() - begun_s < flown_s / speed):
                advance("playing", flown_s, last_s, f"{flown_s:.0f} of {last_s:.0f} s")
                time.sleep(_STEP_S)
            live.send(time_ns, topic, data)
    screen.say(f"Played   {len(messages):,} messages; serving until Ctrl-C")
    while True:
        time.sleep(1.0)
