"""`--signing-key-file` on the command line: bad files, the flight with a key, and where the key must never appear."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from fakes import flying
from running import left, run, the_log

from dslam_mav import read_flight
from dslam_mav.log.reader import read_log
from dslam_mav.mav.signing import Signing

KEY = bytes(range(101, 133))


@pytest.fixture
def key_file(tmp_path: Path) -> Path:
    path = tmp_path / "signing.key"
    path.write_text(KEY.hex() + "\n")
    path.chmod(0o600)
    return path


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, "cannot be read: no such file"),
        ("", "0 digits: expected 64 hexadecimal digits (32 bytes)"),
        ("ab" * 31, "62 digits: expected 64"),
        ("ab" * 33, "66 digits: expected 64"),
        ("ab" * 20 + "xy" + "cd" * 11, "character 41 is no hexadecimal digit"),
        ("é" * 32, "bytes that are no text"),
        ("00" * 32, "all zeros"),
    ],
)
@pytest.mark.parametrize("command", ["upload", "vehicle", "fly"])
def test_a_bad_key_file_is_one_line_without_its_content(
    flown: Any, tmp_path: Path, command: str, content: str | None, words: str
) -> None:
    path = tmp_path / "bad.key"
    if content is not None:
        path.write_text(content)
    more = {"upload": (flown.plan, "--connect", "udpout:127.0.0.1:9"), "vehicle": ("--listen", "udpin:127.0.0.1:0")}
    out = ("--out", tmp_path / "logs")
    done = run(command, *more.get(command, out), "--signing-key-file", path)
    assert (done.code, done.out) == (2, "")
    assert f"--signing-key-file {path}: " in done.line()
    assert words in done.line()
    assert not content or content not in done.err
    assert left(tmp_path) <= {"bad.key"}


def test_a_folder_is_no_key_and_a_key_is_no_file(tmp_path: Path) -> None:
    to = ("clear", "--connect", "udpout:127.0.0.1:9", "--signing-key-file")
    assert "is a directory" in run(*to, tmp_path).line()
    done = run(*to, KEY.hex())
    assert done.code == 2
    assert KEY.hex() not in done.err


def test_a_key_that_others_may_read_is_used_with_a_warning(key_file: Path) -> None:
    with flying(signing=Signing(KEY)) as (url,):
        to = ("clear", "--connect", url, "--signing-key-file", key_file)
        assert run(*to).err == ""
        key_file.chmod(0o644)
        done = run(*to)
    assert done.code == 0
    assert "others may read it" in done.line()


@pytest.mark.parametrize("command", ["upload", "download", "clear", "onboard", "bridge", "fly"])
def test_every_command_with_the_wrong_key_hears_nothing(
    flown: Any, tmp_path: Path, key_file: Path, command: str
) -> None:
    words = {
        "fly": ("fly", flown.plan, "--out", tmp_path / "logs"),
        "upload": ("upload", flown.plan),
        "download": ("download", "-o", tmp_path / "held.plan"),
        "clear": ("clear",),
        "onboard": ("onboard", "--out", tmp_path / "flight.mcap"),
        "bridge": ("bridge",),
    }[command]
    other = bytes(reversed(KEY))
    with flying(signing=Signing(other)) as (url,):
        done = run(*words, "--connect", url, "--timeout", 0.3, "--signing-key-file", key_file)
    assert (done.code, done.out) == (1, "")
    assert "no vehicle answered" in done.line()


def test_a_signed_flight_is_as_good_and_leaves_neither_key_nor_signatures(
    flown: Any, tmp_path: Path, key_file: Path
) -> None:
    words = ("--scene", flown.scene, "--sources", 2, "--speedup", 30, "--signing-key-file", key_file)
    done = run("fly", *words, "--out", tmp_path / "logs", "--json")
    assert (done.code, done.err) == (0, "")
    assert max(done.object["errors"]["sources_m"]) < 0.5
    log = read_log(the_log(tmp_path / "logs"))
    assert read_flight(the_log(tmp_path / "logs")).n_readings == read_flight(flown.log).n_readings
    assert not any(raw[2] & 1 for _, raw in log.frames)  # the flag that announces a signature
    texts = [done.out.encode(), repr(log).encode(), (the_log(tmp_path / "logs").parent / "report.html").read_bytes()]
    for text in (*texts, *log.attachments.values(), *(raw for _, raw in log.frames)):
        assert KEY not in text
        assert KEY.hex().encode() not in text.lower()
