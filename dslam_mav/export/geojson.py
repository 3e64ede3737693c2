"""An answer on the map as GeoJSON (RFC 7946): longitude before latitude, rims counter-clockwise, WGS-84."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from typing import Any

from dslam_mav.export.anchor import Array, PlacedSource, Solution, circle_m, to_wgs84
from dslam_mav.mission import Home

DIGITS = 8  # a millimetre, and a digit to spare


def geojson_bytes(found: Sequence[Solution], home: Home, facts: dict[str, Any]) -> bytes:
    """A FeatureCollection: for each solution a Point and a Polygon (the 95 % circle) a source, and the path's
    LineString. `facts` go to every feature.
    """
    features = [feature for solution in found for feature in _features(solution, home, facts)]
    return (json.dumps({"type": "FeatureCollection", "features": features}, indent=1) + "\n").encode()


def source_facts(source: PlacedSource) -> dict[str, float | None]:
    """What is known of a source, None where it is not."""
    facts = {
        "peak_reading": source.peak_reading,
        "amplitude": source.amplitude,
        "activation_s": source.activation_s,
        "sd_m": source.sd_m,
        "radius_95_m": source.radius_m,
        "ellipse_95_major_m": source.axes_m[0],
        "ellipse_95_minor_m": source.axes_m[1],
        "ellipse_95_axis_deg": source.axis_deg,
    }
    return {name: value if math.isfinite(value) else None for name, value in facts.items()}


def _features(solution: Solution, home: Home, facts: dict[str, Any]) -> Iterator[dict[str, Any]]:
    common = {**facts, "solution": solution.name, "mirror_image": solution.mirrored}
    for number, source in enumerate(solution.sources, 1):
        told = {**common, "source": number, **source_facts(source)}
        name = f"source {number}" if solution.name == "answer" else f"source {number} ({solution.name})"
        point = _coordinates(source.position_m[None], home)[0]
        yield _feature("Point", point, {"name": name, "kind": "source", **told})
        if math.isfinite(source.radius_m) and source.radius_m > 0.0:
            rim = _coordinates(circle_m(source.position_m, source.radius_m), home)
            yield _feature("Polygon", [rim], {"name": f"{name}, 95 % circle", "kind": "accuracy", **told})
    path = "path" if solution.name == "answer" else f"path ({solution.name})"
    yield _feature("LineString", _coordinates(solution.path_m, home), {"name": path, "kind": "path", **common})


def _feature(kind: str, coordinates: Any, properties: dict[str, Any]) -> dict[str, Any]:
    return {"type": "Feature", "geometry": {"type": kind, "coordinates": coordinates}, "properties": properties}


def _coordinates(points_m: Array, home: Home) -> list[list[float]]:
    return [[round(lon, DIGITS), round(lat, DIGITS)] for lon, lat in to_wgs84(points_m, home).tolist()]
