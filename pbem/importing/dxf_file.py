"""DXF drawings: lines, polylines with straight and circular parts, arcs and circles are traces."""

from __future__ import annotations

import cmath
import io
import itertools
import math
import warnings
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pbem.errors import PbemError
from pbem.geometry.curve import Leg
from pbem.importing.reading import Reading, Trace, fail
from pbem.wording import show

Tags = list[tuple[str, str]]

KINDS = ("LINE", "LWPOLYLINE", "POLYLINE", "ARC", "CIRCLE")
# Codes of what polylines have and other entities have not, as they begin: counts, flags, widths, heights and points.
OF_POLYLINES = ("90", "70", "43", "38", "39", "10")
# The last version without marks of classes.
OLD = "AC1009"
# Parts of a circle.
QUARTERS = 4
# Flag of a vertex that is a control point of a spline.
FRAME = 16


def read_dxf(path: Path) -> Reading:
    """The traces of the drawing's model space. Raises CaseError with all its faults."""
    reading = Reading()
    drawing = _open(path, reading)
    others: Counter[str] = Counter()
    hidden: Counter[str] = Counter()
    heights = False
    numbers: Counter[str] = Counter()
    for entity in drawing.modelspace():
        kind = entity.dxftype()
        numbers[kind] += 1
        place = f"{kind} {numbers[kind]}"
        if reason := _find_hidden(entity, drawing):
            hidden[f"{kind} {reason}"] += 1
            continue
        if kind not in KINDS:
            others[kind] += 1
            continue
        try:
            legs, lifted = _read_entity(entity, kind)
        except (ValueError, ArithmeticError, TypeError, AttributeError, KeyError) as error:
            reading.blame(place, str(error) or type(error).__name__, "a line, polyline, arc or circle")
            continue
        if legs is None:
            reading.left_out.append(f"{place}: drawn in a plane other than that of x and y")
            continue
        heights |= lifted
        wrong = [value for leg in legs for value in _list_numbers(leg) if reading.read_number(value, place) is None]
        if not legs:
            reading.left_out.append(f"{place}: one point or none")
        elif not wrong:
            reading.traces.append(Trace(f"t{len(reading.traces) + 1}", place, (tuple(legs),)))
    if heights:
        reading.notes.append("Heights of points are ignored: the model is plane.")
    for what, count in sorted(hidden.items()):
        reading.left_out.append(f"{count} {what}: what the drawing does not show is not read")
    for name, count in _count_on_paper(drawing):
        reading.left_out.append(f"{count} on the sheet {show(name)}: only the model space is read")
    for kind, count in sorted(others.items()):
        reading.left_out.append(f"{count} {kind}: only {', '.join(KINDS)} are read")
    if reading.faults:
        raise fail(path, reading.faults)
    return reading


def _count_on_paper(drawing: Any) -> list[tuple[str, int]]:
    """Sheets other than the model space with lines on them, and how many."""
    counts = [(str(sheet.name), sum(entity.dxftype() in KINDS for entity in sheet)) for sheet in drawing.layouts]
    return [(name, count) for name, count in counts if count and name.lower() != "model"]


def _find_hidden(entity: Any, drawing: Any) -> str:
    """Why an entity is not seen in the drawing; empty if it is."""
    if not entity.dxf.is_supported("layer"):
        return ""  # of a kind that ezdxf does not know
    name = entity.dxf.get("layer", "0")
    layer = drawing.layers.get(name) if drawing.layers.has_entry(name) else None
    if layer is not None and layer.is_frozen():
        return f"on layer {show(name)}, which is frozen"
    if layer is not None and layer.is_off():
        return f"on layer {show(name)}, which is turned off"
    return "that is set invisible" if entity.dxf.get("invisible", 0) else ""


def _open(path: Path, reading: Reading) -> Any:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            import ezdxf
            from ezdxf import recover
    except ImportError as error:
        raise PbemError(
            f"{path}: DXF files are read by ezdxf, which is missing ({error}): apt-get install python3-ezdxf, or run "
            "pip install ezdxf"
        ) from None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                return ezdxf.readfile(str(path))  # type: ignore[attr-defined]
            except (ezdxf.DXFStructureError, UnicodeDecodeError):  # type: ignore[attr-defined]
                marked = _mark_polylines(path)
                if marked is not None:
                    return ezdxf.read(io.StringIO(marked))  # type: ignore[attr-defined]
                drawing, auditor = recover.readfile(str(path))
    except Exception as error:  # whatever a library says of a file that is none of its own
        found = f"what ezdxf cannot read ({type(error).__name__}: {error})"
        reading.blame("the file", found[:200], "a DXF drawing")
        raise fail(path, reading.faults) from None
    reading.notes.append(f"The drawing is damaged; ezdxf has mended {len(auditor.fixes)} places and not "
                         f"{len(auditor.errors)}.")
    return drawing


def _mark_polylines(path: Path) -> str | None:
    """The text with its polylines (LWPOLYLINE) that lack the marks of their class, without which ezdxf reads none, as
    it reads them; None if none lacks them, or the file is no text.

    In drawings of old versions, which have no such marks at all, they become polylines of that time (POLYLINE).
    """
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except UnicodeDecodeError:
        return None
    tags = [(code.strip(), value.strip()) for code, value in zip(lines[::2], lines[1::2], strict=False)]
    at = next((number for number, tag in enumerate(tags) if tag == ("9", "$ACADVER")), None)
    old = at is None or tags[at + 1][1] <= OLD
    starts = [number for number, (code, _) in enumerate(tags) if code == "0"]
    result, changed = tags[: starts[0]] if starts else tags, False
    for start, end in itertools.pairwise([*starts, len(tags)]):
        entity = tags[start:end]
        if entity[0][1] == "LWPOLYLINE" and all(code != "100" for code, _ in entity):
            entity = _age(entity) if old else _mark(entity)
            changed = True
        result += entity
    return "".join(f"{code}\n{value}\n" for code, value in result) if changed else None


def _mark(entity: Tags) -> Tags:
    """A polyline with the marks of its class."""
    own = next((at for at, (code, _) in enumerate(entity) if code in OF_POLYLINES), len(entity))
    return [entity[0], ("100", "AcDbEntity"), *entity[1:own], ("100", "AcDbPolyline"), *entity[own:]]


def _age(entity: Tags) -> Tags:
    """A polyline as old versions have it: with its vertices after it."""
    head = [("0", "POLYLINE"), ("66", "1")]
    vertices: Tags = []
    for code, value in entity[1:]:
        if code == "10":
            vertices += [("0", "VERTEX"), ("8", "0"), (code, value)]
        elif code in ("20", "42") and vertices:
            vertices.append((code, value))
        elif code == "38":
            head += [("10", "0"), ("20", "0"), ("30", value)]
        elif code in ("8", "70", "210", "220", "230"):
            head.append((code, str(int(value) & 1) if code == "70" else value))
    return [*head, *vertices, ("0", "SEQEND")]


def _read_entity(entity: Any, kind: str) -> tuple[list[Leg] | None, bool]:
    """The legs of an entity, none of zero length, or None if it lies in another plane; and whether it has heights."""
    if kind == "LINE":
        ends = [entity.dxf.start, entity.dxf.end]
        return _chain([(complex(point.x, point.y), 0.0) for point in ends]), any(point.z != 0 for point in ends)
    if kind == "POLYLINE" and entity.is_3d_polyline:
        points = [vertex.dxf.location for vertex in _list_drawn(entity)]
        if entity.is_closed and points:
            points.append(points[0])
        return _chain([(complex(point.x, point.y), 0.0) for point in points]), any(point.z != 0 for point in points)
    if kind == "POLYLINE" and not entity.is_2d_polyline:
        return None, False
    normal = entity.dxf.extrusion
    if abs(normal.x) > 1e-9 or abs(normal.y) > 1e-9:
        return None, False
    # An entity seen from below is the mirror image of what its own numbers say.
    mirrored = normal.z < 0
    vertices = _list_vertices(entity, kind)
    if kind in ("LWPOLYLINE", "POLYLINE"):
        lifted = float(entity.dxf.get("elevation", 0.0) if kind == "LWPOLYLINE" else entity.dxf.elevation.z) != 0
    else:
        lifted = entity.dxf.center.z != 0
    if mirrored:
        vertices = [(complex(-point.real, point.imag), -bulge) for point, bulge in vertices]
    return _chain(vertices), lifted


def _list_vertices(entity: Any, kind: str) -> list[tuple[complex, float]]:
    """Points, each with the bulge to the next one: the tangent of a quarter of the angle that the arc turns through."""
    if kind in ("ARC", "CIRCLE"):
        center, radius = complex(entity.dxf.center.x, entity.dxf.center.y), float(entity.dxf.radius)
        if radius == 0:
            return []
        if not radius > 0:
            raise ValueError(f"a radius of {radius:g}")
        first = float(entity.dxf.start_angle) if kind == "ARC" else 0.0
        turn = _turn(first, float(entity.dxf.end_angle)) if kind == "ARC" else 360.0
        parts = max(1, math.ceil(turn * QUARTERS / 360 - 1e-9))
        bulge = math.tan(math.radians(turn / parts) / 4)
        points = [center + radius * cmath.rect(1.0, math.radians(first + turn * k / parts)) for k in range(parts + 1)]
        if turn == 360:
            points[-1] = points[0]
        return [(point, bulge) for point in points]
    if kind == "LWPOLYLINE":
        vertices = [(complex(x, y), float(bulge)) for x, y, bulge in entity.get_points("xyb")]
    else:
        vertices = [
            (complex(vertex.dxf.location.x, vertex.dxf.location.y), float(vertex.dxf.get("bulge", 0.0)))
            for vertex in _list_drawn(entity)
        ]
    closed = entity.closed if kind == "LWPOLYLINE" else entity.is_closed
    if closed and vertices:
        vertices.append((vertices[0][0], 0.0))
    return vertices


def _list_drawn(entity: Any) -> list[Any]:
    """The vertices that a polyline (POLYLINE) runs through: those that a spline was drawn to are only its frame."""
    return [vertex for vertex in entity.vertices if not int(vertex.dxf.get("flags", 0)) & FRAME]


def _turn(first: float, last: float) -> float:
    """Degrees from one angle on counter-clockwise to another; 360 where they are the same but for their rounding."""
    turn = (last - first) % 360
    rounding = 2 * max(math.ulp(first), math.ulp(last))
    return 360.0 if min(turn, 360 - turn) <= rounding else turn


def _chain(vertices: Sequence[tuple[complex, float]]) -> list[Leg]:
    legs = []
    for (start, bulge), (end, _) in itertools.pairwise(vertices):
        turn = 4 * math.atan(bulge)
        if start == end:
            continue
        plain = Leg(start, end, 1)
        legs.append(plain if abs(bulge) < 1e-9 else _bend(start, end, turn))
    return legs


def _bend(start: complex, end: complex, turn: float) -> Leg:
    """The arc between two points that turns through an angle (radians)."""
    return Leg(0j, 0j, 1, center=0j, sweep=turn).tie(start, end)


def _list_numbers(leg: Leg) -> list[float]:
    return [number for point in (leg.start, leg.end) for number in (point.real, point.imag)] + [leg.length]
