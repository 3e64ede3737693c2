"""What the log's tests write: an estimate with everything in it, one without positions, a whole flight."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path as FilePath
from typing import Any

import numpy as np
import pytest

from dslam_mav.log import Recorder, recorder
from dslam_mav.mav.frames import Encoder, messages
from dslam_mav.observations import Progress, Reading
from dslam_mav.records import Estimate, Flight, Leg, Medium, Path, Prediction, Sources, Truth, Verdict

START_NS = 1_760_000_000_123_456_789


def make_estimate(seed: int = 0, dimensions: int = 2, **changes: object) -> Estimate:
    """K = 3 sources on a path of 5 legs; numbers only a double's bits bring back."""
    rng = np.random.default_rng(seed)
    k, d, legs = 3, dimensions, 5
    root = rng.normal(size=(k, d, d)) * 0.1
    covariance = root @ root.transpose(0, 2, 1)
    spread2 = 1.7
    amplitude = np.sort(rng.uniform(1, 9, k))[::-1]
    names = ("b_2", "b_3", "S_1x")
    estimate = Estimate(
        sources=Sources(
            rng.normal(size=(k, d)),
            amplitude,
            amplitude / (np.pi * spread2) ** (d / 2),
            np.array([-1.0, -0.0, np.nan]),
        ),
        path=Path(rng.normal(size=(legs + 1, d)) * 3, rng.normal(size=legs)),
        medium=Medium(diffusivity_m2_s=0.0939, activation_s=-1.0 / 3, ambient=None, static=True, dimensions=d),
        verdict=Verdict.IDENTIFIED,
        reason="Every direction is seen: σ ≤ 0.1 √C.",
        spread_m=spread2**0.5,
        position_covariance_m2=covariance,
        path_aligned_covariance_m2=covariance / 3,
        parameter_covariance=rng.normal(size=(3, 3)),
        parameter_names=names,
        noise_sd=0.1 + 0.2,
        log_likelihood=-np.nextafter(1234.5, 0),
        residual=np.array([5e-324, -0.0, np.inf, *rng.normal(size=97)]),
        unseen_directions=("mirror",),
        diagnostics={
            "starts": 12,
            "cost": np.float64(1 / 3),
            "modes": np.arange(3),
            "t": (1.5, np.nan),
            7: None,
        },
    )
    return replace(estimate, **changes)  # type: ignore[arg-type]


def make_nan_estimate() -> Estimate:
    """A verdict without positions: their shapes are kept."""
    nothing = np.full((3, 2), np.nan)
    return make_estimate(
        verdict=Verdict.NOT_IDENTIFIABLE,
        sources=Sources(nothing, np.full(3, np.nan), np.full(3, np.nan), np.full(3, np.nan)),
        path=Path(np.full((6, 2), np.nan), np.full(5, np.nan)),
        position_covariance_m2=np.full((3, 2, 2), np.nan),
        path_aligned_covariance_m2=np.full((3, 2, 2), np.nan),
        spread_m=np.nan,
    )


def make_flight(legs: int = 5, readings: int = 20) -> Flight:
    """Legs of 3 m; a reading is the number of its leg and, behind the point, how far along it was taken."""
    along = np.linspace(0.0, 0.9, readings)
    return Flight(tuple(Leg(3.0, 3.0 * along, 10.0 * j + along, j + 1.0 + along) for j in range(legs)))


def make_prediction(**changes: Any) -> Prediction:
    """Of a mission that cannot place a tenth of all layouts."""
    given: dict[str, Any] = {
        "n_sources": (2, 4), "spread_m": 10.0, "area_m": (32.0, 31.2), "peak": 8.7, "noise_sd": 1 / 3,
        "readings_per_m": 2.0, "length_m": 224.0, "source_error_m": (0.38, math.inf), "path_error_m": (0.28, 0.66),
        "source_error_aligned_m": (0.3, math.inf), "path_error_aligned_m": (0.1, 0.2), "unidentifiable_share": 0.11,
    }  # fmt: skip
    return Prediction(**given | changes)


def write_flight(path: FilePath, n: int = 2000) -> None:
    """A closed log with every kind of record: `n` frames 5 ms apart, a reading with every fourth."""
    encoder, dialect = Encoder(1, 1), messages()
    rng = np.random.default_rng(1)
    with Recorder(path) as recorder:
        recorder.attach("plan.plan", "application/json", b'{"fileType": "Plan"}')
        recorder.attach("empty", "text/plain", b"")
        recorder.truth(START_NS, Truth(np.eye(2), np.array([2.0, 1.0]), np.array([[0, 0], [1, 0], [1, 1.0]])))
        recorder.prediction(START_NS, make_prediction())
        for i in range(n):
            time_ns = START_NS + i * 5_000_000
            message = dialect.MAVLink_local_position_ned_message(5 * i, *rng.normal(size=6))
            recorder.frame(time_ns, encoder.pack(message))
            if i % 4 == 0:
                recorder.reading(time_ns, Reading(5 * i, float(np.float32(rng.normal()))))
            if i % 400 == 0:
                recorder.progress(time_ns, Progress(i // 400, reached=i % 800 == 0))
                recorder.text(time_ns, logging.WARNING, f"leg {i // 400} flown — ça va")
                recorder.estimate(time_ns, make_estimate(i), i // 400, final=i + 400 >= n, flight=make_flight())
        recorder.attach("scene.json", "application/json", bytes(range(256)) * 40)


@pytest.fixture
def estimate() -> Callable[..., Estimate]:
    return make_estimate


@pytest.fixture
def legs_flown() -> Callable[..., Flight]:
    return make_flight


@pytest.fixture
def prediction() -> Callable[..., Prediction]:
    return make_prediction


@pytest.fixture
def nan_estimate() -> Callable[[], Estimate]:
    return make_nan_estimate


@pytest.fixture
def start_ns() -> int:
    return START_NS


@pytest.fixture(scope="session")
def flight(tmp_path_factory: pytest.TempPathFactory) -> FilePath:
    """One closed log for all tests that only read."""
    path = tmp_path_factory.mktemp("log") / "flight.mcap"
    write_flight(path)
    return path


@pytest.fixture(scope="session")
def small_chunks(tmp_path_factory: pytest.TempPathFactory) -> FilePath:
    """A short closed log of many small chunks."""
    path = tmp_path_factory.mktemp("log") / "flight.mcap"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(recorder, "CHUNK_BYTES", 2048)
        write_flight(path, n=240)
    return path
