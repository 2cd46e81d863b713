"""The tangent operator with few contact unknowns: one factorisation, and a small system for every change of modes.

Beside PETSc's factors all that changes is in one frozen object, `Known`. Three steps put another in its place: new
factors (`_factorise`), columns of further pairs (`_add_columns`), another load (`_take_load`). `solve` takes those that
the present laws need and then solves the pairs' system; `check` corrects a solution by its true residual.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from pbem.arrays import Bool, Integer, Real
from pbem.contact.constraints import ConstraintMap
from pbem.contact.loads import Load
from pbem.contact.modes import G_N, P_N, P_S, Linearisation
from pbem.mesh.numbering import number_components
from pbem.parallel import broadcast, gather_rows
from pbem.solve.petsc.refactoring import Effort
from pbem.solve.problem.problem import Problem
from pbem.solve.problem.tangent import Solved, TangentOperator, describe_residual, size_residual
from pbem.solve.tangent.condensation import (
    PairBases,
    PairFactors,
    PairSolution,
    Split,
    factorise_pairs,
    respond_pairs,
    solve_pairs,
)
from pbem.solve.tangent.load_basis import LoadBasis
from pbem.solve.tangent.mapped_columns import apply_narrow
from pbem.solve.tangent.pair_columns import PairColumns, start_columns
from pbem.solve.tangent.reference import Reference, TangentRows

# A condensed system of a worse reciprocal condition is not trusted: the factors are made anew in the present modes.
LEAST_RCOND = 1e-11
# Checked solutions are corrected until they are as good as this, though the tolerance may be weaker.
GOOD_RESIDUAL = 1e-12
MOST_CORRECTIONS = 2


@dataclass(frozen=True)
class LoadSolution:
    """What a load does to the reference operator; fixed (k, 4): the offsets of the pairs that never change under it.

    offset (4 nodes,): m without the offsets of varying pairs. unknowns (2 nodes,): y = -K0^-1 B m. forces: this rank's
    rows of B m.
    """

    load: Load
    fixed: Real
    offset: Real
    unknowns: Real
    forces: Real

    def is_of(self, load: Load, fixed: Real) -> bool:
        """Whether it is the solution for these numbers."""
        pairs = [(getattr(self.load, each.name), getattr(load, each.name)) for each in fields(Load)]
        return all(np.array_equal(mine, yours) for mine, yours in [(self.fixed, fixed), *pairs])


@dataclass(frozen=True)
class Known:
    """What is known of the reference operator that is factorised.

    laws (m, 4, 2): the tangents of all pairs in it. bases: of the varying pairs. columns: of those that have changed.
    effort: what has been done since it was factorised; counted (v, 4, 2): the tangents of the varying pairs whose
    system was counted last. loads: solutions for all loads so far; load: for the last.
    """

    laws: Real
    bases: PairBases
    columns: PairColumns
    effort: Effort
    loads: LoadBasis
    load: LoadSolution | None = None
    counted: Real | None = None


class CondensedTangent(TangentOperator):
    """Factors of one reference operator; the contact pairs' unknowns are condensed (see condensation).

    varying (m,): pairs whose mode can change. If they are few, their columns are computed at once; crack pairs are
    eliminated from the reference operator, the others have the modes there that they had when it was factorised, and it
    serves for good. If they are many, the reference operator is that of the modes at one time, columns are computed of
    pairs that change, and it is factorised anew when that costs less.
    known: None while nothing is factorised.
    """

    def __init__(self, problem: Problem, rows: TangentRows, varying: Bool, few: bool, panels: bool = False) -> None:
        """panels: see Reference."""
        self.problem, self.few = problem, few
        self.varying = np.flatnonzero(varying)
        self.fixed = np.flatnonzero(~varying)
        pairs = problem.mesh.pairs
        self.eliminated = pairs.crack & varying & few
        self.reference = Reference(problem, rows, np.flatnonzero(self.eliminated), panels)
        self.unknowns = number_components(pairs.slave[self.varying])
        self.known: Known | None = None
        self._factors: PairFactors | None = None  # of the last system of the pairs, on the first rank

    def solve(
        self, constraints: ConstraintMap, load: Load, law: Linearisation, forcing: float = 0.0
    ) -> Solved:
        """See TangentOperator. The first solution after a factorisation is checked, others are not."""
        fresh = not self._reach(law)
        if fresh:
            self._factorise(load, law)
        unknowns, pairs = self._combine(load, law)
        if pairs.rcond < LEAST_RCOND and self._can_be_nearer(law):
            fresh = True
            self._factorise(load, law)
            unknowns, pairs = self._combine(load, law)
        solved = Solved(unknowns, pairs.residual, checked=False)
        return self.check(solved, constraints, load, law) if fresh or pairs.rcond < LEAST_RCOND else solved

    def check(self, solved: Solved, constraints: ConstraintMap, load: Load, law: Linearisation) -> Solved:
        """See TangentOperator."""
        if solved.checked:
            return solved
        tolerance = self.problem.model.solver.newton_tolerance
        best = self._correct(solved.unknowns, constraints, load, law)
        if not best.residual <= tolerance and self._can_be_nearer(law):
            self._factorise(load, law)
            best = self._correct(self._combine(load, law)[0], constraints, load, law)
        if best.residual <= tolerance:
            return best
        if not self.eliminated[self.varying].all():
            self.known = None  # modes like these are no reference for others
        raise describe_residual(best.residual, tolerance)

    @property
    def _present(self) -> Known:
        assert self.known is not None
        return self.known

    def _reach(self, law: Linearisation) -> bool:
        """Whether what is known serves for other laws, with the columns of the pairs that have changed if need be."""
        known = self.known
        if known is None or not np.array_equal(known.laws[self.fixed], law.tangent[self.fixed]):
            return False
        changed = np.flatnonzero((self._split(law).b_tangent != 0).any(axis=(1, 2)))
        missing = changed[~self._mark(known.columns.known)[changed]]
        # From one step to the next most often no tangent changes: the factors of their system serve again.
        tangents = law.tangent[self.varying]
        size = 0 if known.counted is not None and np.array_equal(known.counted, tangents) else 2 * len(changed)
        if not known.effort.allows(2 * len(missing), size) and self._can_be_nearer(law):
            return False
        self._add_columns(missing, size)
        self.known = replace(self._present, counted=tangents)
        return True

    def _mark(self, pairs: Integer) -> Bool:
        """Which ones (v,) of the varying pairs are among these."""
        there = np.zeros(len(self.varying), dtype=bool)
        there[pairs] = True
        return there

    def _add_columns(self, missing: Integer, size: int) -> None:
        """Take further pairs' columns; size: of the dense system that they are wanted for."""
        known = self._present
        columns = known.columns.extend(missing) if len(missing) else known.columns
        self.known = replace(known, columns=columns, effort=known.effort.spend(2 * len(missing), size))

    def _factorise(self, load: Load, law: Linearisation) -> None:
        """Take a reference operator with the laws of the present modes; the loads so far are solved for anew.

        Raises ConvergenceError ("singular tangent", "linear solver"); then nothing is known.
        """
        problem = self.problem
        loads = LoadBasis(problem.unknowns, self.reference.rows) if self.known is None else self.known.loads
        self.known = self._factors = None  # its columns too, before there are others
        tangent = self._refer(law)
        none = np.zeros(tangent.shape[:2])
        self.reference.form(problem.constrain(Linearisation(tangent, none, law.leader), load).matrix)
        bases = PairBases(tangent[self.varying], problem.traction_scale)
        complement = np.zeros_like(tangent)
        complement[self.varying] = bases.complement
        states = problem.constrain(Linearisation(complement, none, law.leader), load).matrix
        columns = start_columns(self.reference, states[:, self.unknowns], self.unknowns)
        if self.few:
            columns = columns.extend(np.arange(len(self.varying)))
        effort = Effort(problem.comm.size, self.reference.factors.work, limited=not self.few)
        self.known = Known(tangent, bases, columns, effort, loads.renew(self._solve_load))

    def _refer(self, law: Linearisation) -> Real:
        """The pairs' tangents (m, 4, 2) for a reference operator: the law's, but sticking ones where eliminated."""
        tangent = law.tangent.copy()
        tangent[self.eliminated] = 0.0
        tangent[self.eliminated, P_N, 0] = tangent[self.eliminated, P_S, 1] = self.problem.traction_scale
        return tangent

    def _can_be_nearer(self, law: Linearisation) -> bool:
        """Whether another reference operator would be nearer to the present laws."""
        return not np.array_equal(self._present.laws, self._refer(law))

    def _split(self, law: Linearisation) -> Split:
        offset = law.offset[self.varying].copy()
        offset[:, G_N] -= self.problem.laws.gap[self.varying]
        return self._present.bases.split(law.tangent[self.varying], offset)

    def _combine(self, load: Load, law: Linearisation) -> tuple[Real, PairSolution]:
        """x (2 nodes,) of the load in the laws' modes, and the solution of the pairs' system."""
        unknowns, pairs = self._condense(self._take_load(load, law).unknowns[:, None], self._split(law))
        return unknowns[:, 0], pairs

    def _take_load(self, load: Load, law: Linearisation) -> LoadSolution:
        """What the load does to the reference operator; solved for if it is no sum of those before."""
        problem, known, fixed = self.problem, self._present, law.offset[self.fixed]
        if known.load is not None and known.load.is_of(load, fixed):
            return known.load
        offset = np.zeros_like(law.offset)
        offset[self.fixed] = fixed
        offset[self.varying, G_N] = problem.laws.gap[self.varying]
        constant = problem.constrain(Linearisation(known.laws, offset, law.leader), load).offset
        vector = join_load(constant, load, problem.traction_scale)
        loads, parts = known.loads.extend(vector, lambda: problem.apply(constant, load), self._solve_load)
        found = LoadSolution(load, fixed, constant, *loads.combine(parts))
        self.known = replace(known, loads=loads, load=found)
        return found

    def _correct(self, unknowns: Real, constraints: ConstraintMap, load: Load, law: Linearisation) -> Solved:
        """The solution with its true residual, corrected for as long as that makes it smaller."""
        problem, solution = self.problem, self._take_load(load, law)
        # B m, of which the load's part is known.
        own = apply_narrow(self.reference.operator, constraints.offset - solution.offset)
        scale = problem.measure(solution.forces + own) or 1.0
        best: Solved | None = None
        for _ in range(1 + MOST_CORRECTIONS):
            v = constraints.evaluate(unknowns)
            left = problem.apply(v, load)
            left_over = problem.measure(left)
            residual = left_over / size_residual(scale, unknowns, constraints.given)
            if best is not None and not residual < best.residual:
                break
            best = Solved(unknowns, residual)
            if left_over <= GOOD_RESIDUAL * scale or not np.isfinite(residual):
                break
            split = self._split(law).drop_offsets()
            unknowns = unknowns + self._condense(self._solve_system(-left[:, None]), split)[0][:, 0]
        assert best is not None
        return best

    def _solve_load(self, forces: Real) -> Real:
        return self._solve_system(-forces[:, None])[:, 0]

    def _solve_system(self, rhs: Real) -> Real:
        """K0^-1 of this rank's part (rows, c) of right-hand sides, (2 nodes, c) on every rank."""
        return gather_rows(self.problem.comm, self.reference.solve_columns(rhs))

    def _condense(self, given: Real, split: Split) -> tuple[Real, PairSolution]:
        """x (2 nodes, c) for c columns y, and the solution of the known pairs' system, by the first rank."""
        problem, columns = self.problem, self._present.columns
        known = columns.known
        rest = np.flatnonzero(~self._mark(known))
        if split.b_offset[rest].any():
            constant = np.zeros_like(split.b_offset)
            constant[rest] = split.b_offset[rest]
            given = given - self._solve_system(columns.find_forces(constant)[:, None])
        found: PairSolution | None = None
        of_pairs = self.unknowns.reshape(-1, 2)
        if problem.comm.rank == 0:
            own = split.take(known)
            if self._factors is None or not self._factors.serve(columns.coupling, own):
                self._factors = None  # before there are others
                self._factors = factorise_pairs(columns.coupling, own)
            found = solve_pairs(self._factors, given[of_pairs[known].ravel()], own)
        found = broadcast(problem.comm, found)
        assert found is not None
        unknowns = given - columns.combine(split.take(known).find_b(found.unknowns))
        unknowns[of_pairs[known].ravel()] = found.unknowns
        others = unknowns[of_pairs[rest]] - split.a_offset[rest, :, None]
        unknowns[of_pairs[rest]] = np.linalg.solve(split.a_tangent[rest], others)
        return unknowns, found

    def respond(
        self, constraints: ConstraintMap, load: Load, law: Linearisation, pairs: Integer, directions: Real
    ) -> Real:
        """See TangentOperator; by the first rank, from the columns of these pairs."""
        own = np.searchsorted(self.varying, pairs)
        missing = np.setdiff1d(own, self._present.columns.known)
        if len(missing):
            self._add_columns(missing, 0)
        columns = self._present.columns
        known = columns.known
        along = self._present.bases.inverse[own] @ (directions / self._present.bases.units[:, None])
        found: Real | None = None
        if self.problem.comm.rank == 0:
            order = np.argsort(known)
            at = order[np.searchsorted(known, own, sorter=order)]
            found = respond_pairs(columns.coupling, self._split(law).take(known), at, along[:, :2], along[:, 2:])
        found = broadcast(self.problem.comm, found)
        assert found is not None
        return found

    def solve_forces(self, constraints: ConstraintMap, load: Load, law: Linearisation, forces: Real) -> Real:
        """See TangentOperator."""
        return self._condense(self._solve_system(forces), self._split(law).drop_offsets())[0]

    def take_over(self, problem: Problem) -> None:
        """See TangentOperator."""
        self.problem = self.reference.problem = problem
        if self.known is not None:  # the gap may be another
            self.known = replace(self.known, load=None)

    def destroy(self) -> None:
        """See TangentOperator."""
        self.reference.destroy()


def join_load(constant: Real, load: Load, traction_scale: float) -> Real:
    """All that forces depend on, in one vector of numbers of one size: the map's offset, and the known fields."""
    scale = np.repeat([1.0, 1.0 / traction_scale], len(constant) // 2)
    far = load.fields.take_far(np.arange(len(constant) // 4)) * np.array([[1.0], [1.0 / traction_scale]])
    return np.concatenate([constant * scale, load.known * scale, far.real.ravel(), far.imag.ravel()])
