"""A reference operator K0 = B M0 of one constraint map: formed by rows, factorised, and solved with.

Unknowns of crack pairs can be eliminated first. In stick such a pair's unknowns are its tractions, which appear in the
pair's own two equations only, by the free term (nothing of them is stored in the operator, as those of both faces
cancel): with f for all other unknowns and equations, and c for these,

    K0 = [ A_ff   0 ]       x_f = A_ff^-1 r_f,    x_c = D^-1 (r_c - A_cf x_f),     D of 2 x 2 blocks,
         [ A_cf   D ]

so that the factors are those of the body without its cracks, whatever becomes of their modes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from pbem.arrays import Integer, Real
from pbem.bem.direct_method import choose_method
from pbem.bem.operator import RegionRows, RowOperator
from pbem.clock import clock
from pbem.parallel import gather_parts, gather_rows
from pbem.solve.petsc.linear import LinearSolver
from pbem.solve.petsc.session import list_factor_options
from pbem.solve.problem.problem import Problem
from pbem.solve.tangent.column_shares import multiply_rows, share_columns
from pbem.solve.tangent.mapped_columns import form_columns, map_columns, take_rows
from pbem.solve.tangent.panel_factors import PanelFactors

# Columns that are formed at a time: little beside the matrix, much beside the cost of a call.
COLUMNS_AT_ONCE = 512
# Products with so many vectors take longer than to form the matrix for them.
FORMED = 64


@dataclass(frozen=True)
class TangentRows:
    """This rank's rows of B, and for every block the unknowns (rising) on which it depends in any modes."""

    operator: RowOperator
    block_unknowns: tuple[Integer, ...]


class Reference:
    """Holds the factors of a K0, and the constraint map with which products are taken (`present`).

    rows: of B, and the unknowns on which they can depend. eliminated (k,): crack pairs whose unknowns are eliminated;
    every M0 holds them in stick without joints.
    """

    def __init__(self, problem: Problem, rows: TangentRows, eliminated: Integer, panels: bool = False) -> None:
        """panels: dense factors are held in panels of columns, with which nothing but columns can be solved."""
        self.problem, self.operator, self.block_unknowns = problem, rows.operator, rows.block_unknowns
        self.method = choose_method(problem.model.solver.linear, problem.mesh.region_nodes, bool(list_factor_options()))
        nodes = problem.mesh.pairs.slave[eliminated]
        kept = np.ones(problem.unknowns, dtype=bool)
        kept.reshape(-1, 2)[nodes] = False
        self.kept, self.number = kept, np.cumsum(kept) - 1
        first, last = 2 * self.operator.first_node, 2 * self.operator.last_node
        self.own = slice(first, last)
        self.kept_rows = np.flatnonzero(kept[self.own])
        self.crack_rows = np.flatnonzero(~kept[self.own])
        here, count = len(self.kept_rows), int(kept.sum())
        self.factors: LinearSolver | PanelFactors = (
            PanelFactors(problem.comm, here, count) if panels and self.method == "lu"
            else LinearSolver(problem.comm, self.method, here, count, self._multiply)
        )
        self.present: sparse.csr_matrix | None = None
        self.free_blocks = np.zeros((0, 2, 2))

    @property
    def solver(self) -> LinearSolver:
        """The factors as preconditioner of GMRES; not if they are held in panels."""
        assert isinstance(self.factors, LinearSolver)
        return self.factors

    @property
    def rows(self) -> int:
        """Of this rank, those of eliminated unknowns included."""
        return self.own.stop - self.own.start

    def form(self, constraints: sparse.csr_matrix) -> None:
        """Form and factorise K0 for a constraint map M0.

        Raises ConvergenceError ("singular tangent", "linear solver").
        """
        self.present = constraints
        kept = self.kept
        chosen = [columns[kept[columns]] for columns in self.block_unknowns]
        wanted = [np.flatnonzero(kept[self.own][block.rows]) for block in self.operator.blocks]
        with clock.piece("matrix"):
            if isinstance(self.factors, PanelFactors):
                self._fill_panels(self.factors, constraints, wanted)
            elif self.method == "lu":
                self._fill_dense(self.factors, constraints, chosen, wanted)
            else:
                self._fill_sparse(constraints, chosen, wanted)
            self.free_blocks = self._invert_free_blocks(constraints)
        with clock.piece("factors", 8.0 * len(self.kept_rows) * int(kept.sum())):
            self.factors.factorise()

    def _fill_panels(self, factors: PanelFactors, constraints: sparse.csr_matrix, wanted: list[Integer]) -> None:
        """Rows of all columns at a time."""
        local, columns = np.cumsum(self.kept[self.own]) - 1, np.flatnonzero(self.kept)
        mapped = [(map_columns(self.operator, block, constraints, columns), local[block.rows[rows]], rows)
                  for block, rows in zip(self.operator.blocks, wanted, strict=True)]

        def form(first: int, values: Real) -> None:
            for block, places, rows in mapped:
                some = slice(*np.searchsorted(places, [first, first + len(values)]))
                if len(rows[some]) == len(values):
                    block.evaluate(rows[some], values)
                elif len(rows[some]):
                    part = np.empty((len(rows[some]), len(columns)))
                    block.evaluate(rows[some], part)
                    values[places[some] - first] = part

        factors.fill(form)

    def _fill_dense(
        self, factors: LinearSolver, constraints: sparse.csr_matrix, chosen: list[Integer], wanted: list[Integer]
    ) -> None:
        """Columns of all rows at a time, as they may have to change ranks."""
        operator, numbers = self.operator, np.flatnonzero(self.kept)
        local = np.cumsum(self.kept[self.own]) - 1
        factors.begin_filling()
        for begin in range(0, len(numbers), COLUMNS_AT_ONCE):
            columns = numbers[begin : begin + COLUMNS_AT_ONCE]
            values = np.zeros((len(self.kept_rows), len(columns)))
            for block, every, rows in zip(operator.blocks, chosen, wanted, strict=True):
                some = every[slice(*np.searchsorted(every, [columns[0], columns[-1] + 1]))]
                if not len(rows) or not len(some):
                    continue
                part = form_columns(operator, block, constraints, some, rows)
                if part.shape == values.shape:
                    values = part
                else:
                    values[np.ix_(local[block.rows[rows]], np.searchsorted(columns, some))] = part
            factors.fill_columns(begin, values)

    def _fill_sparse(self, constraints: sparse.csr_matrix, chosen: list[Integer], wanted: list[Integer]) -> None:
        """Dense blocks of the regions."""
        operator = self.operator
        inside, outside = np.zeros((2, self.rows), dtype=np.int64)
        for block, columns in zip(operator.blocks, chosen, strict=True):
            own = (columns >= self.own.start) & (columns < self.own.stop)
            inside[block.rows], outside[block.rows] = own.sum(), (~own).sum()
        self.solver.begin_filling((inside[self.kept_rows], outside[self.kept_rows]))
        local = np.cumsum(self.kept[self.own]) - 1
        for block, every, rows in zip(operator.blocks, chosen, wanted, strict=True):
            for begin in range(0, len(every), COLUMNS_AT_ONCE):
                columns = every[begin : begin + COLUMNS_AT_ONCE]
                values = form_columns(operator, block, constraints, columns, rows)
                self.solver.fill(local[block.rows[rows]], self.number[columns], values)

    def _invert_free_blocks(self, constraints: sparse.csr_matrix) -> Real:
        """D^-1 (this rank's eliminated pairs, 2, 2)."""
        terms = (self.operator.free[self.crack_rows] @ constraints[:, self.crack_rows + self.own.start]).tocoo()
        assert np.array_equal(terms.row // 2, terms.col // 2)
        blocks = np.zeros((len(self.crack_rows) // 2, 2, 2))
        blocks[terms.row // 2, terms.row % 2, terms.col % 2] = terms.data
        return np.linalg.inv(blocks)

    def _multiply(self, part: Real) -> Real:
        """This rank's part of K x without the eliminated unknowns and equations."""
        assert self.present is not None
        unknowns = np.zeros(self.problem.unknowns)
        unknowns[self.kept] = gather_parts(self.problem.comm, part)
        result: Real = self.operator.apply(self.present @ unknowns)[self.kept_rows]
        return result

    def solve(self, rhs: Real, most: int | None = None) -> Real:
        """This rank's part (rows,) of the solution for its part of the right-hand side, by GMRES with `present`.

        most: iterations. Raises ConvergenceError ("linear solver").
        """
        with clock.piece("GMRES", rhs.nbytes):
            kept = self.solver.solve(rhs[self.kept_rows], most)[:, None]
            if self.kept.all():
                return kept[:, 0]
            return self._complete(rhs[:, None], kept, self._multiply_cracks(kept))[:, 0]

    def solve_columns(self, rhs: Real) -> Real:
        """This rank's rows (rows, k) of the solutions for many right-hand sides, by the factors alone."""
        with clock.piece("columns", rhs.nbytes):
            given, factors = rhs[self.kept_rows], self.factors
            if self.kept.all():
                return factors.solve_columns(given)
            if isinstance(factors, PanelFactors) and rhs.shape[1] >= FORMED:
                return self._complete(rhs, *factors.solve_and_multiply(given, len(self.crack_rows), self._form_cracks))
            kept = factors.solve_columns(given)
            return self._complete(rhs, kept, self._multiply_cracks(kept))

    def _complete(self, rhs: Real, kept: Real, product: Real) -> Real:
        """Add the eliminated unknowns (rows, k) to the solution for the others; product: A_cf x_f (theory, 60)."""
        left, result = rhs[self.crack_rows] - product, np.empty((self.rows, rhs.shape[1]))
        result[self.kept_rows] = kept
        result[self.crack_rows] = np.matmul(self.free_blocks, left.reshape(-1, 2, rhs.shape[1])).reshape(left.shape)
        return result

    def _multiply_cracks(self, kept: Real) -> Real:
        """This rank's rows of A_cf x_f (crack rows, c), for its rows of many x_f.

        For so many that it pays A_cf is formed first, which is half as wide as B.
        """
        assert self.present is not None
        comm = self.problem.comm
        whole = gather_rows(comm, kept)
        if kept.shape[1] >= FORMED:
            mine = whole[:, share_columns(comm, kept.shape[1])[comm.rank]].T
            return multiply_rows(comm, mine, len(self.crack_rows), self._form_cracks)
        result = np.zeros((len(self.crack_rows), kept.shape[1]))
        every = np.zeros((self.problem.unknowns, kept.shape[1]))
        every[self.kept] = whole
        for block, rows, places in self._list_crack_rows():
            result[places] += take_rows(block.matrix, rows) @ (self.present[block.columns] @ every)
        return result

    def _form_cracks(self, columns: slice) -> Real:
        """This rank's rows of A_cf (crack rows, columns)."""
        assert self.present is not None
        of = np.flatnonzero(self.kept)[columns]
        formed = np.zeros((len(self.crack_rows), len(of)))
        for block, rows, places in self._list_crack_rows():
            formed[places] += form_columns(self.operator, block, self.present, of, rows)
        return formed

    def _list_crack_rows(self) -> list[tuple[RegionRows, Integer, Integer]]:
        """Blocks with rows of eliminated unknowns, these rows in the block, and their places among crack_rows."""
        found = [(block, np.flatnonzero(~self.kept[self.own][block.rows])) for block in self.operator.blocks]
        return [(block, at, np.searchsorted(self.crack_rows, block.rows[at])) for block, at in found if len(at)]

    def destroy(self) -> None:
        """Free PETSc's storage."""
        self.factors.destroy()
