"""The tangent operator with few contact unknowns: one factorisation, and a small system for every change of modes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pbem.contact.constraints import ConstraintMap
from pbem.contact.loads import Load
from pbem.contact.modes import G_N, P_N, P_S, Linearisation
from pbem.parallel import broadcast, gather_rows
from pbem.solve.condensation import PairBases, PairSolution, Split, respond_pairs, solve_pairs
from pbem.solve.effort import Effort
from pbem.solve.linear import choose_method
from pbem.solve.load_basis import LoadBasis
from pbem.solve.pair_columns import PairColumns
from pbem.solve.problem import Problem
from pbem.solve.reference import Reference, apply_narrow
from pbem.solve.tangent import Solved, describe_residual, size_residual

Real = NDArray[np.float64]
Integer = NDArray[np.int64]
Bool = NDArray[np.bool_]

# A condensed system of a worse reciprocal condition is not trusted: the factors are made anew in the present modes.
LEAST_RCOND = 1e-11
# Checked solutions are corrected until they are as good as this, though the tolerance may be weaker.
GOOD_RESIDUAL = 1e-12
MOST_CORRECTIONS = 2


class CondensedTangent:
    """Factors of one reference operator; the contact pairs' unknowns are condensed (see pbem.solve.condensation).

    varying (m,): pairs whose mode can change. If they are few, their columns are computed at once; crack pairs are
    eliminated from the reference operator, the others have the modes there that they had when it was factorised, and it
    serves for good. If they are many, the reference operator is that of the modes at one time, columns are computed of
    pairs that change, and it is factorised anew when that costs less.
    """

    def __init__(self, problem: Problem, varying: Bool, few: bool) -> None:
        self.problem, self.few = problem, few
        self.varying = np.flatnonzero(varying)
        self.fixed = np.flatnonzero(~varying)
        pairs = problem.mesh.pairs
        self.eliminated = pairs.crack & varying & few
        method = choose_method(problem.model.solver.linear, len(problem.mesh.region_names))
        self.reference = Reference(problem, method, np.flatnonzero(self.eliminated))
        self.unknowns = (2 * pairs.slot[self.varying][:, None] + np.arange(2)).ravel()
        self.laws: Real | None = None  # the laws' tangents in the reference (m, 4, 2)
        self.loads = LoadBasis(problem.unknowns, self.reference.rows)
        self.load: Load | None = None
        self.effort = Effort(problem.comm.size)

    def solve(self, constraints: ConstraintMap, load: Load, law: Linearisation) -> Solved:
        """See AnyTangent. The first solution after a factorisation is checked, others are not."""
        fresh = self.laws is None or not np.array_equal(self.laws[self.fixed], law.tangent[self.fixed])
        if fresh or not self._reach(law):
            fresh = True
            self._refer(load, law)
        unknowns, pairs = self._combine(load, law)
        if pairs.rcond < LEAST_RCOND and self._can_refer_better(law):
            fresh = True
            self._refer(load, law)
            unknowns, pairs = self._combine(load, law)
        solved = Solved(unknowns, constraints.evaluate(unknowns), pairs.residual, checked=False)
        return self.check(solved, constraints, load, law) if fresh or pairs.rcond < LEAST_RCOND else solved

    def _combine(self, load: Load, law: Linearisation) -> tuple[Real, PairSolution]:
        """x (2 nodes,) of the load in the laws' modes, and the solution of the pairs' system."""
        unknowns, pairs = self._condense(self._find_load_solution(load, law)[:, None], self._split(law))
        return unknowns[:, 0], pairs

    def _reach(self, law: Linearisation) -> bool:
        """Compute the columns of the pairs that have changed, unless new factors cost less."""
        changed = np.flatnonzero((self._split(law).b_tangent != 0).any(axis=(1, 2)))
        missing = np.setdiff1d(changed, self.columns.known)
        if not self.effort.allows(2 * len(missing), 2 * len(changed)) and self._can_refer_better(law):
            return False
        if len(missing):
            self.columns.add(missing)
        return True

    def check(self, solved: Solved, constraints: ConstraintMap, load: Load, law: Linearisation) -> Solved:
        """See AnyTangent."""
        if solved.checked:
            return solved
        tolerance = self.problem.model.solver.newton_tolerance
        best = self._mend(solved.unknowns, constraints, load, law)
        if best.residual <= tolerance:
            return best
        if self._can_refer_better(law):
            self._refer(load, law)
            return self.check(self.solve(constraints, load, law), constraints, load, law)
        if not self.eliminated[self.varying].all():
            self.laws = None  # modes like these are no reference for others
        raise describe_residual(best.residual, tolerance)

    def _mend(self, unknowns: Real, constraints: ConstraintMap, load: Load, law: Linearisation) -> Solved:
        """The solution with its true residual, corrected for as long as that makes it smaller."""
        problem = self.problem
        scale = self._measure_forces(constraints) or 1.0
        split = self._split(law).drop_offsets()
        best: Solved | None = None
        for _ in range(1 + MOST_CORRECTIONS):
            v = constraints.evaluate(unknowns)
            left = problem.apply(v, load)
            left_over = problem.measure(left)
            residual = left_over / size_residual(scale, unknowns)
            if best is not None and not residual < best.residual:
                break
            best = Solved(unknowns, v, residual)
            if left_over <= GOOD_RESIDUAL * scale or not np.isfinite(residual):
                break
            unknowns = unknowns + self._condense(self._solve_system(-left[:, None]), split)[0][:, 0]
        assert best is not None
        return best

    def _refer(self, load: Load, law: Linearisation) -> None:
        """Factorise the operator with the laws of the present modes, and find what the pairs add to it."""
        problem = self.problem
        self.laws, self.load = None, None
        tangent = self._reference_tangent(law)
        none = np.zeros(tangent.shape[:2])
        self.reference.form(problem.constrain(Linearisation(tangent, none, law.leader), load).matrix)
        self.bases = PairBases(tangent[self.varying], problem.traction_scale)
        complement = np.zeros_like(tangent)
        complement[self.varying] = self.bases.complement
        states = problem.constrain(Linearisation(complement, none, law.leader), load).matrix
        self.columns = PairColumns(self.reference, states[:, self.unknowns], self.unknowns)
        self.effort.restart(self.reference.solver.work, limited=not self.few)
        if self.few:
            self.columns.add(np.arange(len(self.varying)))
        self.loads.renew(self._solve_load)
        self.laws = tangent

    def _reference_tangent(self, law: Linearisation) -> Real:
        """The pairs' tangents (m, 4, 2) for a reference operator: the law's, but sticking ones where eliminated."""
        tangent = law.tangent.copy()
        tangent[self.eliminated] = 0.0
        tangent[self.eliminated, P_N, 0] = tangent[self.eliminated, P_S, 1] = self.problem.traction_scale
        return tangent

    def _can_refer_better(self, law: Linearisation) -> bool:
        """Whether another reference operator would be nearer to the present laws."""
        return self.laws is None or not np.array_equal(self.laws, self._reference_tangent(law))

    def _split(self, law: Linearisation) -> Split:
        offset = law.offset[self.varying].copy()
        offset[:, G_N] -= self.problem.laws.gap[self.varying]
        return self.bases.split(law.tangent[self.varying], offset)

    def _find_load_solution(self, load: Load, law: Linearisation) -> Real:
        """y (2 nodes,), without the offsets of varying pairs."""
        if load is not self.load:
            problem = self.problem
            assert self.laws is not None
            offset = law.offset.copy()
            offset[self.varying] = 0.0
            offset[self.varying, G_N] = problem.laws.gap[self.varying]
            constant = self.load_offset = problem.constrain(Linearisation(self.laws, offset, law.leader), load).offset
            self.load_solution, self.load_forces = self.loads.combine(
                join_load(constant, load, problem.traction_scale),
                lambda: problem.apply(constant, load), self._solve_load,
            )  # fmt: skip
            self.load = load
        return self.load_solution

    def _measure_forces(self, constraints: ConstraintMap) -> float:
        """Norm of B m, of which the load's part is known."""
        own = apply_narrow(self.reference.operator, constraints.offset - self.load_offset)
        return self.problem.measure(self.load_forces + own)

    def _solve_load(self, forces: Real) -> Real:
        return self._solve_system(-forces[:, None])[:, 0]

    def _solve_system(self, rhs: Real) -> Real:
        """K0^-1 of this rank's part (rows, c) of right-hand sides, (2 nodes, c) on every rank."""
        return gather_rows(self.problem.comm, self.reference.solve_columns(rhs))

    def _condense(self, given: Real, split: Split) -> tuple[Real, PairSolution]:
        """x (2 nodes, c) for c columns y, and the solution of the known pairs' system, by the first rank."""
        problem, known = self.problem, self.columns.known
        rest = np.setdiff1d(np.arange(len(self.varying)), known)
        if split.b_offset[rest].any():
            constant = np.zeros_like(split.b_offset)
            constant[rest] = split.b_offset[rest]
            given = given - self._solve_system(self.columns.find_forces(constant)[:, None])
        found: PairSolution | None = None
        of_pairs = self.unknowns.reshape(-1, 2)
        if problem.comm.rank == 0:
            found = solve_pairs(self.columns.coupling, given[of_pairs[known].ravel()], split.take(known))
        found = broadcast(problem.comm, found)
        assert found is not None
        unknowns = given - self.columns.combine(split.take(known).find_b(found.unknowns))
        unknowns[of_pairs[known].ravel()] = found.unknowns
        others = unknowns[of_pairs[rest]] - split.a_offset[rest, :, None]
        unknowns[of_pairs[rest]] = np.linalg.solve(split.a_tangent[rest], others)
        return unknowns, found

    def respond(
        self, constraints: ConstraintMap, load: Load, law: Linearisation, pairs: Integer, directions: Real
    ) -> Real:
        """See AnyTangent; by the first rank, from the columns of these pairs."""
        own = np.searchsorted(self.varying, pairs)
        missing = np.setdiff1d(own, self.columns.known)
        if len(missing):
            self.effort.count_columns(2 * len(missing))
            self.columns.add(missing)
        known = self.columns.known
        along = self.bases.inverse[own] @ (directions / self.bases.units[:, None])
        found: Real | None = None
        if self.problem.comm.rank == 0:
            order = np.argsort(known)
            at = order[np.searchsorted(known, own, sorter=order)]
            found = respond_pairs(self.columns.coupling, self._split(law).take(known), at, along[:, :2], along[:, 2:])
        found = broadcast(self.problem.comm, found)
        assert found is not None
        return found

    def solve_forces(self, constraints: ConstraintMap, load: Load, law: Linearisation, forces: Real) -> Real:
        """See AnyTangent."""
        return self._condense(self._solve_system(forces), self._split(law).drop_offsets())[0]

    def destroy(self) -> None:
        """See AnyTangent."""
        self.reference.destroy()


def join_load(constant: Real, load: Load, traction_scale: float) -> Real:
    """All that forces depend on, in one vector of numbers of one size: the map's offset, and the known fields."""
    scale = np.repeat([1.0, 1.0 / traction_scale], len(constant) // 2)
    far = load.far * np.array([[1.0], [1.0 / traction_scale]])
    return np.concatenate([constant * scale, load.known * scale, far.real.ravel(), far.imag.ravel()])
