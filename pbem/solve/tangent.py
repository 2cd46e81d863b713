"""The tangent operator K = B M of a contact state, and the solution of the linear system with it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from pbem.bem.operator import RowOperator
from pbem.contact.constraints import ConstraintMap
from pbem.contact.loads import Load
from pbem.errors import ConvergenceError
from pbem.parallel import gather_parts
from pbem.solve.linear import LinearSolver, choose_method
from pbem.solve.problem import Problem

Real = NDArray[np.float64]


@dataclass(frozen=True)
class Solved:
    """Unknowns x (2 nodes,), v = M x + m (4 nodes,), and the relative residual of B v = 0."""

    unknowns: Real
    v: Real
    residual: float


class AnyTangent(Protocol):
    """What Newton's method asks of a tangent operator, however it is stored."""

    def solve(self, constraints: ConstraintMap, load: Load) -> Solved:
        """Solve B (M x + m) = 0. Raises ConvergenceError: "singular tangent", "linear solver"."""

    def destroy(self) -> None:
        """Free PETSc's storage."""


class Tangent:
    """The tangent operator K = B M(mode) in a linear solver."""

    def __init__(self, problem: Problem) -> None:
        assert isinstance(problem.operator, RowOperator)
        self.problem = problem
        options = problem.model.solver
        method = choose_method(options.linear, len(problem.mesh.region_names))
        operator = problem.operator
        self.solver = LinearSolver(
            problem.comm, method, operator.rows, problem.unknowns, reuse=options.linear == "gmres"
        )
        inside, outside = np.zeros((2, operator.rows), dtype=np.int64)
        for block, columns in zip(operator.blocks, problem.block_columns, strict=True):
            own = (columns >= 2 * operator.first_node) & (columns < 2 * operator.last_node)
            inside[block.rows], outside[block.rows] = own.sum(), (~own).sum()
        self.solver.allocate(inside, outside)
        self.formed: sparse.csr_matrix | None = None

    def update(self, constraints: ConstraintMap) -> None:
        """Form K for a constraint map; K and its factors stay if no pair has changed its mode since the last time."""
        if self.formed is not None and _are_equal(self.formed, constraints.matrix):
            return
        self.formed = constraints.matrix
        operator = self.problem.operator
        assert isinstance(operator, RowOperator)
        for block, columns in zip(operator.blocks, self.problem.block_columns, strict=True):
            self.solver.fill(block.rows, columns, operator.multiply_block(block, constraints.matrix, columns))
        self.solver.finish_filling()

    def solve(self, constraints: ConstraintMap, load: Load) -> Solved:
        """Solve B (M x + m) = 0 for a constraint map.

        Raises ConvergenceError: "singular tangent", "linear solver".
        """
        problem = self.problem
        self.update(constraints)
        forced = problem.apply(constraints.offset, load)
        scale = problem.measure(forced)
        if scale == 0.0:
            unknowns = np.zeros(problem.unknowns)
            return Solved(unknowns, constraints.evaluate(unknowns), 0.0)
        tolerance = problem.model.solver.newton_tolerance
        unknowns = self.solve_system(-forced)
        for attempt in range(2):
            v = constraints.evaluate(unknowns)
            left = problem.apply(v, load)
            residual = problem.measure(left) / scale
            if residual <= tolerance:
                return Solved(unknowns, v, residual)
            if attempt == 0 and np.isfinite(residual):
                unknowns = unknowns - self.solve_system(left)
        raise ConvergenceError(
            "singular tangent",
            f"the linear system is solved only to a relative residual of {residual:.1e} (asked: {tolerance:.1e}); "
            "a body is probably free to move in its present contact",
        )

    def solve_system(self, rhs: Real) -> Real:
        """The unknowns (2 nodes,), on every rank, for this rank's part of the right-hand side."""
        return gather_parts(self.problem.comm, self.solver.solve(rhs))

    def destroy(self) -> None:
        self.solver.destroy()


def _are_equal(one: sparse.csr_matrix, other: sparse.csr_matrix) -> bool:
    """Whether two constraint maps are the same numbers in the same places."""
    parts = ((one.indptr, other.indptr), (one.indices, other.indices), (one.data, other.data))
    return all(np.array_equal(mine, yours) for mine, yours in parts)
