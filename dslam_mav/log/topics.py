"""The log's topics and their messages."""

from __future__ import annotations

from foxglove_schemas_protobuf.Grid_pb2 import Grid
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
from foxglove_schemas_protobuf.PosesInFrame_pb2 import PosesInFrame
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from google.protobuf.message import Message

from dslam_mav.log.schemas.flight_pb2 import (
    EstimateUpdate,
    MissionProgress,
    Prediction,
    RawFrame,
    ThermalReading,
    Truth,
)

PRODUCER = "dslam-mav"  # the MCAP header's library begins so
RECOVERED = "dslam-mav/recovered"  # the name of the metadata that `recover` adds

RAW = "/mavlink/raw"
THERMAL = "/thermal"
MISSION = "/mission"
ESTIMATE = "/estimate"
TEXT = "/log"
TRUTH = "/truth"
PATH = "/path"
SCENE = "/scene"
FIELD = "/field"
FIELD_POINTS = "/field_points"
PREDICTION = "/prediction"
PATH_POINTS = "/path_points"
SOURCE_POINTS = "/source_points"
READING_POINTS = "/reading_points"

# A topic's channel is its place here, counted from 1: append only. Where the chunk that declares the channels
# is destroyed, the reader still knows by this what the other chunks hold.
TOPICS: dict[str, type[Message]] = {
    RAW: RawFrame,
    THERMAL: ThermalReading,
    MISSION: MissionProgress,
    ESTIMATE: EstimateUpdate,
    TEXT: Log,
    TRUTH: Truth,
    PATH: PosesInFrame,
    SCENE: SceneUpdate,
    FIELD: Grid,
    FIELD_POINTS: PointCloud,
    PREDICTION: Prediction,
    PATH_POINTS: PointCloud,
    SOURCE_POINTS: PointCloud,
    READING_POINTS: PointCloud,
}
CHANNEL_IDS = {topic: number for number, topic in enumerate(TOPICS, start=1)}
