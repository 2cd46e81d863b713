"""What one run of a case takes, by pieces and ranks; used by the benchmarks of large models.

usage: mpirun -n 2 .venv/bin/python scripts/measure_run.py CASE.toml [--operator-only] [--output FILE.h5]

Prints one line of JSON: seconds of the pieces (slowest rank), peak memory of every rank (MB), unknowns, iterations of
GMRES, seconds of a product and of copying the bytes that it reads.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
RUN_AS_ROOT = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
               "OMPI_MCA_rmaps_base_oversubscribe": "1", "OMP_NUM_THREADS": "1"}


def run_measured(case: Path, ranks: int, *options: str, timeout: float = 7200) -> dict[str, Any]:
    """Measure a case in a process of its own per rank. Raises RuntimeError if the run fails."""
    command = ["mpirun", "-n", str(ranks), sys.executable, str(Path(__file__).resolve()), str(case), *options]
    done = subprocess.run(command, env={**os.environ, **RUN_AS_ROOT}, capture_output=True, text=True, timeout=timeout)
    if done.returncode != 0:
        raise RuntimeError(f"{' '.join(command)}\n{done.stdout}\n{done.stderr}")
    result: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return result


def make_case(kind: str, folder: Path, *options: str) -> Path:
    """A case file of random cracks or inclusions, made by `pbem make`."""
    path = folder / f"{kind}{len(list(folder.iterdir()))}.toml"
    subprocess.run([sys.executable, "-m", "pbem", "make", kind, "-o", str(path), *options], check=True,
                   capture_output=True, cwd=ROOT)
    return path


class Clock:
    """Adds up the seconds of named pieces."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    def wrap(self, name: str, action: Callable[..., Any], keep: list[Any]) -> Callable[..., Any]:
        """The action with its seconds counted and its results kept."""

        def timed(*arguments: Any, **named: Any) -> Any:
            begin = time.perf_counter()
            result = action(*arguments, **named)
            self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - begin
            keep.append(result)
            return result

        return timed


def measure(case: Path, operator_only: bool, output: str | None = None) -> dict[str, Any]:
    """Run a case on the ranks of this MPI world and gather what it took."""
    begin = time.perf_counter()
    from pbem import driver
    from pbem.parallel import world
    from pbem.solve.preconditioner import schwarz
    from pbem.solve.problem.problem import Problem
    from pbem.solve.steps import march

    clock = Clock()
    problems: list[Any] = []
    tangents: list[Any] = []
    ignored: list[Any] = []
    clock.seconds["import"] = time.perf_counter() - begin
    driver.make_checked_model = clock.wrap("read", driver.make_checked_model, ignored)
    driver.generate_mesh = clock.wrap("mesh", driver.generate_mesh, ignored)
    driver.assemble_problem = clock.wrap("assembly", driver.assemble_problem, problems)
    products: list[dict[str, Any]] = []
    assemble = driver.assemble_problem

    def assemble_and_try(*given: Any) -> Any:
        """With products before the run frees what they need."""
        problem = assemble(*given)
        products.append(measure_product(problem, world))
        return problem

    driver.assemble_problem = assemble_and_try
    driver.do_on_first = clock.wrap("first rank", driver.do_on_first, ignored)
    Problem.make_tangent = clock.wrap("tangent", Problem.make_tangent, tangents)
    march.solve_step = clock.wrap("Newton", march.solve_step, ignored)
    schwarz.SchwarzPreconditioner.update = clock.wrap("preconditioner", schwarz.SchwarzPreconditioner.update, ignored)
    if operator_only:
        driver.march = lambda *_given, **_named: iter(())
    with tempfile.TemporaryDirectory() as folder:
        target = output or world.bcast(str(Path(folder) / "run.h5"), root=0)
        driver.run(case, target, force=True)
        clock.seconds["whole"] = time.perf_counter() - begin
        world.Barrier()
    problem = problems[0]
    report: dict[str, Any] = {
        "unknowns": problem.unknowns,
        "ranks": world.size,
        "notes": list(problem.system.notes),
        "memory": world.gather(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024),
        "seconds": _find_slowest(world.allgather(clock.seconds)),
    }
    report["krylov"] = list(getattr(tangents[0], "iterations", [])) if tangents else []
    report |= products[0]
    return report if world.rank == 0 else {}


def _find_slowest(seconds: list[dict[str, float]]) -> dict[str, float]:
    """Of every piece the seconds of the rank that took longest; some pieces are done by the first rank alone."""
    names = {name for each in seconds for name in each}
    return {name: max(each.get(name, 0.0) for each in seconds) for name in sorted(names)}


def measure_product(problem: Any, world: Any) -> dict[str, Any]:
    """Seconds of a product with B (best of five, slowest rank), and of copying the bytes of its matrices."""
    v = np.random.default_rng(0).standard_normal(4 * problem.mesh.nodes)
    best = np.inf
    for _ in range(5):
        world.Barrier()
        begin = time.perf_counter()
        problem.system.apply(v)
        best = min(best, max(world.allgather(time.perf_counter() - begin)))
    stored = problem.system.stored
    sample = np.ones(4_000_000)
    target = np.empty_like(sample)
    copy = np.inf
    for _ in range(5):
        world.Barrier()
        begin = time.perf_counter()
        np.copyto(target, sample)
        copy = min(copy, max(world.allgather(time.perf_counter() - begin)))
    bytes_copied = max(world.allgather(stored))
    sources = getattr(problem.system.operator, "sources", None)
    return {
        "product": best, "stored": world.allreduce(stored) / 1e6, "copy": copy * bytes_copied / sample.nbytes,
        "leaves": len(sources.forest.leaves) if sources else 0, "terms": sources.terms if sources else 0,
    }  # fmt: skip


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("case", type=Path)
    parser.add_argument("--operator-only", action="store_true", help="stop when the operator is there")
    parser.add_argument("--output", help="result file to keep")
    options = parser.parse_args()
    from pbem.parallel import abort_if_unexpected
    from pbem.parallel import world as ranks

    # An error on one rank must not leave the others waiting for it.
    with abort_if_unexpected(ranks, SystemExit):
        outcome = measure(options.case, options.operator_only, options.output)
    if outcome:
        print(json.dumps(outcome))
