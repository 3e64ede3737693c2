"""What goes into a log comes out of it, bit for bit."""

from __future__ import annotations

import dataclasses
import logging
import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dslam_mav.log import Recorder, codec, log_info, read_log
from dslam_mav.log.schemas import flight_pb2
from dslam_mav.mav.frames import parse_frame
from dslam_mav.observations import Progress, Reading
from dslam_mav.records import Estimate, Medium, Truth, Verdict


def bits(value: object) -> object:
    """Everything in a record, floats and arrays as their bytes: equal only if equal bit for bit."""
    if dataclasses.is_dataclass(value):
        return {f.name: bits(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, np.ndarray):
        return (value.dtype.str, value.shape, value.tobytes())
    if isinstance(value, float):
        return struct.pack("<d", value)
    if isinstance(value, tuple | list):
        return [bits(item) for item in value]
    if isinstance(value, dict):
        return {str(key): bits(item) for key, item in value.items()}
    return value


def plain(estimate: Estimate) -> Estimate:
    """The estimate with its diagnostics as JSON knows them."""
    diagnostics = {"starts": 12, "cost": 1 / 3, "modes": [0, 1, 2], "t": [1.5, float("nan")], "7": None}
    return dataclasses.replace(
        estimate, diagnostics=diagnostics, alternatives=tuple(plain(other) for other in estimate.alternatives)
    )


def test_every_record_comes_back(tmp_path, start_ns, estimate, nan_estimate, prediction):
    path = tmp_path / "flight.mcap"
    first = estimate(1, alternatives=(estimate(2), estimate(3, verdict=Verdict.AMBIGUOUS)))
    truth = Truth(np.eye(2), np.array([2.0, 1.0]), np.array([[0, 0], [1, 0.1], [1, 1.0]]))
    values = [0.1, -0.0, float("nan"), float("inf"), 5e-324]
    with Recorder(path) as recorder:
        for i, value in enumerate(values):
            recorder.reading(start_ns + i, Reading(2**32 - 1 - i, value, "THERMAL2"))
        recorder.progress(start_ns, Progress(3, reached=True))
        recorder.progress(start_ns, Progress(0, reached=False))
        recorder.text(start_ns, logging.ERROR, "√C is 10 m\nand more \udc80")
        recorder.text(start_ns, logging.INFO + 5, "")
        recorder.truth(start_ns, truth)
        recorder.prediction(start_ns, prediction())
        recorder.prediction(start_ns + 1, prediction(peak=1.0))
        recorder.estimate(start_ns + 9, first, 4, final=False)
        recorder.estimate(start_ns + 2_500_000_000, nan_estimate(), 5, final=True)
        recorder.attach("plan.plan", "application/json", b"{}")
    log = read_log(path)
    assert bits(log.readings) == bits(
        tuple((start_ns + i, Reading(2**32 - 1 - i, v, "THERMAL2")) for i, v in enumerate(values))
    )
    assert log.progress == ((start_ns, Progress(3, True)), (start_ns, Progress(0, False)))
    assert log.texts == (
        (start_ns, logging.ERROR, "√C is 10 m\nand more ?"),
        (start_ns, logging.INFO, ""),
    )
    assert bits(log.truth) == bits(truth)
    assert bits(log.prediction) == bits(prediction()), "what was said before take-off, not later"
    assert [(e.received_ns, e.legs_flown, e.final) for e in log.estimates] == [
        (start_ns + 9, 4, False),
        (start_ns + 2_500_000_000, 5, True),
    ]
    assert bits(log.estimates[0].estimate) == bits(plain(first))
    assert bits(log.estimates[1].estimate) == bits(plain(nan_estimate()))
    assert log.attachments == {"plan.plan": b"{}"}
    assert log.complete
    assert log.duration_s == 2.5


def test_alternatives_of_alternatives_are_left_out(estimate):
    nested = estimate(1, alternatives=(estimate(2, alternatives=(estimate(3),)),))
    decoded = codec.decode_estimate(codec.encode_update(nested, 1, True).estimate)
    assert len(decoded.alternatives) == 1
    assert decoded.alternatives[0].alternatives == ()


@pytest.mark.parametrize(
    "medium",
    [
        Medium(),
        Medium(activation_s="shared", ambient=None, sensor_lag_s=None),
        Medium(activation_s=0.0, diffusivity_m2_s=1e-300),
        Medium(spread_m=12.49, static=True, ambient=-0.0, dimensions=3),
    ],
)
def test_unknown_and_zero_are_kept_apart(medium, estimate):
    before = estimate(dimensions=medium.dimensions, medium=medium)
    decoded = codec.decode_estimate(codec.encode_update(before, 1, True).estimate)
    assert bits(decoded.medium) == bits(medium)


@pytest.mark.parametrize(
    "bad", [{"n_sources": (0, 2)}, {"noise_sd": 0.0}, {"path_error_m": (2.0, 1.0)}, {"unidentifiable_share": 1.5}]
)
def test_numbers_that_make_no_prediction_are_no_prediction(tmp_path, start_ns, prediction, bad):
    message = codec.encode_prediction(prediction())
    for name, value in bad.items():
        if name == "n_sources":
            message.fewest_sources = value[0]
        elif name == "path_error_m":
            message.path_error_m.median_m, message.path_error_m.p90_m = value
        else:
            setattr(message, name, value)
    (name,) = bad
    with pytest.raises(ValueError, match=name):
        codec.decode_prediction(message)


def test_a_log_without_a_prediction_has_none(tmp_path, start_ns):
    with Recorder(tmp_path / "flight.mcap") as recorder:
        recorder.reading(start_ns, Reading(1, 2.0))
    assert read_log(tmp_path / "flight.mcap").prediction is None


def test_an_estimate_without_sources_keeps_its_shapes(estimate):
    empty = estimate().sources
    none = dataclasses.replace(empty, position_m=np.zeros((0, 2)), amplitude=(), peak_reading=(), activation_s=())
    before = estimate(
        sources=none,
        position_covariance_m2=np.zeros((0, 2, 2)),
        path_aligned_covariance_m2=np.zeros((0, 2, 2)),
    )
    after = codec.decode_estimate(codec.encode_update(before, 0, False).estimate)
    assert after.sources.position_m.shape == (0, 2)
    assert after.position_covariance_m2.shape == (0, 2, 2)


@settings(deadline=None)
@given(st.lists(st.floats(width=64, allow_nan=True), min_size=1, max_size=20), st.integers(0, 2**32 - 1))
def test_readings_and_residuals_come_back_bit_for_bit(values, time_boot_ms):
    for value in values:
        wire = codec.encode_reading(Reading(time_boot_ms, value)).SerializeToString()
        assert bits(codec.decode_reading(flight_pb2.ThermalReading.FromString(wire))) == bits(
            Reading(time_boot_ms, value)
        )


def test_frames_are_stored_as_they_came(flight: Path, start_ns):
    log = read_log(flight)
    assert len(log.frames) == 2000
    for i, (time_ns, raw) in enumerate(log.frames):
        assert time_ns == start_ns + i * 5_000_000
        frame = parse_frame(raw, time_ns)
        assert frame is not None
        assert frame.message.time_boot_ms == 5 * i


def test_info_agrees_with_the_log(flight: Path):
    log, info = read_log(flight), log_info(flight)
    assert info == {"topics": log.topics, "duration_s": log.duration_s, "complete": True}
    assert info["topics"]["/thermal"] == len(log.readings) == 500
    assert info["topics"]["/mavlink/raw"] == 2000
    assert info["topics"]["/path"] == len(log.estimates) == 5
    assert info["duration_s"] == pytest.approx(1999 * 0.005)
    assert log.attachments == {
        "plan.plan": b'{"fileType": "Plan"}',
        "empty": b"",
        "scene.json": bytes(range(256)) * 40,
    }
