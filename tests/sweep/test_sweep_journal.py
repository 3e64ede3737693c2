"""The journal of finished points: whatever is cut off or damaged, whole lines stay, and more can be added."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dslam_mav.errors import DslamError
from dslam_mav.sweep.journal import Journal

ROWS = {f"key {n}": {"error_m": 0.1 * n + 1e-17, "verdict": "IDENTIFIED", "bound_m": None} for n in range(5)}


def written(path: Path) -> bytes:
    with Journal(path) as journal:
        for key, row in ROWS.items():
            journal.add(key, row)
    return path.read_bytes()


def test_rows_come_back_to_the_last_bit(tmp_path):
    written(tmp_path / "a" / "points.jsonl")
    with Journal(tmp_path / "a" / "points.jsonl") as journal:
        assert journal.rows == ROWS


@settings(deadline=None, max_examples=60)
@given(cut=st.integers(0, 500), junk=st.binary(max_size=20))
def test_cut_anywhere_whole_lines_stay(tmp_path_factory, cut, junk):
    path = tmp_path_factory.mktemp("cut") / "points.jsonl"
    data = written(path)
    cut = min(cut, len(data))
    whole = data[:cut].count(b"\n")
    path.write_bytes(data[:cut] + junk.replace(b"\n", b""))
    with Journal(path) as journal:
        # a cut right before a line's end loses that line, whatever comes after it
        assert list(journal.rows) == list(ROWS)[:whole]
        journal.add("more", {"error_m": 1.0})
    with Journal(path) as journal:
        assert list(journal.rows) == [*list(ROWS)[:whole], "more"]


def test_a_damaged_line_costs_its_own_row_alone(tmp_path):
    path = tmp_path / "points.jsonl"
    lines = written(path).splitlines(keepends=True)
    path.write_bytes(b"".join([*lines[:2], b"\x00\xff{\n", b'{"key": 3}\n', b"[]\n", *lines[3:]]))
    with Journal(path) as journal:
        assert list(journal.rows) == [key for n, key in enumerate(ROWS) if n != 2]


def test_the_last_word_on_a_point_counts(tmp_path):
    path = tmp_path / "points.jsonl"
    with Journal(path) as journal:
        journal.add("a", {"failure": "killed"})
        journal.add("a", {"failure": None})
    with Journal(path) as journal:
        assert journal.rows == {"a": {"failure": None}}


def test_a_row_is_in_the_file_as_soon_as_it_is_added(tmp_path):
    path = tmp_path / "points.jsonl"
    with Journal(path) as journal:
        journal.add("a", {"n": 1})
        assert json.loads(path.read_text()) == {"key": "a", "row": {"n": 1}}


@pytest.mark.skipif(sys.platform == "win32", reason="no file locks")
def test_two_sweeps_do_not_write_one_journal(tmp_path):
    path = tmp_path / "points.jsonl"
    with Journal(path):
        with pytest.raises(DslamError, match="another sweep is writing it"):
            Journal(path)
    Journal(path).close()


def test_a_folder_that_cannot_be_is_said(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(DslamError, match=r"points\.jsonl: cannot be written: "):
        Journal(tmp_path / "file" / "points.jsonl")
