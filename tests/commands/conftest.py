"""One demonstration flight for all tests that only look at what a flight leaves."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from running import SCENE, run


@dataclass(frozen=True)
class Flown:
    folder: Path  # logs/
    scene: Path
    plan: Path
    log: Path
    result: dict[str, Any]


@pytest.fixture(scope="session")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Flown:
    """A flight with --json, complete, of two sources."""
    home = tmp_path_factory.mktemp("flown")
    scene, plan = home / "scene.json", home / "star.plan"
    scene.write_text(json.dumps(SCENE))
    assert run("plan", "--leg", 16, "-o", plan).code == 0
    done = run("fly", "--scene", scene, "--sources", 2, "--out", home / "logs", "--speedup", 30, "--json")
    assert done.code == 0, done.err
    return Flown(home / "logs", scene, plan, Path(done.object["log"]), done.object)


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    """A scene file of two sources."""
    path = tmp_path / "scene.json"
    path.write_text(json.dumps(SCENE))
    return path
