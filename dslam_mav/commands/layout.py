"""`layout`: how Foxglove is to show a flight log."""

from __future__ import annotations

import json
import sys
from argparse import Namespace
from importlib.resources import files
from pathlib import Path

from dslam_mav.commands.screen import Screen
from dslam_mav.files import check_output, write_whole


def run(options: Namespace) -> int:
    """The layout into a file, or as it is."""
    layout = files("dslam_mav.log").joinpath("foxglove_layout.json").read_bytes()
    screen = Screen(json_only=options.json)
    if options.output is None:
        sys.stdout.write(json.dumps(json.loads(layout)) + "\n" if options.json else layout.decode())
        return 0
    check_output(Path(options.output), (".json",))
    write_whole(Path(options.output), layout)
    screen.say(f"{options.output}: import it in Foxglove (Layouts, Import from file)")
    screen.result({"layout": options.output})
    return 0
