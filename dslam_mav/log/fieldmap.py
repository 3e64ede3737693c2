"""The reconstructed field on a square grid of cells, as Foxglove's Grid and as points. Pure."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from foxglove_schemas_protobuf.Grid_pb2 import Grid
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
from foxglove_schemas_protobuf.Vector2_pb2 import Vector2
from numpy.typing import NDArray

from dslam_mav.dslam.field import field
from dslam_mav.log import points
from dslam_mav.log import primitives as draw
from dslam_mav.log.codec import timestamp
from dslam_mav.records import Estimate

Array = NDArray[np.float64]

CELLS = 64  # per side

_CELL = np.dtype([("value", "<f4"), *points.COLOUR])


@dataclass(frozen=True, slots=True, eq=False)
class FieldMap:
    """`value` (CELLS, CELLS), rows along +y: the field above ambient at cells' centres, in the plane `z_m`.

    `corner_m` (2,) is the lowest x and y of the square of cells, `centre_m` (CELLS², d) are their centres.
    """

    corner_m: Array
    cell_m: float
    z_m: float
    centre_m: Array
    value: Array


def field_map(estimate: Estimate) -> FieldMap | None:
    """The field around path and sources at the flight's first reading; None where it is not known. In space the plane
    is that of the largest source.
    """
    sources = estimate.sources
    d, spread2 = sources.position_m.shape[1], sources.squared_spread_m2
    if not (len(sources) and (spread2 > 0.0).all() and np.isfinite([spread2, sources.amplitude]).all()):
        return None
    around = np.vstack([estimate.path.vertices_m, sources.position_m])[:, :2]
    low, high = around.min(axis=0), around.max(axis=0)
    side_m = 1.2 * float((high - low).max())
    if not side_m > 0.0:
        return None
    cell_m = side_m / CELLS
    corner_m = 0.5 * (low + high - side_m)
    z_m = float(sources.position_m[0, 2]) if d == 3 else 0.0
    x, y = np.meshgrid(*(corner + cell_m * (np.arange(CELLS) + 0.5) for corner in corner_m))
    centre_m = np.column_stack([x.ravel(), y.ravel(), *([np.full(x.size, z_m)] if d == 3 else [])])
    value = field(centre_m, spread2, sources.position_m, sources.amplitude).reshape(CELLS, CELLS)
    return FieldMap(corner_m, cell_m, z_m, centre_m, value)


def grid(time_ns: int, frame_id: str, mapped: FieldMap) -> Grid:
    """The map as coloured cells."""
    cells = np.empty((CELLS, CELLS), dtype=_CELL)
    cells["value"] = mapped.value
    points.fill(cells)
    return Grid(
        timestamp=timestamp(time_ns),
        frame_id=frame_id,
        pose=draw.pose((*mapped.corner_m, mapped.z_m)),
        column_count=CELLS,
        cell_size=Vector2(x=mapped.cell_m, y=mapped.cell_m),
        row_stride=CELLS * _CELL.itemsize,
        cell_stride=_CELL.itemsize,
        fields=points.fields_of(_CELL),
        data=cells.tobytes(),
    )


def point_cloud(time_ns: int, frame_id: str, mapped: FieldMap) -> PointCloud:
    """The map as coloured points at the cells' centres."""
    return points.cloud(time_ns, frame_id, mapped.centre_m, mapped.value.ravel())
