"""The tangent operator by GMRES, with the LU factors of the present modes or of earlier ones as preconditioner."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from pbem.arrays import Integer, Real
from pbem.contact.constraints import ConstraintMap
from pbem.contact.loads import Load
from pbem.contact.map_entries import are_equal
from pbem.contact.modes import Linearisation
from pbem.errors import ConvergenceError
from pbem.parallel import gather_parts
from pbem.solve.problem.problem import Problem
from pbem.solve.problem.response import select_states
from pbem.solve.problem.tangent import Solved, TangentOperator, describe_residual, size_residual
from pbem.solve.tangent.reference import Reference, TangentRows

# Of GMRES with old factors: fewer are not worth a try, more take too much storage.
LEAST_ITERATIONS, MOST_ITERATIONS = 4, 100


class FactoredTangent(TangentOperator):
    """The operator of the present modes, solved by GMRES with the factors of the same or of earlier modes.

    Old factors are kept until the further iterations with them have taken as many operations as new factors would.
    """

    def __init__(self, problem: Problem, rows: TangentRows) -> None:
        self.problem = problem
        self.reference = Reference(problem, rows, np.zeros(0, dtype=np.int64))
        self.factored: sparse.csr_matrix | None = None  # the constraint map of the factors
        self.spent = 0.0  # operations that old factors took beyond those that new ones would have

    def update(self, constraints: ConstraintMap) -> None:
        """Factorise the operator of a constraint map, unless the present factors are its own."""
        self.reference.present = constraints.matrix
        if self.factored is None or not are_equal(self.factored, constraints.matrix):
            self._factorise(constraints)

    def solve(
        self, constraints: ConstraintMap, load: Load, law: Linearisation, forcing: float = 0.0
    ) -> Solved:
        """See TangentOperator."""
        problem = self.problem
        self.reference.present = constraints.matrix
        forced = problem.apply(constraints.offset, load)
        scale = problem.measure(forced)
        if scale == 0.0:
            unknowns = np.zeros(problem.unknowns)
            return Solved(unknowns, 0.0)
        tolerance = problem.model.solver.newton_tolerance
        unknowns = self._solve_by_any(constraints, -forced)
        for attempt in range(2):
            v = constraints.evaluate(unknowns)
            left = problem.apply(v, load)
            residual = problem.measure(left) / size_residual(scale, unknowns, constraints.given)
            if residual <= tolerance:
                return Solved(unknowns, residual)
            if attempt == 0 and np.isfinite(residual):
                unknowns = unknowns - self._solve_by_any(constraints, left)
        self.factored = None  # whatever comes next is solved with factors of its own
        raise describe_residual(residual, tolerance)

    def check(self, solved: Solved, constraints: ConstraintMap, load: Load, law: Linearisation) -> Solved:
        """See TangentOperator; every solution is checked."""
        return solved

    def respond(
        self, constraints: ConstraintMap, load: Load, law: Linearisation, pairs: Integer, directions: Real
    ) -> Real:
        """See TangentOperator."""
        self.reference.present = constraints.matrix
        states, unknowns = select_states(self.problem, load, law, pairs, directions)
        forces = (self.problem.system.apply(-states[:, k]) for k in range(states.shape[1]))
        return np.stack([self._solve_by_any(constraints, each)[unknowns] for each in forces], axis=1)

    def solve_forces(self, constraints: ConstraintMap, load: Load, law: Linearisation, forces: Real) -> Real:
        """See TangentOperator."""
        self.reference.present = constraints.matrix
        return np.stack([self._solve_by_any(constraints, each) for each in forces.T], axis=1)

    def _solve_by_any(self, constraints: ConstraintMap, rhs: Real) -> Real:
        """Solve with the factors there are if that is expected to pay, else with new ones."""
        if self.factored is not None and not are_equal(self.factored, constraints.matrix):
            try:
                return self._solve_by_old(rhs)
            except ConvergenceError:
                self.factored = None
        self.update(constraints)
        try:
            result = gather_parts(self.problem.comm, self.reference.solve(rhs))
        except ConvergenceError:
            self._refuse_singular(rhs)
            raise
        return result

    def _refuse_singular(self, rhs: Real) -> None:
        """Raise ConvergenceError ("singular tangent") if the factors are none of a regular operator."""
        solver = self.reference.solver
        if not solver.factored:
            return
        part = self.reference.solve_columns(rhs[:, None])[:, 0]
        size = size_residual(self.problem.measure(rhs), gather_parts(self.problem.comm, part))
        residual = self.problem.measure(solver.multiply(part) - rhs) / size
        tolerance = self.problem.model.solver.newton_tolerance
        if not residual <= tolerance:
            self.factored = None
            raise describe_residual(residual, tolerance)

    def _solve_by_old(self, rhs: Real) -> Real:
        solver = self.reference.solver
        most = int((solver.work.factors - self.spent) / max(solver.work.iteration, 1.0))
        if most < LEAST_ITERATIONS:
            raise ConvergenceError("linear solver", "new factors are due")
        try:
            return gather_parts(self.problem.comm, self.reference.solve(rhs, min(most, MOST_ITERATIONS)))
        finally:
            self.spent += (solver.iterations - 1) * solver.work.iteration

    def _factorise(self, constraints: ConstraintMap) -> None:
        self.factored, self.spent = None, 0.0
        self.reference.form(constraints.matrix)
        self.factored = constraints.matrix

    def take_over(self, problem: Problem) -> None:
        """See TangentOperator."""
        self.problem = self.reference.problem = problem

    def destroy(self) -> None:
        """See TangentOperator."""
        self.reference.destroy()
