"""`report`: one page of a flight, one that compares many, and what each says was predicted."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from running import left, run

from dslam_mav.log.reader import read_log


def test_a_page_that_compares_several_logs(flown: Any, tmp_path: Path) -> None:
    logs = [tmp_path / name for name in ("a.mcap", "b.mcap", "cut.mcap", "junk.mcap")]
    data = flown.log.read_bytes()
    for log, part in zip(logs, (data, data, data[: int(len(data) * 0.8)], b"junk"), strict=True):
        log.write_bytes(part)
    page = tmp_path / "all.html"
    assert run("report", logs[0]).out == f"{tmp_path / 'a.html'}\n"
    done = run("report", *logs, logs[0], "-o", page, "--json")
    assert done.code == 0
    assert done.line() == f"warning: {done.object['flights'][3]['problem']}"
    assert done.object["report"] == str(page)
    first, again, cut, junk = done.object["flights"]
    assert [flight["log"] for flight in done.object["flights"]] == [str(log) for log in logs], (
        "a log named twice is one"
    )
    assert {**first, "log": None} == {**again, "log": None}
    assert (first["verdict"], first["sources"], first["problem"]) == ("IDENTIFIED", 2, None)
    assert first["length_m"] == pytest.approx(112.0, abs=0.5)
    assert first["noise_sd"] == flown.result["noise_sd"]
    assert first["source_error_m"] == pytest.approx(flown.result["errors"]["sources_rms_m"])
    assert 0.1 < first["predicted_source_error_m"]["median"] / first["source_sd_m"] < 10.0
    assert cut["predicted_source_error_m"] == first["predicted_source_error_m"], "as the log says"
    assert "junk.mcap" in junk["problem"]
    assert junk["verdict"] is None
    text = page.read_text()
    assert text.count("<tr data-flight=") == 4
    assert 'href="a.html"' in text
    assert left(tmp_path) == {*(log.name for log in logs), "a.html", "all.html"}


def test_a_report_shows_what_was_predicted_then_and_of_an_old_log_what_would_be_now(flown: Any, tmp_path: Path) -> None:
    log = read_log(flown.log)
    assert log.prediction is not None
    assert log.prediction.n_sources == (2, 2)
    assert log.prediction.length_m == pytest.approx(112.0, abs=0.1)
    assert log.prediction.spread_m == pytest.approx(5.0, rel=0.01)
    page = flown.log.with_name("report.html").read_text()
    assert "Recorded before take-off: for 2 sources anywhere" in page
    assert "How sure, leg by leg" in page
    for option, words in ((), "Recorded before take-off: for 2"), (("--sources", 3), "says nothing: for 3"):
        assert run("report", flown.log, *option, "-o", tmp_path / "page.html").code == 0
        assert words in (tmp_path / "page.html").read_text()


def test_a_link_to_a_page_holds_whatever_its_name(flown: Any, tmp_path: Path) -> None:
    log = tmp_path / "wind 5 m#2 50%.mcap"
    log.write_bytes(flown.log.read_bytes())
    assert run("report", log).code == 0
    assert run("report", log, flown.log, "-o", tmp_path / "all.html").code == 0
    assert 'href="wind%205%20m%232%2050%25.html"' in (tmp_path / "all.html").read_text()
