"""The linear solvers alone: an operator without factors is a reason to halve the step, on all ranks, not a crash."""

from __future__ import annotations

import subprocess
from collections.abc import Callable

import pytest

# Solves with a matrix that has a column of zeros, then with regular ones in its place.
SINGULAR_THEN_REGULAR = """
import sys
import numpy as np
from pbem.errors import ConvergenceError
from pbem.parallel import gather_parts, share_nodes, world
from pbem.solve.petsc.linear import LinearSolver
from pbem.solve.petsc.session import petsc_options

methods, *options = sys.argv[1:]
# A number that the ranks cannot share equally.
rows = 13
first, last = share_nodes(np.ones(rows), world.size)[world.rank:world.rank + 2]
own = np.arange(last - first)
singular = np.random.default_rng(1).standard_normal((rows, rows))
regular = singular + 5 * np.eye(rows)
singular[:, 5] = 0

def solve(method):
    said = []
    solver = LinearSolver(world, method, len(own), rows, lambda part: matrix[first:last] @ gather_parts(world, part))
    for matrix in (singular, regular, np.eye(rows)):
        solver.begin_filling((np.full(len(own), len(own)), np.full(len(own), rows - len(own))))
        if method == "lu":
            for column in range(0, rows, 5):
                solver.fill_columns(column, matrix[first:last, column:column + 5])
        else:
            solver.fill(own, np.arange(rows), matrix[first:last])
        try:
            solver.factorise()
            expected = (np.linalg.pinv(matrix) @ np.arange(3.0 * rows).reshape(rows, 3))[first:last]
            given = np.arange(3.0 * rows).reshape(rows, 3)[first:last]
            if not options:
                found = solver.solve_columns(given), solver.solve_columns(given[:, 1:2])
                assert np.allclose(found[0], expected) and np.allclose(found[1], expected[:, 1:2])
            said.append("solved" if np.allclose(solver.solve(given[:, 2]), expected[:, 2]) else "wrong")
        except ConvergenceError as error:
            said.append(error.reason)
    solver.destroy()
    return said

with petsc_options(dict(option.split("=") for option in options)):
    for method in methods.split(","):
        for each in world.gather(solve(method)) or ():
            print(*each, sep=", ")
"""

Launch = Callable[..., subprocess.CompletedProcess[str]]


@pytest.mark.parametrize("ranks", [1, 2, 3])
def test_an_operator_without_factors_is_singular_on_all_ranks(ranks: int, mpirun_snippet: Launch) -> None:
    done = mpirun_snippet(ranks, SINGULAR_THEN_REGULAR, "lu,mumps", timeout=40.0)
    assert done.stdout.splitlines() == 2 * ranks * ["singular tangent, solved, solved"], done.stderr


def test_a_preconditioner_of_the_users_own_is_not_asked_for_what_mumps_knows(mpirun_snippet: Launch) -> None:
    options = ("pc_type=none", "ksp_max_it=0")
    done = mpirun_snippet(1, SINGULAR_THEN_REGULAR, "mumps", *options, timeout=40.0)
    assert done.stdout.splitlines() == [", ".join(3 * ["linear solver"])], done.stderr
