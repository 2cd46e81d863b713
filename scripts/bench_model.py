#!/usr/bin/env python3
"""Processor seconds of all before and after the solution, piece by piece, for growing numbers of cracks or inclusions.

    .venv/bin/python scripts/bench_model.py [cracks|inclusions] [--count 250 1000 2000] [--profile PIECE]

Cracks: 8 elements of order 2, 0.1 per unit area, friction; inclusions: circles of 16 arcs that take 0.3 of the area,
held by friction; in an infinite plane. No operator is assembled: the steps that are written hold made-up numbers. After
each column but the first stands the exponent with which the seconds grew: 1 is proportional. A process for each size
tells its peak memory, that of the imports in front.
"""

from __future__ import annotations

import argparse
import contextlib
import cProfile
import io
import json
import math
import os
import pstats
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

STEPS = 5
OPTIONS = {
    "cracks": ["--density", "0.1", "--sxx", "0.3", "--friction", "0.6"],
    "inclusions": ["--fraction", "0.3", "--friction", "0.5"],
}


def measure_peak() -> float:
    """Peak memory of this process, MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


class Clock:
    """Seconds by the names of pieces."""

    def __init__(self, profiled: str | None) -> None:
        self.seconds: dict[str, float] = {}
        self._profiled = profiled

    @contextlib.contextmanager
    def measure(self, piece: str) -> Iterator[None]:
        """Add the time of the block to the piece."""
        profile = cProfile.Profile() if piece == self._profiled else None
        begin = time.process_time()
        if profile:
            profile.enable()
        yield
        if profile:
            profile.disable()
            pstats.Stats(profile, stream=sys.stderr).sort_stats("cumulative").print_stats(35)
        self.seconds[piece] = self.seconds.get(piece, 0.0) + time.process_time() - begin


def make_step(mesh, laws, number: int):
    """A step with numbers that are not zero: every third pair open, the others slipping or sticking in turn."""
    from pbem.mesh.mesh import list_faces
    from pbem.solve.problem.step import ContactState, Iteration, Step

    faces = len(list_faces(mesh).position)
    wave = np.sin(np.arange(faces) + number)
    pairs = np.arange(mesh.pairs.count)
    values = np.cos(pairs + number)
    contact = ContactState(
        mode=(pairs % 3).astype(np.int8), opening=np.abs(values), slip=values, traction_n=-np.abs(values),
        traction_s=values, internal={"slip_path": np.abs(values), "broken": np.zeros(len(pairs), dtype=bool)},
    )  # fmt: skip
    iteration = Iteration(1, 1e-12, 3, *np.bincount(contact.mode, minlength=3).tolist(), seconds=1.0)
    return Step(number, 0, number / STEPS, (iteration,), 1e-12, wave * (1 + 1j), wave * (1 - 1j), contact)


def measure_pieces(kind: str, count: int, folder: Path, profiled: str | None) -> Clock:
    """Go through a run but for its operator and its solutions."""
    from pbem.case import parse_draft, read_case_text
    from pbem.cli import main
    from pbem.contact.anchor import anchor_motions
    from pbem.contact.free_motions import close_nearest_pairs, find_free_motions, find_ties
    from pbem.contact.laws import collect_laws, start_memory
    from pbem.contact.loads import collect_outer_nodes, evaluate_load, find_needed_columns
    from pbem.mesh.generate import generate_mesh
    from pbem.model.build import build_model
    from pbem.model.rigid_body_modes import find_rigid_body_modes
    from pbem.results.describe import describe_results
    from pbem.results.model_text import describe_model
    from pbem.results.plots import plot_model, plot_results
    from pbem.results.reader import open_results
    from pbem.results.writer import ResultWriter

    clock = Clock(profiled)
    file, target = folder / "field.toml", folder / "field.h5"
    with clock.measure("make"), contextlib.redirect_stdout(io.StringIO()):
        main(["make", kind, "-o", str(file), "--count", str(count), "--compact", "--force", "--steps", str(STEPS),
              *OPTIONS[kind]])  # fmt: skip
    with clock.measure("read"):
        case = parse_draft(read_case_text(file)).case
    assert case is not None
    with clock.measure("model"):
        model = build_model(case)
    with clock.measure("mesh"):
        mesh = generate_mesh(model)
    with clock.measure("check"):
        describe_model(model, mesh)
    with clock.measure("check --plot"):
        plot_model(model, mesh, folder / "model.png")
    with clock.measure("laws"):
        laws = collect_laws(model, mesh)
    with clock.measure("loads"):
        outer = collect_outer_nodes(model, mesh)
        for number in range(STEPS):
            evaluate_load(model, mesh, outer, 0, (1 + number) / STEPS)
        find_needed_columns(model, mesh, outer)
    with clock.measure("support"):
        anchored = find_rigid_body_modes(model)
        anchors = anchor_motions(mesh, anchored)
        modes = start_memory(laws).modes
        for _ in range(STEPS):
            find_free_motions(model, mesh, anchors, anchored, find_ties(model, mesh, modes))
        close_nearest_pairs(mesh, laws, modes, laws.gap)
    with clock.measure("writer, begin"):
        writer = ResultWriter(target, model, mesh, 1, "")
    for number in range(1, STEPS + 1):
        step = make_step(mesh, laws, number)
        with clock.measure(f"writer, {STEPS} steps"):
            writer.append(step)
    with clock.measure("writer, end"):
        writer.finish()
    with clock.measure("resume"):
        ResultWriter.resume(target, model, mesh, 1, "").finish()
    with clock.measure("open"):
        results = open_results(target)
        assert np.isfinite(results.traction).all() and len(results.tips) + len(results.reactions) >= 0
    with clock.measure("info"):
        describe_results(results)
    with clock.measure("plot"):
        plot_results(results, folder / "field.png")
    return clock


def report(kind: str, counts: list[int], profiled: str | None) -> None:
    """Print the table, a process for each size."""
    runs = []
    for count in counts:
        command = [sys.executable, __file__, kind, "--count", str(count), "--one"]
        command += ["--profile", profiled] if profiled else []
        done = subprocess.run(command, stdout=subprocess.PIPE, text=True, env=os.environ | {"OMP_NUM_THREADS": "1"})
        if done.returncode:
            sys.exit(f"{count} {kind}: failed")
        runs.append(json.loads(done.stdout))
    print(f"{kind:18s}" + "".join(f"{count:>16d}" for count in counts))
    for piece in [*runs[0]["seconds"], "all"]:
        line = f"{piece:18s}"
        values = [run["seconds"].get(piece, sum(run["seconds"].values())) for run in runs]
        for i, value in enumerate(values):
            growth = math.log(value / values[i - 1]) / math.log(counts[i] / counts[i - 1]) if i else math.nan
            line += f"{value:9.3f} " + (f"^{growth:5.2f}" if i else " " * 6)
        print(line)
    for name in ("imports, MB", "peak, MB", "file, MB"):
        print(f"{name:18s}" + "".join(f"{run[name]:9.0f} " + " " * 6 for run in runs))


def main() -> None:
    """Read the arguments; one process measures one size."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("kind", nargs="?", default="cracks", choices=list(OPTIONS))
    parser.add_argument("--count", type=int, nargs="+", default=[250, 1000, 2000])
    parser.add_argument("--profile", metavar="PIECE", help="also print the profile of a piece, e.g. model")
    parser.add_argument("--one", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if not options.one:
        report(options.kind, options.count, options.profile)
        return
    import pbem.results.plots
    import pbem.results.writer  # noqa: F401

    begin = measure_peak()
    with tempfile.TemporaryDirectory() as folder:
        clock = measure_pieces(options.kind, options.count[0], Path(folder), options.profile)
        size = (Path(folder) / "field.h5").stat().st_size / 1e6
    print(json.dumps({"seconds": clock.seconds, "imports, MB": begin, "peak, MB": measure_peak(), "file, MB": size}))


if __name__ == "__main__":
    main()
