"""Records <-> the log's protobuf messages. Pure. Every float comes back bit for bit (protobuf doubles)."""

from __future__ import annotations

import json
import logging
import math
from collections.abc import Iterable
from typing import Any, cast

import numpy as np
from foxglove_schemas_protobuf.Log_pb2 import Log
from google.protobuf.timestamp_pb2 import Timestamp
from numpy.typing import NDArray

from dslam_mav.log.schemas import flight_pb2 as pb
from dslam_mav.observations import Progress, Reading
from dslam_mav.records import Estimate, Gauge, Medium, Path, Prediction, Sources, Truth, Verdict

FloatArray = NDArray[np.float64]

_LEVELS = {  # Foxglove's (DEBUG 1 … FATAL 5) <-> Python's
    1: logging.DEBUG,
    2: logging.INFO,
    3: logging.WARNING,
    4: logging.ERROR,
    5: logging.CRITICAL,
}
_RANGES = ("source_error_m", "path_error_m", "source_error_aligned_m", "path_error_aligned_m")
_PREDICTED = ("spread_m", "peak", "noise_sd", "readings_per_m", "length_m", "unidentifiable_share")
_OPTIONAL_MEDIUM = ("diffusivity_m2_s", "spread_m", "ambient", "sensor_lag_s", "extent")


def timestamp(time_ns: int) -> Timestamp:
    """Nanoseconds since 1970 as Foxglove's messages carry them."""
    seconds, nanos = divmod(time_ns, 1_000_000_000)
    return Timestamp(seconds=seconds, nanos=nanos)


def encode_reading(reading: Reading) -> pb.ThermalReading:
    """A reading as `/thermal` holds it."""
    return pb.ThermalReading(
        time_boot_ms=int(reading.time_boot_ms), value=float(reading.value), name=_text(reading.name)
    )


def decode_reading(message: pb.ThermalReading) -> Reading:
    """The reading of a `/thermal` message."""
    return Reading(message.time_boot_ms, message.value, message.name)


def encode_progress(progress: Progress) -> pb.MissionProgress:
    """Mission progress as `/mission` holds it."""
    return pb.MissionProgress(seq=int(progress.seq), reached=bool(progress.reached))


def decode_progress(message: pb.MissionProgress) -> Progress:
    """The mission progress of a `/mission` message."""
    return Progress(message.seq, message.reached)


def encode_text(received_ns: int, level: int, text: str) -> Log:
    """A line of `/log`; a level between Python's five counts as the one below it."""
    rank = max((k for k, v in _LEVELS.items() if v <= level), default=1)
    return Log(
        timestamp=timestamp(received_ns),
        level=cast(Log.Level.ValueType, rank),
        message=_text(text),
        name="dslam-mav",
    )


def decode_text(message: Log) -> tuple[int, str]:
    """(Python's level, text) of a `/log` message."""
    return _LEVELS.get(message.level, logging.NOTSET), message.message


def encode_truth(truth: Truth) -> pb.Truth:
    """Truth as `/truth` holds it."""
    return pb.Truth(
        source_position_m=_array(truth.source_position_m),
        amplitude=truth.amplitude.tolist(),
        vertices_m=_array(truth.vertices_m),
    )


def decode_truth(message: pb.Truth) -> Truth:
    """The truth of a `/truth` message."""
    return Truth(_numbers(message.source_position_m), np.array(message.amplitude), _numbers(message.vertices_m))


def encode_prediction(prediction: Prediction) -> pb.Prediction:
    """A prediction as `/prediction` holds it."""
    fewest, most = prediction.n_sources
    message = pb.Prediction(fewest_sources=fewest, most_sources=most, area_m=prediction.area_m)
    for name in _PREDICTED:
        setattr(message, name, getattr(prediction, name))
    for name in _RANGES:
        median_m, p90_m = getattr(prediction, name)
        getattr(message, name).CopyFrom(pb.Range(median_m=median_m, p90_m=p90_m))
    return message


def decode_prediction(message: pb.Prediction) -> Prediction:
    """The prediction of a `/prediction` message; numbers that make none are a ValueError."""
    numbers: dict[str, Any] = {name: getattr(message, name) for name in _PREDICTED}
    for name in _RANGES:
        given = getattr(message, name)
        numbers[name] = given.median_m, given.p90_m
    return Prediction(n_sources=(message.fewest_sources, message.most_sources), area_m=tuple(message.area_m), **numbers)


def encode_update(estimate: Estimate, legs_flown: int, final: bool) -> pb.EstimateUpdate:
    """An estimate as `/estimate` holds it, with its alternatives but without theirs."""
    message = pb.EstimateUpdate(estimate=_encode(estimate), legs_flown=int(legs_flown), final=bool(final))
    message.estimate.alternatives.extend(_encode(other) for other in estimate.alternatives)
    return message


def decode_estimate(message: pb.Estimate) -> Estimate:
    """The estimate of an `/estimate` message; numbers that make no estimate are a ValueError."""
    return Estimate(
        sources=Sources(
            _numbers(message.sources.position_m),
            np.array(message.sources.amplitude, dtype=np.float64),
            np.array(message.sources.peak_reading, dtype=np.float64),
            np.array(message.sources.activation_s, dtype=np.float64),
        ),
        path=_decode_path(message.path),
        medium=_decode_medium(message.medium),
        verdict=Verdict(message.verdict),
        reason=message.reason,
        spread_m=message.spread_m,
        position_covariance_m2=_numbers(message.position_covariance_m2),
        path_aligned_covariance_m2=_numbers(message.path_aligned_covariance_m2),
        parameter_covariance=_numbers(message.parameter_covariance),
        parameter_names=tuple(message.parameter_names),
        noise_sd=message.noise_sd,
        log_likelihood=message.log_likelihood,
        residual=np.array(message.residual, dtype=np.float64),
        gauge=cast(Gauge, message.gauge),
        unseen_directions=tuple(message.unseen_directions),
        alternatives=tuple(decode_estimate(other) for other in message.alternatives),
        diagnostics=json.loads(message.diagnostics_json) if message.diagnostics_json else {},
    )


def _encode(estimate: Estimate) -> pb.Estimate:
    """One estimate without its alternatives."""
    sources = estimate.sources
    return pb.Estimate(
        verdict=int(estimate.verdict),
        verdict_name=estimate.verdict.name,
        verdict_sentence=estimate.verdict.sentence,
        reason=_text(estimate.reason),
        gauge=estimate.gauge,
        sources=pb.Sources(
            position_m=_array(sources.position_m),
            amplitude=sources.amplitude.tolist(),
            peak_reading=sources.peak_reading.tolist(),
            activation_s=sources.activation_s.tolist(),
        ),
        path=_encode_path(estimate.path),
        medium=_encode_medium(estimate.medium),
        spread_m=estimate.spread_m,
        noise_sd=estimate.noise_sd,
        log_likelihood=estimate.log_likelihood,
        position_covariance_m2=_array(estimate.position_covariance_m2),
        path_aligned_covariance_m2=_array(estimate.path_aligned_covariance_m2),
        parameter_names=[_text(name) for name in estimate.parameter_names],
        parameter_covariance=_array(estimate.parameter_covariance),
        residual=estimate.residual.tolist(),
        unseen_directions=[_text(direction) for direction in estimate.unseen_directions],
        diagnostics_json=json.dumps(_plain(estimate.diagnostics)),
    )


def _encode_path(path: Path) -> pb.Path:
    message = pb.Path(vertices_m=_array(path.vertices_m), heading_rad=path.heading_rad.tolist())
    if path.coefficients_m is not None:
        message.coefficients_m.CopyFrom(_array(path.coefficients_m))
    return message


def _decode_path(message: pb.Path) -> Path:
    coefficients = _numbers(message.coefficients_m) if message.HasField("coefficients_m") else None
    return Path(_numbers(message.vertices_m), np.array(message.heading_rad, dtype=np.float64), coefficients)


def _encode_medium(medium: Medium) -> pb.Medium:
    message = pb.Medium(static=medium.static, dimensions=medium.dimensions)
    for name in _OPTIONAL_MEDIUM:
        value = getattr(medium, name)
        if value is not None:
            setattr(message, name, float(value))
    drift = medium.ambient_drift_per_s
    message.ambient_drift_per_s = math.nan if drift is None else float(drift)
    if isinstance(medium.activation_s, str):
        message.activation_shared = True
    elif isinstance(medium.activation_s, tuple):
        message.activations_s.extend(medium.activation_s)
    elif medium.activation_s is not None:
        message.activation_s = float(medium.activation_s)
    return message


def _decode_medium(message: pb.Medium) -> Medium:
    known: dict[str, Any] = {
        name: getattr(message, name) if message.HasField(name) else None for name in (*_OPTIONAL_MEDIUM, "activation_s")
    }
    if message.activation_shared:
        known["activation_s"] = "shared"
    if message.activations_s:
        known["activation_s"] = tuple(message.activations_s)
    drift = None if math.isnan(message.ambient_drift_per_s) else message.ambient_drift_per_s
    return Medium(static=message.static, dimensions=message.dimensions, ambient_drift_per_s=drift, **known)


def _array(values: FloatArray) -> pb.Array:
    return pb.Array(shape=values.shape, values=values.ravel().tolist())


def _numbers(message: pb.Array) -> FloatArray:
    return np.array(message.values, dtype=np.float64).reshape(tuple(message.shape))


def _text(text: str) -> str:
    """Text without lone surrogates, which protobuf refuses."""
    return text.encode("utf-8", "replace").decode("utf-8")


def _plain(value: Any) -> Any:
    """Diagnostics as JSON knows them: arrays and tuples become lists, what is unknown its name in words."""
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    if isinstance(value, str | int | float | bool) or value is None:
        return value
    return [_plain(item) for item in value] if isinstance(value, Iterable) else str(value)
