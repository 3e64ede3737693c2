"""A file is replaced whole or stays what it was."""

import errno
import os

import pytest

from dslam_mav.errors import BadInputError, LogError
from dslam_mav.files import write_whole


def test_what_was_there_is_replaced_and_nothing_else_is_left(tmp_path):
    target = tmp_path / "flight.plan"
    target.write_text("what was there")
    write_whole(target, b"new", LogError)
    assert target.read_bytes() == b"new"
    assert list(tmp_path.iterdir()) == [target]


@pytest.mark.parametrize("failure", [BadInputError, LogError])
def test_what_cannot_be_written_is_told_as_the_caller_says_and_leaves_nothing(tmp_path, failure):
    folder = tmp_path / "folder"
    folder.mkdir()
    with pytest.raises(failure, match=r"folder: cannot be written: "):
        write_whole(folder, b"new", failure)
    with pytest.raises(failure, match=r"file: cannot be written: No such file"):
        write_whole(tmp_path / "no" / "file", b"new", failure)
    assert list(tmp_path.iterdir()) == [folder]


@pytest.mark.parametrize("links", [True, False])
def test_a_file_that_may_not_be_replaced_is_not(tmp_path, monkeypatch, links):
    def refuse(*_: object) -> None:
        raise OSError(errno.EPERM, "Operation not permitted")  # as memory cards answer

    if not links:
        monkeypatch.setattr(os, "link", refuse)
    target = tmp_path / "flight.mcap"
    write_whole(target, b"first", LogError, anew=False)
    assert target.read_bytes() == b"first"
    with pytest.raises(LogError, match=r"flight\.mcap: cannot be written: File exists"):
        write_whole(target, b"second", LogError, anew=False)
    assert target.read_bytes() == b"first"
    assert list(tmp_path.iterdir()) == [target]
