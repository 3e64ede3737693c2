"""What each pattern sees: maps that agree with the prediction, a page that agrees with its pictures and with `plan`."""

from __future__ import annotations

import io
import json
import shlex
import sys
from contextlib import redirect_stdout
from pathlib import Path

import numpy as np
import pytest

from dslam_mav.cli import main
from dslam_mav.commands import gallery
from dslam_mav.commands.screen import Screen
from dslam_mav.dslam.expected import Sensing, errors_flown, place_errors
from dslam_mav.dslam.layouts import Prior, Region, drawn
from dslam_mav.experiments.sight import sight
from missions.patterns import PATTERN_NAMES, pattern

DOCS = Path(__file__).parents[2] / "docs"
BIGGEST = 60_000
PRIOR = Prior((3, 3), (10.0, 10.0), Region((0.0, -10.0), (32.0, 20.0)))
SENSING = Sensing(0.1, 2.0)
STAR = pattern("star7", 32.0)


def test_errors_of_single_sources_make_up_the_error_of_all():
    (layouts,) = drawn(PRIOR, 60, np.random.default_rng(1))
    each = place_errors(STAR, layouts, SENSING, np.random.default_rng(2))
    together = errors_flown(STAR, layouts, SENSING, np.random.default_rng(3)).source
    assert each.shape == (60, 3, 16)
    rms = np.sqrt((each**2).mean(axis=1)).ravel()
    assert np.median(rms) == pytest.approx(np.median(together), rel=0.1)


def test_a_source_amid_the_star_is_seen_and_one_far_off_is_not():
    axes = np.array([16.0, 80.0]), np.array([5.0])
    seen = sight(STAR, PRIOR, SENSING, axes, np.random.default_rng(0))
    assert seen.error_m.shape == (1, 2)
    assert seen.error_m[0, 0] < 5.0
    assert np.isinf(seen.error_m[0, 1])


def test_a_single_source_beside_none_is_refused():
    with pytest.raises(ValueError):
        sight(
            STAR,
            Prior((1, 1), (10.0, 10.0), PRIOR.region),
            SENSING,
            (np.zeros(1), np.zeros(1)),
            np.random.default_rng(0),
        )


def test_a_picture_is_a_small_indexed_png(monkeypatch):
    pytest.importorskip("matplotlib")
    monkeypatch.setattr(gallery, "CELLS", 9)
    entry, picture = gallery.draw("star5", (), Screen())
    assert entry.legs == 5
    assert_small_and_indexed(picture)
    assert "| [star5](#star5) | 5 | 160 m | 1.2 m / 3.7 m |" in gallery.page([entry])


@pytest.mark.parametrize("name", [*PATTERN_NAMES, "best"])
def test_the_page_shows_every_pattern(name):
    page = (DOCS / "gallery.md").read_text()
    assert f"\n## {name}\n" in page
    assert f"(gallery/{name}.png)" in page
    assert_small_and_indexed((DOCS / "gallery" / f"{name}.png").read_bytes())


@pytest.mark.parametrize("name", [name for name in PATTERN_NAMES if name not in ("star7", "square")])
def test_the_page_says_what_plan_says(name):
    page = (DOCS / "gallery.md").read_text()
    section = page.split(f"\n## {name}\n")[1].split("\n## ")[0]
    (command,) = [line.strip() for line in section.splitlines() if line.startswith("    dslam-mav ")]
    out = io.StringIO()
    with redirect_stdout(out):
        assert main([*shlex.split(command)[1:], "--json"]) == 0
    told = json.loads(out.getvalue())
    row = next(line for line in page.splitlines() if line.startswith(f"| [{name}]"))
    assert told["verdict"] in section
    assert f"| {told['legs']} | {told['length_m']:.0f} m |" in row
    median = told["predicted"]["source_error_m"]["median"]
    assert (f"| {float(f'{median:.2g}'):g} m / " if median is not None else "| none |") in row
    assert f"| {100 * told['predicted']['unidentifiable_share']:.0f} % |" in row


def assert_small_and_indexed(picture: bytes) -> None:
    """Palette PNG: colour type 3 in its header."""
    assert len(picture) < BIGGEST
    assert picture[:8] == b"\x89PNG\r\n\x1a\n"
    assert picture[25] == 3


def test_the_folder_is_made_and_nothing_else_written(tmp_path, monkeypatch, capsys):
    pytest.importorskip("matplotlib")
    monkeypatch.setattr(gallery, "CELLS", 5)
    monkeypatch.setattr(gallery, "PATTERNS", {"triangle": ()})
    monkeypatch.setattr(sys, "argv", ["gallery"])
    assert gallery.main([str(tmp_path / "docs")]) == 0
    written = sorted(str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*") if path.is_file())
    assert written == ["docs/gallery.md", "docs/gallery/triangle.png"]
    assert capsys.readouterr().out.startswith("triangle: Blind")
