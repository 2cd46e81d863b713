"""Linear solvers for the tangent operator: dense LU by LAPACK or ScaLAPACK, sparse LU by MUMPS, GMRES on these."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Literal

import numpy as np
import petsc4py
from mpi4py import MPI
from numpy.typing import NDArray

# Signals are the shell's and MPI's business: with PETSc's handlers a closed pipe would look like a crash.
petsc4py.init(["pbem", "-no_signal_handler"])
from petsc4py import PETSc  # noqa: E402

from pbem.errors import ConvergenceError  # noqa: E402

Real = NDArray[np.float64]
Integer = NDArray[np.int64]
Method = Literal["lu", "mumps"]

PREFIX = "pbem_"

# MUMPS' codes (INFOG(1)) for too little work space, which can be asked for again, and for too little memory.
MORE_ROOM_HELPS = (-8, -9, -11, -12, -14, -15, -17, -18, -20)
NO_MEMORY = (-5, -7, -13, -19, -22, -29)
MOST_WORKSPACE = 10_000  # per cent

# PETSc's codes with which LAPACK and ScaLAPACK report a pivot that is zero; MUMPS sets the solver's reason instead.
ZERO_PIVOT, LIBRARY_ERROR = 71, 76


def choose_method(requested: str, regions: int) -> Method:
    """The direct solver: sparse for several regions, since a region's rows are zero in the others' columns."""
    if requested in ("lu", "mumps"):
        return "lu" if requested == "lu" else "mumps"
    return "lu" if regions == 1 else "mumps"


def petsc_version() -> str:
    """Version of the PETSc library in use."""
    return ".".join(str(part) for part in PETSc.Sys.getVersion())


@contextmanager
def petsc_options(options: Mapping[str, str]) -> Iterator[None]:
    """Hold options in PETSc's database under the program's prefix while the block runs."""
    database = PETSc.Options()
    for name, value in options.items():
        database.setValue(PREFIX + name, value)
    try:
        yield
    finally:
        for name in options:
            database.delValue(PREFIX + name)


class LinearSolver:
    """Holds the distributed matrix, its Krylov solver and its factors; rows in contiguous shares of the ranks.

    reuse: keep the factors of an earlier matrix as preconditioner while GMRES converges quickly with them.
    """

    def __init__(self, comm: MPI.Intracomm, method: Method, local_rows: int, rows: int, reuse: bool) -> None:
        self.method = method
        self.reuse = reuse
        self.comm = comm
        self.factored = False  # factors are there that have served a solution
        self.shape = ((local_rows, rows), (local_rows, rows))
        self.matrix: PETSc.Mat | None = None
        self.solver: PETSc.KSP | None = None
        self.converted: PETSc.Mat | None = None  # ScaLAPACK's copy of the dense matrix, which it factors
        self.factor_type = "mumps" if method == "mumps" else ("petsc" if comm.size == 1 else "scalapack")
        self.workspace = 30  # per cent by which MUMPS may exceed its estimate (ICNTL(14))
        self.right, self.left = self._make_vectors()

    def _make_vectors(self) -> tuple[PETSc.Vec, PETSc.Vec]:
        right = PETSc.Vec().createMPI(self.shape[0], comm=self.comm)
        return right, right.duplicate()

    def allocate(self, inside: Integer, outside: Integer) -> None:
        """Make the matrix; inside, outside (local_rows,): numbers of columns in which each row can be non-zero.

        Inside are the columns with the numbers of this rank's rows.
        """
        if self.method == "lu":
            self.matrix = PETSc.Mat().createDense(self.shape, comm=self.comm)
            self.matrix.setUp()
            return
        self.matrix = PETSc.Mat().create(comm=self.comm)
        self.matrix.setSizes(self.shape)
        self.matrix.setType("aij")
        self.matrix.setPreallocationNNZ((inside.astype(PETSc.IntType), outside.astype(PETSc.IntType)))
        self.matrix.setOption(PETSc.Mat.Option.ROW_ORIENTED, True)

    def fill(self, rows: Integer, columns: Integer, values: Real) -> None:
        """Set a dense block: local row numbers, global column numbers, values (rows, columns)."""
        assert self.matrix is not None
        if self.method == "lu":
            self.matrix.getDenseArray()[np.ix_(rows, columns)] = values
            return
        begin = self.matrix.getOwnershipRange()[0]
        self.matrix.setValues(
            (rows + begin).astype(PETSc.IntType), columns.astype(PETSc.IntType), np.ascontiguousarray(values)
        )

    def finish_filling(self) -> None:
        """End an update of the matrix; its factors are made anew at the next solution unless they are reused."""
        assert self.matrix is not None
        self.matrix.assemble()
        if not (self.reuse and self.factored):
            self._renew()

    def _make_solver(self) -> None:
        solver = PETSc.KSP().create(comm=self.comm)
        solver.setOptionsPrefix(PREFIX)
        if self.factor_type == "scalapack":
            assert self.matrix is not None
            self.converted = self.matrix.convert("scalapack", out=PETSc.Mat())
        solver.setOperators(self.matrix, self.converted)
        # Not "preonly": with factors as preconditioner GMRES ends in one iteration, and heeds the user's options.
        solver.setType("fgmres")
        solver.setTolerances(rtol=1e-13, atol=0.0, divtol=1e10, max_it=60)
        preconditioner = solver.getPC()
        preconditioner.setType("lu")
        preconditioner.setFactorSolverType(self.factor_type)
        if self.factor_type == "mumps":
            preconditioner.setFactorSetUpSolverType()
            factor = preconditioner.getFactorMatrix()
            factor.setMumpsIcntl(7, 2)
            factor.setMumpsIcntl(14, self.workspace)
        if self.reuse:
            preconditioner.setReusePreconditioner(True)
        solver.setFromOptions()
        self.solver = solver

    def _destroy_solver(self) -> None:
        for item in (self.solver, self.converted):
            if item is not None:
                item.destroy()
        self.solver = self.converted = None
        self.factored = False

    def solve(self, rhs: Real) -> Real:
        """This rank's part of the solution for this rank's part of the right-hand side.

        Raises ConvergenceError ("singular tangent" or "linear solver") on all ranks alike.
        """
        for _ in range(6):
            assert self.solver is not None
            self.right.setArray(rhs)
            reason = self._run_solver()
            if reason > 0:
                self.factored = True
                return np.array(self.left.getArray())
            if not self._recover():
                break
        raise self._explain(reason)

    def _run_solver(self) -> int:
        """Solve, and return PETSc's reason to end; a zero pivot of dense factors is a failed set-up too."""
        assert self.solver is not None
        try:
            self.solver.solve(self.right, self.left)
        except PETSc.Error as error:
            if error.ierr != {"petsc": ZERO_PIVOT, "scalapack": LIBRARY_ERROR}.get(self.factor_type):
                raise
            # PETSc has left its solver half set up and the vectors locked.
            for vector in (self.right, self.left):
                vector.destroy()
            self.right, self.left = self._make_vectors()
            self._renew()
            return int(PETSc.KSP.ConvergedReason.DIVERGED_PCSETUP_FAILED)
        return int(self.solver.getConvergedReason())

    def _recover(self) -> bool:
        """Whether another try makes sense: more room for MUMPS, or fresh factors in place of reused ones."""
        code = self._find_mumps_code()
        if code is not None:
            if code in MORE_ROOM_HELPS and self.workspace < MOST_WORKSPACE:
                self.workspace = 2 * self.workspace + 50
                self._renew()
                return True
            if code < 0:
                return False
        if self.reuse and self.factored:
            self._renew()
            return True
        return False

    def _find_mumps_code(self) -> int | None:
        """INFOG(1) of MUMPS: 0 or more if all is well; None where MUMPS is not used."""
        if self.solver is None:
            return None
        # Not self.factor_type: the user's options can have put something else in its place.
        preconditioner = self.solver.getPC()
        if preconditioner.getType() != "lu" or preconditioner.getFactorSolverType() != "mumps":
            return None
        return int(preconditioner.getFactorMatrix().getMumpsInfog(1))

    def _renew(self) -> None:
        self._destroy_solver()
        self._make_solver()

    def _explain(self, reason: int) -> ConvergenceError:
        code = self._find_mumps_code()
        if code in MORE_ROOM_HELPS or code in NO_MEMORY:
            detail = f"MUMPS has no room for the LU factors (INFOG(1) = {code}); try more memory or fewer elements"
            return ConvergenceError("linear solver", detail)
        if reason == PETSc.KSP.ConvergedReason.DIVERGED_PCSETUP_FAILED:
            detail = "the tangent operator has no LU factors; a body is probably free to move"
            return ConvergenceError("singular tangent", detail)
        names = {value: name for name, value in vars(PETSc.KSP.ConvergedReason).items() if isinstance(value, int)}
        return ConvergenceError("linear solver", f"PETSc's solver ended with {names.get(reason, reason)}")

    def destroy(self) -> None:
        """Free PETSc's storage (older versions of petsc4py never do it by themselves)."""
        self._destroy_solver()
        for item in (self.matrix, self.right, self.left):
            if item is not None:
                item.destroy()
        self.matrix = None
