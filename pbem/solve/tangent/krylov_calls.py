"""What PETSc's solvers and our GMRES ask of a tangent operator that is not stored."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from pbem.arrays import Real
from pbem.contact.modes import Linearisation, carry_over
from pbem.errors import ConvergenceError
from pbem.solve.petsc.session import PREFIX, PETSc, petsc_options
from pbem.solve.preconditioner.schwarz import SchwarzPreconditioner
from pbem.solve.problem.problem import Problem


class Called(Protocol):
    """What is asked of the tangent operator, on this rank's parts of vectors; all ranks call all methods together."""

    preconditioner: SchwarzPreconditioner

    def multiply(self, part: Real) -> Real: ...

    def precondition(self, part: Real) -> Real: ...


class Product:
    """What PETSc asks of a matrix that is not stored."""

    def __init__(self, tangent: Called) -> None:
        self._tangent = tangent

    def mult(self, matrix: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        y.setArray(self._tangent.multiply(np.array(x.getArray(readonly=True))))


class Rows:
    """This rank's equations and preconditioner, turned within each node: see pbem.solve.petsc.minimal_residual.Rows."""

    def __init__(self, tangent: Called) -> None:
        self._tangent = tangent

    def multiply(self, part: Real) -> Real:
        return self._tangent.multiply(part)

    def precondition(self, part: Real) -> Real:
        return self._tangent.precondition(part)

    def turn(self, part: Real) -> Real:
        return self._tangent.preconditioner.turn(part)

    def turn_back(self, part: Real) -> Real:
        return self._tangent.preconditioner.turn_back(part)

    @property
    def judged(self) -> Real:
        return self._tangent.preconditioner.judged


class Preconditioning:
    """What PETSc asks of a preconditioner of ours."""

    def __init__(self, tangent: Called) -> None:
        self._tangent = tangent

    def apply(self, preconditioner: PETSc.PC, x: PETSc.Vec, y: PETSc.Vec) -> None:
        y.setArray(self._tangent.precondition(np.array(x.getArray(readonly=True))))


def take_options(solver: PETSc.KSP, most: int) -> bool:
    """Set a solver as the user's options say, who may ask for another method; whether it is ours. most: iterations.

    Raises ConvergenceError: "linear solver", for a preconditioner that needs a stored matrix.
    """
    with petsc_options(choose_options()):
        solver.setFromOptions()
    ours = solver.getType() == "python"
    if not ours:
        solver.setPCSide(PETSc.PC.Side.RIGHT)
        if not PETSc.Options().hasName(PREFIX + "ksp_gmres_restart"):
            solver.setGMRESRestart(most)
    kind = solver.getPC().getType()
    if kind not in ("python", "none"):
        solver.destroy()
        raise ConvergenceError(
            "linear solver",
            f"PETSc's preconditioner {kind!r} needs a stored matrix, which the hierarchical operator has not; "
            'omit pc_type, or use operator = "dense"',
        )
    return bool(ours)


def choose_options() -> dict[str, str]:
    """Options of PETSc's that have no function of their own, unless the user says otherwise.

    GMRES orthogonalises its vectors twice: with traction equations on graded meshes rows differ so much in size that
    once is not enough, and it stagnates.
    """
    name = "ksp_gmres_cgs_refinement_type"
    return {} if PETSc.Options().hasName(PREFIX + name) else {name: "refine_always"}


def carry_solution(
    problem: Problem, part: Real, before: Linearisation, law: Linearisation, expected: Real | None
) -> Real:
    """This rank's part of the last solution (own unknowns,), under the laws before, in the present unknowns.

    expected (m, 4): states that are expected of the pairs, None for those of the solution."""
    nodes, slave, carried = problem.system.nodes, problem.mesh.pairs.slave, part.reshape(-1, 2).copy()
    own = np.flatnonzero(np.isin(slave, nodes))
    at, leader = np.searchsorted(nodes, slave[own]), problem.laws.leader
    state = before.take(own).apply(carried[at])
    if expected is not None:
        state = np.where((leader[own] != own)[:, None], state, expected[own])
    carried[at] = carry_over(state, law.take(own), problem.traction_scale)
    return carried.ravel()


def is_unsolved(solver: PETSc.KSP) -> bool:
    """Whether GMRES came to its limit of iterations. Not where rounding ended it, as there is no better solution then.
    """
    reasons = PETSc.KSP.ConvergedReason
    return solver.getConvergedReason() in (reasons.DIVERGED_MAX_IT, reasons.DIVERGED_NANORINF)


def refuse_unsolved(solver: PETSc.KSP, part: float) -> None:
    """Raise ConvergenceError ("linear solver") where GMRES did not reduce a residual to a part of it within its limit
    of iterations."""
    if is_unsolved(solver):
        raise ConvergenceError(
            "linear solver",
            f"GMRES did not reduce a residual to {part:g} of it in {solver.getIterationNumber()} iterations",
        )


def describe_unsolved(
    residual: float, count: int, tolerance: float, asked: tuple[float, float], singular: int
) -> ConvergenceError:
    """The error of a system that GMRES solved to a residual only, in so many iterations; tolerance: of that.

    asked: the relative tolerance of GMRES, and what it is unless the user asks for another. singular: groups of
    elements whose matrices are.
    """
    loose = f"; {singular} groups of elements are not held by any neighbour" if singular else ""
    given, usual = asked
    return ConvergenceError(
        "linear solver",
        f"GMRES reached a relative residual of {residual:.1e} in {count} iterations (asked: {tolerance:.1e}){loose}"
        + (f"; the option ksp_rtol = {given:g} lets it end there"
           if given > usual else '; try operator = "dense"'),
    )
