"""Tables of text: a row x1,y1,x2,y2 for each trace, or a row id,x,y for each vertex."""

from __future__ import annotations

import csv
import math
import re
from pathlib import Path

from pbem.geometry.shape import LARGEST
from pbem.importing.reading import Reading, Trace, choose_names, draw_line, fail
from pbem.wording import list_names, show

DELIMITERS = ",;\t|"
# Names of columns, in small letters.
SEGMENT = ("x1", "y1", "x2", "y2")
IDENTITIES = ("id", "name", "trace", "fid", "trace_id", "line")
# Columns that number the vertices of a trace, and its parts, as geographic information systems write them.
ORDERS = ("order", "seq", "sequence", "vertex", "vertex_id", "vertex_index", "point_order")
PARTS = ("part", "part_id", "vertex_part")
# Words in names of columns that hold the coordinates of one axis.
AXES = {"x": {"x", "east", "easting", "lon", "longitude"}, "y": {"y", "north", "northing", "lat", "latitude"}}
EXPECTED = "rows x1,y1,x2,y2 or id,x,y, with or without a header that names them"


def read_csv(path: Path, text: str) -> Reading:
    """The traces of a file. Raises CaseError with all its faults."""
    reading = Reading()
    rows = _split(text)
    if not rows:
        reading.blame("the file", "no rows", EXPECTED)
        raise fail(path, reading.faults)
    header = [cell.lower() for cell in rows[0][1]]
    columns = _read_header(header)
    by_position = columns is None and len(rows) > 1 and not _is_data(rows[0][1]) and _is_data(rows[1][1])
    if by_position and len(rows[0][1]) == len(rows[1][1]) and _agrees(header):
        named = list_names([show(cell) for cell in rows[0][1]])
        reading.notes.append(f"Columns {named} are taken as {'x1, y1, x2, y2' if len(header) == 4 else 'id, x, y'}.")
        rows = rows[1:]
    elif columns is None and not _is_data(rows[0][1]):
        found = f"columns {list_names([show(cell) for cell in rows[0][1]])}"
        reading.blame(f"line {rows[0][0]}", found, EXPECTED)
        raise fail(path, reading.faults)
    if columns is not None:
        if "order" in columns and not _numbers_all(rows[1:], columns["order"]):
            del columns["order"]  # something else is meant
        _tell_unread(rows[0][1], columns, reading)
        width, rows = len(header), rows[1:]
    else:
        width = len(rows[0][1])
        columns = {len(SEGMENT): dict(zip(SEGMENT, range(4), strict=True)), 3: {"id": 0, "x": 1, "y": 2}}[
            width
        ]
    for line, cells in rows:
        if len(cells) > width:
            # Of a decimal comma, for example.
            reading.blame(f"line {line}", f"a row of {len(cells)}", f"{width} columns, as before")
    if "x1" in columns:
        _read_segments(rows, columns, reading)
    else:
        _read_vertices(rows, columns, reading)
    if reading.faults:
        raise fail(path, reading.faults)
    return reading


def _split(text: str) -> list[tuple[int, list[str]]]:
    """Number of the line, and cells, of every row that has any."""
    lines = text.splitlines()
    sample = [line for line in lines[:50] if line.strip() and not line.lstrip().startswith("#")]
    # Of a decimal comma, the other one parts the cells.
    order = ";\t|," if any(";" in line or "\t" in line for line in sample) else DELIMITERS
    delimiter = next((each for each in order if sample and all(each in line for line in sample)), None)
    rows = []
    for number, line in enumerate(lines, 1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        if delimiter is None:
            cells = line.split()
        else:
            cells = [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter))]
            while len(cells) > 3 and not cells[-1]:
                cells.pop()
        if delimiter not in (None, ","):
            cells = [cell.replace(",", ".") if cell.count(",") == 1 else cell for cell in cells]
        rows.append((number, cells))
    return rows


def _read_header(names: list[str]) -> dict[str, int] | None:
    """Numbers of the columns that are needed, or None if the row names none."""
    places = {name.strip().lstrip("\ufeff"): number for number, name in reversed(list(enumerate(names)))}
    identity = next((places[name] for name in IDENTITIES if name in places), None)
    if all(name in places for name in SEGMENT):
        columns = {name: places[name] for name in SEGMENT}
        return columns if identity is None else {**columns, "id": identity}
    if identity is not None and "x" in places and "y" in places:
        columns = {"id": identity, "x": places["x"], "y": places["y"]}
        for key, known in (("order", ORDERS), ("part", PARTS)):
            found = next((places[name] for name in known if name in places), identity)
            if found != identity:
                columns[key] = found
        return columns
    return None


def _numbers_all(rows: list[tuple[int, list[str]]], column: int) -> bool:
    """Whether a column has a number in every row."""
    return all(column < len(cells) and _parse(cells[column]) is not None for _, cells in rows)


def _tell_unread(names: list[str], columns: dict[str, int], reading: Reading) -> None:
    """Say which columns are not read."""
    others = [show(name) for number, name in enumerate(names) if number not in columns.values() and name]
    if others:
        reading.notes.append(f"Columns that are not read: {list_names(others)}.")


def _agrees(names: list[str]) -> bool:
    """Whether no name says that its column holds coordinates of another axis than its position does."""
    axes = ("x", "y", "x", "y") if len(names) == 4 else (None, "x", "y")
    for name, axis in zip(names, axes, strict=True):
        words = set(re.findall("[a-z]+", name))
        told = [each for each, known in AXES.items() if words & known]
        if len(told) == 1 and told[0] != axis:
            return False
    return True


def _is_data(cells: list[str]) -> bool:
    """Whether a first row can be one of data: four numbers, or a name and two of them."""
    if len(cells) == 4:
        return any(_parse(cell) is not None for cell in cells)
    return len(cells) == 3 and any(_parse(cell) is not None for cell in cells[1:])


def _parse(cell: str) -> float | None:
    try:
        # Python's own numbers may have underlines, which no table has.
        return None if "_" in cell else float(cell)
    except ValueError:
        return None


def _read_cell(cells: list[str], column: int, key: str, line: int, reading: Reading) -> float | None:
    place = f"line {line}, {key}"
    if column >= len(cells):
        reading.blame(place, f"a row of {len(cells)}", f"{column + 1} columns or more")
        return None
    value = _parse(cells[column])
    if value is None or not math.isfinite(value) or abs(value) > LARGEST:
        expected = "a number" if value is None else f"a finite number of at most {LARGEST:g}"
        reading.blame(place, show(cells[column]), expected)
        return None
    return value


def _read_segments(rows: list[tuple[int, list[str]]], columns: dict[str, int], reading: Reading) -> None:
    found: list[tuple[int, str | None, complex, complex]] = []
    for line, cells in rows:
        x1, y1, x2, y2 = (_read_cell(cells, columns[key], key, line, reading) for key in SEGMENT)
        name = cells[columns["id"]] if "id" in columns and columns["id"] < len(cells) else None
        if None not in (x1, y1, x2, y2):
            assert x1 is not None and y1 is not None and x2 is not None and y2 is not None
            found.append((line, name, complex(x1, y1), complex(x2, y2)))
    names = choose_names({"id": [name for _, name, _, _ in found]}, len(found), reading)
    for name, (line, _, start, end) in zip(names, found, strict=True):
        reading.traces.append(Trace(name, f"line {line}", (draw_line([start, end]),)))


def _check_order(along: list[tuple[int, float]], reading: Reading) -> None:
    """Blame the last of the vertices of a part, by line and number, where the numbers turn back: a trace may have been
    drawn from either end."""
    if len(along) > 2 and (along[1][1] - along[0][1]) * (along[2][1] - along[1][1]) < 0:
        (line, number), before = along[2], along[1][1]
        reading.blame(f"line {line}, order", f"{number:g} after {before:g}", "vertices in order along a trace")


def _read_vertices(rows: list[tuple[int, list[str]]], columns: dict[str, int], reading: Reading) -> None:
    """Successive rows of one name, and of one part if there is a column of these, are a part of its trace."""
    parts: dict[str, list[tuple[int, list[complex]]]] = {}
    last, last_part = None, ""
    along: list[tuple[int, float]] = []  # lines and order of the present part's vertices
    for line, cells in rows:
        x, y = (_read_cell(cells, columns[key], key, line, reading) for key in ("x", "y"))
        name = cells[columns["id"]] if columns["id"] < len(cells) else ""
        part = cells[columns["part"]] if "part" in columns and columns["part"] < len(cells) else ""
        along = along if (name, part) == (last, last_part) else []
        number = _read_cell(cells, columns["order"], "order", line, reading) if "order" in columns else None
        if number is not None:
            _check_order([*along[-2:], (line, number)], reading)
            if not along or number != along[-1][1]:
                along.append((line, number))
        if not name or not name.isprintable():
            reading.blame(f"line {line}, id", show(name), "the name of a trace")
        if x is None or y is None:
            continue
        if (name, part) != (last, last_part):
            if name in parts and name != last:
                reading.notes.append(f"Line {line}: '{name}' comes back after another trace, as a further part of it.")
            parts.setdefault(name, []).append((line, []))
        parts[name][-1][1].append(complex(x, y))
        last, last_part = name, part
    for name, pieces in parts.items():
        for line, points in pieces:
            if len(points) < 2:
                reading.left_out.append(f"line {line}: '{name}' has one point")
        legs = tuple(draw_line(points) for _, points in pieces if len(points) > 1)
        if legs:
            reading.traces.append(Trace(name, f"line {pieces[0][0]}", legs))
