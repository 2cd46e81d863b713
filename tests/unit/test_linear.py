"""The linear solvers alone: an operator without factors is a reason to halve the step, on all ranks, not a crash."""

from __future__ import annotations

import subprocess
from collections.abc import Callable

import pytest

# Solves with a matrix that has a column of zeros, then with the unit matrix in its place.
SINGULAR_THEN_UNIT = """
import sys
import numpy as np
from pbem.errors import ConvergenceError
from pbem.parallel import share_nodes, world
from pbem.solve.linear import LinearSolver, petsc_options

method, reuse, *options = sys.argv[1:]
rows = 12
first, last = share_nodes(np.ones(rows), world.size)[world.rank:world.rank + 2]
own = np.arange(last - first)
singular = np.random.default_rng(1).standard_normal((rows, rows))
singular[:, 5] = 0
said = []
with petsc_options(dict(option.split("=") for option in options)):
    solver = LinearSolver(world, method, len(own), rows, reuse == "reuse")
    solver.allocate(np.full(len(own), len(own)), np.full(len(own), rows - len(own)))
    for matrix in (singular, np.eye(rows)):
        solver.fill(own, np.arange(rows), matrix[first:last])
        solver.finish_filling()
        for _ in range(2):
            try:
                said.append("solved" if np.allclose(solver.solve(1.0 + own), 1.0 + own) else "wrong")
            except ConvergenceError as error:
                said.append(error.reason)
    solver.destroy()
for each in world.gather(said) or ():
    print(*each, sep=", ")
"""

Launch = Callable[..., subprocess.CompletedProcess[str]]


@pytest.mark.parametrize("ranks", [1, 2, 3])
@pytest.mark.parametrize("reuse", ["renew", "reuse"])
@pytest.mark.parametrize("method", ["lu", "mumps"])
def test_an_operator_without_factors_is_singular_on_all_ranks(
    method: str, reuse: str, ranks: int, mpirun_snippet: Launch
) -> None:
    done = mpirun_snippet(ranks, SINGULAR_THEN_UNIT, method, reuse, timeout=40.0)
    assert done.stdout.splitlines() == ranks * ["singular tangent, singular tangent, solved, solved"], done.stderr


def test_a_preconditioner_of_the_users_own_is_not_asked_for_what_mumps_knows(mpirun_snippet: Launch) -> None:
    options = ("pc_type=none", "ksp_max_it=0")
    done = mpirun_snippet(1, SINGULAR_THEN_UNIT, "mumps", "renew", *options, timeout=40.0)
    assert done.stdout.splitlines() == [", ".join(4 * ["linear solver"])], done.stderr
