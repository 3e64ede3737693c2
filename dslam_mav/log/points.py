"""Coloured points as Foxglove's PointCloud, which Foxglove and Rerun both draw: of a scene's lines and shapes Rerun
draws none. Pure.

Places are (N, 2) or (N, 3).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from foxglove_schemas_protobuf.PackedElementField_pb2 import PackedElementField
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
from numpy.typing import NDArray

from dslam_mav.log import primitives as draw
from dslam_mav.log.codec import timestamp
from dslam_mav.records import Estimate, Flight

Array = NDArray[np.float64]

COLOUR = [("red", "u1"), ("green", "u1"), ("blue", "u1"), ("alpha", "u1")]
_POINT = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("value", "<f4"), *COLOUR])

# black, violet, red, orange, pale yellow: dark to bright, so that it reads in grey too
_STOPS = np.array([[0, 0, 4], [87, 16, 110], [188, 55, 84], [249, 142, 9], [252, 255, 164]], dtype=np.float64)

_PATH_COLOUR = (0.35, 0.65, 1.0, 1.0)  # both stand out from the field's
_SOURCE_COLOUR = (0.2, 1.0, 0.85, 1.0)
_PATH_POINTS = 400
_MAX_READINGS = 2000
_CURTAIN = 0.25  # height of the greatest reading above the path, as a share of the path's extent


def cloud(time_ns: int, frame_id: str, place_m: Array, value: Array, colour: draw.Colour | None = None) -> PointCloud:
    """Points with a value each (N,), in one colour or, without, in those of the values."""
    points = np.zeros(len(place_m), dtype=_POINT)
    for name, coordinate in zip("xyz", place_m.T, strict=False):
        points[name] = coordinate
    points["value"] = value
    if colour is None:
        fill(points)
    else:
        for (name, _), share in zip(COLOUR, colour, strict=True):
            points[name] = round(255 * share)
    return PointCloud(
        timestamp=timestamp(time_ns),
        frame_id=frame_id,
        pose=draw.pose((0.0, 0.0)),
        point_stride=_POINT.itemsize,
        fields=fields_of(_POINT),
        data=points.tobytes(),
    )


def fill(elements: NDArray[np.void]) -> None:
    """Their colours by their values, from the smallest to the largest."""
    value = elements["value"].astype(np.float64)
    span = float(np.ptp(value)) if value.size else 0.0
    share = (value - value.min(initial=np.inf)) / (span or 1.0)
    at = np.linspace(0.0, 1.0, len(_STOPS))
    for channel, name in enumerate(("red", "green", "blue")):
        elements[name] = np.interp(share, at, _STOPS[:, channel])
    elements["alpha"] = 255


def fields_of(kind: np.dtype[np.void]) -> list[PackedElementField]:
    """A packed element as Foxglove describes it."""
    types = {"f": PackedElementField.FLOAT32, "u": PackedElementField.UINT8}
    return [
        PackedElementField(name=name, offset=offset, type=types[element.kind])
        for name, (element, offset, *_) in (kind.fields or {}).items()
    ]


def path_points(time_ns: int, estimate: Estimate) -> PointCloud:
    """The path, evenly dotted; a point's value is the distance flown."""
    vertices_m = estimate.path.vertices_m
    flown_m = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(vertices_m, axis=0), axis=1))])
    at_m = np.linspace(0.0, flown_m[-1], _PATH_POINTS)
    place_m = np.column_stack([np.interp(at_m, flown_m, coordinate) for coordinate in vertices_m.T])
    return cloud(time_ns, estimate.gauge, place_m, at_m, _PATH_COLOUR)


def source_points(time_ns: int, estimate: Estimate) -> PointCloud:
    """Every source and, around it, the border of the region that holds it with 95 %; a point's value is its number."""
    place_m, number = [], []
    for k, (centre_m, covariance_m2) in enumerate(
        zip(estimate.sources.position_m, estimate.position_covariance_m2, strict=True)
    ):
        around_m = np.vstack([centre_m, *draw.ellipses(centre_m, covariance_m2)])
        place_m.append(around_m)
        number.append(np.full(len(around_m), k + 1.0))
    return cloud(time_ns, estimate.gauge, np.vstack(place_m), np.concatenate(number), _SOURCE_COLOUR)


def reading_points(time_ns: int, estimate: Estimate, flight: Flight) -> PointCloud | None:
    """The readings where they were taken, by the estimate, each as high above the path as its value; no more than can
    be told apart. None where the estimate's legs are not the flight's.
    """
    vertices_m = estimate.path.vertices_m
    if not flight.n_readings or len(vertices_m) != len(flight.legs) + 1:
        return None
    place_m = np.vstack(list(_places(vertices_m, flight)))
    value = np.concatenate([leg.reading for leg in flight.legs])
    every = -(-value.size // _MAX_READINGS)
    place_m, value = place_m[::every], value[::every]
    height_m = _CURTAIN * float(np.ptp(vertices_m, axis=0).max())
    place_m[:, 2] += height_m * (value - value.min()) / (float(np.ptp(value)) or 1.0)
    return cloud(time_ns, estimate.gauge, place_m, value)


def _places(vertices_m: Array, flight: Flight) -> Iterator[Array]:
    """(n, 3) of each leg's readings."""
    for leg, begin_m, end_m in zip(flight.legs, vertices_m[:-1], vertices_m[1:], strict=True):
        along = (end_m - begin_m) / (float(np.linalg.norm(end_m - begin_m)) or 1.0)
        flat = begin_m + leg.distance_m[:, None] * along
        yield np.pad(flat, ((0, 0), (0, 3 - flat.shape[1])))
