#!/usr/bin/env python3
"""Circular inclusions in a plate with the dense operator, against one MUMPS factorisation of the run's tangent.

    [mpirun -n 2] .venv/bin/python scripts/bench_inclusions.py [--count 10 20 40] [--elements 24] [--steps 4]

A line for each number of inclusions and law: how often the tangent was factorised, the seconds of the first of these
and of all, of the columns of pairs that changed, and of the whole run, also over the first factorisation. All are
seconds of this rank's processor (waiting for other ranks is counted), as other work on the machine does not change
them much; --wall takes those of the clock.
"""

from __future__ import annotations

import argparse
import math
import resource
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pbem
from pbem.cli import main as run_command
from pbem.parallel import world
from pbem.solve.petsc.linear import LinearSolver
from pbem.solve.problem.step import Iteration, SilentReporter
from pbem.solve.tangent.pair_columns import PairColumns

FRACTION = 0.2  # of the area
FRICTION = 0.3


class Recorder(SilentReporter):
    """Counts the iterations."""

    def __init__(self) -> None:
        self.iterations = 0

    def iterate(self, iteration: Iteration) -> None:
        self.iterations += 1


def write_case(folder: Path, count: int, elements: int, steps: int, law: str) -> Path:
    """The case file, with the dense operator."""
    path = folder / f"inclusions_{count}_{law}.toml"
    friction = ["--friction", str(FRICTION)] if law == "coulomb" else []
    side = f"{math.sqrt(math.pi * count / FRACTION):.4g}"
    run_command(
        ["make", "inclusions", "-o", str(path), "--count", str(count), "--elements", str(elements), "--plate", side,
         "--steps", str(steps), "--law", law, "--sxx", "0.3", "--force", *friction]
    )  # fmt: skip
    path.write_text(path.read_text() + '\n[solver]\noperator = "dense"\n', encoding="utf-8")
    return path


def record(owner: type, name: str, clock: Callable[[], float]) -> list[float]:
    """Seconds of every call of a method from now on."""
    seconds: list[float] = []
    whole = getattr(owner, name)

    def timed(*given: Any, **named: Any) -> Any:
        begin = clock()
        try:
            return whole(*given, **named)
        finally:
            seconds.append(clock() - begin)

    setattr(owner, name, timed)
    return seconds


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--count", type=int, nargs="+", default=[10, 20])
    parser.add_argument("--elements", type=int, default=24, help="on each inclusion")
    parser.add_argument("--steps", type=int, default=4)
    parser.add_argument("--wall", action="store_true", help="seconds of the clock")
    options = parser.parse_args()
    clock = time.perf_counter if options.wall else time.process_time
    factors = record(LinearSolver, "factorise", clock)
    columns = record(PairColumns, "extend", clock)
    if world.rank == 0:
        print("count law      unknowns  iterations  factors   first     all  columns  whole run  over first  peak MB")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(world.bcast(name))
        for count in options.count:
            for law in ("bonded", "coulomb"):
                if world.rank == 0:
                    write_case(folder, count, options.elements, options.steps, law)
                world.Barrier()
                factors.clear()
                columns.clear()
                recorder = Recorder()
                begin = clock()
                results = pbem.run(
                    folder / f"inclusions_{count}_{law}.toml", folder / "inclusions.h5", force=True, reporter=recorder
                )
                whole = clock() - begin
                peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
                if world.rank == 0:
                    print(
                        f"{count:5d} {law:8s} {2 * len(results.nodes.position):8d} {recorder.iterations:11d} "
                        f"{len(factors):8d} {factors[0]:7.2f} {sum(factors):7.2f} {sum(columns):8.2f} {whole:10.2f} "
                        f"{whole / factors[0]:11.2f} {peak:8.0f}",
                        flush=True,
                    )
        world.Barrier()


if __name__ == "__main__":
    main()
