"""A file is replaced whole or stays what it was; what cannot be written says whose fault it is."""

import errno
import os

import pytest

from dslam_mav.errors import BadInputError, LogError, unwritable
from dslam_mav.files import check_folder, check_output, write_whole


def test_what_was_there_is_replaced_and_nothing_else_is_left(tmp_path):
    target = tmp_path / "flight.plan"
    target.write_text("what was there")
    write_whole(target, b"new")
    assert target.read_bytes() == b"new"
    assert list(tmp_path.iterdir()) == [target]


def test_a_path_that_will_not_do_is_bad_input_before_and_after_the_work(tmp_path):
    folder, file, pipe = tmp_path / "folder", tmp_path / "file", tmp_path / "pipe"
    folder.mkdir()
    file.touch()
    os.mkfifo(pipe)
    for path, told in (
        (folder, "folder: cannot be written: is a directory"),
        (tmp_path / "no" / "file", "file: cannot be written: no such file"),
        (file / "page.html", "page.html: cannot be written: not a directory"),
        (pipe, "pipe: cannot be written: it is no file"),
    ):
        for attempt in (check_output, lambda path: write_whole(path, b"new")):
            with pytest.raises(BadInputError, match=told):
                attempt(path)
    check_folder(tmp_path / "deep" / "deeper")
    with pytest.raises(BadInputError, match="not a directory"):
        check_folder(file / "deeper")
    assert sorted(tmp_path.iterdir()) == [file, folder, pipe]


def test_endings_name_what_is_written(tmp_path):
    check_output(tmp_path / "page.HTML", (".html", ".htm"))
    check_output(tmp_path / "page", (".html",))
    with pytest.raises(BadInputError, match=r"page\.pdf: ending '\.pdf': expected \.html or \.htm"):
        check_output(tmp_path / "page.pdf", (".html", ".htm"))


def test_a_full_disk_is_nobodys_bad_input():
    full = unwritable("out", OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)))
    assert (type(full), str(full)) == (LogError, "out: cannot be written: no space left on device")
    assert type(unwritable("out", PermissionError(errno.EACCES, "Permission denied"))) is BadInputError


@pytest.mark.parametrize("links", [True, False])
def test_a_file_that_may_not_be_replaced_is_not(tmp_path, monkeypatch, links):
    def refuse(*_: object) -> None:
        raise OSError(errno.EPERM, "Operation not permitted")  # as memory cards answer

    if not links:
        monkeypatch.setattr(os, "link", refuse)
    target = tmp_path / "flight.mcap"
    write_whole(target, b"first", anew=False)
    assert target.read_bytes() == b"first"
    with pytest.raises(BadInputError, match=r"flight\.mcap: cannot be written: file exists"):
        write_whole(target, b"second", anew=False)
    assert target.read_bytes() == b"first"
    assert list(tmp_path.iterdir()) == [target]
