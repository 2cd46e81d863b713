"""Linear solvers for the tangent operator: dense LU by LAPACK or ScaLAPACK, sparse LU by MUMPS, GMRES on these."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from mpi4py import MPI

from pbem.arrays import Integer, Real
from pbem.bem.direct_method import OPERATIONS_OF_A_SPARSE_ENTRY, OPERATIONS_OF_AN_ENTRY, Method
from pbem.errors import ConvergenceError
from pbem.parallel import gather_parts
from pbem.solve.petsc.refactoring import FactorWork
from pbem.solve.petsc.session import PREFIX, PETSc, factor_in_place, pass_over_divergence
from pbem.solve.petsc.shares import change_shares, find_own_blocks, share_equally

# MUMPS' codes (INFOG(1)) for too little work space, which can be asked for again, and for too little memory.
MORE_ROOM_HELPS = (-8, -9, -11, -12, -14, -15, -17, -18, -20)
NO_MEMORY = (-5, -7, -13, -19, -22, -29)
MOST_WORKSPACE = 10_000  # per cent

# PETSc's codes with which LAPACK and ScaLAPACK report a pivot that is zero; MUMPS sets the solver's reason instead.
ZERO_PIVOT, LIBRARY_ERROR = 71, 76

# What an operation takes, in those of a large LU factorisation (see pbem.bem.direct_method): a call for any columns; an
# operation on one column (it waits for memory), one on many columns at a time, and such a one of several ranks.
OPERATIONS_OF_A_CALL = 2e7
# Seconds of MUMPS' factors of two to four regions (672 to 3720 unknowns) and of their columns, as this number and that
# of its entries have it, agree within 15 %.
SPARSE = 0.7
SINGLE, MANY, MANY_BY_RANKS = 12.0, 1.0, 4.0


class LinearSolver:
    """LU factors of a distributed matrix as preconditioner of GMRES; rows in contiguous shares of the ranks.

    The matrix is filled once and gives its storage to its factors. GMRES multiplies by `multiply`, from this rank's
    part of a vector to this rank's part of the product: with the operator that was factorised it ends in one
    iteration, with one near to it in some. All methods are called by all ranks together.

    iterations: of the last solution. work: of the last factorisation, counted, so that equal runs decide alike.
    """

    def __init__(
        self, comm: MPI.Intracomm, method: Method, local_rows: int, rows: int, multiply: Callable[[Real], Real],
        prefix: str = PREFIX,
    ) -> None:
        """prefix: of the options of PETSc's that are heeded."""
        self._prefix = prefix
        self.method = method
        self.comm = comm
        self.shape = ((local_rows, rows), (local_rows, rows))
        self.matrix: PETSc.Mat | None = None
        self.solver: PETSc.KSP | None = None
        self.factor_type = "mumps" if method == "mumps" else ("petsc" if comm.size == 1 else "scalapack")
        self.workspace = 30  # per cent by which MUMPS may exceed its estimate (ICNTL(14))
        # ScaLAPACK has shares of its own: vectors change them on their way to it and back.
        inner = share_equally(rows, comm.size) if self.factor_type == "scalapack" else comm.allgather(local_rows)
        self.outer, self.inner = np.array(comm.allgather(local_rows)), np.array(inner)
        self.inner_shape = 2 * ((int(self.inner[comm.rank]), rows),)
        self.operator = PETSc.Mat().createPython(self.inner_shape, _Product(self._multiply), comm=comm)
        self.multiply = multiply
        self.operator.setUp()
        self.right, self.left = self.operator.createVecs()
        self.work = FactorWork(0.0, 0.0, 0.0, 0.0)
        self.iterations = 0

    @property
    def factored(self) -> bool:
        """Whether there are factors; the user's options may have put something else in their place."""
        return self.solver is not None and self.solver.getPC().getType() == "lu"

    def begin_filling(self, counts: tuple[Integer, Integer] | None = None) -> None:
        """Make an empty matrix in place of the former and its factors.

        counts, for MUMPS: numbers (local_rows,) of columns in which each row can be non-zero, inside and outside of the
        columns with the numbers of this rank's rows.
        """
        self._release()
        if self.factor_type == "scalapack":
            self.matrix = self._make_scattered(self.inner_shape)
            return
        if self.method == "lu":
            self.matrix = PETSc.Mat().createDense(self.inner_shape, comm=self.comm)
            self.matrix.setUp()
            return
        assert counts is not None
        self.matrix = PETSc.Mat().create(comm=self.comm)
        self.matrix.setSizes(self.shape)
        self.matrix.setType("aij")
        self.matrix.setPreallocationNNZ(tuple(count.astype(PETSc.IntType) for count in counts))
        self.matrix.setOption(PETSc.Mat.Option.ROW_ORIENTED, True)
        # Ranks would wait for different things where one of them has no columns of the others.
        self.matrix.setOption(PETSc.Mat.Option.NEW_NONZERO_ALLOCATION_ERR, True)

    def fill_columns(self, first: int, values: Real) -> None:
        """Set some columns (local_rows, k) of a dense matrix, from the first on; all ranks together."""
        assert self.matrix is not None
        count = values.shape[1]
        if self.factor_type != "scalapack":
            self.matrix.getDenseArray()[:, first : first + count] = values
            return
        # Every rank takes from the whole columns the blocks that are its own: ScaLAPACK's redistribution of a matrix
        # takes room for several copies of it.
        whole = gather_parts(self.comm, values.ravel()).reshape(-1, count)
        rows, columns = find_own_blocks(len(whole), self.comm), find_own_blocks(first + count, self.comm, across=True)
        columns = columns[columns >= first]
        self.matrix.setValues(
            rows.astype(PETSc.IntType), columns.astype(PETSc.IntType), whole[np.ix_(rows, columns - first)]
        )

    def fill(self, rows: Integer, columns: Integer, values: Real) -> None:
        """Set a dense block of a sparse matrix: local row numbers, global column numbers, values (rows, columns)."""
        assert self.matrix is not None
        begin = self.matrix.getOwnershipRange()[0]
        self.matrix.setValues(
            (rows + begin).astype(PETSc.IntType), columns.astype(PETSc.IntType), np.ascontiguousarray(values)
        )

    def factorise(self) -> None:
        """Factorise the filled matrix.

        Raises ConvergenceError ("singular tangent" or "linear solver") or MemoryError on all ranks alike; then there
        are no factors.
        """
        assert self.matrix is not None
        self.matrix.assemble()
        while not self._set_up():
            code = self._find_mumps_code()
            self._destroy_solver()
            if code not in MORE_ROOM_HELPS or self.workspace >= MOST_WORKSPACE:
                self._release()
                raise _explain_factors(code)
            self.workspace = 2 * self.workspace + 50
        assert self.solver is not None
        self.work = self._count_work()
        if self.factor_type == "mumps":  # it has a copy of its own
            self.solver.setOperators(self.operator, self.operator)
            self.matrix.destroy()
            self.matrix = None
        else:
            self.solver.setOperators(self.operator, self.matrix)

    def _count_work(self) -> FactorWork:
        """Of the factors there are; the same on all ranks."""
        assert self.solver is not None and self.matrix is not None
        rows = float(self.shape[0][1])
        entries, stored, operations, each = rows**2, rows**2, 2 / 3 * rows**3, OPERATIONS_OF_AN_ENTRY
        if self.factor_type == "mumps":
            entries = float(self.matrix.getInfo(PETSc.Mat.InfoType.GLOBAL_SUM)["nz_used"])
            stored, operations, each = entries, 0.0, OPERATIONS_OF_A_SPARSE_ENTRY
            if self._find_mumps_code() is not None:
                factor = self.solver.getPC().getFactorMatrix()
                size = factor.getMumpsInfog(29)  # below zero: in millions
                stored, operations = float(size if size >= 0 else -1e6 * size), SPARSE * factor.getMumpsRinfog(3)
        # A product is one of known and unknown values: twice the matrix's entries.
        return FactorWork(
            operations + each * entries,
            OPERATIONS_OF_A_CALL + SINGLE * 2.0 * stored,
            2.0 * stored * (MANY if self.comm.size == 1 else MANY_BY_RANKS),
            SINGLE * (4.0 * entries + 2.0 * stored),
        )

    def _set_up(self) -> bool:
        """Make the Krylov solver and the factors; whether there are any."""
        solver = self.solver = PETSc.KSP().create(comm=self.comm)
        solver.setOptionsPrefix(self._prefix)
        solver.setOperators(self.matrix, self.matrix)  # products are those of `multiply` once there are factors
        # Not "preonly": with factors as preconditioner GMRES ends in one iteration, and heeds the user's options.
        solver.setType("fgmres")
        solver.setTolerances(rtol=1e-13, atol=0.0, divtol=1e10, max_it=60)
        preconditioner = solver.getPC()
        preconditioner.setType("lu")
        preconditioner.setFactorSolverType(self.factor_type)
        preconditioner.setReusePreconditioner(True)
        with factor_in_place(self.factor_type != "mumps"):
            solver.setFromOptions()
        if preconditioner.getType() == "lu" and preconditioner.getFactorSolverType() == "mumps":
            # Only now: a factor that was made before would not know the prefix of the user's options, which win.
            preconditioner.setFactorSetUpSolverType()
            factor = preconditioner.getFactorMatrix()
            factor.setMumpsIcntl(7, 2)
            factor.setMumpsIcntl(14, self.workspace)
        try:
            solver.setUp()
            preconditioner.setUp()
        except PETSc.Error as error:
            if error.ierr != {"petsc": ZERO_PIVOT, "scalapack": LIBRARY_ERROR}.get(self.factor_type):
                raise
            return False
        return (self._find_mumps_code() or 0) >= 0

    def solve(self, rhs: Real, most: int | None = None) -> Real:
        """This rank's part of the solution for this rank's part of the right-hand side.

        most: iterations, instead of the Krylov solver's own limit.
        Raises ConvergenceError ("linear solver") on all ranks alike.
        """
        assert self.solver is not None
        limits = self.solver.getTolerances()
        if most is not None:
            self.solver.setTolerances(max_it=most)
            self.solver.setGMRESRestart(max(most, 1))
        self.right.setArray(self._share(rhs, self.outer, self.inner))
        with pass_over_divergence():
            self.solver.solve(self.right, self.left)
        self.solver.setTolerances(*limits)
        self.iterations = max(1, int(self.solver.getIterationNumber()))
        reason = int(self.solver.getConvergedReason())
        if reason <= 0:
            names = {value: name for name, value in vars(PETSc.KSP.ConvergedReason).items() if isinstance(value, int)}
            raise ConvergenceError("linear solver", f"PETSc's solver ended with {names.get(reason, reason)}")
        return self._share(np.array(self.left.getArray()), self.inner, self.outer)

    def solve_columns(self, rhs: Real) -> Real:
        """This rank's rows (local_rows, k) of the solutions for many right-hand sides, by the factors alone."""
        assert self.solver is not None
        factor = self.solver.getPC().getFactorMatrix()
        if rhs.shape[1] == 1:
            self.right.setArray(self._share(rhs[:, 0], self.outer, self.inner))
            factor.solve(self.right, self.left)
            return self._share(np.array(self.left.getArray()), self.inner, self.outer)[:, None]
        given = self._make_columns(self._share(rhs, self.outer, self.inner))
        found = given.duplicate(copy=False)
        if self.factor_type == "scalapack":
            scattered, solution = self._scatter(given), self._scatter(found)
            factor.matSolve(scattered, solution)
            solution.convert("dense", out=found)
            scattered.destroy()
            solution.destroy()
        else:
            factor.matSolve(given, found)
        result = self._share(np.array(found.getDenseArray()[:, : rhs.shape[1]], order="C"), self.inner, self.outer)
        given.destroy()
        found.destroy()
        return result

    def _make_columns(self, values: Real) -> PETSc.Mat:
        share = -(-values.shape[1] // self.comm.size)  # ScaLAPACK wants equal shares of the columns, too
        shape = (self.inner_shape[0], (share, share * self.comm.size))
        matrix = PETSc.Mat().createDense(shape, comm=self.comm)
        matrix.setUp()
        matrix.getDenseArray()[:, : values.shape[1]] = values
        matrix.assemble()
        return matrix

    def _scatter(self, dense: PETSc.Mat) -> PETSc.Mat:
        """A dense matrix as ScaLAPACK's, with the same shares."""
        scattered = self._make_scattered(dense.getSizes())
        dense.convert("scalapack", out=scattered)
        return scattered

    def _make_scattered(self, shape: Any) -> PETSc.Mat:
        matrix = PETSc.Mat().create(comm=self.comm)
        matrix.setSizes(shape)
        matrix.setType("scalapack")
        matrix.setUp()
        return matrix

    def _share(self, part: Real, old: Integer, new: Integer) -> Real:
        return change_shares(self.comm, part, old, new)

    def _multiply(self, part: Real) -> Real:
        return self._share(self.multiply(self._share(part, self.inner, self.outer)), self.outer, self.inner)

    def _find_mumps_code(self) -> int | None:
        """INFOG(1) of MUMPS: 0 or more if all is well; None where MUMPS is not used."""
        if self.solver is None:
            return None
        # Not self.factor_type: the user's options can have put something else in its place.
        preconditioner = self.solver.getPC()
        if preconditioner.getType() != "lu" or preconditioner.getFactorSolverType() != "mumps":
            return None
        return int(preconditioner.getFactorMatrix().getMumpsInfog(1))

    def _destroy_solver(self) -> None:
        if self.solver is not None:
            self.solver.destroy()
        self.solver = None

    def _release(self) -> None:
        self._destroy_solver()
        if self.matrix is not None:
            self.matrix.destroy()
        self.matrix = None

    def destroy(self) -> None:
        """Free PETSc's storage (older versions of petsc4py never do it by themselves)."""
        self._release()
        for item in (self.operator, self.right, self.left):
            item.destroy()


class _Product:
    """What PETSc asks of a matrix that is given by its product only."""

    def __init__(self, multiply: Callable[[Real], Real]) -> None:
        self.multiply = multiply

    def mult(self, _: Any, given: PETSc.Vec, result: PETSc.Vec) -> None:
        result.setArray(self.multiply(np.array(given.getArray(readonly=True))))


def _explain_factors(code: int | None) -> ConvergenceError | MemoryError:
    if code in NO_MEMORY:  # no smaller step needs less
        return MemoryError(f"MUMPS has no room for the LU factors, INFOG(1) = {code}")
    if code in MORE_ROOM_HELPS:
        detail = f"MUMPS has no room for the LU factors (INFOG(1) = {code}); try more memory or fewer elements"
        return ConvergenceError("linear solver", detail)
    return ConvergenceError(
        "singular tangent", "the tangent operator has no LU factors; a body is probably free to move"
    )
