"""What is installed is what is in the tree: packages, the files beside them, the version, the command."""

from __future__ import annotations

import importlib.util
import shutil
import subprocess
import sys
import tomllib
import zipfile
from importlib import import_module
from pathlib import Path

import pytest

import dslam_mav

ROOT = Path(__file__).parents[1]
TOPS = ("dslam_mav", "missions", "sim_bridge")
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def shipped_files() -> set[str]:
    """All that belongs to the packages; caches do not."""
    files = (path for top in TOPS for path in (ROOT / top).rglob("*") if path.is_file())
    return {str(path.relative_to(ROOT)) for path in files if "__pycache__" not in path.parts}


def test_every_package_is_listed_by_name():
    folders = {str(Path(name).parent).replace("/", ".") for name in shipped_files() if name.endswith(".py")}
    assert set(PROJECT["tool"]["setuptools"]["packages"]) == folders
    for folder in folders:
        assert (ROOT / folder.replace(".", "/") / "__init__.py").is_file(), f"{folder} is no package"


def test_the_version_is_told_once():
    assert dslam_mav.__version__ == PROJECT["project"]["version"]


def test_the_command_is_there():
    module, _, function = PROJECT["project"]["scripts"]["dslam-mav"].partition(":")
    assert callable(getattr(import_module(module), function))


@pytest.mark.skipif(importlib.util.find_spec("build") is None, reason="the `build` package (extra dev) is missing")
@pytest.mark.skipif(importlib.util.find_spec("setuptools") is None, reason="setuptools is not in this environment")
def test_a_wheel_holds_every_file_of_the_packages_and_nothing_else(tmp_path):
    tree = tmp_path / "tree"
    for top in TOPS:
        shutil.copytree(ROOT / top, tree / top, ignore=shutil.ignore_patterns("__pycache__"))
    for path in ROOT.iterdir():
        if path.is_file() and (path.name in ("pyproject.toml", "LICENSE") or path.suffix == ".md"):
            shutil.copy(path, tree)
    (tree / "README.md").touch()
    command = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", str(tmp_path / "out"), str(tree)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    (wheel,) = (tmp_path / "out").glob("*.whl")
    inside = {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}
    assert inside == shipped_files()
    assert wheel.name.startswith(f"dslam_mav-{dslam_mav.__version__}-")
