"""Every command that README and docs/ show is run: here, as it stands, or where its own tests are."""

from __future__ import annotations

import csv
import re
import shlex
import shutil
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from dataflash import dataflash
from flown import fly
from running import SCENE, run
from test_docs import ROOT, SHOWN

from dslam_mav.log.reader import read_log

SHARED = ROOT.parent / "shared"
ELSEWHERE = {
    r".*(--connect|--scheduler)": (
        "commands/test_processes.py", "commands/test_fly_profiles.py", "commands/test_check.py",
        "commands/test_signing_key.py", "sweep/test_sweep_cluster.py",
    ),
    r"vehicle ": ("sim_bridge/loopback/test_ardupilot_ways.py", "commands/test_fly_hostile.py"),
    r"fly --readings ../shared": ("test_real_input.py",),
    r"replay --live": ("commands/test_live_commands.py",),
    r"plan --pattern (best|.*--area 32,32|(lawnmower|star7) --sources 3$)": (
        "commands/test_plan_best.py", "experiments/test_gallery.py", "test_docs.py",
    ),
    r"paper |sweep docs": ("experiments/test_paper_command.py", "commands/test_sweep_command.py"),
}  # fmt: skip
"""Commands that need a vehicle or a cluster of their own, or minutes: they are run there, on smaller ones."""
COMMANDS = sorted({" ".join(shlex.split(command, comments=True)) for _, command in SHOWN})
HERE = [c for c in COMMANDS if "--help" not in c and not any(re.match(pattern, c) for pattern in ELSEWHERE)]
QUICKLY = {"fly": ("--speedup", "30")}
NO_ANSWER = "no position can be given"


@pytest.fixture(scope="session")
def kit(flown: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with every file that the pages name."""
    folder = tmp_path_factory.mktemp("kit") / "here"
    (folder / "logs" / "latest").mkdir(parents=True)
    data = flown.log.read_bytes()
    for name in ("flight.mcap", "logs/latest/flight.mcap"):
        (folder / name).write_bytes(data)
    (folder / "cut.mcap").write_bytes(data[: int(0.8 * len(data))])
    (folder / "scene.json").write_bytes(flown.scene.read_bytes())
    (folder / "star.plan").write_bytes(read_log(flown.log).attachments["plan.plan"])
    (folder / "00000042.BIN").write_bytes(dataflash(fly(late_ms=100)))
    assert run("export", flown.log, "--to", "tlog", "-o", folder / "flight.tlog").code == 0
    assert run("export", flown.log, "--to", "csv", "-o", folder / "readings.csv").code == 0
    with (folder / "readings.csv").open() as lines:
        rows = list(csv.DictReader(lines))[::3]  # as few as will do
    (folder / "log.csv").write_text("time_s,value\n" + "".join(f"{row['time_s']},{row['value']}\n" for row in rows))
    (folder / "gas.csv").write_text("time_s,value,east_m,north_m,Time,Gas,X,Y\n" + "".join(_placed(rows)))
    for link, target in (("docs", ROOT / "docs"), ("missions", ROOT / "missions"), ("../shared", SHARED)):
        (folder / link).symlink_to(target)
    return folder


def _placed(rows: list[dict[str, str]]) -> list[str]:
    corner = np.array(SCENE["path"]["vertices_m"])
    steps = [(b - a) / np.linalg.norm(b - a) for a, b in pairwise(corner)]
    lines = []
    for row in rows:
        if row["leg"]:
            j = int(row["leg"]) - 1
            x, y = corner[j] + float(row["distance_m"]) * steps[j]
            t, value = float(row["time_s"]), float(row["value"])
            lines.append(f"{t},{value},{x:.4f},{y:.4f},{1e3 * t},{-value},{x:.4f},{y:.4f}\n")
    return lines


@pytest.mark.parametrize("command", HERE)
def test_a_command_shown_does_what_it_should(
    command: str, kit: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if "../shared" in command and not SHARED.is_dir():
        pytest.skip("../shared/data is not there")
    here = tmp_path / "here"
    shutil.copytree(kit, here, symlinks=True)
    (tmp_path / "shared").symlink_to(SHARED)
    monkeypatch.chdir(here)
    words = shlex.split(command)
    words = [path for word in words for path in (sorted(map(str, Path().glob(word))) if "/*/" in word else [word])]
    done = run(*words, *QUICKLY.get(words[0], ()))
    assert "Traceback" not in done.err
    wanted = 3 if "cut.mcap" in command else 0
    assert done.code == wanted or NO_ANSWER in done.err, done
    if "-o" in words:
        assert Path(words[words.index("-o") + 1]).stat().st_size > 100


def test_what_is_run_elsewhere_has_its_tests() -> None:
    for names in ELSEWHERE.values():
        for name in names:
            assert (ROOT / "tests" / name).is_file(), name
    assert len(HERE) > 25
