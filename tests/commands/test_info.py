"""`info`: whether a log is whole, of recordings of others too."""

from __future__ import annotations

from pathlib import Path

from dataflash import dataflash
from flown import fly
from running import run


def test_a_damaged_bin_is_not_called_complete(tmp_path: Path) -> None:
    data, path = dataflash(fly(late_ms=100)), tmp_path / "00000001.BIN"
    path.write_bytes(data)
    assert "s, complete\n" in run("info", path).out
    assert run("info", path, "--json").object["complete"] is True
    path.write_bytes(data[: len(data) // 2] + bytes(2000) + data[len(data) // 2 :])
    assert "s, without the bytes in it that are no records\n" in run("info", path).out
    assert run("info", path, "--json").object["complete"] is False
    path.write_bytes(bytes(3000))
    done = run("info", path)
    assert (done.code, done.out) == (2, "")
    assert "expected records that begin with a3 95, found none" in done.line()
