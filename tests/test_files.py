"""A file is replaced whole or stays what it was."""

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
