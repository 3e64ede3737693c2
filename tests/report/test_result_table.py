"""The result for the terminal and for scripts."""

from __future__ import annotations

import json
from dataclasses import replace
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from report_flights import without_positions
from rich.console import Console

from dslam_mav.dslam.scoring import score
from dslam_mav.records import Verdict
from dslam_mav.report.numbers import degrees, fixed, nice_ticks, significant, tick_labels, with_sd
from dslam_mav.report.table import result_json, result_table


def printed(table):
    out = StringIO()
    Console(file=out, width=140, color_system=None).print(table)
    return out.getvalue()


def test_table_has_a_row_for_each_source_and_errors_only_with_truth(case):
    truth, _, estimate = case
    result = score(estimate, truth)
    text = printed(result_table(estimate, truth))
    assert "AMBIGUOUS" in text
    for k in range(3):
        row = next(line for line in text.splitlines() if f"S{k + 1}" in line)
        assert significant(float(result.source_error_m[k]), 2) in row
        assert significant(float(estimate.sd_m[k]), 2) in row
        assert fixed(float(estimate.sources.peak_reading[k]), 1) in row
    assert "error" not in printed(result_table(estimate, None))


def test_unknown_positions_are_not_shown_as_nan(case):
    truth, _, estimate = case
    unknown = without_positions(estimate, Verdict.NOT_IDENTIFIABLE, "Two directions change no reading.")
    text = printed(result_table(unknown, truth))
    assert "NOT_IDENTIFIABLE: " in text
    assert "nan" not in text


def test_json_is_valid_and_holds_what_scripts_rely_on(case):
    truth, _, estimate = case
    answer = json.loads(
        json.dumps(result_json(estimate, truth, Path("a/flight.mcap"), "a/report.html"), allow_nan=False)
    )
    assert answer["verdict"] == "AMBIGUOUS"
    assert answer["gauge"] == "canonical"
    assert answer["sources"][0]["position_m"] == pytest.approx(estimate.sources.position_m[0].tolist())
    assert set(answer["sources"][0]) == {"position_m", "amplitude", "peak_reading", "activation_s", "sd_m"}
    assert answer["sources"][0]["activation_s"] is None, "NaN is null"
    assert len(answer["path"]["vertices_m"]) == 8
    assert answer["medium"]["spread_m"] == 10.0
    assert answer["alternatives"][0]["delta_log_likelihood"] == pytest.approx(1.7)
    assert answer["errors"]["path_rms_m"] == pytest.approx(score(estimate, truth).path_error_rms_m)
    assert (answer["log"], answer["report"]) == ("a/flight.mcap", "a/report.html")


def test_json_without_truth_or_positions_is_null_where_nothing_is_known(case):
    truth, _, estimate = case
    assert result_json(estimate, None, None, None)["errors"] is None
    unknown = result_json(without_positions(estimate, Verdict.TOO_FEW_DATA, ""), truth, None, None)
    json.dumps(unknown, allow_nan=False)
    assert unknown["errors"] is None
    assert unknown["noise_sd"] is None
    assert unknown["sources"][0]["position_m"] == [None, None]
    assert unknown["path"]["vertices_m"][0] == [None, None]


def test_uncertain_spread_and_amplitude_partly_cancel_in_the_peak(case):
    _, _, estimate = case
    covariance = np.array([[0.04, 0.03], [0.03, 0.0324]])
    tied = replace(estimate, parameter_names=("ln amplitude 1", "ln C"), parameter_covariance=covariance)
    text = printed(result_table(tied, None))
    row = next(line for line in text.splitlines() if "S1" in line)
    amplitude, peak = estimate.sources.amplitude[0], estimate.sources.peak_reading[0]
    assert with_sd(amplitude, 0.2 * amplitude) in row
    assert with_sd(peak, np.sqrt(0.04 - 2 * 0.03 + 0.0324) * peak) in row


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (with_sd(12.3456, 0.0512), "12.346 ± 0.051"),
        (with_sd(-0.0001, 0.0512), "0.000 ± 0.051"),
        (with_sd(2389.2, 71.7), "2389 ± 72"),
        (with_sd(1.0, 0.0996), "1.00 ± 0.10"),
        (with_sd(float("nan"), 0.1), "–"),
        (with_sd(3.14159, float("nan")), "3.142"),
        (significant(0.00012345), "0.000123"),
        (significant(1234567.0), "1.23 × 10⁶"),
        (significant(-3.2e-9, 2), "−3.2 × 10⁻⁹"),
        (significant(0.9999), "1.00"),
        (fixed(float("inf"), 2), "∞"),
        (degrees(3.5 * np.pi), "−90.0°"),
    ],
)
def test_numbers_carry_the_digits_that_are_known(text, expected):
    assert text == expected


def test_ticks_are_round_and_inside():
    ticks = nice_ticks(-0.83, 0.83, 4)
    assert tick_labels(ticks) == ["−0.5", "0.0", "0.5"]
    assert tick_labels(nice_ticks(19.0, 31.0, 6)) == ["20", "22", "24", "26", "28", "30"]
