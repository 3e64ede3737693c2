"""An answer on the map as KML 2.2 (OGC 07-147r2), for Google Earth, QGroundControl and GIS programs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any
from xml.etree import ElementTree as ET

from dslam_mav.export.anchor import Array, PlacedSource, Solution, circle_m, to_wgs84
from dslam_mav.export.geojson import DIGITS, source_facts
from dslam_mav.mission import Home

NAMESPACE = "http://www.opengis.net/kml/2.2"

# aabbggrr; shape and width tell answers from others, not colour alone
_STYLES = {"answer": ("ff1a40e6", "4d1a40e6", "3"), "other": ("ff808080", "33808080", "1")}


def kml_bytes(found: Sequence[Solution], home: Home, title: str, facts: dict[str, Any]) -> bytes:
    """A document with a folder for each solution: a placemark and a 95 % circle a source, and the path."""
    root = ET.Element("kml", xmlns=NAMESPACE)
    document = ET.SubElement(root, "Document")
    _text(document, "name", title)
    _text(document, "description", "; ".join(f"{name}: {value}" for name, value in facts.items()))
    for name, colours in _STYLES.items():
        _style(document, name, *colours)
    for solution in found:
        _folder(document, solution, home)
    ET.indent(root)
    return bytes(ET.tostring(root, encoding="utf-8", xml_declaration=True)) + b"\n"


def _folder(document: ET.Element, solution: Solution, home: Home) -> None:
    folder = ET.SubElement(document, "Folder")
    best = solution.name == "answer"
    _text(folder, "name", solution.name)
    _text(folder, "visibility", "1" if best or solution.mirrored else "0")
    style = "answer" if best else "other"
    for number, source in enumerate(solution.sources, 1):
        name = f"source {number}" if best else f"source {number} ({solution.name})"
        mark = _placemark(folder, name, style, source)
        _text(ET.SubElement(mark, "Point"), "coordinates", _coordinates(source.position_m[None], home))
        if math.isfinite(source.radius_m) and source.radius_m > 0.0:
            mark = _placemark(folder, f"{name}, 95 % circle", style, source)
            polygon = ET.SubElement(mark, "Polygon")
            _text(polygon, "tessellate", "1")
            ring = ET.SubElement(ET.SubElement(polygon, "outerBoundaryIs"), "LinearRing")
            _text(ring, "coordinates", _coordinates(circle_m(source.position_m, source.radius_m), home))
    mark = _placemark(folder, "path" if best else f"path ({solution.name})", style, None)
    line = ET.SubElement(mark, "LineString")
    _text(line, "tessellate", "1")
    _text(line, "coordinates", _coordinates(solution.path_m, home))


def _placemark(folder: ET.Element, name: str, style: str, source: PlacedSource | None) -> ET.Element:
    """Its children in the order the schema demands; the geometry comes last."""
    mark = ET.SubElement(folder, "Placemark")
    _text(mark, "name", name)
    _text(mark, "styleUrl", f"#{style}")
    if source is not None:
        extended = ET.SubElement(mark, "ExtendedData")
        for field, value in source_facts(source).items():
            if value is not None:
                _text(ET.SubElement(extended, "Data", name=field), "value", f"{value:.6g}")
    return mark


def _style(document: ET.Element, name: str, line: str, fill: str, width: str) -> None:
    style = ET.SubElement(document, "Style", id=name)
    drawn = ET.SubElement(style, "LineStyle")
    _text(drawn, "color", line)
    _text(drawn, "width", width)
    _text(ET.SubElement(style, "PolyStyle"), "color", fill)


def _text(parent: ET.Element, tag: str, text: str) -> None:
    ET.SubElement(parent, tag).text = text


def _coordinates(points_m: Array, home: Home) -> str:
    return " ".join(f"{lon:.{DIGITS}f},{lat:.{DIGITS}f}" for lon, lat in to_wgs84(points_m, home).tolist())
