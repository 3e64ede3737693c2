"""`upload` sends a plan as `fly` does: stopped at its corners, where the autopilot would cut them."""

from __future__ import annotations

from pathlib import Path

import pytest
from fakes import flying, mission
from running import run

from missions.plan_file import read_plan, write_plan


@pytest.mark.parametrize(
    ("profile", "drawn_s", "words", "held_s", "said"),
    [
        ("ardupilot", 0.0, (), 1.0, True),
        ("ardupilot", 0.0, ("--hold", 3), 3.0, True),
        ("ardupilot", 0.0, ("--hold", 0), 0.0, False),
        ("ardupilot", 2.0, (), 2.0, False),
        ("px4", 0.0, (), 1.0, True),
        ("strict", 0.0, (), 0.0, False),
        ("strict", 0.0, ("--hold", 2), 2.0, True),
    ],
)
def test_corners_are_held_unless_the_plan_has_holds(tmp_path: Path, profile, drawn_s, words, held_s, said) -> None:
    plan, held = tmp_path / "drawn.plan", tmp_path / "held.plan"
    write_plan(plan, mission(hold_s=drawn_s))
    with flying(profile=profile, speedup=20.0) as (url,):
        done = run("upload", plan, "--connect", url, *words)
        assert run("download", "--connect", url, "-o", held).code == 0
    assert (done.code, done.err) == (0, "")
    assert ("get a hold of" in done.out) is said
    assert {item.params[0] for _, item in read_plan(held).mission.waypoints()} == {held_s}
