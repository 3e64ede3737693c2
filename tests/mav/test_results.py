"""An estimate on the wire: names, numbers, words."""

from dataclasses import replace

import numpy as np
import pytest

from dslam_mav.mav.frames import Encoder, messages, parse_frame
from dslam_mav.mav.results import in_words, result_messages, severity, status_messages
from dslam_mav.records import Estimate, Medium, Path, Sources, Verdict


def estimate(position_m, amplitude, **changes) -> Estimate:
    k = len(amplitude)
    whole = Estimate(
        sources=Sources(position_m, amplitude, np.ones(k), np.zeros(k)),
        path=Path(np.zeros((4, 2)), np.zeros(3)), medium=Medium(),
        verdict=Verdict.IDENTIFIED, reason="",
        spread_m=1.0,
        position_covariance_m2=np.stack([np.diag([0.01, 0.07])] * k),
        path_aligned_covariance_m2=np.zeros((k, 2, 2)),
        parameter_covariance=np.zeros((0, 0)), parameter_names=(), noise_sd=0.1,
        log_likelihood=0.0, residual=[],
    )  # fmt: skip
    return replace(whole, **changes)


def on_the_wire(sent) -> dict[str, float]:
    encoder = Encoder(1, 191)
    frames = [parse_frame(encoder.pack(m), 0) for m in sent]
    return {f.message.name: f.message.value for f in frames}


def test_the_gauge_names_the_coordinates():
    e = estimate([[1.5, -2.0], [3.0, 4.0]], [50.0, 20.0])
    values = on_the_wire(result_messages(e, 2**32 + 5))
    assert values["SRC1_X"] == 1.5
    assert values["SRC2_Y"] == 4.0
    assert values["SRC2_AMP"] == 20.0
    assert values["SRC1_SD"] == pytest.approx(0.2)  # sqrt((0.01 + 0.07) / 2)
    assert values["DSLAM_ST"] == 0.0
    anchored = on_the_wire(result_messages(replace(e, gauge="anchored"), 0))
    assert anchored.keys() == {n.replace("X", "E").replace("Y", "N") for n in values}
    assert result_messages(e, 2**32 + 5)[0].time_boot_ms == 5


def test_unknown_numbers_are_not_sent():
    e = estimate([[np.nan] * 2] * 2, [1e39, np.nan], verdict=Verdict.NOT_IDENTIFIABLE)
    e = replace(e, position_covariance_m2=np.full((2, 2, 2), np.nan))
    assert on_the_wire(result_messages(e, 0)) == {"DSLAM_ST": 2.0}
    assert len(in_words(e, 3, final=True)) == 1


def test_words_come_in_chunks_of_fifty_that_belong_together():
    (line, *sources) = in_words(estimate([[1.5, -2.0]], [50.0]), 7, final=True)
    assert line.startswith("D-SLAM: Sources and path are identified")
    assert sources == ["Source 1: x 1.5 m, y -2.0 m, ±0.2 m"]
    text = "D-SLAM after 12 legs: " + Verdict.MODEL_MISFIT.sentence
    chunks = status_messages(text + " ±", 77, severity=severity(Verdict.MODEL_MISFIT))
    encoder = Encoder(1, 191)
    read = [parse_frame(encoder.pack(c), 0).message for c in chunks]
    assert [m.chunk_seq for m in read] == list(range(len(read)))
    assert {(m.id, m.severity) for m in read} == {(77, messages().MAV_SEVERITY_WARNING)}
    assert "".join(m.text for m in read) == text + " +/-"
    assert status_messages("short", 77)[0].id == 0
