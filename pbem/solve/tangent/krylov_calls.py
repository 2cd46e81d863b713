"""What PETSc's solvers and our GMRES ask of a tangent operator that is not stored."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from pbem.arrays import Integer, Real
from pbem.errors import ConvergenceError
from pbem.mesh.numbering import number_components
from pbem.parallel import gather_parts
from pbem.solve.petsc.session import PREFIX, PETSc
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


def choose_options() -> dict[str, str]:
    """Options of PETSc's that have no function of their own, unless the user says otherwise.

    GMRES orthogonalises its vectors twice: with traction equations on graded meshes rows differ so much in size that
    once is not enough, and it stagnates.
    """
    name = "ksp_gmres_cgs_refinement_type"
    return {} if PETSc.Options().hasName(PREFIX + name) else {name: "refine_always"}


def find_order(problem: Problem) -> Integer:
    """Unknowns of all ranks, one rank after the other."""
    own = problem.system.nodes.astype(float)
    nodes = gather_parts(problem.comm, own).astype(np.int64)
    return number_components(nodes)


def refuse_unsolved(solver: PETSc.KSP, part: float) -> None:
    """Raise ConvergenceError ("linear solver") where GMRES did not reduce a residual to a part of it within its limit
    of iterations. Not where rounding ended it, as there is no better solution then."""
    reasons = PETSc.KSP.ConvergedReason
    if solver.getConvergedReason() in (reasons.DIVERGED_MAX_IT, reasons.DIVERGED_NANORINF):
        raise ConvergenceError(
            "linear solver",
            f"GMRES did not reduce a residual to {part:g} of it in {solver.getIterationNumber()} iterations",
        )
