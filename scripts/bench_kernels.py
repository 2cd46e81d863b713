"""Kernels of order 2 against what they must cost at the least, in one run on one thread.

The reference, per pair of collocation point and element, is one logarithm and one arc tangent and writing the same
bytes into the same memory, written before. The two functions are measured three times: in a loop of C with the flags of
setup.py, in one with -O2 alone (no vector functions), and by NumPy. Points lie on the elements of a circle-like
polygon, circles are arcs, cracks have no traction columns; a field's cracks have eight elements, of which two are tips.
Rows go to memory as a whole and, as when an operator is assembled, again and again into the same piece of the cache.

usage: OMP_NUM_THREADS=1 .venv/bin/python scripts/bench_kernels.py [--elements N] [--repeat N]
"""

from __future__ import annotations

import argparse
import ctypes
import runpy
import subprocess
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray

from pbem.bem.rows import Sources, evaluate_rows
from pbem.mesh.shape_functions import place_crack_nodes, place_nodes

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]

CACHED_BYTES = 2_000_000  # of both arrays of rows together
FUNCTIONS = """
#include <math.h>
#include <stddef.h>
void evaluate(const double *x, const double *y, double *out, size_t n)
{
    for (size_t i = 0; i < n; i++) out[i] = log(x[i]) + atan2(y[i], x[i]);
}
void fill(double *out, size_t n)
{
    for (size_t i = 0; i < n; i++) out[i] = 1.0;
}
"""


def time_best(action: Callable[[], object], repeat: int) -> float:
    """Seconds of the fastest of some runs."""
    best = np.inf
    for _ in range(repeat):
        begin = time.perf_counter()
        action()
        best = min(best, time.perf_counter() - begin)
    return best


def compile_reference(folder: Path, name: str, flags: list[str]) -> ctypes.CDLL:
    """Build the loops above."""
    source, library = folder / f"{name}.c", folder / f"{name}.so"
    source.write_text(FUNCTIONS)
    subprocess.run(["cc", *flags, "-shared", "-fPIC", "-o", str(library), str(source), "-lm"], check=True)
    return ctypes.CDLL(str(library))


def read_build_flags() -> list[str]:
    """The compiler's flags in setup.py."""
    with patch("setuptools.setup"):
        build = runpy.run_path(str(Path(__file__).parents[1] / "setup.py"))
    return ["-O3", *build["select_processor_flags"](), *build["MATH_FLAGS"]]


def point_to(values: Real) -> ctypes.c_void_p:
    return ctypes.c_void_p(values.ctypes.data)


def measure_functions(libraries: dict[str, ctypes.CDLL], repeat: int) -> dict[str, float]:
    """Seconds of one logarithm and one arc tangent, by reference."""
    random = np.random.default_rng(0)
    x, y, out = random.uniform(0.5, 2.0, 4096), random.uniform(-2.0, 2.0, 4096), np.empty(4096)

    def by_numpy() -> None:
        np.log(x, out=out)
        np.arctan2(y, x, out=out)

    count = ctypes.c_size_t(len(x))
    seconds = {
        name: time_best(lambda f=library.evaluate: f(point_to(x), point_to(y), point_to(out), count), 50 * repeat)
        for name, library in libraries.items()
    }
    seconds["NumPy"] = time_best(by_numpy, 50 * repeat)
    return {name: value / len(x) for name, value in seconds.items()}


def measure_writing(library: ctypes.CDLL, pieces: list[list[Real]], repeat: int) -> float:
    """Seconds of writing pieces of arrays one after the other, by the faster of two ways."""

    def by_loop(parts: list[Real]) -> None:
        for part in parts:
            library.fill(point_to(part), ctypes.c_size_t(part.size))

    def by_numpy(parts: list[Real]) -> None:
        for part in parts:
            part.fill(1.0)

    return min(time_pieces([partial(way, parts) for parts in pieces], repeat) for way in (by_loop, by_numpy))


def time_pieces(pieces: list[Callable[[], object]], repeat: int) -> float:
    """Seconds of all pieces in turn, each at its fastest: other work on the machine disturbs short ones less."""
    best = np.full(len(pieces), np.inf)
    for _ in range(repeat):
        for i, piece in enumerate(pieces):
            best[i] = min(best[i], time_best(piece, 1))
    return float(best.sum())


@dataclass(frozen=True)
class Rows:
    """What is measured: rows of some points on all elements. most: the limit of the ratio, if there is one."""

    name: str
    sources: Sources
    point: Complex
    normal: Complex | None
    tractions: bool
    most: float | None = None

    def evaluate(self, own: slice, out: tuple[Real, Real]) -> None:
        """Rows of some of the points, which lie on the elements of the same numbers, in their middle."""
        on = np.arange(own.start, own.stop)
        normal = None if self.normal is None else self.normal[own]
        evaluate_rows(self.sources, self.point[own], on, normal, self.tractions, np.zeros(len(on)), out)


def make_polygon(elements: int) -> Sources:
    """A regular polygon of straight elements."""
    corners = np.exp(2j * np.pi * np.arange(elements + 1) / elements)
    none = np.zeros(elements, dtype=np.int8)
    return Sources(corners[:-1], corners[1:], none, place_nodes(2), 1.8, 1.0, 16.0, crack_local=place_crack_nodes(2))


def make_field(elements: int) -> Sources:
    """Cracks of eight equal elements of length 1/4 at random."""
    random = np.random.default_rng(1)
    cracks = -(-elements // 8)
    middle = np.sqrt(cracks / 0.15) * random.uniform(size=(cracks, 2)) @ [1, 1j]
    direction = np.exp(1j * random.uniform(0, np.pi, cracks))[:, None]
    ends = middle[:, None] + direction * np.linspace(-1, 1, 9)
    family = np.tile(np.array([1, 3, 3, 3, 3, 3, 3, 2], dtype=np.int8), cracks)
    field = Sources(ends[:, :-1].ravel(), ends[:, 1:].ravel(), family, place_nodes(2), 1.8, 1.0, 16.0)
    return replace(field, crack_local=place_crack_nodes(2))


def make_arcs(elements: int, circle: int = 32) -> Sources:
    """Circles of radius 1 at random, of 32 elements each."""
    random = np.random.default_rng(2)
    circles = -(-elements // circle)
    center = np.repeat(np.sqrt(circles * 12.0) * random.uniform(size=(circles, 2)) @ [1, 1j], circle)
    turn = np.tile(np.exp(2j * np.pi * np.arange(circle) / circle), circles)
    sweep = np.full(len(center), 2 * np.pi / circle)
    start, end = center + turn, center + turn * np.exp(1j * sweep)
    return Sources(start, end, np.zeros(len(start), dtype=np.int8), place_nodes(2), 1.8, 1.0, 160.0, center, sweep)


def list_rows(elements: int) -> list[Rows]:
    """All cases, one point on each element."""
    polygon, field, arcs = make_polygon(elements), make_field(elements), make_arcs(elements)
    sides = 0.5 * (polygon.start + polygon.end)
    outward, faces = sides / np.abs(sides), 0.5 * (field.start + field.end)
    tips = replace(polygon, family=np.full(elements, 1, dtype=np.int8))
    assert arcs.center is not None and arcs.sweep is not None
    radius = (arcs.start - arcs.center) * np.exp(0.5j * arcs.sweep)
    across = np.exp(1j * np.angle(field.end - field.start)) * -1j
    return [
        Rows("displacement, with tractions", polygon, sides, None, True, 3.0),
        Rows("displacement, cracks", polygon, sides, None, False, 3.0),
        Rows("traction, with tractions", polygon, sides, outward, True, 4.0),
        Rows("traction, cracks", polygon, sides, outward, False, 4.0),
        Rows("displacement, tip", tips, sides, None, False),
        Rows("traction, tip", tips, sides, outward, False),
        Rows("displacement, field", field, faces, None, False),
        Rows("traction, field", field, faces, across, False),
        Rows("displacement, arc", arcs, arcs.center + radius, None, True),
        Rows("traction, arc", arcs, arcs.center + radius, radius, True),
    ]


def print_table(cases: list[Rows], library: ctypes.CDLL, functions: dict[str, float], cached: bool, n: int) -> None:
    """One line a case: nanoseconds per pair, and the ratio to every reference."""
    print(f"\nrows in {'the cache' if cached else 'memory'}; ns per pair; kernel/(functions + writing) by reference")
    heads = "".join(f"{name:>10s}" for name in functions)
    print(f"{'rows':32s}{'kernel':>8s}{'writing':>9s}{heads}{'limit':>7s}")
    for rows in cases:
        points, width = len(rows.point), 6 * rows.sources.count
        chunk = min(points, max(1, CACHED_BYTES // (4 * 8 * width)))
        begins = range(0, points - chunk + 1, chunk)
        out = [np.zeros((2 * (chunk if cached else points), width)) for _ in range(2)]
        places = [slice(0, 2 * chunk) if cached else slice(2 * begin, 2 * (begin + chunk)) for begin in begins]
        pairs = len(begins) * chunk * rows.sources.count
        calls = [
            partial(rows.evaluate, slice(begin, begin + chunk), (out[0][place], out[1][place]))
            for begin, place in zip(begins, places, strict=True)
        ]
        kernel = time_pieces(calls, n) / pairs
        written = out if rows.tractions else out[:1]
        writing = measure_writing(library, [[part[place] for part in written] for place in places], n) / pairs
        ratios = "".join(f"{kernel / (value + writing):10.2f}" for value in functions.values())
        limit = "" if rows.most is None else f"{rows.most:7.0f}"
        print(f"{rows.name:32s}{kernel * 1e9:8.1f}{writing * 1e9:9.2f}{ratios}{limit}")


def print_small_call(repeat: int) -> None:
    """A block of a hierarchical operator: 100 points on 50 distant elements."""
    polygon = make_polygon(50)
    point, on = 3 + 0.5 * polygon.start.repeat(2), np.full(100, -1)
    out = (np.zeros((200, 300)), np.zeros((200, 300)))
    seconds = time_best(lambda: evaluate_rows(polygon, point, on, None, True, None, out), 100 * repeat)
    one = time_best(lambda: evaluate_rows(polygon, point[:1], on[:1], None, True, None, out), 100 * repeat)
    print(f"\nboth kernels, 100 points x 50 elements: {seconds * 1e6:.0f} us a call, {seconds * 2e5:.1f} ns per pair")
    print(f"1 point x 50 elements: {one * 1e6:.1f} us a call")


def print_near_pairs(cases: list[Rows], repeat: int) -> None:
    """Pairs on or next to each other, which are done by the closed forms."""
    print("\npoints on an element, ns per pair: ", end="")
    for rows in cases:
        element = rows.sources.select(np.array([0]))
        point, on, none = rows.point[:1].repeat(200), np.zeros(200, dtype=int), np.zeros(200)
        normal = None if rows.normal is None else rows.normal[:1].repeat(200)
        out = (np.zeros((400, 6)), np.zeros((400, 6)))
        call = partial(evaluate_rows, element, point, on, normal, rows.tractions, none, out)
        print(f"{rows.name} {time_best(call, 100 * repeat) * 5e6:.0f}", end="; ")
    print()


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--elements", type=int, default=600)
    parser.add_argument("--repeat", type=int, default=7)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        libraries = {
            "C, vector": compile_reference(Path(folder), "vector", read_build_flags()),
            "C, -O2": compile_reference(Path(folder), "scalar", ["-O2"]),
        }
        functions = measure_functions(libraries, options.repeat)
        values = ", ".join(f"{name} {value * 1e9:.2f}" for name, value in functions.items())
        print(f"{options.elements} elements, one point each; order 2\none logarithm and one arc tangent, ns: {values}")
        cases = list_rows(options.elements)
        for cached in (False, True):
            print_table(cases, libraries["C, vector"], functions, cached, options.repeat)
    print_small_call(options.repeat)
    print_near_pairs(cases, options.repeat)


if __name__ == "__main__":
    main()
