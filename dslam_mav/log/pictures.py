"""Pictures of an estimate in Foxglove's well-known messages, which Foxglove and Rerun draw. Pure.

The path (`/path`), sources with their 95 % regions, path and labels (`/scene`), and the reconstructed field
above ambient at the flight's first reading (`/field`); all of it as points as well, for Rerun, and the readings above
the path (`/…_points`). An estimate whose positions are NaN draws nothing and takes the last scene and points off the
screen. The frame of reference is named by the gauge.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from foxglove_schemas_protobuf.PosesInFrame_pb2 import PosesInFrame
from foxglove_schemas_protobuf.SceneEntity_pb2 import SceneEntity
from foxglove_schemas_protobuf.SceneEntityDeletion_pb2 import SceneEntityDeletion
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from google.protobuf.message import Message
from numpy.typing import NDArray

from dslam_mav.log import primitives as draw
from dslam_mav.log.codec import timestamp
from dslam_mav.log.fieldmap import field_map, grid, point_cloud
from dslam_mav.log.points import cloud, path_points, reading_points, source_points
from dslam_mav.log.topics import FIELD, FIELD_POINTS, PATH, PATH_POINTS, READING_POINTS, SCENE, SOURCE_POINTS
from dslam_mav.records import Estimate, Flight

Array = NDArray[np.float64]

_PATH_COLOUR = (0.10, 0.45, 0.85, 1.0)
_SOURCE_COLOUR = (0.90, 0.25, 0.10, 1.0)
_REGION_COLOUR = (0.90, 0.25, 0.10, 0.6)
_OTHER_COLOUR = (0.50, 0.50, 0.50, 0.6)


def pictures(time_ns: int, estimate: Estimate, flight: Flight | None = None) -> Iterator[tuple[str, Message]]:
    """(topic, message) of every picture of the estimate, all at `time_ns`; readings where the `flight` is given."""
    if not _drawable(estimate):
        yield (
            SCENE,
            SceneUpdate(deletions=[SceneEntityDeletion(timestamp=timestamp(time_ns), type=SceneEntityDeletion.ALL)]),
        )
        for topic in (PATH_POINTS, SOURCE_POINTS, FIELD_POINTS, READING_POINTS):
            yield topic, cloud(time_ns, estimate.gauge, np.empty((0, 3)), np.empty(0))
        return
    yield PATH, _path(time_ns, estimate)
    yield (
        SCENE,
        SceneUpdate(
            entities=[
                _path_entity(time_ns, estimate),
                _sources_entity(time_ns, estimate),
                _others_entity(time_ns, estimate),
            ]
        ),
    )
    yield PATH_POINTS, path_points(time_ns, estimate)
    yield SOURCE_POINTS, source_points(time_ns, estimate)
    if flight is not None and (read := reading_points(time_ns, estimate, flight)) is not None:
        yield READING_POINTS, read
    mapped = field_map(estimate)
    if mapped is not None:
        yield FIELD, grid(time_ns, estimate.gauge, mapped)
        yield FIELD_POINTS, point_cloud(time_ns, estimate.gauge, mapped)


def _drawable(estimate: Estimate) -> bool:
    vertices, sources = estimate.path.vertices_m, estimate.sources.position_m
    return bool(
        len(vertices) > 1
        and np.isfinite(vertices).all()
        and np.isfinite(sources).all()
        and np.isfinite(estimate.path.heading_rad).all()
    )


def _path(time_ns: int, estimate: Estimate) -> PosesInFrame:
    """A pose at every corner, turned along the leg that begins there; the last one as the last leg."""
    headings = np.append(estimate.path.heading_rad, estimate.path.heading_rad[-1])
    return PosesInFrame(
        timestamp=timestamp(time_ns),
        frame_id=estimate.gauge,
        poses=[draw.pose(vertex, heading) for vertex, heading in zip(estimate.path.vertices_m, headings, strict=True)],
    )


def _entity(time_ns: int, estimate: Estimate, name: str) -> SceneEntity:
    """Replaces what was drawn under the same name before."""
    return SceneEntity(timestamp=timestamp(time_ns), frame_id=estimate.gauge, id=name)


def _path_entity(time_ns: int, estimate: Estimate) -> SceneEntity:
    entity = _entity(time_ns, estimate, "path")
    vertices = estimate.path.vertices_m
    entity.lines.append(draw.line(vertices, _PATH_COLOUR))
    entity.texts.append(draw.label(vertices[0], "start", _PATH_COLOUR))
    entity.texts.append(draw.label(vertices[-1], estimate.verdict.name, _PATH_COLOUR))
    return entity


def _sources_entity(time_ns: int, estimate: Estimate) -> SceneEntity:
    entity = _entity(time_ns, estimate, "sources")
    sources = estimate.sources
    size_m = _marker_m(estimate)
    for k, position in enumerate(sources.position_m):
        entity.spheres.append(draw.sphere(position, size_m, _SOURCE_COLOUR))
        sd_m = float(estimate.sd_m[k])
        text = f"source {k + 1}: peak {sources.peak_reading[k]:.3g}"
        if np.isfinite(sd_m):
            text += f" ± {sd_m:.2g} m"
        entity.texts.append(draw.label(position, text, _SOURCE_COLOUR))
        for ring in draw.ellipses(position, estimate.position_covariance_m2[k]):
            entity.lines.append(draw.line(ring, _REGION_COLOUR, closed=True))
    return entity


def _others_entity(time_ns: int, estimate: Estimate) -> SceneEntity:
    """The alternatives' sources, paler and unlabelled."""
    entity = _entity(time_ns, estimate, "alternatives")
    for other in estimate.alternatives:
        for position in other.sources.position_m:
            if np.isfinite(position).all():
                entity.spheres.append(draw.sphere(position, _marker_m(estimate), _OTHER_COLOUR))
    return entity


def _marker_m(estimate: Estimate) -> float:
    """A source's marker: small against the path."""
    return float(0.02 * np.ptp(estimate.path.vertices_m, axis=0).max()) or 0.1
