#!/usr/bin/env python3
"""Both operators on models of several kinds and sizes: what was forecast, what each took, and which is chosen.

    .venv/bin/python scripts/bench_operator_choice.py [--kinds inclusions-coulomb cracks ...] [--counts 10 20 60]

Seconds are those of this rank's processor for a whole run. The forecasts are in operations of an LU factorisation; the
last column is the time of the operator that "auto" takes, over that of the faster one.
"""

from __future__ import annotations

import argparse
import math
import tempfile
import time
from pathlib import Path

from measure_run import make_case

import pbem
from pbem.bem.operator_choice import choose_operator
from pbem.bem.operator_cost import forecast_dense, forecast_hierarchical
from pbem.case.build import read_model
from pbem.mesh.generate import generate_mesh
from pbem.solve.problem.step import SilentReporter

FRACTION, STEPS = 0.2, 4


def make_model(folder: Path, kind: str, count: int) -> Path:
    """Inclusions in a plate, bonded or held by friction, or cracks in a plane."""
    name, _, law = kind.partition("-")
    if name == "cracks":
        return make_case("cracks", folder, "--count", str(count), "--density", "0.1", "--friction", "0.6",
                         "--sxx", "0.3")  # fmt: skip
    friction = ["--friction", "0.3"] if law == "coulomb" else []
    side = f"{math.sqrt(math.pi * count / FRACTION):.4g}"
    return make_case("inclusions", folder, "--count", str(count), "--elements", "24", "--plate", side, "--steps",
                     str(STEPS), "--law", law, "--sxx", "0.3", *friction)  # fmt: skip


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--kinds", nargs="+", default=["inclusions-coulomb", "inclusions-bonded", "cracks"])
    parser.add_argument("--counts", type=int, nargs="+", default=[10, 20, 40])
    options = parser.parse_args()
    print(f"{'kind':20s}{'count':>6s}{'unknowns':>10s}{'forecast: dense':>16s}{'hierarchical':>14s}{'ratio':>7s}"
          f"{'dense s':>9s}{'hierarchical s':>16s}{'ratio':>7s}  chosen        over the faster")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for kind in options.kinds:
            for count in options.counts:
                case = make_model(folder, kind, count)
                model = read_model(case)[1]
                mesh = generate_mesh(model)
                costs = forecast_dense(model, mesh), forecast_hierarchical(model, mesh)
                chosen, seconds = choose_operator(model, mesh).name, {}
                for operator in ("dense", "hierarchical"):
                    begin = time.process_time()
                    pbem.run(case, folder / "run.h5", force=True, operator=operator, reporter=SilentReporter())
                    seconds[operator] = time.process_time() - begin
                print(f"{kind:20s}{count:6d}{2 * mesh.nodes:10d}{costs[0]:16.2e}{costs[1]:14.2e}"
                      f"{costs[0] / costs[1]:7.2f}{seconds['dense']:9.1f}{seconds['hierarchical']:16.1f}"
                      f"{seconds['dense'] / seconds['hierarchical']:7.2f}  {chosen:14s}"
                      f"{seconds[chosen] / min(seconds.values()):6.2f}", flush=True)


if __name__ == "__main__":
    main()
