"""Foxglove's drawing primitives from plain numbers.

Points have 2 or 3 coordinates; colours are (r, g, b, a), 0 to 1.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from foxglove_schemas_protobuf.Color_pb2 import Color
from foxglove_schemas_protobuf.LinePrimitive_pb2 import LinePrimitive
from foxglove_schemas_protobuf.Point3_pb2 import Point3
from foxglove_schemas_protobuf.Pose_pb2 import Pose
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.SpherePrimitive_pb2 import SpherePrimitive
from foxglove_schemas_protobuf.TextPrimitive_pb2 import TextPrimitive
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Colour = tuple[float, float, float, float]

# √ of the 95 % quantile of χ² with 2 and 3 degrees of freedom: standard deviations out to the region's border
_REGION_SD = {2: 2.4477, 3: 2.7955}
_RING_POINTS = 48


def pose(position_m: ArrayLike, heading_rad: float = 0.0) -> Pose:
    """At a point, turned counter-clockwise about the vertical."""
    x, y, z = _three(position_m)
    return Pose(
        position=Vector3(x=x, y=y, z=z),
        orientation=Quaternion(x=0.0, y=0.0, z=math.sin(0.5 * heading_rad), w=math.cos(0.5 * heading_rad)),
    )


def line(points_m: Array, colour: Colour, *, closed: bool = False) -> LinePrimitive:
    """A line 2 pixels wide through points (N, d)."""
    return LinePrimitive(
        type=LinePrimitive.LINE_LOOP if closed else LinePrimitive.LINE_STRIP,
        pose=pose((0.0, 0.0)),
        thickness=2.0,
        scale_invariant=True,
        points=[Point3(x=x, y=y, z=z) for x, y, z in map(_three, points_m)],
        color=_colour(colour),
    )


def sphere(position_m: ArrayLike, diameter_m: float, colour: Colour) -> SpherePrimitive:
    """A ball."""
    size = Vector3(x=diameter_m, y=diameter_m, z=diameter_m)
    return SpherePrimitive(pose=pose(position_m), size=size, color=_colour(colour))


def label(position_m: ArrayLike, text: str, colour: Colour) -> TextPrimitive:
    """Text that faces the viewer, 12 pixels high."""
    return TextPrimitive(
        pose=pose(position_m),
        billboard=True,
        font_size=12.0,
        scale_invariant=True,
        color=_colour(colour),
        text=text,
    )


def ellipses(centre_m: Array, covariance_m2: Array) -> Iterator[Array]:
    """Rings (N, d) around the region that holds the centre with 95 % probability; none for a NaN covariance.

    In the plane one ellipse; in space the ellipsoid's three principal sections.
    """
    d = len(centre_m)
    if not np.isfinite(covariance_m2).all():
        return
    variance, axes = np.linalg.eigh(covariance_m2)
    half_axes = _REGION_SD[d] * np.sqrt(np.maximum(variance, 0.0)) * axes  # columns
    angle = np.linspace(0.0, 2.0 * np.pi, _RING_POINTS, endpoint=False)
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    for i in range(d):
        for j in range(i + 1, d):
            yield centre_m + circle @ half_axes[:, [i, j]].T


def _three(point: ArrayLike) -> tuple[float, float, float]:
    x, y, *rest = np.asarray(point, dtype=np.float64).tolist()
    return x, y, rest[0] if rest else 0.0


def _colour(colour: Colour) -> Color:
    r, g, b, a = colour
    return Color(r=r, g=g, b=b, a=a)
