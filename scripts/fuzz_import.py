"""Seeded mutants of maps and meshes: `pbem import` gives a case that `pbem check` accepts, or a message with a place.

    python scripts/fuzz_import.py [--count N] [--seed S] [--keep FOLDER] [--seconds 20]

Prints what went wrong and the counts of both ends; the exit code is 1 if anything did.
"""

from __future__ import annotations

import argparse
import cmath
import contextlib
import io
import itertools
import json
import math
import random
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path

from pbem.cli import main as run_command

Line = list[list[float]]


def draw_map(r: random.Random) -> list[Line]:
    """Random polylines in a box, some with arms that end on others."""
    extent = 10.0 ** r.uniform(-3, 4)
    lines = []
    for _ in range(r.choice((1, 2, 5, 12, 25))):
        x, y, angle = r.uniform(0, extent), r.uniform(0, extent), r.uniform(0, 2 * math.pi)
        line = [[x, y]]
        for _ in range(r.randint(1, 6)):
            angle += r.gauss(0, 0.4)
            step = extent * r.uniform(0.03, 0.3)
            x, y = x + step * math.cos(angle), y + step * math.sin(angle)
            line.append([x, y])
        lines.append(line)
    return lines


def measure(lines: Sequence[Line]) -> float:
    """The extent of lines."""
    numbers = [number for line in lines for point in line for number in point[:2]]
    return max(numbers) - min(numbers) or 1.0


def stack(r: random.Random, lines: list[Line]) -> None:
    """One trace on another, whole or in part, exactly or nearly, there or back."""
    line = r.choice(lines)
    copy = [list(point) for point in line]
    off = r.choice((0.0, 1e-12, 1e-6, 1e-4)) * measure(lines)
    copy = [[x + off * r.uniform(-1, 1), y + off * r.uniform(-1, 1)] for x, y, *_ in copy]
    if r.random() < 0.5:
        copy.reverse()
    if r.random() < 0.4:
        (x, y), (u, v) = copy[0][:2], copy[1][:2]
        copy[0] = [x + 0.3 * (u - x), y + 0.3 * (v - y)]
    lines.append(copy)


def touch(r: random.Random, lines: list[Line]) -> None:
    """A trace that all but ends on another one, or pokes through it."""
    line = r.choice(lines)
    number = r.randrange(len(line) - 1)
    a, b = complex(*line[number][:2]), complex(*line[number + 1][:2])
    t = r.choice((0.0, 1.0, 0.5, r.random()))
    off = r.choice((0.0, 1e-14, 1e-9, 1e-5, 1e-4, 1e-3)) * r.choice((-1, 1)) * measure(lines)
    normal = 1j * (b - a) / (abs(b - a) or 1.0)
    end = a + t * (b - a) + off * normal
    start = end + normal * measure(lines) * r.uniform(0.05, 0.3) * cmath.exp(1j * r.uniform(-1.4, 1.4))
    lines.append([[start.real, start.imag], [end.real, end.imag]])


def close(r: random.Random, lines: list[Line]) -> None:
    """A closed trace, or one that all but closes."""
    line = r.choice(lines)
    off = r.choice((0.0, 0.0, 1e-9, 1e-5)) * measure(lines)
    line.append([line[0][0] + off, line[0][1]])


def cross_itself(r: random.Random, lines: list[Line]) -> None:
    """A trace like an eight, or a star."""
    size = measure(lines) * r.uniform(0.02, 0.3)
    x, y = r.choice(lines)[0][:2]
    count, skip = r.choice(((5, 2), (7, 3), (4, 1), (6, 1)))
    lines.append([
        [x + size * math.cos(2 * math.pi * skip * k / count), y + size * math.sin(2 * math.pi * skip * k / count)]
        for k in range(count + 1)
    ])


def double(r: random.Random, lines: list[Line]) -> None:
    """Vertices twice, or nearly."""
    line = r.choice(lines)
    number = r.randrange(len(line))
    off = r.choice((0.0, 0.0, 1e-12, 1e-7)) * measure(lines)
    for _ in range(r.randint(1, 3)):
        line.insert(number, [line[number][0] + off, line[number][1]])


def shrink(r: random.Random, lines: list[Line]) -> None:
    """A trace without length, or nearly."""
    x, y = r.choice(lines)[0][:2]
    off = r.choice((0.0, 1e-12, 1e-6)) * measure(lines)
    lines.append([[x, y], [x + off, y]])


def star(r: random.Random, lines: list[Line]) -> None:
    """Several traces through all but one point."""
    x, y = r.choice(lines)[0][:2]
    size = measure(lines) * 0.1
    for _ in range(r.randint(2, 5)):
        angle, off = r.uniform(0, math.pi), size * r.choice((0.0, 1e-5, 1e-3))
        u, v = size * math.cos(angle), size * math.sin(angle)
        lines.append([[x - u + off * r.random(), y - v], [x + u, y + v + off * r.random()]])


def double_back(r: random.Random, lines: list[Line]) -> None:
    """A trace that goes back on itself."""
    line = r.choice(lines)
    line.append([0.5 * (a + b) for a, b in zip(line[-1], line[-2], strict=False)])


def shift(r: random.Random, lines: list[Line]) -> None:
    """Far from the origin."""
    by = measure(lines) * 10.0 ** r.uniform(0, 9)
    for line in lines:
        for point in line:
            point[0] += by
            point[1] -= 0.7 * by


def enlarge(r: random.Random, lines: list[Line]) -> None:
    """Other units, and coordinates that are too large."""
    by = 10.0 ** r.choice((-12, -6, 6, 12, 90, 300))
    for line in lines:
        for point in line:
            point[:] = [value * by for value in point]


def lift(r: random.Random, lines: list[Line]) -> None:
    """Heights."""
    for line in lines:
        for point in line:
            point.append(r.uniform(0, 100))


def cut_short(r: random.Random, lines: list[Line]) -> None:
    """Lines of one point or none."""
    lines.append([r.choice(lines)[0]][: r.randint(0, 1)])


MUTATIONS: tuple[Callable[[random.Random, list[Line]], None], ...] = (
    stack, stack, touch, touch, touch, close, cross_itself, double, shrink, star, double_back, shift, enlarge, lift,
    cut_short,
)  # fmt: skip
WRONG = (math.nan, math.inf, -math.inf, None, "12", "x", True, [], {}, 10**400, -0.0)


def write_geojson(r: random.Random, lines: list[Line]) -> str:
    """Features of one line or several, with names or without, now and then with a wrong value."""
    features: list[object] = []
    names = r.choice(("none", "id", "same", "odd"))
    for number, line in enumerate(lines):
        kind, coordinates = "LineString", list(line)
        if r.random() < 0.15:
            kind, coordinates = "MultiLineString", [line, r.choice(lines)]  # type: ignore[list-item]
        name = {"none": {}, "id": {"id": number}, "same": {"id": 3}, "odd": {"name": f"t{number}.1 \"é'"}}[names]
        features.append({"type": "Feature", "properties": name,
                         "geometry": {"type": kind, "coordinates": coordinates}})
    for _ in range(r.choice((0,) * 8 + (1, 2))):
        features.append(r.choice((
            None, {"type": "Feature", "geometry": None}, {"type": "Feature", "properties": 4, "geometry": {}},
            {"type": "Feature", "geometry": {"type": "Point", "coordinates": [1, 2]}},
            {"type": "Feature", "geometry": {"type": "LineString", "coordinates": [[1, 2], [3, r.choice(WRONG)]]}},
            {"type": "Feature", "geometry": {"type": "LineString", "coordinates": r.choice(WRONG)}},
        )))
    data: object = {"type": r.choice(("FeatureCollection",) * 30 + ("Topology",)), "features": features}
    return json.dumps(data)


def write_csv(r: random.Random, lines: list[Line]) -> str:
    """Rows of ends or of vertices, with a header or none, now and then with a wrong value."""
    delimiter = r.choice((",", ",", ";", "\t", " "))
    rows: list[list[object]] = []
    if r.random() < 0.5:
        rows += [["x1", "y1", "x2", "y2"]] if r.random() < 0.5 else []
        rows += [[*a[:2], *b[:2]] for line in lines for a, b in itertools.pairwise(line)]
    else:
        rows += [["id", "x", "y"]] if r.random() < 0.5 else []
        rows += [[number, *point[:2]] for number, line in enumerate(lines) for point in line]
    if r.random() < 0.15 and rows:
        row = r.choice(rows)
        row[r.randrange(len(row))] = r.choice(WRONG)
    if r.random() < 0.05 and rows:
        r.choice(rows).pop()
    return "\n".join(delimiter.join(map(str, row)) for row in rows)


def write_dxf(r: random.Random, lines: list[Line]) -> str:
    """A minimal drawing of lines, polylines with bulges, arcs and circles."""
    parts = ["0", "SECTION", "2", "ENTITIES"]

    def add(*pairs: object) -> None:
        parts.extend(str(each) for each in pairs)

    for line in lines:
        kind = r.choice(("LINE", "POLY", "ARC", "CIRCLE", "TEXT"))
        if kind == "LINE":
            for a, b in itertools.pairwise(line):
                add(0, "LINE", 8, "0", 10, a[0], 20, a[1], 11, b[0], 21, b[1])
        elif kind == "POLY":
            add(0, "POLYLINE", 8, "0", 66, 1, 70, r.choice((0, 1)))
            for point in line:
                bulge = r.choice((0.0, 0.0, 0.3, -1.0, 1e-12, 50.0))
                add(0, "VERTEX", 8, "0", 10, point[0], 20, point[1], 42, bulge)
            add(0, "SEQEND")
        elif kind == "TEXT":
            add(0, "TEXT", 8, "0", 10, 0, 20, 0, 40, 1, 1, "note")
        elif line:
            add(0, kind, 8, "0", 10, line[0][0], 20, line[0][1], 40, measure(lines) * r.choice((0.1, 0.1, 0.0, 1e-9)))
            if kind == "ARC":
                add(50, r.uniform(0, 360), 51, r.choice((r.uniform(0, 360), 0.0, 1e-9)))
    add(0, "ENDSEC", 0, "EOF")
    return "\n".join(parts) + "\n"


def write_msh(r: random.Random, lines: list[Line]) -> str:
    """A mesh of a rectangle of two materials, version 2.2, turned and moved; now and then a number is changed."""
    columns, rows = r.randint(1, 5), r.randint(2, 6)
    place, turn = complex(*lines[0][0][:2]) if lines[0] else 0j, cmath.exp(1j * r.choice((0.0, 0.0, r.uniform(0, 6))))
    size = measure([line for line in lines if line])
    nodes = [(i, j) for j in range(rows + 1) for i in range(columns + 1)]
    tags = {node: number for number, node in enumerate(nodes, 1)}
    half = rows // 2
    elements = []
    for j in range(rows):
        for i in range(columns):
            corners = [tags[at] for at in ((i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1))]
            elements.append([3, 2, 1 + (j >= half), 1 + (j >= half), *corners])
    for j, group in ((0, 1), (half, 2), (rows, 3)):
        if r.random() < 0.8:
            elements += [[1, 2, group, group, tags[i, j], tags[i + 1, j]] for i in range(columns)]
    text = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$Nodes", str(len(nodes))]
    for node in nodes:
        z = place + turn * size * complex(node[0] / columns, node[1] / rows)
        text.append(f"{tags[node]} {z.real!r} {z.imag!r} 0")
    text += ["$EndNodes", "$Elements", str(len(elements))]
    text += [" ".join(map(str, [number, *element])) for number, element in enumerate(elements, 1)]
    text.append("$EndElements")
    if r.random() < 0.3:
        number = r.randrange(len(text))
        words = text[number].split()
        words[r.randrange(len(words))] = str(r.choice((0, -1, 7, 3.5, "nan", "1e400", "x", 99999999)))
        text[number] = " ".join(words)
    return "\n".join(text) + "\n"


WRITERS: dict[str, Callable[[random.Random, list[Line]], str]] = {
    ".geojson": write_geojson, ".csv": write_csv, ".dxf": write_dxf, ".msh": write_msh,
}


def make_mutant(seed: int) -> tuple[str, bytes, list[str]]:
    """Ending and content of a file, and options for its import."""
    r = random.Random(seed)
    lines = draw_map(r)
    for _ in range(r.randint(0, 5)):
        mutation = r.choice(MUTATIONS)
        usable = [line for line in lines if len(line) > 1]
        others = [line for line in lines if len(line) <= 1]
        with contextlib.suppress(OverflowError):
            mutation(r, usable)
        lines = usable + others
    kind = r.choices(list(WRITERS), (5, 3, 2, 1))[0]
    content = WRITERS[kind](r, lines).encode()
    if r.random() < 0.06:
        content = r.choice((
            b"", b"\n \n", content[: r.randrange(len(content) + 1)], bytes(r.randrange(256) for _ in range(300)),
            content.replace(b"0", b"\0", 3), b"\xff\xfe" + content, content.replace(b",", b",,", 2),
        ))
    options = []
    if kind != ".msh":
        for option, values in (("--snap", (0, 1e-3, 0.05)), ("--simplify", (0, 1e-3, 0.02)), ("--size", (0.05, 0.3))):
            if r.random() < 0.25:
                with contextlib.suppress(ValueError, OverflowError):
                    value = r.choice(values) * measure([line for line in lines if line])
                    options += [option, repr(value)]
    return kind, content, options


def call(*arguments: str) -> tuple[int, str]:
    """Exit code and all that is printed."""
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        code = run_command(arguments)
    return code, said.getvalue()


def try_mutant(seed: int, folder: Path) -> tuple[str, str]:
    """How it ended, "accepted", "refused" or "wrong", and what was said."""
    kind, content, options = make_mutant(seed)
    file, case = folder / f"map_{seed}{kind}", folder / f"case_{seed}.toml"
    file.write_bytes(content)
    case.unlink(missing_ok=True)
    code, said = call("import", str(file), "-o", str(case), *options)
    if code == 2:
        right = not case.exists() and "found" in said and "expected" in said and "Traceback" not in said
        return ("refused" if right else "wrong"), said
    if code:
        return "wrong", said
    code, checked = call("check", str(case))
    right = code == 0
    return ("accepted" if right else "wrong"), f"{said}\n{checked}"


def run_seeds(
    description: str | None, try_seed: Callable[[int, Path], tuple[str, str]], name_seed: Callable[[int], str]
) -> int:
    """Try the seeds that the command line asks for, and print what was wrong; returns the exit code.

    try_seed: "accepted", "refused" or "wrong", and what was said; name_seed: what the file of a seed is.
    """
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=500)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--keep", metavar="FOLDER", help="where the files go")
    parser.add_argument("--seconds", type=float, default=20.0, help="of the processor that one may take")
    options = parser.parse_args()
    counts: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(options.keep or temporary)
        folder.mkdir(parents=True, exist_ok=True)
        for seed in range(options.seed, options.seed + options.count):
            begin = time.process_time()
            end, said = try_seed(seed, folder)
            took = time.process_time() - begin
            if took > options.seconds:
                end, said = "wrong", f"{said}\n{took:.0f} s"
            counts[end] += 1
            if end == "wrong":
                print(f"--- seed {seed}: {name_seed(seed)}\n{said[-1500:]}", flush=True)
    print(dict(counts))
    return 1 if counts["wrong"] else 0


def _name_mutant(seed: int) -> str:
    kind, _, options = make_mutant(seed)
    return " ".join([kind, *options])


if __name__ == "__main__":
    sys.exit(run_seeds(__doc__, try_mutant, _name_mutant))
