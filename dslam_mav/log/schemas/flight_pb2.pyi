# mypy: disable-error-code="type-arg"
from google.protobuf.internal import containers as _containers
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class RawFrame(_message.Message):
    __slots__ = ("raw", "system", "component", "message_id", "signature_removed")
    RAW_FIELD_NUMBER: _ClassVar[int]
    SYSTEM_FIELD_NUMBER: _ClassVar[int]
    COMPONENT_FIELD_NUMBER: _ClassVar[int]
    MESSAGE_ID_FIELD_NUMBER: _ClassVar[int]
    SIGNATURE_REMOVED_FIELD_NUMBER: _ClassVar[int]
    raw: bytes
    system: int
    component: int
    message_id: int
    signature_removed: bool
    def __init__(self, raw: _Optional[bytes] = ..., system: _Optional[int] = ..., component: _Optional[int] = ..., message_id: _Optional[int] = ..., signature_removed: bool = ...) -> None: ...

class ThermalReading(_message.Message):
    __slots__ = ("time_boot_ms", "value", "name")
    TIME_BOOT_MS_FIELD_NUMBER: _ClassVar[int]
    VALUE_FIELD_NUMBER: _ClassVar[int]
    NAME_FIELD_NUMBER: _ClassVar[int]
    time_boot_ms: int
    value: float
    name: str
    def __init__(self, time_boot_ms: _Optional[int] = ..., value: _Optional[float] = ..., name: _Optional[str] = ...) -> None: ...

class MissionProgress(_message.Message):
    __slots__ = ("seq", "reached")
    SEQ_FIELD_NUMBER: _ClassVar[int]
    REACHED_FIELD_NUMBER: _ClassVar[int]
    seq: int
    reached: bool
    def __init__(self, seq: _Optional[int] = ..., reached: bool = ...) -> None: ...

class Array(_message.Message):
    __slots__ = ("shape", "values")
    SHAPE_FIELD_NUMBER: _ClassVar[int]
    VALUES_FIELD_NUMBER: _ClassVar[int]
    shape: _containers.RepeatedScalarFieldContainer[int]
    values: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, shape: _Optional[_Iterable[int]] = ..., values: _Optional[_Iterable[float]] = ...) -> None: ...

class Sources(_message.Message):
    __slots__ = ("position_m", "amplitude", "peak_reading", "activation_s")
    POSITION_M_FIELD_NUMBER: _ClassVar[int]
    AMPLITUDE_FIELD_NUMBER: _ClassVar[int]
    PEAK_READING_FIELD_NUMBER: _ClassVar[int]
    ACTIVATION_S_FIELD_NUMBER: _ClassVar[int]
    position_m: Array
    amplitude: _containers.RepeatedScalarFieldContainer[float]
    peak_reading: _containers.RepeatedScalarFieldContainer[float]
    activation_s: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, position_m: _Optional[_Union[Array, _Mapping]] = ..., amplitude: _Optional[_Iterable[float]] = ..., peak_reading: _Optional[_Iterable[float]] = ..., activation_s: _Optional[_Iterable[float]] = ...) -> None: ...

class Path(_message.Message):
    __slots__ = ("vertices_m", "heading_rad", "coefficients_m")
    VERTICES_M_FIELD_NUMBER: _ClassVar[int]
    HEADING_RAD_FIELD_NUMBER: _ClassVar[int]
    COEFFICIENTS_M_FIELD_NUMBER: _ClassVar[int]
    vertices_m: Array
    heading_rad: _containers.RepeatedScalarFieldContainer[float]
    coefficients_m: Array
    def __init__(self, vertices_m: _Optional[_Union[Array, _Mapping]] = ..., heading_rad: _Optional[_Iterable[float]] = ..., coefficients_m: _Optional[_Union[Array, _Mapping]] = ...) -> None: ...

class Medium(_message.Message):
    __slots__ = ("diffusivity_m2_s", "activation_s", "activation_shared", "spread_m", "ambient", "static", "dimensions", "sensor_lag_s", "extent", "activations_s", "ambient_drift_per_s")
    DIFFUSIVITY_M2_S_FIELD_NUMBER: _ClassVar[int]
    ACTIVATION_S_FIELD_NUMBER: _ClassVar[int]
    ACTIVATION_SHARED_FIELD_NUMBER: _ClassVar[int]
    SPREAD_M_FIELD_NUMBER: _ClassVar[int]
    AMBIENT_FIELD_NUMBER: _ClassVar[int]
    STATIC_FIELD_NUMBER: _ClassVar[int]
    DIMENSIONS_FIELD_NUMBER: _ClassVar[int]
    SENSOR_LAG_S_FIELD_NUMBER: _ClassVar[int]
    EXTENT_FIELD_NUMBER: _ClassVar[int]
    ACTIVATIONS_S_FIELD_NUMBER: _ClassVar[int]
    AMBIENT_DRIFT_PER_S_FIELD_NUMBER: _ClassVar[int]
    diffusivity_m2_s: float
    activation_s: float
    activation_shared: bool
    spread_m: float
    ambient: float
    static: bool
    dimensions: int
    sensor_lag_s: float
    extent: float
    activations_s: _containers.RepeatedScalarFieldContainer[float]
    ambient_drift_per_s: float
    def __init__(self, diffusivity_m2_s: _Optional[float] = ..., activation_s: _Optional[float] = ..., activation_shared: bool = ..., spread_m: _Optional[float] = ..., ambient: _Optional[float] = ..., static: bool = ..., dimensions: _Optional[int] = ..., sensor_lag_s: _Optional[float] = ..., extent: _Optional[float] = ..., activations_s: _Optional[_Iterable[float]] = ..., ambient_drift_per_s: _Optional[float] = ...) -> None: ...

class Estimate(_message.Message):
    __slots__ = ("verdict", "verdict_name", "verdict_sentence", "reason", "gauge", "sources", "path", "medium", "spread_m", "noise_sd", "log_likelihood", "position_covariance_m2", "path_aligned_covariance_m2", "parameter_names", "parameter_covariance", "residual", "unseen_directions", "diagnostics_json", "alternatives")
    VERDICT_FIELD_NUMBER: _ClassVar[int]
    VERDICT_NAME_FIELD_NUMBER: _ClassVar[int]
    VERDICT_SENTENCE_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    GAUGE_FIELD_NUMBER: _ClassVar[int]
    SOURCES_FIELD_NUMBER: _ClassVar[int]
    PATH_FIELD_NUMBER: _ClassVar[int]
    MEDIUM_FIELD_NUMBER: _ClassVar[int]
    SPREAD_M_FIELD_NUMBER: _ClassVar[int]
    NOISE_SD_FIELD_NUMBER: _ClassVar[int]
    LOG_LIKELIHOOD_FIELD_NUMBER: _ClassVar[int]
    POSITION_COVARIANCE_M2_FIELD_NUMBER: _ClassVar[int]
    PATH_ALIGNED_COVARIANCE_M2_FIELD_NUMBER: _ClassVar[int]
    PARAMETER_NAMES_FIELD_NUMBER: _ClassVar[int]
    PARAMETER_COVARIANCE_FIELD_NUMBER: _ClassVar[int]
    RESIDUAL_FIELD_NUMBER: _ClassVar[int]
    UNSEEN_DIRECTIONS_FIELD_NUMBER: _ClassVar[int]
    DIAGNOSTICS_JSON_FIELD_NUMBER: _ClassVar[int]
    ALTERNATIVES_FIELD_NUMBER: _ClassVar[int]
    verdict: int
    verdict_name: str
    verdict_sentence: str
    reason: str
    gauge: str
    sources: Sources
    path: Path
    medium: Medium
    spread_m: float
    noise_sd: float
    log_likelihood: float
    position_covariance_m2: Array
    path_aligned_covariance_m2: Array
    parameter_names: _containers.RepeatedScalarFieldContainer[str]
    parameter_covariance: Array
    residual: _containers.RepeatedScalarFieldContainer[float]
    unseen_directions: _containers.RepeatedScalarFieldContainer[str]
    diagnostics_json: str
    alternatives: _containers.RepeatedCompositeFieldContainer[Estimate]
    def __init__(self, verdict: _Optional[int] = ..., verdict_name: _Optional[str] = ..., verdict_sentence: _Optional[str] = ..., reason: _Optional[str] = ..., gauge: _Optional[str] = ..., sources: _Optional[_Union[Sources, _Mapping]] = ..., path: _Optional[_Union[Path, _Mapping]] = ..., medium: _Optional[_Union[Medium, _Mapping]] = ..., spread_m: _Optional[float] = ..., noise_sd: _Optional[float] = ..., log_likelihood: _Optional[float] = ..., position_covariance_m2: _Optional[_Union[Array, _Mapping]] = ..., path_aligned_covariance_m2: _Optional[_Union[Array, _Mapping]] = ..., parameter_names: _Optional[_Iterable[str]] = ..., parameter_covariance: _Optional[_Union[Array, _Mapping]] = ..., residual: _Optional[_Iterable[float]] = ..., unseen_directions: _Optional[_Iterable[str]] = ..., diagnostics_json: _Optional[str] = ..., alternatives: _Optional[_Iterable[_Union[Estimate, _Mapping]]] = ...) -> None: ...

class EstimateUpdate(_message.Message):
    __slots__ = ("estimate", "legs_flown", "final")
    ESTIMATE_FIELD_NUMBER: _ClassVar[int]
    LEGS_FLOWN_FIELD_NUMBER: _ClassVar[int]
    FINAL_FIELD_NUMBER: _ClassVar[int]
    estimate: Estimate
    legs_flown: int
    final: bool
    def __init__(self, estimate: _Optional[_Union[Estimate, _Mapping]] = ..., legs_flown: _Optional[int] = ..., final: bool = ...) -> None: ...

class Truth(_message.Message):
    __slots__ = ("source_position_m", "amplitude", "vertices_m")
    SOURCE_POSITION_M_FIELD_NUMBER: _ClassVar[int]
    AMPLITUDE_FIELD_NUMBER: _ClassVar[int]
    VERTICES_M_FIELD_NUMBER: _ClassVar[int]
    source_position_m: Array
    amplitude: _containers.RepeatedScalarFieldContainer[float]
    vertices_m: Array
    def __init__(self, source_position_m: _Optional[_Union[Array, _Mapping]] = ..., amplitude: _Optional[_Iterable[float]] = ..., vertices_m: _Optional[_Union[Array, _Mapping]] = ...) -> None: ...

class Range(_message.Message):
    __slots__ = ("median_m", "p90_m")
    MEDIAN_M_FIELD_NUMBER: _ClassVar[int]
    P90_M_FIELD_NUMBER: _ClassVar[int]
    median_m: float
    p90_m: float
    def __init__(self, median_m: _Optional[float] = ..., p90_m: _Optional[float] = ...) -> None: ...

class Prediction(_message.Message):
    __slots__ = ("fewest_sources", "most_sources", "spread_m", "area_m", "peak", "noise_sd", "readings_per_m", "length_m", "source_error_m", "path_error_m", "source_error_aligned_m", "path_error_aligned_m", "unidentifiable_share")
    FEWEST_SOURCES_FIELD_NUMBER: _ClassVar[int]
    MOST_SOURCES_FIELD_NUMBER: _ClassVar[int]
    SPREAD_M_FIELD_NUMBER: _ClassVar[int]
    AREA_M_FIELD_NUMBER: _ClassVar[int]
    PEAK_FIELD_NUMBER: _ClassVar[int]
    NOISE_SD_FIELD_NUMBER: _ClassVar[int]
    READINGS_PER_M_FIELD_NUMBER: _ClassVar[int]
    LENGTH_M_FIELD_NUMBER: _ClassVar[int]
    SOURCE_ERROR_M_FIELD_NUMBER: _ClassVar[int]
    PATH_ERROR_M_FIELD_NUMBER: _ClassVar[int]
    SOURCE_ERROR_ALIGNED_M_FIELD_NUMBER: _ClassVar[int]
    PATH_ERROR_ALIGNED_M_FIELD_NUMBER: _ClassVar[int]
    UNIDENTIFIABLE_SHARE_FIELD_NUMBER: _ClassVar[int]
    fewest_sources: int
    most_sources: int
    spread_m: float
    area_m: _containers.RepeatedScalarFieldContainer[float]
    peak: float
    noise_sd: float
    readings_per_m: float
    length_m: float
    source_error_m: Range
    path_error_m: Range
    source_error_aligned_m: Range
    path_error_aligned_m: Range
    unidentifiable_share: float
    def __init__(self, fewest_sources: _Optional[int] = ..., most_sources: _Optional[int] = ..., spread_m: _Optional[float] = ..., area_m: _Optional[_Iterable[float]] = ..., peak: _Optional[float] = ..., noise_sd: _Optional[float] = ..., readings_per_m: _Optional[float] = ..., length_m: _Optional[float] = ..., source_error_m: _Optional[_Union[Range, _Mapping]] = ..., path_error_m: _Optional[_Union[Range, _Mapping]] = ..., source_error_aligned_m: _Optional[_Union[Range, _Mapping]] = ..., path_error_aligned_m: _Optional[_Union[Range, _Mapping]] = ..., unidentifiable_share: _Optional[float] = ...) -> None: ...
