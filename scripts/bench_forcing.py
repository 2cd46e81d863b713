#!/usr/bin/env python3
"""Products with the hierarchical operator: systems solved as well as needed, against every one solved in full.

    [mpirun -n 2] .venv/bin/python scripts/bench_forcing.py [--cracks 250 1000 2000] [CASE.toml ...] [--parts 0.03 0.1]

Each case is run with every system solved in full (option newton_forcing 0) and with each forcing term, in this order in
one process. A line for each run: iterations of Newton's method, products in all and in the dearest iteration, seconds
of this rank's processor, the last two also over those of the exact run; pairs whose status differs from the exact run's
and the largest difference of slip, over the largest slip.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

import numpy as np
from measure_run import make_case

import pbem
from pbem.parallel import world
from pbem.solve.nonlinear.forcing import FORCING
from pbem.solve.problem.step import SilentReporter


def make_field(folder: Path, count: int) -> Path:
    """A field of isolated cracks that stick, slip and open."""
    return make_case(
        "cracks", folder, "--count", str(count), "--half-length", "1", "--density", "0.1", "--distance", "0.1",
        "--friction", "0.6", "--sxx", "0.3", "--syy", "-1", "--elements", "8",
    )  # fmt: skip


def compare(case: Path, folder: Path, parts: list[float]) -> None:
    """Print a line for every forcing term, the exact run first."""
    exact: tuple[pbem.Results, float] | None = None
    for part in (0.0, *parts):
        begin = time.process_time()
        results = pbem.run(case, folder / f"{part}.h5", force=True, operator="hierarchical", reporter=SilentReporter(),
                           petsc={"newton_forcing": str(part)})  # fmt: skip
        seconds = time.process_time() - begin
        if world.rank:
            continue
        exact = exact or (results, seconds)
        products, before = results.convergence["products"], exact[0].convergence["products"]
        other = sum(int((results.contact[k].mode != exact[0].contact[k].mode).sum()) for k in results.contact)
        slip, slip_before = (np.concatenate([each.contact[k].slip[-1] for k in each.contact])
                             for each in (results, exact[0]))  # fmt: skip
        change = float(np.abs(slip - slip_before).max() / (np.abs(slip_before).max() or 1.0))
        print(f"{case.stem[:20]:20s}{part:9g}{len(products):8d}{products.sum():10d}{products.max():9d}{seconds:9.1f}"
              f"{products.sum() / before.sum():10.2f}{seconds / exact[1]:9.2f}{other:9d}{change:10.1e}", flush=True)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("cases", nargs="*", type=Path)
    parser.add_argument("--cracks", type=int, nargs="*", default=[])
    parser.add_argument("--parts", type=float, nargs="+", default=[FORCING])
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(world.bcast(name))
        made = [make_field(folder, count) for count in options.cracks] if world.rank == 0 else []
        if world.rank == 0:
            print(f"{'case':20s}{'forcing':>9s}{'Newton':>8s}{'products':>10s}{'at most':>9s}{'cpu s':>9s}"
                  f"{'products/':>10s}{'cpu/':>9s}{'statuses':>9s}{'slip':>10s}")
        for case in [*world.bcast(made), *options.cases]:
            compare(case, folder, options.parts)
        world.Barrier()


if __name__ == "__main__":
    main()
