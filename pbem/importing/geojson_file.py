"""GeoJSON: LineString and MultiLineString are traces."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from pbem.importing.reading import Reading, Trace, choose_names, draw_line, fail
from pbem.wording import show

# Properties that may name the traces, in this order, in small letters.
NAMES = ("name", "id", "fid", "objectid", "trace_id", "label")
# The identifier that a feature has beside its properties; after the first two of these.
OF_FEATURES = "id of the features"
# EPSG codes in this range are systems of geographic coordinates.
GEOGRAPHIC = range(4001, 5000)


def read_geojson(path: Path, text: str) -> Reading:
    """The traces of a file. Raises CaseError with all its faults."""
    reading = Reading()
    try:
        data = json.loads(text)
    except (json.JSONDecodeError, RecursionError) as error:
        place = f"line {error.lineno}, column {error.colno}" if isinstance(error, json.JSONDecodeError) else "the file"
        found = error.msg if isinstance(error, json.JSONDecodeError) else "lists too deep in each other"
        reading.blame(place, found, "GeoJSON")
        raise fail(path, reading.faults) from None
    features = list(_list_features(data, reading))
    lines = [(place, feature, parts) for place, feature in features if (parts := _read_lines(feature, place, reading))]
    if reading.faults:
        raise fail(path, reading.faults)
    names = choose_names(_list_names([feature for _, feature, _ in lines]), len(lines), reading)
    reading.traces = [
        Trace(name, place, tuple(parts)) for name, (place, _, parts) in zip(names, lines, strict=True)
    ]
    _tell_system(data, reading)
    return reading


def _list_features(data: Any, reading: Reading) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Features with their places; a geometry that stands alone is one."""
    kind = data.get("type") if isinstance(data, dict) else None
    if kind == "FeatureCollection":
        features = data.get("features")
        if not isinstance(features, list):
            reading.blame("features", show(features), "a list of features")
            return
        for number, feature in enumerate(features, 1):
            if isinstance(feature, dict) and feature.get("type") == "Feature":
                yield f"features[{number}]", feature
            else:
                reading.blame(f"features[{number}]", show(feature), 'a table with type = "Feature"')
    elif kind == "Feature":
        yield "the feature", data
    elif isinstance(kind, str) and ("coordinates" in data or "geometries" in data):
        yield "the geometry", {"type": "Feature", "geometry": data}
    else:
        reading.blame("the file", show(kind if isinstance(data, dict) else data), "a FeatureCollection of GeoJSON")


def _read_lines(feature: Mapping[str, Any], place: str, reading: Reading) -> list[Any]:
    """The parts of a feature."""
    return list(_read_geometry(feature.get("geometry"), place, reading))


def _read_geometry(geometry: Any, place: str, reading: Reading, depth: int = 0) -> Iterator[Any]:
    if geometry is None:
        reading.left_out.append(f"{place}: no geometry")
        return
    kind = geometry.get("type") if isinstance(geometry, dict) else None
    if not isinstance(kind, str):
        reading.blame(f"{place}.geometry", show(geometry), "a geometry with its type")
    elif kind == "GeometryCollection" and depth < 4:
        members = geometry.get("geometries")
        if not isinstance(members, list):
            reading.blame(f"{place}.geometry.geometries", show(members), "a list of geometries")
            return
        for number, each in enumerate(members, 1):
            yield from _read_geometry(each, f"{place}.geometry.geometries[{number}]", reading, depth + 1)
    elif kind in ("LineString", "MultiLineString"):
        rows = geometry.get("coordinates")
        where = f"{place}.geometry.coordinates"
        lines = [(where, rows)]
        if kind == "MultiLineString":
            if not isinstance(rows, list):
                reading.blame(where, show(rows), "a list of lines")
                return
            lines = [(f"{where}[{number}]", row) for number, row in enumerate(rows, 1)]
        for each, row in lines:
            points = _read_points(row, each, reading)
            if points is not None and len(points) > 1:
                yield draw_line(points)
            elif points is not None:
                reading.left_out.append(f"{each}: a line of {len(points)} point{'' if len(points) == 1 else 's'}")
    else:
        reading.left_out.append(f"{place}: a {show(kind)}, which is no line")


def _read_points(row: Any, place: str, reading: Reading) -> list[complex] | None:
    if not isinstance(row, list):
        reading.blame(place, show(row), "a list of points [x, y]")
        return None
    points, before, heights = [], len(reading.faults), False
    for number, point in enumerate(row, 1):
        where = f"{place}[{number}]"
        if not isinstance(point, list) or len(point) < 2:
            reading.blame(where, show(point), "a point [x, y]")
            continue
        x, y = (reading.read_number(value, f"{where}[{axis}]") for axis, value in enumerate(point[:2], 1))
        heights |= len(point) > 2
        if x is not None and y is not None:
            points.append(complex(x, y))
    note = "Heights and further numbers of points are ignored: the model is plane."
    if heights and note not in reading.notes:
        reading.notes.append(note)
    return points if len(reading.faults) == before else None


def _list_names(features: list[Mapping[str, Any]]) -> dict[str, list[str | None]]:
    """Candidates for the names of all features, by where they stand."""
    tables = []
    for feature in features:
        properties = feature.get("properties")
        tables.append(
            {str(key).lower(): value for key, value in properties.items()} if isinstance(properties, dict) else {}
        )
    by_property = {key: [_spell(table.get(key)) for table in tables] for key in NAMES}
    of_features = {OF_FEATURES: [_spell(feature.get("id")) for feature in features]}
    first = {key: by_property.pop(key) for key in NAMES[:2]}
    return {**first, **of_features, **by_property}


def _spell(value: Any) -> str | None:
    if isinstance(value, float) and value.is_integer():
        value = int(value)
    return str(value) if isinstance(value, str | int) and not isinstance(value, bool) else None


def _tell_system(data: Mapping[str, Any], reading: Reading) -> None:
    """Say so if the coordinates are degrees, or may be."""
    system = data.get("crs")
    properties = system.get("properties") if isinstance(system, dict) else None
    name = str(properties.get("name", "")) if isinstance(properties, dict) else ""
    code = re.search(r"EPSG\D*(\d+)\s*$", name, re.IGNORECASE)
    degrees = "CRS84" in name or "CRS:84" in name or (code is not None and int(code.group(1)) in GEOGRAPHIC)
    if degrees:
        reading.notes.append(
            f"The coordinates are degrees of longitude and latitude ({show(name)}), which are taken as lengths: "
            "project the map to a system in metres first (for example with ogr2ogr -t_srs)."
        )
        return
    points = [end for trace in reading.traces for part in trace.parts for leg in part for end in (leg.start, leg.end)]
    if not name and all(abs(point.real) <= 180 and abs(point.imag) <= 90 for point in points):
        reading.notes.append(
            "The file names no system of coordinates: they are taken as lengths. Degrees of longitude and latitude "
            "would have to be projected first."
        )
