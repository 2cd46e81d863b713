#!/usr/bin/env python3
"""Bodies and cracks that are connected: products and iterations of GMRES, also over those without what serves them.

    [mpirun -n 2] .venv/bin/python scripts/bench_connected.py [--models beam layers masonry] [--size 1.0] [--alone]
    [mpirun -n 2] .venv/bin/python scripts/bench_connected.py --models --traces KB11_traces.geojson [--count 150]

Models, all with the hierarchical operator: a beam of 1:50 that is held at one end; 40 layers of 10 x 0.3 with friction
between them, pressed and then sheared; a wall of 20 x 20 bricks in running bond with friction in all joints, by its
weight, pressed and then sheared. --size scales their numbers. Traces: the middle of a map, each trace cut into 1, 4 and
16 pieces of equal length. The runs that are compared with have no factors of all bodies together (-pbem_newton_bodies
0); --alone leaves these out.

A line for each run: unknowns, Newton's iterations, the most and all iterations of GMRES, products, seconds of this
rank's processor; the last ones also over those of the run without, and of maps over those of whole
traces; pairs whose status differs from the other run's.
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import pbem
from pbem.parallel import world
from pbem.solve.problem.step import Iteration, SilentReporter

PIECES = (1, 4, 16)
HELD = "{ ux = 0.0, uy = 0.0 }"
FRICTION = '{ law = "coulomb", friction = '


def write_beam(size: float) -> str:
    """A beam of length 50 and height 1, loaded on its upper side."""
    count, lines = round(400 * size), []
    for name, a, b, elements in (
        ("bottom", (0, 0), (50, 0), count), ("right", (50, 0), (50, 1), 8), ("top", (50, 1), (0, 1), count),
        ("left", (0, 1), (0, 0), 8),
    ):
        lines.append(f'curves.{name} = {{ points = [{list(a)}, {list(b)}], elements = {elements}, grading = "none" }}')
    return "\n".join(["materials.steel = { young = 1000.0, poisson = 0.3 }", *lines,
                      'regions.beam = { material = "steel", boundary = ["bottom", "right", "top", "left"] }',
                      f"boundary = {{ left = {HELD}, top = {{ ty = -0.001 }} }}", "analysis.steps = 1", ""])


def write_layers(size: float) -> str:
    """Layers of 10 x 0.3 on each other, of which the lowest is held."""
    count, width, height = round(40 * size), 10.0, 0.3
    lines = ["materials.rock = { young = 1000.0, poisson = 0.25 }"]

    def add_curve(name: str, a: tuple[float, float], b: tuple[float, float], elements: int) -> None:
        lines.append(f'curves.{name} = {{ points = [{list(a)}, {list(b)}], elements = {elements}, grading = "none" }}')

    for k in range(count + 1):
        add_curve(f"s{k}", (0.0, k * height), (width, k * height), 24)
    for k in range(count):
        add_curve(f"l{k}", (0.0, (k + 1) * height), (0.0, k * height), 2)
        add_curve(f"r{k}", (width, k * height), (width, (k + 1) * height), 2)
        lines.append(f'regions.a{k} = {{ material = "rock", boundary = ["s{k}", "r{k}", "s{k + 1}", "l{k}"] }}')
    lines += [f"interfaces.s{k} = {FRICTION}0.5 }}" for k in range(1, count)]
    return "\n".join([*lines, f"boundary.s0 = {HELD}", *_write_stages([f"s{count}"], 0.2 * math.sqrt(40 / count)), ""])


def write_wall(size: float) -> str:
    """Bricks of 1 x 0.5 in rows, each second row begins with half a brick's shift."""
    count, length, height, elements = round(20 * size), 1.0, 0.5, 4
    rows = [[float(i) for i in range(count + 1)] if j % 2 == 0 else
            [0.0, *(i + 0.5 for i in range(count)), float(count)] for j in range(count)]
    lines = ["materials.brick = { young = 1000.0, poisson = 0.2, density = 0.05 }", "gravity.gy = -1.0"]

    def add_curve(name: str, a: list[float], b: list[float], joint: bool) -> None:
        number = max(1, round(elements * max(abs(b[0] - a[0]), abs(b[1] - a[1])) / length))
        lines.append(f'curves.{name} = {{ points = [{a}, {b}], elements = {number}, grading = "none" }}')
        if joint:
            lines.append(f"interfaces.{name} = {FRICTION}0.6 }}")

    places = []
    for j in range(count + 1):
        ends = sorted({x for row in rows[max(j - 1, 0) : j + 1] for x in row})
        places.append(ends)
        for i, (a, b) in enumerate(itertools.pairwise(ends)):
            add_curve(f"h{j}_{i}", [a, j * height], [b, j * height], 0 < j < count)
    for j, row in enumerate(rows):
        for i, x in enumerate(row):
            add_curve(f"v{j}_{i}", [x, j * height], [x, (j + 1) * height], 0 < i < len(row) - 1)
        for i, (a, b) in enumerate(itertools.pairwise(row)):
            low, up = ([f"h{k}_{n}" for n, x in enumerate(places[k][:-1]) if a <= x < b] for k in (j, j + 1))
            lines.append(f'regions.b{j}_{i} = {{ material = "brick", boundary = '
                         f'{json.dumps([*low, f"v{j}_{i + 1}", *reversed(up), f"v{j}_{i}"])} }}')
    top = [f"h{count}_{i}" for i in range(len(places[count]) - 1)]
    lines += [f"boundary.h0_{i} = {HELD}" for i in range(len(places[0]) - 1)]
    return "\n".join([*lines, *_write_stages(top, 0.3), ""])


def _write_stages(top: list[str], shear: float) -> list[str]:
    """Pressed by 1, then sheared as well."""
    lines = []
    for load in ("ty = -1.0", f"tx = {shear!r}"):
        lines += ["[[stages]]", "steps = 1", *(f"[stages.boundary.{name}]\n{load}" for name in top)]
    return lines


MODELS = {"beam": write_beam, "layers": write_layers, "masonry": write_wall}


def cut_traces(path: Path, count: int, pieces: int) -> dict[str, object]:
    """GeoJSON of about so many traces in the middle of a map, each in pieces of equal length."""
    features = json.loads(path.read_text())["features"]
    lines = [np.array(each["geometry"]["coordinates"])[:, :2] for each in features]
    ends = np.concatenate(lines)
    middle, half = (ends.max(axis=0) + ends.min(axis=0)) / 2, np.ptp(ends, axis=0) / 2
    reach = np.array([(np.abs(line - middle) / half).max() for line in lines])
    made = []
    for k in np.sort(np.argsort(reach, kind="stable")[:count]):
        line = lines[k]
        along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
        cuts = np.linspace(0.0, along[-1], pieces + 1)
        for a, b in itertools.pairwise(cuts):
            at = np.concatenate([[a], along[(along > a * (1 + 1e-9)) & (along < b * (1 - 1e-9))], [b]])
            points = np.stack([np.interp(at, along, line[:, axis]) for axis in (0, 1)], axis=1)
            geometry = {"type": "LineString", "coordinates": points.tolist()}
            made.append({"type": "Feature", "properties": {}, "geometry": geometry})
    return {"type": "FeatureCollection", "features": made}


def make_map_case(path: Path, folder: Path, count: int, pieces: int, length: float) -> Path:
    """The case of a cut map, as `pbem import` writes it; what is snapped does not depend on the number of pieces."""
    source, case = folder / f"pieces{pieces}.geojson", folder / f"pieces{pieces}.toml"
    source.write_text(json.dumps(cut_traces(path, count, pieces)))
    subprocess.run([sys.executable, "-m", "pbem", "import", str(source), "-o", str(case), "--force", "--size",
                    str(length), "--snap", str(1e-3 * length), "--sxx=-5", "--syy=-30", "--young=50000",
                    "--poisson=0.25"], check=True, capture_output=True)  # fmt: skip
    return case


class Counting(SilentReporter):
    """Keeps the iterations of GMRES of every system of Newton's method."""

    def __init__(self) -> None:
        self.linear: list[int] = []

    def iterate(self, iteration: Iteration) -> None:
        self.linear.append(iteration.linear_iterations)


@dataclass(frozen=True)
class Outcome:
    """Of a run: iterations of Newton's method, the most and all of GMRES, products, seconds; modes of all pairs."""

    newton: int
    most: int
    linear: int
    products: int
    seconds: float
    unknowns: int
    modes: NDArray[np.int8]


def run(case: Path, folder: Path, bodies: bool) -> Outcome | None:
    """What a run takes, with factors of all bodies together or without; None but on the first rank."""
    begin, counting = time.process_time(), Counting()
    petsc = {} if bodies else {"newton_bodies": "0"}
    results = pbem.run(case, folder / "run.h5", force=True, operator="hierarchical", reporter=counting, petsc=petsc)
    seconds = time.process_time() - begin
    if world.rank:
        return None
    # Files hold both faces of a crack, with the same unknowns.
    crack = results.elements.crack
    nodes = len(results.nodes.position) * (len(crack) - int(crack.sum()) // 2) // len(crack)
    modes = [np.zeros(0, dtype=np.int8), *(each.mode.ravel() for each in results.contact.values())]
    return Outcome(len(counting.linear), max(counting.linear), sum(counting.linear),
                   int(results.convergence["products"].sum()), seconds, 2 * nodes,
                   np.concatenate(modes))  # fmt: skip


def compare(case: Path, folder: Path, alone: bool, whole: Outcome | None) -> Outcome | None:
    """Print a line. alone: without the run that is compared with; whole: one more of these."""
    plain = None if alone else run(case, folder, False)
    found = run(case, folder, True)
    if found is None:
        return None
    line = (f"{case.stem[:14]:14s}{found.unknowns:9d}{found.newton:8d}{found.most:7d}{found.linear:7d}"
            f"{found.products:10d}{found.seconds:8.1f}")
    if plain is not None:
        line += (f"{found.most / plain.most:9.2f}{found.linear / plain.linear:9.2f}"
                 f"{found.products / plain.products:10.2f}{found.seconds / plain.seconds:8.2f}"
                 f"{int((found.modes != plain.modes).sum()):9d}")
    if whole is not None:
        line += f"   over whole traces: GMRES {found.most / whole.most:.2f}, {found.linear / whole.linear:.2f}"
        line += f"; products {found.products / whole.products:.2f}"
    print(line, flush=True)
    return found


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--models", nargs="*", choices=list(MODELS), default=list(MODELS))
    parser.add_argument("--size", type=float, default=1.0)
    parser.add_argument("--traces", type=Path, help="a map as GeoJSON")
    parser.add_argument("--count", type=int, default=150, help="traces that are taken")
    parser.add_argument("--length", type=float, default=0.7, help="of an element at most")
    parser.add_argument("--pieces", type=int, nargs="+", default=list(PIECES))
    parser.add_argument("--alone", action="store_true")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(world.bcast(name))
        if world.rank == 0:
            over = "" if options.alone else (f"{'most/':>9s}{'GMRES/':>9s}{'products/':>10s}{'cpu/':>8s}"
                                             f"{'statuses':>9s}")
            print(f"{'model':14s}{'unknowns':>9s}{'Newton':>8s}{'most':>7s}{'GMRES':>7s}{'products':>10s}"
                  f"{'cpu s':>8s}{over}")
        for model in options.models:
            case = folder / f"{model}.toml"
            if world.rank == 0:
                case.write_text(MODELS[model](options.size))
            world.Barrier()
            compare(case, folder, options.alone, None)
        whole = None
        for pieces in options.pieces if options.traces else ():
            case = folder / f"pieces{pieces}.toml"
            if world.rank == 0:
                make_map_case(options.traces, folder, options.count, pieces, options.length)
            world.Barrier()
            found = compare(case, folder, options.alone, whole)
            whole = whole or found
        world.Barrier()


if __name__ == "__main__":
    main()
