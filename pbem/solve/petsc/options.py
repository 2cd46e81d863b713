"""PETSc's options are tried on a small system before anything is computed: PETSc reads them when it first solves."""

from __future__ import annotations

from collections.abc import Mapping

from pbem.errors import CaseError, Fault
from pbem.solve.petsc.session import PREFIX, PETSc, petsc_options


def check_kind(given: object) -> None:
    """Raise TypeError for options that are no dictionary of texts."""
    if given is None or (isinstance(given, Mapping) and all(isinstance(name, str) for name in given)):
        return
    raise TypeError(f"petsc: found {given!r}; expected a dictionary: values by names of options")


def check_options(source: str, case: Mapping[str, str], given: Mapping[str, str]) -> None:
    """Try options without prefix: those of a case's [petsc] table, and those given besides, which win over them.

    Raises CaseError with all that PETSc refuses, in its own words. For one rank.
    """
    faults = []
    for name, value in {**case, **given}.items():
        said = _try(name, value)
        if said:
            place = f"-{PREFIX}{name}" if name in given else f"petsc.{name}"
            faults.append(Fault(place, f'"{value}", which PETSc refuses ({said})', "a value that it takes"))
    if faults:
        raise CaseError(source, tuple(faults))


def _try(name: str, value: str) -> str:
    """What PETSc says against an option of a direct solver with GMRES around it; "" if nothing."""
    matrix = PETSc.Mat().createAIJ((2, 2), comm=PETSc.COMM_SELF)
    solver = PETSc.KSP().create(PETSc.COMM_SELF)
    try:
        with petsc_options({name: value}):
            matrix.setUp()
            matrix.setDiagonal(_make_ones())
            solver.setOptionsPrefix(PREFIX)
            matrix.setOptionsPrefix(PREFIX)
            solver.setOperators(matrix)
            solver.setType("fgmres")
            solver.getPC().setType("lu")
            solver.getPC().setFactorSolverType("mumps")
            solver.setFromOptions()
            solver.setTolerances(*solver.getTolerances())
            if solver.getPC().getType() == "lu":
                solver.setUp()
    except PETSc.Error as error:
        return " ".join(str(error).strip().splitlines()[-1].removeprefix("[0]").split())
    finally:
        solver.destroy()
        matrix.destroy()
    return ""


def _make_ones() -> PETSc.Vec:
    ones = PETSc.Vec().createSeq(2, comm=PETSc.COMM_SELF)
    ones.set(1.0)
    return ones
