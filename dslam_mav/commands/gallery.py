"""`make gallery`: what each pattern sees, as pictures and one page, under docs/.

python -m dslam_mav.commands.gallery [FOLDER]
"""

from __future__ import annotations

import math
import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dslam_mav.commands.plan_making import find_plan
from dslam_mav.commands.plan_options import add_plan
from dslam_mav.commands.plan_prior import Expectation, expectation
from dslam_mav.commands.plan_words import verdict
from dslam_mav.commands.screen import Screen
from dslam_mav.dslam.outlook import Outlook, Range, outlook, reason
from dslam_mav.experiments.pictures.sight import sight_png
from dslam_mav.experiments.sight import sight
from dslam_mav.files import write_whole
from dslam_mav.mission import leg_plan
from dslam_mav.records.arrays import Array
from dslam_mav.records.words import count
from dslam_mav.report.foreseen import NONE, metres

ASKED = ("--sources", "3", "--spread", "10", "--area", "32,32")
PATTERNS = {
    "star7": (), "star5": (), "triangle": (), "square": (), "lawnmower": (), "spiral": (),
    "random": ("--leg", "20", "--seed", "4"),
    "best": ("--length", "160"),
}  # fmt: skip
NOTES = {"random": "One draw of many: others see nothing at all, or nearly as much as a star."}
REACH_M, CELLS = 26.0, 53
SEED = 0
INTRODUCTION = """# What each pattern sees

Which mission is flown decides what can be known. Each map shows, by the Cramér–Rao bound, the error that 90 % of
flights do not exceed for a source lying there, while two others lie anywhere in the dashed area of 32 × 32 m; √C is
10 m, the noise 20 dB below the mean squared reading on a star that fills the area, two readings a metre. Dark is well
seen; hatched, a source is not known to 20 m. The dot is where the flight begins; errors are relative to its first leg.
A second answer that fits as well is nothing a bound shows: `plan --simulate` does.

The figures are those of `plan` with the command below each picture. `make gallery` draws all of it anew."""


@dataclass(frozen=True, slots=True)
class Entry:
    """A pattern, the command that plans it, and what it sees."""

    name: str
    command: str
    legs: int
    length_m: float
    seen: Outlook
    why: str | None


def main(words: Sequence[str] | None = None) -> int:
    """Draw all pictures and write the page that shows them."""
    parser = ArgumentParser(prog="gallery", description="Draw what each pattern sees.")
    parser.add_argument("folder", nargs="?", default="docs", help="(default: docs)")
    folder, screen = Path(parser.parse_args(words).folder), Screen()
    (folder / "gallery").mkdir(parents=True, exist_ok=True)
    entries = []
    for name, more in PATTERNS.items():
        entry, picture = draw(name, more, screen)
        write_whole(folder / "gallery" / f"{name}.png", picture)
        screen.say(f"{name}: {verdict(entry.seen)}")
        entries.append(entry)
    write_whole(folder / "gallery.md", page(entries).encode())
    return 0


def draw(name: str, more: Sequence[str], screen: Screen) -> tuple[Entry, bytes]:
    """A pattern's entry, the same figures as `plan` prints, and its picture as PNG."""
    words = ["--pattern", name, *more, *ASKED]
    options = _options(words)
    planned = find_plan(options, screen)
    path = leg_plan(planned.mission).vertices_m
    expected = expectation(options, path, planned.prior, planned.fence, planned.speed_m_s)
    seen = outlook(path, expected.groups, expected.sensing)
    why = reason(path, expected.groups, expected.sensing) if seen.poor else None
    length_m = float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())
    entry = Entry(name, "dslam-mav plan " + " ".join(words), len(path) - 1, length_m, seen, why)
    return entry, _picture(entry, path, expected)


def page(entries: Sequence[Entry]) -> str:
    """The Markdown that shows them."""
    lines = [
        *INTRODUCTION.splitlines(),
        "",
        "| pattern | legs | length | source error, median / 90 % | path error, median / 90 % | not identifiable |",
        "| --- | ---: | ---: | ---: | ---: | ---: |",
        *(_row(entry) for entry in entries),
        "",
    ]
    for entry in entries:
        because = f" {entry.why[:1].upper()}{entry.why[1:]}." if entry.why else ""
        lines += [
            f"## {entry.name}",
            "",
            f"![The path of {entry.name} over a map of the error to expect](gallery/{entry.name}.png)",
            "",
            " ".join(filter(None, (f"{verdict(entry.seen)}{because}", NOTES.get(entry.name)))),
            "",
            f"    {entry.command}",
            "",
        ]
    return "\n".join(lines)


def _row(entry: Entry) -> str:
    seen = entry.seen
    source, path = _range(seen.source), _range(seen.path)
    blind = f"{100.0 * seen.unidentifiable_share:.0f} %"
    return f"| [{entry.name}](#{entry.name}) | {entry.legs} | {entry.length_m:.0f} m | {source} | {path} | {blind} |"


def _range(values: Range) -> str:
    if math.isinf(values.median_m):
        return NONE
    return f"{metres(values.median_m)} m / {metres(values.p90_m)}{'' if math.isinf(values.p90_m) else ' m'}"


def _options(words: Sequence[str]) -> Namespace:
    parser = ArgumentParser()
    add_plan(parser)
    return parser.parse_args(words)


def _picture(entry: Entry, path: Array, expected: Expectation) -> bytes:
    """In metres about the middle of the area."""
    middle = expected.prior.region.middle
    half = 0.5 * expected.prior.region.extent
    axis = np.linspace(-REACH_M, REACH_M, CELLS)
    rng = np.random.default_rng(SEED)
    seen = sight(path, expected.prior, expected.sensing, (axis + middle[0], axis + middle[1]), rng)
    title = f"{entry.name}: {count(entry.legs, 'leg')}, {entry.length_m:.0f} m"
    return sight_png(seen, path, (middle - half, middle + half), title)


if __name__ == "__main__":
    sys.exit(main())
