#!/usr/bin/env python3
"""A plate with frictional cracks through many load steps, against one LAPACK factorisation of the size of its tangent.

    mpirun -n 2 .venv/bin/python scripts/bench_dense.py [--outer 300] [--cracks 12] [--elements 11] [--steps 20]

The outer boundary has 4 x outer elements, the cracks cracks x elements, of order 2: 7992 unknowns, 10 % of them of
contact, as given. The loads come and go in four stages, so that modes change in almost every step. Shown are the parts
of the run as the program runs it, the whole of it against assembly and one LU by LAPACK (on one thread and on as many
threads as there are ranks, in processes of their own), and Newton's iterations in per cent of that LU. Where others
compute as well, the processor's seconds tell more; those of ranks that wait for each other are among them, unless
OMPI_MCA_mpi_yield_when_idle=1 lets the others have them.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from make_crack_field import scatter_cracks

import pbem
from pbem.blas_kernels import name_kernels, note_old_kernels
from pbem.case.build import read_model
from pbem.mesh.generate import generate_mesh
from pbem.parallel import world
from pbem.solve.problem.step import Iteration, SilentReporter, Step
from pbem.solve.system.assembly import assemble_problem

SIDE = 10.0
# Tractions on the top and on the right at the end of each stage.
STAGES = ((-1.0, -0.3), (-1.0, 0.3), (-0.4, -0.6), (-1.2, 0.5))

FACTORISE = """
import os, sys, time
os.sched_setaffinity(0, range(os.cpu_count()))  # mpirun binds its ranks to a core each, and what they start
import numpy as np
from scipy.linalg import lu_factor
count = int(sys.argv[1])
matrix = np.asfortranarray(np.random.default_rng(1).standard_normal((count, count)))
begin, worked = time.perf_counter(), time.process_time()
lu_factor(matrix, overwrite_a=True, check_finite=False)
print(time.perf_counter() - begin, time.process_time() - worked)
"""


def write_case(outer: int, cracks: int, elements: int, steps: int) -> str:
    """The text of the case file."""
    corners = [(0, 0), (SIDE, 0), (SIDE, SIDE), (0, SIDE), (0, 0)]
    sides = ("bottom", "right", "top", "left")
    curves = [
        f"{name} = {{ points = [{list(corners[k])}, {list(corners[k + 1])}], elements = {outer} }}"
        for k, name in enumerate(sides)
    ]
    names = [f"c{number:02d}" for number in range(1, cracks + 1)]
    for name, (a, b) in zip(names, scatter_cracks(cracks, SIDE, 3), strict=True):
        curves.append(f"{name} = {{ points = [[{a.real}, {a.imag}], [{b.real}, {b.imag}]], elements = {elements} }}")
    stages = [
        f'[[stages]]\nname = "{number}"\nsteps = {steps // len(STAGES)}\nboundary.top = {{ ty = {top} }}\n'
        f"boundary.right = {{ tx = {right} }}"
        for number, (top, right) in enumerate(STAGES, 1)
    ]
    return "\n".join(
        [
            "[materials.rock]", "young = 1.0e3", "poisson = 0.2", "[curves]", *curves, "[regions.plate]",
            'material = "rock"', f"boundary = {list(sides)}", f"cracks = {names}",
            "[boundary]", "bottom = { uy = 0.0 }", "left = { ux = 0.0 }", "top = { tx = 0.0, ty = 0.0 }",
            "right = { tx = 0.0, ty = 0.0 }",
            "[interfaces]", *(f"{name} = {{ friction = 0.6 }}" for name in names), *stages, "",
        ]
    )  # fmt: skip


class Recorder(SilentReporter):
    """Remembers the iterations of all steps."""

    def __init__(self) -> None:
        self.iterations: list[Iteration] = []
        self.steps: list[Step] = []

    def iterate(self, iteration: Iteration) -> None:
        self.iterations.append(iteration)

    def accept(self, step: Step) -> None:
        self.steps.append(step)


def wait_for_first() -> None:
    """The other ranks wait here without taking a processor."""
    request = world.Ibarrier()
    while not request.Test():
        time.sleep(0.05)


def time_lapack(count: int, threads: int) -> tuple[float, float]:
    """Seconds of one LU of a random matrix, in a process of its own, and of the processor."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("OMPI_", "PMIX_"))}
    environment |= {"OMP_NUM_THREADS": str(threads), "OPENBLAS_NUM_THREADS": str(threads)}
    command = [sys.executable, "-c", FACTORISE, str(count)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    seconds, worked = map(float, done.stdout.split())
    return seconds, worked


def measure_peak() -> float:
    """Peak memory of this rank so far (MB)."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--outer", type=int, default=300, help="elements on each side of the plate")
    parser.add_argument("--cracks", type=int, default=12)
    parser.add_argument("--elements", type=int, default=11, help="of each crack")
    parser.add_argument("--steps", type=int, default=20)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(world.bcast(name))
        case = folder / "plate.toml"
        if world.rank == 0:
            case.write_text(write_case(**vars(options)), encoding="utf-8")
        world.Barrier()
        start = world.gather(measure_peak())
        recorder = Recorder()
        begin, before = time.perf_counter(), time.process_time()
        pbem.run(case, folder / "plate.h5", force=True, reporter=recorder)
        whole = time.perf_counter() - begin
        worked = world.gather(time.process_time() - before)
        peaks = world.gather(measure_peak())
        model = read_model(case)[1]
        mesh = generate_mesh(model)
        world.Barrier()
        begin = time.perf_counter()
        problem = assemble_problem(model, mesh, world)
        world.Barrier()
        assembly = time.perf_counter() - begin
        unknowns, pairs = problem.unknowns, mesh.pairs.count
        del problem
        if world.rank == 0:
            threads = sorted({1, world.size})
            lu = {count: time_lapack(unknowns, count) for count in threads}
        wait_for_first()
    if world.rank == 0:
        assert peaks is not None and start is not None and worked is not None
        print(f"{unknowns} unknowns, {2 * pairs} of them of contact; {world.size} ranks; {len(recorder.steps)} steps")
        print_figures(recorder, whole, assembly, {threads: seconds for threads, (seconds, _) in lu.items()})
        print(note_old_kernels() or f"kernels of OpenBLAS: {name_kernels() or 'not known'}")
        print("seconds of the processor: ranks", *(f"{value:.2f}" for value in worked), "LU",
              *(f"{value:.2f}" for _, value in lu.values()))
        print("memory of each rank, MB: start", *(f"{value:.0f}" for value in start), "peak",
              *(f"{value:.0f}" for value in peaks))


def print_figures(recorder: Recorder, whole: float, assembly: float, lu: dict[int, float]) -> None:
    """The table."""
    first, *later = [iteration.seconds for iteration in recorder.iterations]
    changes = [sum(iteration.changed for iteration in step.iterations) for step in recorder.steps]
    rest = whole - assembly - first - sum(later)
    print(f"assembly {assembly:.2f} s, first iteration {first:.2f} s, {len(later)} later ones {sum(later):.2f} s, "
          f"the rest {rest:.2f} s, whole run {whole:.2f} s")
    for threads, seconds in lu.items():
        print(f"LAPACK LU on {threads} threads: {seconds:.2f} s; whole run / (assembly + LU) = "
              f"{whole / (assembly + seconds):.2f}; first iteration {first / seconds:.0%}, later ones in % of LU: "
              f"mean {100 * np.mean(later) / seconds:.2f}, most {100 * max(later) / seconds:.2f}")
    print("pairs that changed mode, by step:", *changes)


if __name__ == "__main__":
    main()
