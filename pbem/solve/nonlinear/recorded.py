"""What is told of the iterations of a search: their counts and times, to the reporter and for the file."""

from __future__ import annotations

import time

import numpy as np

from pbem.arrays import Bool
from pbem.contact.laws import OPEN, SLIP, STICK, ModeState
from pbem.solve.problem.problem import Problem
from pbem.solve.problem.step import Iteration, Reporter
from pbem.solve.problem.tangent import Solved


class Record:
    """The iterations of a load step, whichever search they belong to, and the products that they took."""

    def __init__(self, problem: Problem, reporter: Reporter, iterations: list[Iteration]) -> None:
        """iterations: so far; further ones join them."""
        self._system, self._reporter, self.iterations = problem.system, reporter, iterations
        self._products = problem.system.products

    def add(self, solved: Solved, modes: ModeState, changed: Bool, begin: float) -> None:
        """Tell of an iteration that began at a time."""
        stick, slip, is_open = (int((modes.mode == kind).sum()) for kind in (STICK, SLIP, OPEN))
        seconds, before = time.perf_counter() - begin, self._products
        self._products = self._system.products
        self.iterations.append(Iteration(
            len(self.iterations) + 1, solved.residual, int(np.count_nonzero(changed)), stick, slip, is_open, seconds,
            solved.linear_iterations, self._products - before,
        ))  # fmt: skip
        self._reporter.iterate(self.iterations[-1])
