"""The tangent operator without the anchors of motions that the present contact holds.

The dense operator holds all its anchors for good, K = B M with B + P F' in place of B: with it bodies that nothing
holds yet are regular. Where pairs hold them, K would let the anchors carry a part of the load. With R, orthonormal
combinations of the anchors that are to be taken off, the equations without them are

    K x + B m = P R b,    b = R' F' v,    v = M x + m    (displacements of v alone enter)

that is x = x_0 + X b with x_0 for the anchors' part left in, K X = P R, and (1 - R' F' M X) b = R' F' v_0: the
Woodbury identity. Its residual is that of the equations without these anchors.
"""

from __future__ import annotations

import numpy as np

from pbem.arrays import Integer, Real
from pbem.contact.constraints import ConstraintMap
from pbem.contact.loads import Load
from pbem.contact.modes import Linearisation
from pbem.errors import ConvergenceError
from pbem.solve.problem.problem import Problem
from pbem.solve.problem.response import select_states
from pbem.solve.problem.tangent import Solved, TangentOperator, describe_residual, size_residual

# Solutions are corrected until they are as good as this, though the tolerance may be weaker.
GOOD_RESIDUAL = 1e-12
MOST_CORRECTIONS = 2
# Right-hand sides that are solved together.
COLUMNS_AT_ONCE = 512


class ReleasedTangent(TangentOperator):
    """Another tangent operator, whose solutions it frees from the anchors that a constraint map releases."""

    def __init__(self, problem: Problem, anchored: TangentOperator) -> None:
        self.problem, self.anchored = problem, anchored
        self.held: Solved | None = None  # the last solution with all anchors
        self.responses = np.zeros((problem.unknowns, 0))  # X

    def solve(
        self, constraints: ConstraintMap, load: Load, law: Linearisation, forcing: float = 0.0
    ) -> Solved:
        """See TangentOperator."""
        self.held = self.anchored.solve(constraints, load, law)
        if not _releases(constraints):
            return self.held
        return self._release(self.held, constraints, load, law)

    def check(self, solved: Solved, constraints: ConstraintMap, load: Load, law: Linearisation) -> Solved:
        """See TangentOperator."""
        if solved.checked:
            return solved
        assert self.held is not None
        if not _releases(constraints):
            return self.anchored.check(solved, constraints, load, law)
        self.held = self.anchored.check(self.held, constraints, load, law)
        return self._release(self.held, constraints, load, law)

    def _release(self, held: Solved, constraints: ConstraintMap, load: Load, law: Linearisation) -> Solved:
        """The solution without the released anchors; checked and corrected if that with all anchors is checked."""
        problem = self.problem
        assert constraints.released is not None
        forces = self._share_forces(constraints.released)
        self.responses = self.anchored.solve_forces(constraints, load, law, forces)
        v = constraints.evaluate(held.unknowns) - load.known
        unknowns = self._complete(held.unknowns[:, None], v[:, None], constraints)[:, 0]
        if not held.checked:
            return Solved(unknowns, held.residual, checked=False)
        scale = problem.measure(problem.apply(constraints.offset, load, constraints.released)) or 1.0
        best: Solved | None = None
        for _ in range(1 + MOST_CORRECTIONS):
            v = constraints.evaluate(unknowns)
            left = problem.apply(v, load, constraints.released)
            residual = problem.measure(left) / size_residual(scale, unknowns, constraints.given)
            if best is not None and not residual < best.residual:
                break
            best = Solved(unknowns, residual)
            if residual <= GOOD_RESIDUAL or not np.isfinite(residual):
                break
            change = self.anchored.solve_forces(constraints, load, law, -left[:, None])
            unknowns = unknowns + self._complete(change, constraints.matrix @ change, constraints)[:, 0]
        assert best is not None
        tolerance = problem.model.solver.newton_tolerance
        if not best.residual <= tolerance:
            raise describe_residual(best.residual, tolerance)
        return best

    def _share_forces(self, released: Real) -> Real:
        """P R (this rank's rows, r)."""
        result: Real = self.problem.anchor_parts[0] @ released
        return result

    def _complete(self, unknowns: Real, v: Real, constraints: ConstraintMap) -> Real:
        """x_0 + X b for c columns x_0 (2 nodes, c) and their v_0 (4 nodes, c), less known fields (theory, 62)."""
        released = constraints.released
        assert released is not None
        functional = self.problem.anchor_parts[1]
        matrix = np.eye(released.shape[1]) - released.T @ (functional @ (constraints.matrix @ self.responses))
        try:
            parts = np.linalg.solve(matrix, released.T @ (functional @ v))
        except np.linalg.LinAlgError:
            detail = "the tangent operator is singular without the anchors that the present contact makes needless"
            raise ConvergenceError("singular tangent", detail) from None
        result: Real = unknowns + self.responses @ parts
        return result

    def respond(
        self, constraints: ConstraintMap, load: Load, law: Linearisation, pairs: Integer, directions: Real
    ) -> Real:
        """See TangentOperator; with released anchors by whole solutions, many at a time."""
        if not _releases(constraints):
            return self.anchored.respond(constraints, load, law, pairs, directions)
        states, unknowns = select_states(self.problem, load, law, pairs, directions)
        result = np.empty((len(unknowns), len(unknowns)))
        for first in range(0, len(unknowns), COLUMNS_AT_ONCE):
            some = states[:, first : first + COLUMNS_AT_ONCE]
            change = self.anchored.solve_forces(constraints, load, law, self.problem.system.apply(-some))
            whole = self._complete(change, constraints.matrix @ change + some, constraints)
            result[:, first : first + COLUMNS_AT_ONCE] = whole[unknowns]
        return result

    def solve_forces(self, constraints: ConstraintMap, load: Load, law: Linearisation, forces: Real) -> Real:
        """See TangentOperator."""
        return self.anchored.solve_forces(constraints, load, law, forces)

    def take_over(self, problem: Problem) -> None:
        """See TangentOperator."""
        self.problem, self.held = problem, None
        self.anchored.take_over(problem)

    def destroy(self) -> None:
        """See TangentOperator."""
        self.anchored.destroy()


def _releases(constraints: ConstraintMap) -> bool:
    return constraints.released is not None and constraints.released.shape[1] > 0
