"""`recover`: what a cut or damaged log still holds, as a whole log."""

from __future__ import annotations

import os
from argparse import Namespace
from pathlib import Path

from rich.table import Table

from dslam_mav.commands.screen import Screen
from dslam_mav.errors import BadInputError
from dslam_mav.files import check_output, write_whole
from dslam_mav.log.recover import Count, Salvaged, salvage
from dslam_mav.log.recovered import lost_in_words
from dslam_mav.records.words import count

LOSSY = 3


def run(options: Namespace) -> int:
    """Write the log anew; 0 where nothing is lost, 3 where something is or may be."""
    screen = Screen(json_only=options.json)
    log, out = Path(options.log), Path(options.output)
    if os.path.lexists(out):
        raise BadInputError(f"-o {out}: exists already, and a log is never overwritten")
    check_output(out, (".mcap",))
    with screen.progress(f"{log} -> {out}"):
        salvaged = salvage(log)
        write_whole(out, salvaged.data, anew=False)
    _show(screen, log, out, salvaged)
    screen.result(
        {
            "out": str(out),
            "clean": salvaged.clean,
            "closed": salvaged.closed,
            "kept": salvaged.kept,
            "lost": salvaged.lost,
            "exact": salvaged.exact,
            "topics": {t: {"kept": c.kept, "lost": c.lost, "exact": c.exact} for t, c in salvaged.topics.items()},
            "attachments": salvaged.attachments,
            "attachments_lost": salvaged.lost_attachments,
            "metadata_lost": salvaged.lost_metadata,
            "chunks_left_out": salvaged.unread,
        }
    )
    return 0 if salvaged.clean else LOSSY


def _show(screen: Screen, log: Path, out: Path, salvaged: Salvaged) -> None:
    table = Table(box=None, pad_edge=False)
    table.add_column("topic")
    table.add_column("kept", justify="right")
    table.add_column("lost", justify="right")
    for topic, held in salvaged.topics.items():
        table.add_row(topic, str(held.kept), _lost(held))
    screen.table(table)
    screen.say(f"Attachments kept: {', '.join(salvaged.attachments) or 'none'}")
    for what, names in (("Attachments", salvaged.lost_attachments), ("Metadata", salvaged.lost_metadata)):
        if names:
            screen.say(f"{what} lost: {', '.join(names)}")
    if salvaged.unread:
        screen.say(f"Chunks left out, without a checksum or compressed with lz4: {salvaged.unread}")
    if not salvaged.closed:
        screen.say(f"{log} ends early (cut, killed, or on a full disk): what is missing there cannot be counted")
    screen.say(f"{out}: {count(salvaged.kept, 'message')}, {lost_in_words(salvaged.lost, exact=salvaged.exact)}")


def _lost(held: Count) -> str:
    if held.exact:
        return str(held.lost)
    return f"at least {held.lost}" if held.lost else "unknown"
