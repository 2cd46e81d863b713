"""Seeded maps in the dress of other programs: `pbem import` reads the same traces in all, or says with a place why not.

    python -m scripts.fuzz_dialects [--count N] [--seed S] [--keep FOLDER] [--seconds 20]

Each map is imported from plain GeoJSON and from a file as other programs write it: systems of coordinates, nested and
empty geometries, heights, odd names, tables with other delimiters, decimal commas, quotes, marks of byte order, further
columns and line ends, drawings of all versions. What is accepted has to have the curves of the plain map and has to
pass `pbem check`; what is refused has to say what was found and what is expected. Files with a fault (what no format
allows, or cut short) may end either way. Prints what went wrong, refused dresses among them, and the counts; the exit
code is 1 if anything did.
"""

from __future__ import annotations

import csv
import io
import json
import math
import random
import sys
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import ezdxf
from ezdxf import units

from scripts.fuzz_import import Line, call, draw_map, run_seeds

NAMES = ("Störung {}", "断层{}", "f-{}", "F {} (mapped)", "{}", "a'b\"{}", "#{}", "[{}]", "x={}", "fault.{}",
         "∂{}\u200b", "{}.5", "a\\{}", "t{}*", "..{}", "ü" * 300 + "{}")

WORDS = (b"NaN", b"Infinity", b"1e999", b"null", b'"', b"{", b"]", b",", b"\n", b"-", b"\0")


@dataclass(frozen=True)
class Dressed:
    """A file: its ending and content; same: whether it has to be read, and as the plain map is."""

    ending: str
    content: bytes
    same: bool = True
    what: str = ""


def round_map(r: random.Random) -> list[Line]:
    """A map with coordinates of few digits, now and then as those of a projected system."""
    lines = draw_map(r)
    numbers = [abs(value) for line in lines for point in line for value in point]
    digits = max(0, 5 - math.floor(math.log10(max(numbers))))
    x, y = r.choice(((0.0, 0.0), (0.0, 0.0), (466000.0, 6691580.0), (-12000.0, 300.0)))
    factor = 100.0 / max(numbers) if x else 1.0
    digits = 6 if x else digits
    return [[[round(x + factor * a, digits), round(y + factor * b, digits)] for a, b in line] for line in lines]


def write_plain(lines: list[Line]) -> bytes:
    """GeoJSON without anything else."""
    return json.dumps({"type": "FeatureCollection", "features": [
        {"type": "Feature", "properties": {}, "geometry": {"type": "LineString", "coordinates": line}}
        for line in lines
    ]}).encode()


def dress_geojson(r: random.Random, lines: list[Line]) -> Dressed:
    """Systems of coordinates, names, heights, further members."""
    name = r.choice((*NAMES, None, None))
    heights = r.choice((0, 0, 1, 2))
    features: list[Any] = []
    for number, line in enumerate(lines):
        points = [[*point, *(r.uniform(0, 50) for _ in range(heights))] for point in line]
        geometry: Any = {"type": "LineString", "coordinates": points}
        if r.random() < 0.3:
            geometry = {"coordinates": [points], "type": "MultiLineString", "bbox": [0, 0, 1, 1]}
        if r.random() < 0.15:
            geometry["coordinates"] = [points, [], [points[0]]]
            geometry["type"] = "MultiLineString"
        for _ in range(r.choice((0, 0, 0, 1, 2, 3))):
            geometry = {"type": "GeometryCollection", "geometries": [geometry]}
        properties = None if name is None and r.random() < 0.5 else {"length": 3.2, "note": None, "list": [1, {"a": 2}]}
        if name is not None and properties is not None:
            properties[r.choice(("name", "NAME", "Name")) if number == 0 else "name"] = name.format(number)
        feature = {"type": "Feature", "properties": properties, "geometry": geometry}
        if r.random() < 0.3:
            feature |= {"id": r.choice((number, f"way/{number}", None)), "bbox": None}
        features.append(feature)
    data: Any = {"type": "FeatureCollection", "name": "map", "features": features}
    if r.random() < 0.6:
        data["crs"] = r.choice((
            None, {}, [], 4326, "EPSG:3067", {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::3067"}},
            {"type": "name", "properties": {"name": None}}, {"type": "link", "properties": {"href": "http://x/y"}},
            {"type": "name", "properties": "EPSG:25832"}, {"type": "name", "properties": {"name": 32632}},
            {"type": "EPSG", "properties": {"code": 3067}},
        ))
    text = json.dumps(data, ensure_ascii=r.random() < 0.5, indent=r.choice((None, 2)))
    text = text.replace("\n", r.choice(("\n", "\r\n")))
    encoding = r.choice(("utf-8", "utf-8", "utf-8-sig", "utf-16"))
    return Dressed(r.choice((".geojson", ".json", ".GeoJSON")), text.encode(encoding), True, "geojson")


def dress_sequence(r: random.Random, lines: list[Line]) -> Dressed:
    """A feature on each line, as GeoJSON text sequences have it, with marks of records or without."""
    mark = r.choice(("", "\x1e"))
    return Dressed(".geojson", "".join(
        f"{mark}{json.dumps(feature)}\n" for feature in json.loads(write_plain(lines))["features"]
    ).encode(), False, "sequence")


def dress_csv(r: random.Random, lines: list[Line]) -> Dressed:
    """Tables as spreadsheets and geographic information systems write them."""
    delimiter = r.choice((",", ";", "\t", "|"))
    comma = delimiter != "," and r.random() < 0.5
    segments = all(len(line) == 2 for line in lines)

    def spell(value: float) -> str:
        text = r.choice((repr(value), f"{value:.17g}", f"{value:.12e}" if value == float(f"{value:.12e}") else
                         repr(value), f"+{value!r}" if value >= 0 else repr(value)))
        return text.replace(".", ",") if comma else text

    capital = r.choice((str, str.upper, str.title))
    further = r.choice(([], [], ["length"], ["Type", "comment"]))
    rows: list[list[str]] = []
    if segments:
        rows.append([*map(capital, ("x1", "y1", "x2", "y2")), *further])
        for line in lines:
            rows.append([*(spell(value) for point in line for value in point), *("note; 3,5" for _ in further)])
    else:
        name = r.choice(("{}", "f{}", "Störung {}", "a,b;{}"))
        columns = [r.choice(("id", "name", "fid")), "x", "y", *further]
        order = r.sample(range(len(columns)), len(columns)) if r.random() < 0.4 else [*range(len(columns))]
        rows.append([capital(columns[k]) for k in order])
        for number, line in enumerate(lines):
            for x, y in line:
                cells = [name.format(number), spell(x), spell(y), *("note; 3,5" for _ in further)]
                rows.append([cells[k] for k in order])
    text = io.StringIO()
    ends = r.choice(("\n", "\r\n"))
    quoting = r.choice((csv.QUOTE_MINIMAL, csv.QUOTE_MINIMAL, csv.QUOTE_ALL, csv.QUOTE_NONNUMERIC))
    writer = csv.writer(text, delimiter=delimiter, lineterminator=ends, quoting=quoting)
    if r.random() < 0.2:
        text.write(f"# made by hand{ends}")
    writer.writerows(rows)
    if r.random() < 0.3:
        text.write(ends * r.randint(1, 3))
    encoding = r.choice(("utf-8", "utf-8-sig", "utf-16", "cp1252"))
    ending = r.choice((".csv", ".txt", ".CSV"))
    return Dressed(ending, text.getvalue().encode(encoding, "replace"), True, f"csv {delimiter!r} {comma}")


def dress_wkt(r: random.Random, lines: list[Line]) -> Dressed:
    """A column of well-known text, which is not read."""
    rows = ["WKT,id", *(f'"LINESTRING ({", ".join(f"{x} {y}" for x, y in line)})",{k}' for k, line in enumerate(lines))]
    return Dressed(".csv", "\n".join(rows).encode(), False, "wkt")


def dress_dxf(r: random.Random, lines: list[Line]) -> Dressed:
    """Drawings of any version, with blocks, texts and units that say nothing of the traces."""
    drawing = ezdxf.new(r.choice(("R12", "R2000", "R2004", "R2007", "R2010", "R2018")), setup=r.random() < 0.3)
    old = drawing.dxfversion == "AC1009"
    drawing.header["$INSUNITS"] = r.choice((0, 1, 4, 6, units.KM))
    space = drawing.modelspace()
    layer = r.choice(("0", "traces", "Störungen"))
    if layer != "0":
        drawing.layers.add(layer, color=r.choice((1, 7)))
    height = r.choice((0.0, 0.0, 12.5))
    for line in lines:
        kind = r.choice(("line", "2d", "3d") if old else ("line", "2d", "3d", "light"))
        attributes = {"layer": layer}
        if kind == "line" and len(line) == 2:
            space.add_line((*line[0], height), (*line[1], height), dxfattribs=attributes)
        elif kind == "2d":
            space.add_polyline2d([tuple(point) for point in line], dxfattribs=attributes)
        elif kind == "light":
            space.add_lwpolyline([tuple(point) for point in line], dxfattribs=attributes)
        else:
            space.add_polyline3d([(*point, r.uniform(0, 5)) for point in line], dxfattribs=attributes)
    if r.random() < 0.4:
        block = drawing.blocks.new("MARK")
        block.add_line((0, 0), (1, 1))
        space.add_blockref("MARK", (3, 4), dxfattribs={"xscale": 2, "rotation": 30})
        space.add_text("north")
    if not old and r.random() < 0.3:
        space.add_spline([(0, 0, 0), (1, 2, 0), (3, 1, 0)])
        space.add_ellipse((0, 0), major_axis=(2, 0), ratio=0.5)
    if r.random() < 0.2:
        hidden = drawing.layers.add("hidden")
        hidden.off() if r.random() < 0.5 else hidden.freeze()
        space.add_line((-5, -5), (5, 6), dxfattribs={"layer": "hidden"})
    if r.random() < 0.25:
        target: Any = io.BytesIO()
        drawing.write(target, fmt="bin")
        return Dressed(".dxf", target.getvalue(), True, "dxf binary")
    target = io.StringIO()
    drawing.write(target)
    text = target.getvalue().replace("\n", r.choice(("\n", "\r\n")))
    return Dressed(r.choice((".dxf", ".DXF")), text.encode(drawing.output_encoding, "replace"), True,
                   f"dxf {drawing.dxfversion}")  # fmt: skip


def spoil(r: random.Random, dressed: Dressed) -> Dressed:
    """A fault: cut short, bytes changed, values that are none."""
    content = dressed.content
    for _ in range(r.randint(1, 3)):
        at = r.randrange(len(content) + 1)
        content = r.choice((
            content[:at], content[at:], content[:at] + bytes([r.randrange(256)]) + content[at + 1:],
            content[:at] + r.choice(WORDS) + content[at:],
            content[:at] + content[at:][::-1][: r.randint(0, 40)] + content[at:],
            content.replace(b"1", b"NaN", 1), content.replace(b"2", b"1" * 400, 1), content * 2,
        )) or b" "
    return Dressed(dressed.ending, content, False, f"{dressed.what} spoilt")


DRESSES: tuple[Callable[[random.Random, list[Line]], Dressed], ...] = (
    dress_geojson, dress_geojson, dress_csv, dress_csv, dress_dxf, dress_dxf, dress_sequence, dress_wkt,
)


def make_dressed(seed: int) -> tuple[list[Line], Dressed]:
    """A map, and a file of it."""
    r = random.Random(seed)
    lines = round_map(r)
    if r.random() < 0.3:
        lines = [line[:2] for line in lines]
    if r.random() < 0.02:
        lines = [[[x + 1e3 * k, y] for x, y in line] for k in range(40) for line in lines][:400]
    dressed = r.choice(DRESSES)(r, lines)
    return lines, spoil(r, dressed) if r.random() < 0.35 else dressed


def read_curves(case: Path) -> list[Any]:
    """The shapes of the curves of a case, in any order."""
    curves = tomllib.loads(case.read_text(encoding="utf-8"))["curves"].values()
    return sorted(json.dumps(curve["points"]) if "points" in curve else json.dumps(curve) for curve in curves)


def try_dressed(seed: int, folder: Path) -> tuple[str, str]:
    """How it ended, "accepted", "refused" or "wrong", and what was said."""
    lines, dressed = make_dressed(seed)
    plain, file = folder / f"plain_{seed}.geojson", folder / f"map_{seed}{dressed.ending}"
    cases = [folder / f"{kind}_{seed}.toml" for kind in ("plain", "dressed")]
    plain.write_bytes(write_plain(lines))
    file.write_bytes(dressed.content)
    ends = [call("import", str(path), "-o", str(case), "--force") for path, case in
            zip((plain, file), cases, strict=True)]  # fmt: skip
    code, said = ends[1]
    if "Traceback" in said or code not in (0, 2):
        return "wrong", said
    if code == 2:
        right = "found" in said and "expected" in said and not (dressed.same and ends[0][0] == 0)
        return ("refused" if right else "wrong"), said
    if dressed.same and (ends[0][0] != 0 or read_curves(cases[0]) != read_curves(cases[1])):
        return "wrong", f"{said}\nother curves than in the plain map"
    code, checked = call("check", str(cases[1]))
    return ("accepted" if code == 0 and "Traceback" not in checked else "wrong"), f"{said}\n{checked}"


if __name__ == "__main__":
    sys.exit(run_seeds(__doc__, try_dressed, lambda seed: make_dressed(seed)[1].what))
