"""What README and docs/ show holds: commands parse, links and pictures are there, cheap commands do as is told."""

from __future__ import annotations

import contextlib
import io
import json
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent / "commands"))

from running import run

from dslam_mav.assumptions import Assumptions
from dslam_mav.cli import _parser
from dslam_mav.commands.settings import KEYS, with_settings
from dslam_mav.commands.sweep_file import read_sweep
from sim_bridge.fields.scene import parse_scene, read_scene

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
FENCE = re.compile(r"^ *```(\w*)\n(.*?)^ *```", re.MULTILINE | re.DOTALL)
COMMAND = re.compile(r"^(?:\$ )?(?:\.venv/bin/)?dslam-mav ((?!…).*)$")
LINK = re.compile(r"\]\(([^)\s]+)\)")


def _name(page: Path) -> str:
    return str(page.relative_to(ROOT))


def _blocks(page: Path, language: str) -> list[str]:
    return [body for found, body in FENCE.findall(page.read_text()) if found == language]


def _commands(page: Path) -> Iterator[str]:
    """In blocks of shell and console, in lines set in by four, and whole in backticks."""
    text = page.read_text()
    for language in ("sh", "console"):
        for body in _blocks(page, language):
            yield from (found[1] for line in body.splitlines() if (found := COMMAND.match(line.strip())))
    outside = FENCE.sub("", text)
    yield from re.findall(r"^    dslam-mav (.+)$", outside, re.MULTILINE)
    yield from (one for one in re.findall(r"`(?:\.venv/bin/)?dslam-mav ([^\s`]+ [^`]+)`", outside) if "…" not in one)


SHOWN = sorted({(_name(page), command) for page in PAGES for command in _commands(page)})


def test_commands_are_found() -> None:
    assert len(SHOWN) > 60
    shown = {command.split()[0] for _, command in SHOWN}
    every = {"plan", "upload", "download", "clear", "check", "vehicle", "bridge", "onboard", "fly", "replay", "report",
             "info", "export", "recover", "layout", "paper", "sweep"}  # fmt: skip
    assert shown >= every


@pytest.mark.parametrize(("page", "command"), SHOWN)
def test_a_command_shown_is_one(page: str, command: str) -> None:
    words = shlex.split(command, comments=True)
    if words[-1] == "--help":
        assert run(*words).code == 0
        return
    options = _parser().parse_args(words)
    module, function = options.run
    assert callable(getattr(import_module(f"dslam_mav.commands.{module}"), function))
    with_settings(Assumptions(), getattr(options, "set", None) or [])


def _anchors(page: Path) -> set[str]:
    """Of a page's headings, as GitHub and mkdocs make them."""
    headings = re.findall(r"^#+ (.+)$", FENCE.sub("", page.read_text()), re.MULTILINE)
    return {re.sub(r"[^\w\s-]", "", heading).strip().lower().replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=_name)
def test_links_and_pictures_are_there(page: Path) -> None:
    for link in LINK.findall(FENCE.sub("", page.read_text())):
        if "://" in link:
            continue
        path, _, anchor = link.partition("#")
        target = (page.parent / path).resolve() if path else page
        assert target.is_file(), f"{_name(page)}: {link}"
        assert not anchor or anchor in _anchors(target), f"{_name(page)}: {link}: no such heading"


@pytest.mark.parametrize("page", PAGES, ids=_name)
def test_files_modules_and_targets_named_are_there(page: Path) -> None:
    text = page.read_text()
    for path in re.findall(r"`((?:tests|docs|dslam_mav|sim_bridge|missions)/[\w./-]*)`", text):
        assert (ROOT / path).exists(), f"{_name(page)}: {path}"
    for module in re.findall(r"-m (tests\.[.\w]*\w)", text):
        path = ROOT / module.replace(".", "/")
        assert path.with_suffix(".py").is_file() or (path / "__main__.py").is_file(), f"{_name(page)}: {module}"
    targets = set(re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    assert set(re.findall(r"`make ([a-z]+)", text)) <= targets


def test_every_page_is_in_the_site() -> None:
    named = re.findall(r": ([\w-]+\.md)$", (ROOT / "mkdocs.yml").read_text(), re.MULTILINE)
    assert sorted(named) == sorted(page.name for page in (ROOT / "docs").glob("*.md"))


def test_the_site_builds_without_a_warning_and_asks_the_network_for_nothing(tmp_path: Path) -> None:
    build = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(tmp_path)]
    quiet = {**os.environ, "NO_MKDOCS_2_WARNING": "1", "HTTPS_PROXY": "http://127.0.0.1:9"}
    done = subprocess.run(build, cwd=ROOT, env=quiet, capture_output=True, text=True, timeout=280, check=False)
    assert (done.returncode, done.stdout + done.stderr) == (0, "")
    for page in (ROOT / "docs").glob("*.md"):
        html = (tmp_path / page.with_suffix(".html").name).read_text()
        assert not re.findall(r'<(?:script|img|link|iframe)[^>]+(?:src|href)="?(?:https?:)?//[^">]+', html), page.name


def test_the_front_door_is_short() -> None:
    assert len((ROOT / "README.md").read_text().splitlines()) <= 300


def test_scenes_and_sweeps_shown_are_taken(tmp_path: Path) -> None:
    (scene,) = _blocks(ROOT / "docs" / "readings.md", "json")
    assert len(parse_scene(scene.encode(), "scene").sources) == 2
    example, logs = _blocks(ROOT / "docs" / "sweeps.md", "toml")
    assert (ROOT / "docs" / "examples" / "sweep.toml").read_text().endswith(example)
    (tmp_path / "logs").mkdir()
    for number, text in enumerate((example, logs)):
        path = tmp_path / f"{number}.toml"
        path.write_text(text)
        read_sweep(path)


def test_python_shown_prints_what_it_says() -> None:
    first, plots, bound = _blocks(ROOT / "docs" / "python.md", "python")
    assert (ROOT / "docs" / "examples" / "three_plots.py").read_text().endswith(plots)
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        exec(first + bound, {})
    assert out.getvalue().splitlines() == re.findall(r"^# (.+)$", first + bound, re.MULTILINE)


def test_flights_over_the_demonstrations_scene_are_told_how_many_sources_it_has() -> None:
    true = len(read_scene(ROOT / "sim_bridge" / "scenes" / "star7_three_sources.json").sources)
    over_another = re.compile(r"--(scene|readings|connect) ")
    told = [re.search(r"--sources (\d+)", c) for _, c in SHOWN if c.startswith("fly ") and not over_another.search(c)]
    assert {int(number[1]) for number in told if number is not None} == {true}


def test_every_assumption_that_can_be_set_is_named() -> None:
    (named,) = re.findall(r"^KEY is (.+?);", (ROOT / "docs" / "log.md").read_text(), re.MULTILINE | re.DOTALL)
    assert re.findall(r"`([\w-]+)`", named) == list(KEYS)


def test_plan_prints_what_is_shown() -> None:
    """Line by line, but for what is left out."""
    consoles = [body for page in PAGES for body in _blocks(page, "console") if body.startswith("$ dslam-mav plan")]
    shown = [body for body in consoles if "best" not in body.splitlines()[0]]  # the search takes its time
    assert len(shown) >= 3
    for body in shown:
        command, *lines = body.splitlines()
        done = run(*shlex.split(command)[2:])
        assert done.code == 0
        for line in lines:
            assert line.strip() == "…" or line in (done.out + done.err).splitlines(), command


def test_layout_is_what_foxglove_takes(tmp_path: Path) -> None:
    (words,) = {tuple(shlex.split(c, comments=True)) for _, c in SHOWN if c.startswith("layout")}
    done = run("layout", "-o", tmp_path / words[-1])
    assert done.code == 0
    assert "3D!map" in json.loads((tmp_path / words[-1]).read_text())["configById"]


def test_info_tells_of_the_logs_it_takes() -> None:
    done = run("info", "--help")
    assert done.code == 0
    assert ".mcap, .tlog, ArduPilot's .bin, or .csv" in done.out
