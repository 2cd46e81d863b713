#!/usr/bin/env python3
"""What a sweep costs beside single runs: 9 friction coefficients and 3 loads, on two blocks and on cracks.

    [mpirun -n 2] .venv/bin/python scripts/bench_sweep.py [--cracks 60] [--frictions 9] [--loads 3] [--wall]

For each model: seconds of one whole run, as `pbem run` makes it with its file and its estimated errors, and of the
sweep, their ratio, and by how much rows of the sweep differ from runs of the same cases, relative to the largest value
of the column; of as many as --check says. Seconds are those of this rank's processor, as other work on the machine
does not change them much; --wall takes those of the clock.
"""

from __future__ import annotations

import argparse
import math
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

import pbem
from pbem.bundled import find_case
from pbem.cli import main as run_command
from pbem.parallel import world
from pbem.results.reader import Results

QUANTITIES = ["contact.slip.largest", "contact.opening.max", "energy.external", "energy.dissipated"]


def measure(results: Results) -> list[float]:
    """The same quantities of a result file."""
    last = [(each.slip[-1], each.opening[-1]) for each in results.contact.values()]
    return [max(float(np.abs(slip).max()) for slip, _ in last), max(float(gap.max()) for _, gap in last),
            float(results.energy.external[-1]), float(results.energy.dissipated[-1])]


def compare(case: Path, values: dict[str, list[float]], checked: int, clock: Callable[[], float], folder: Path) -> None:
    """Print a line for one model."""
    output = folder / "single.h5"
    pbem.run(case, output, force=True)  # what is loaded at first use
    begun = clock()
    pbem.run(case, output, force=True)
    single = clock() - begun
    begun = clock()
    table = pbem.sweep(case, values, QUANTITIES)
    whole = clock() - begun
    rows = list(table)
    error = 0.0
    for row in rows[:: max(1, math.ceil(len(rows) / checked))]:
        results = pbem.run(case, output, force=True, set={key: row[key] for key in values})
        for name, expected in zip(QUANTITIES, measure(results), strict=True):
            size = float(np.nanmax(np.abs(table[name]))) or 1.0
            error = max(error, abs(row[name] - expected) / size)
    if world.rank == 0:
        bad = sum(row["status"] != "finished" for row in rows)
        print(f"{case.stem:12s} {len(rows):3d} cases  single run {single:8.2f} s  sweep {whole:8.2f} s  "
              f"ratio {whole / single:6.2f}  a case {whole / len(rows) / single:5.3f}  difference {error:.1e}"
              f"{f'  not finished {bad}' if bad else ''}", flush=True)


def main() -> None:
    """The script."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cracks", type=int, nargs="*", default=[60])
    parser.add_argument("--frictions", type=int, default=9)
    parser.add_argument("--loads", type=int, default=3)
    parser.add_argument("--check", type=int, default=4)
    parser.add_argument("--wall", action="store_true")
    options = parser.parse_args()
    clock = time.perf_counter if options.wall else time.process_time
    frictions = [round(float(each), 3) for each in np.linspace(0.1, 0.9, options.frictions)]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(world.bcast(name))
        blocks = find_case("two_blocks")
        loads = [round(float(each), 5) for each in np.linspace(0.002, 0.006, options.loads)]
        compare(blocks, {"interfaces.interface.friction": frictions, "boundary.top.ux": loads}, options.check, clock,
                folder)
        for count in options.cracks:
            path = folder / f"cracks_{count}.toml"
            if world.rank == 0:
                run_command(["make", "cracks", "-o", str(path), "--count", str(count), "--density", "0.1", "--sxx",
                             "-0.5", "--syy", "-2", "--sxy", "0.5", "--friction", "0.3"])
            world.Barrier()
            stresses = [round(float(each), 5) for each in np.linspace(0.5, 0.9, options.loads)]
            compare(path, {"generate.crack.friction": frictions, "remote.sxy": stresses}, options.check, clock, folder)


if __name__ == "__main__":
    main()
