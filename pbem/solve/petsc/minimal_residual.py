"""A Krylov method of PETSc's kind "python" that keeps its directions: a flexible GMRES which can be gone on with.

Each iteration takes one further direction z, the preconditioned residual (where that hardly fell: the preconditioned
last vector of the basis, with which the method cannot break down), and its product K z, orthonormalised against those
before; the residual then is the smallest that all directions so far allow. That is what GMRES finds, with
the basis of P. Jiranek and M. Rozloznik (Numer. Algorithms 53, 2010). Unlike PETSc's own GMRES it has the residual and
the solution after every iteration without a product, and its directions serve for other right-hand sides of the same
operator, so that a system that was solved loosely is solved in full by going on.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Protocol

import numpy as np
from mpi4py import MPI
from scipy.linalg import solve_triangular

from pbem.arrays import Real
from pbem.parallel import add_up, norm_of_parts
from pbem.solve.petsc.session import PETSc

# From a residual that fell to no less than this part the next direction is not taken.
FELL = 0.9
# A product that is the same as a sum of those before, but for this part, adds nothing.
NOTHING = 1e-14
# Vectors of the stored basis in an array. It grows by arrays: a larger one beside the former would take twice as much.
GROWTH = 32


class Rows(Protocol):
    """What is to be solved, on this rank's rows (k,), all ranks together."""

    def multiply(self, part: Real) -> Real:
        """K z."""

    def precondition(self, part: Real) -> Real:
        """P r."""

    def turn(self, part: Real) -> Real:
        """An orthogonal change of the equations, after which some hold by themselves: `judged` are the others."""

    def turn_back(self, part: Real) -> Real:
        """The inverse of `turn`."""

    @property
    def judged(self) -> Real:
        """1 for equations whose residuals are minimised, 0 for those that are fulfilled afterwards."""


class Columns:
    """Vectors (k,) one after the other, as the columns of a matrix."""

    def __init__(self) -> None:
        self.count = 0
        self._blocks: list[Real] = []

    def append(self, vector: Real) -> None:
        """One further column."""
        if self.count == GROWTH * len(self._blocks):
            self._blocks.append(np.empty((len(vector), GROWTH), order="F"))
        self._blocks[-1][:, self.count % GROWTH] = vector
        self.count += 1

    @property
    def last(self) -> Real:
        """The last column."""
        column: Real = self._blocks[-1][:, (self.count - 1) % GROWTH]
        return column

    def _parts(self) -> Iterator[tuple[slice, Real]]:
        for begin, block in zip(range(0, self.count, GROWTH), self._blocks, strict=True):
            end = min(begin + GROWTH, self.count)
            yield slice(begin, end), block[:, : end - begin]

    def dot(self, vector: Real) -> Real:
        """Products (count,) of all columns with a vector."""
        return np.concatenate([np.zeros(0), *(part.T @ vector for _, part in self._parts())])

    def add_up(self, shares: Real, rows: int) -> Real:
        """The sum (rows,) of so much of each column."""
        result = np.zeros(rows)
        for own, part in self._parts():
            result += part @ shares[own]
        return result


class MinimalResidual:
    """See the module; the context of a PETSc KSP of type "python".

    residual: of the last solution, this rank's part. must_stop: asked in each iteration, all ranks together, whether to
    end there; stopped: whether it was so.
    """

    def __init__(self, comm: MPI.Intracomm, rows: Rows, most: int) -> None:
        """most: directions that are kept."""
        self._comm, self._rows, self._most = comm, rows, most
        self.forget()
        self.residual: Real = np.zeros(0)
        self.must_stop: Callable[[], bool] = lambda: False
        self.stopped = False

    def forget(self) -> None:
        """Drop all directions, as those of another operator."""
        self._directions, self._products = Columns(), Columns()
        self._factor = np.zeros((0, 0))

    @property
    def _count(self) -> int:
        return self._products.count

    def solve(self, solver: PETSc.KSP, right: PETSc.Vec, left: PETSc.Vec) -> None:
        """What PETSc asks of a Krylov method; begins at zero (theory, 87)."""
        begun = residual = self._rows.turn(np.array(right.getArray(readonly=True)))
        judged = self._rows.judged
        if self._count >= self._most:
            self.forget()
        shares, first = np.zeros(self._count), self._measure(residual)
        for _ in range(2 if self._count else 0):  # the first leaves rounding of the largest vectors
            share = add_up(self._comm, self._products.dot(judged * residual))
            residual = residual - self._products.add_up(share, len(residual))
            shares += share
        norm, before, number = self._measure(residual), np.inf, 0
        reason = _ask(solver, 0, norm, first)
        while not reason:
            from_residual = norm <= FELL * before or not self._count
            given = residual if from_residual else judged * self._products.last
            if not self._add(self._rows.turn_back(given)):
                reason = PETSc.KSP.ConvergedReason.DIVERGED_BREAKDOWN
                break
            last = self._products.last
            share = add_up(self._comm, np.array([last @ (judged * residual)]))
            residual = residual - share[0] * last
            shares = np.append(shares, share)
            before, norm, number = norm, self._measure(residual), number + 1
            reason = _ask(solver, number, norm, first)
            self.stopped = not reason and self.must_stop()
            if not reason and (self.stopped or self._count >= self._most):
                reason = PETSc.KSP.ConvergedReason.DIVERGED_MAX_IT
        solver.setConvergedReason(reason)
        if reason == PETSc.KSP.ConvergedReason.DIVERGED_NANORINF:  # nothing of it can be used
            self.forget()
            shares, residual = np.zeros(0), begun
        parts = solve_triangular(self._factor[: self._count, : self._count], shares) if self._count else shares
        left.setArray(self._directions.add_up(parts, len(residual)))
        self.residual = self._rows.turn_back(residual)

    def _measure(self, residual: Real) -> float:
        return norm_of_parts(self._comm, self._rows.judged * residual)

    def _add(self, given: Real) -> bool:
        """Take the direction that the preconditioner makes of a vector; whether its product is a new one."""
        direction = self._rows.precondition(given)
        product = self._rows.turn(self._rows.multiply(direction))
        judged, whole = self._rows.judged, self._measure(product)
        factor = np.zeros(self._count + 1)
        for _ in range(2):
            share = add_up(self._comm, self._products.dot(judged * product)) if self._count else np.zeros(0)
            product = product - self._products.add_up(share, len(product))
            factor[:-1] += share
        factor[-1] = self._measure(product)
        if not factor[-1] > NOTHING * whole:
            return False
        room = self._factor.shape[1]
        if self._count == room:
            wider = np.zeros((room + GROWTH, room + GROWTH))
            wider[:room, :room] = self._factor
            self._factor = wider
        self._factor[: len(factor), self._count] = factor
        self._directions.append(direction)
        self._products.append(product / factor[-1])
        return True


def _ask(solver: PETSc.KSP, number: int, norm: float, first: float) -> int:
    """PETSc's reason to end after so many iterations, 0 for none; tells its monitors. first: the norm at the start."""
    reasons = PETSc.KSP.ConvergedReason
    solver.setIterationNumber(number)
    if not np.isfinite(norm):  # which PETSc refuses to be told
        return int(reasons.DIVERGED_NANORINF)
    solver.setResidualNorm(norm)
    solver.monitor(number, norm)
    relative, absolute, _, most = solver.getTolerances()
    if norm <= absolute:
        return int(reasons.CONVERGED_ATOL)
    if norm <= relative * first:
        return int(reasons.CONVERGED_RTOL)
    return int(reasons.DIVERGED_MAX_IT) if number >= most else 0
