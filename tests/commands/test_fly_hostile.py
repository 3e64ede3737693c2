"""`fly` to a vehicle behind a bad link: an answer, and a log that replays to the same."""

from __future__ import annotations

from typing import Any

import pytest
from running import end, run, spawn, spawn_vehicle, stop


@pytest.mark.parametrize("spec", ["loss=0.15,duplicate=0.1,reorder=0.05,corrupt=0.01,stranger=0.1", "wrap=30"])
def test_fly_over_a_bad_link(flown: Any, tmp_path: Any, spec: str) -> None:
    vehicle, url = spawn_vehicle("--speedup", 8, "--link-faults", spec, "--seed", 1)
    try:
        words = (flown.plan, "--scene", flown.scene, "--sources", 2, "--connect", url, "--timeout", 30)
        done = end(spawn("fly", *words, "--out", tmp_path / "logs", "--json"), 120.0)
    finally:
        stop(vehicle)
    assert done.code == 0, done.err
    assert max(done.object["errors"]["sources_m"]) < 0.6
    again = run("replay", done.object["log"], "--json").object
    assert again["sources"] == done.object["sources"]


def test_a_bad_spec_is_one_line() -> None:
    done = run("vehicle", "--link-faults", "fog=1", "--listen", "udpin:127.0.0.1:0")
    assert (done.code, done.out) == (2, "")
    assert "--link-faults fog=1: 'fog': expected some of loss, duplicate" in done.line()
