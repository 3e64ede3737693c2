"""A flight that stands out of the sources' reach before its first leg, calibrated by that; compass on and off."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest
from running import SCENE, run

AWAY_M = 120.0


def moved(scene: dict[str, Any]) -> dict[str, Any]:
    """The scene so far from home that nothing of it is seen there."""
    other = json.loads(json.dumps(scene))
    for source in other["sources"]:
        source["position_m"][0] += AWAY_M
    other["path"]["vertices_m"] = [[x + AWAY_M, y] for x, y in other["path"]["vertices_m"]]
    return other


@pytest.fixture(scope="module")
def hovered(tmp_path_factory: pytest.TempPathFactory) -> Any:
    folder = tmp_path_factory.mktemp("hover")
    scene = folder / "scene.json"
    scene.write_text(json.dumps(moved(SCENE)))
    assumed = ("--sources", 2, "--ambient", "hover", "--noise", "hover")
    done = run("fly", "--scene", scene, *assumed, "--out", folder / "logs", "--speedup", 40, "--json")
    assert done.code == 0, done.err
    return done.object


def test_the_stand_gives_the_ambient_level_and_replay_repeats_it(hovered: Any) -> None:
    assert abs(hovered["medium"]["ambient"] - 20.0) < 0.5 * hovered["noise_sd"]
    assert run("replay", hovered["log"], "--json").object | {"report": hovered["report"]} == hovered
    free = run("replay", hovered["log"], "--ambient", "auto", "--noise", "legs", "--json").object
    assert free["medium"]["ambient"] != hovered["medium"]["ambient"]


def test_the_report_tells_the_stand_and_compares_the_compass(hovered: Any, tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    assert run("report", hovered["log"], "-o", page).code == 0
    for written in (page, Path(hovered["report"])):
        text = " ".join(re.sub(r"<[^>]+>", " ", written.read_text()).split())
        assert re.search(r"Standing before leg 1 \d+ readings in [\d.]+ s: noise [\d.]+, level 20\.", text)
        told = text[text.index("With and without the compass") :]
        assert re.match(r"With and without the compass Without compass With compass verdict (\w+) \1 ", told)
        assert "which of two mirror images" in told
        first, second = re.findall(r"S1 (.*?) S2", told)[0].split(" peak ")[:2]
        assert first
        assert second


def test_words_it_does_not_know_are_refused() -> None:
    assert "a number, auto or hover" in run("fly", "--ambient", "hoover").line()
    assert "--set ambient=hoover" in run("replay", "x.mcap", "--set", "ambient=hoover").line()
