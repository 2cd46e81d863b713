"""LU factors of a dense matrix whose rows are dealt to several ranks in panels, in the place of the matrix.

Each rank keeps the rows that it has formed, but for those that it has more than others: the order of the equations is
chosen so that its rows are panels. What is factorised is the transpose, whose columns they are, P A' Q' = L U with the
order Q of the equations and the interchanges P of the unknowns. Panel by panel the rank that has it eliminates and
passes it on, and every rank brings its own columns up to date (theory, source 38); the rank that has the next panel
begins with that, so that nobody waits for it. Almost all is products of matrices, as wide as the processor likes them;
with ScaLAPACK solutions for many right-hand sides take four times as long.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise

import numpy as np
from mpi4py import MPI
from scipy.linalg import lapack

from pbem.arrays import Integer, Real
from pbem.bem.direct_method import OPERATIONS_OF_AN_ENTRY
from pbem.errors import ConvergenceError
from pbem.parallel import gather_rows
from pbem.solve.petsc.linear import OPERATIONS_OF_A_CALL, SINGLE
from pbem.solve.petsc.refactoring import FactorWork
from pbem.solve.tangent.column_shares import bring_home, exchange, list_rows, multiply_rows, share_columns
from pbem.solve.tangent.panel_passing import Coming, Passing, receive_ahead
from pbem.solve.tangent.part_products import divide_by_triangle, take_off_product

# Columns of a panel: each rank has at least so many panels, as it idles with the last one.
WIDEST, LEAST, PANELS = 192, 16, 8
# Columns of the panels with which many right-hand sides are solved for at a time.
WIDE = 384
# Rows that are formed at a time: little beside the matrix, so few that they are in the cache.
ROWS_AT_ONCE = 64
# Of so many right-hand sides it pays that each rank solves for some of them, to which all panels have to come.
MANY = 16


class PanelFactors:
    """Factors of a matrix (rows, rows) of which each rank gives some neighbouring rows; solved with for any columns.

    All methods are called by all ranks together. work: of the last factorisation, counted.
    """

    def __init__(self, comm: MPI.Intracomm, local_rows: int, rows: int) -> None:
        self.comm, self.rows = comm, rows
        self._rows_of = list_rows(comm, local_rows)
        width = int(np.clip(rows // (PANELS * comm.size), LEAST, WIDEST))
        self._cuts = [*range(0, rows, width), rows]
        self._rank_of = np.arange(rows) // width % comm.size
        self._equations, self._moved = deal_equations(
            self._rank_of, np.array([each.stop - each.start for each in self._rows_of]))
        # Transposed: of this rank's columns, one after the other; every column is contiguous.
        self._columns = np.zeros((0, rows))
        self._pivots, self._order = np.zeros(rows, dtype=np.int32), np.arange(rows)
        self.work = FactorWork(0.0, 0.0, 0.0, 0.0)

    @property
    def stored(self) -> int:
        """Bytes of this rank's columns."""
        return self._columns.nbytes

    def fill(self, form: Callable[[int, Real], None]) -> None:
        """Take another matrix in place of the former and its factors.

        form: puts this rank's rows from a given one on into an array (k, rows).
        """
        rank, size = self.comm.rank, self.comm.size
        self._columns = np.zeros((0, 0))  # the former first
        self._columns = np.empty((np.count_nonzero(self._rank_of == rank), self.rows))
        mine = self._rows_of[rank]
        kept = mine.stop - mine.start - np.count_nonzero(self._moved[:, 0] == rank)
        for begin in range(0, kept, ROWS_AT_ONCE):
            form(begin, self._columns[begin : min(begin + ROWS_AT_ONCE, kept)])
        # What others have more than they keep comes behind.
        given, at = kept, kept
        for begin in range(0, len(self._moved), ROWS_AT_ONCE):
            some = self._moved[begin : begin + ROWS_AT_ONCE]
            sent = np.empty((np.count_nonzero(some[:, 0] == rank), self.rows))
            form(given, sent)
            given += len(sent)
            counts = [[np.count_nonzero((some == pair).all(axis=1)) for pair in pairs] for pairs in (
                [(rank, each) for each in range(size)], [(each, rank) for each in range(size)])]
            taken = self._columns[at : at + sum(counts[1])]
            self.comm.Alltoallv([sent, np.multiply(counts[0], self.rows)], [taken, np.multiply(counts[1], self.rows)])
            at += len(taken)

    def factorise(self) -> None:
        """Factorise the filled matrix. Raises ConvergenceError ("singular tangent") on all ranks alike."""
        panels, passing = len(self._cuts) - 1, Passing(self.comm)
        coming = self._eliminate(0, passing)
        for panel in range(panels):
            lower = self._take_panel(panel, coming, passing)
            own, right = self._count_before(panel), self._count_before(panel + 1)
            self._swap(slice(0, own), panel)
            if panel + 1 < panels:
                # The next panel first, as all wait for what comes of it.
                after = self._count_before(panel + 2)
                self._update(slice(right, after), panel, lower)
                coming, right = self._eliminate(panel + 1, passing), after
            self._update(slice(right, len(self._columns)), panel, lower)
        passing.finish()
        order = list(range(self.rows))
        for row, pivot in enumerate(self._pivots.tolist()):
            order[row], order[pivot] = order[pivot], order[row]
        self._order = np.array(order)
        entries = float(self.rows) ** 2
        call = OPERATIONS_OF_A_CALL + SINGLE * 2.0 * entries
        self.work = FactorWork(
            2 / 3 * entries * self.rows + OPERATIONS_OF_AN_ENTRY * entries, call, 2.0 * entries, call
        )

    def _eliminate(self, panel: int, passing: Passing) -> Coming:
        """Factors of a panel (w, rows from its first on), transposed, in its place and on their way to all ranks.

        With them the pivots (w + 1,), the last of which says whether elimination has failed.
        """
        first, last = self._cuts[panel], self._cuts[panel + 1]
        found, pivots = np.empty((last - first, self.rows - first)), np.zeros(last - first + 1, dtype=np.int32)
        root = panel % self.comm.size
        if root == self.comm.rank:
            at = self._count_before(panel)
            found[:] = self._columns[at : at + len(found), first:]
            _, pivots[:-1], pivots[-1] = lapack.dgetrf(found.T, overwrite_a=1)
            self._columns[at : at + len(found), first:] = found
        return passing.send((pivots, found), root)

    def _take_panel(self, panel: int, coming: Coming, passing: Passing) -> Real:
        """The factors of a panel, on every rank, when its pivots are known."""
        pivots, found = coming.wait()
        if pivots[-1]:
            passing.finish()  # before what was sent is freed
            self._columns = np.zeros((0, self.rows))
            raise ConvergenceError(
                "singular tangent", "the tangent operator has no LU factors; a body is probably free to move"
            )
        first, last = self._cuts[panel], self._cuts[panel + 1]
        self._pivots[first:last] = pivots[:-1] + first
        return found

    def _swap(self, columns: slice, panel: int) -> None:
        """Interchange rows of some of this rank's columns as elimination in a panel did."""
        part = self._columns[columns]
        if len(part):
            lapack.dlaswp(part.T, self._pivots, k1=self._cuts[panel], k2=self._cuts[panel + 1] - 1, overwrite_a=1)

    def _update(self, columns: slice, panel: int, lower: Real) -> None:
        """Bring some of this rank's columns, which are right of a panel, up to date with it."""
        first, last = self._cuts[panel], self._cuts[panel + 1]
        self._swap(columns, panel)
        part = self._columns[columns]
        divide_by_triangle(part[:, first:last], lower[:, : last - first], lower=True)
        take_off_product(part[:, last:], part[:, first:last], lower[:, last - first :])

    def solve_columns(self, rhs: Real) -> Real:
        """This rank's rows (local_rows, k) of the solutions for its rows of many right-hand sides."""
        if rhs.shape[1] < MANY:
            values = gather_rows(self.comm, rhs)[self._equations].T.copy()
            self._solve_few(values)
            whole = np.empty_like(values)
            whole[:, self._order] = values
            return np.ascontiguousarray(whole[:, self._rows_of[self.comm.rank]].T)
        return bring_home(self.comm, self._solve_shares(rhs), self._rows_of)

    def solve_and_multiply(self, rhs: Real, count: int, form: Callable[[slice], Real]) -> tuple[Real, Real]:
        """As `solve_columns`, and this rank's rows (count, k) of products with the solutions; see `multiply_rows`."""
        values = self._solve_shares(rhs)
        return bring_home(self.comm, values, self._rows_of), multiply_rows(self.comm, values, count, form)

    def _solve_shares(self, rhs: Real) -> Real:
        """The solutions (k / ranks, rows) for this rank's share of right-hand sides (local_rows, k)."""
        shares = share_columns(self.comm, rhs.shape[1])
        mine = shares[self.comm.rank].stop - shares[self.comm.rank].start
        parts = exchange(self.comm, [rhs[:, share].T for share in shares],
                         [(mine, rows.stop - rows.start) for rows in self._rows_of])
        values = np.take(np.concatenate(parts, axis=1), self._equations, axis=1)
        self._solve_many(values)
        return np.take(values, np.argsort(self._order), axis=1)

    def _solve_many(self, values: Real) -> None:
        """Put the solutions in the place of this rank's right-hand sides (k, rows), both in the order of elimination.
        """
        together = range(0, len(self._cuts) - 1, max(1, WIDE // self._cuts[1]))
        groups = [(begin, end) for begin, end in pairwise([*together, len(self._cuts) - 1])]
        for group, upper in zip(groups, self._pass_on(groups, below=False), strict=True):
            first, last = (self._cuts[panel] for panel in group)
            take_off_product(values[:, first:last], values[:, :first], upper[:, :first], transposed=True)
            divide_by_triangle(values[:, first:last], upper[:, first:], lower=False, transposed=True)
        for group, lower in zip(groups[::-1], self._pass_on(groups[::-1], below=True), strict=True):
            first, last = (self._cuts[panel] for panel in group)
            take_off_product(values[:, first:last], values[:, last:], lower[:, last - first :], transposed=True)
            divide_by_triangle(values[:, first:last], lower[:, : last - first], lower=True, transposed=True)

    def _solve_few(self, values: Real) -> None:
        """As `_solve_many`, for right-hand sides that all ranks know; panels stay where they are."""
        panels = range(len(self._cuts) - 1)
        for lower in (False, True):
            taken = np.zeros((len(values), len(self._columns)))  # what the solution so far takes from this rank's
            for panel in reversed(panels) if lower else panels:
                first, last, at = self._cuts[panel], self._cuts[panel + 1], self._count_before(panel)
                root = panel % self.comm.size
                found = np.ascontiguousarray(values[:, first:last])
                if root == self.comm.rank:
                    found -= taken[:, at : at + last - first]
                    divide_by_triangle(found, self._columns[at : at + last - first, first:last], lower, transposed=True)
                self.comm.Bcast(found, root=root)
                values[:, first:last] = found
                rest = slice(0, at) if lower else slice(self._count_before(panel + 1), len(self._columns))
                taken[:, rest] += found @ self._columns[rest, first:last].T

    def _pass_on(self, groups: Sequence[tuple[int, int]], below: bool) -> Iterator[Real]:
        """The columns (w, rows) of groups of panels, transposed, on every rank: of their first row and all below it, or
        all above it and their own.
        """
        passing = Passing(self.comm)
        for (found,) in receive_ahead(self._send(begin, end, below, passing) for begin, end in groups):
            yield found
        passing.finish()

    def _send(self, begin: int, end: int, below: bool, passing: Passing) -> Coming:
        first, last = self._cuts[begin], self._cuts[end]
        rows = slice(first, self.rows) if below else slice(0, last)
        found, requests = np.empty((last - first, rows.stop - rows.start)), []
        for panel in range(begin, end):
            root, at = panel % self.comm.size, self._count_before(panel)
            part = found[self._cuts[panel] - first : self._cuts[panel + 1] - first]
            if root == self.comm.rank:
                part[:] = self._columns[at : at + len(part), rows]
            requests += passing.send((part,), root).requests
        return Coming((found,), requests)

    def _count_before(self, panel: int) -> int:
        """How many of this rank's columns are in panels before this one."""
        size, rank, width = self.comm.size, self.comm.rank, self._cuts[1]
        return min((panel + size - 1 - rank) // size * width, len(self._columns))

    def destroy(self) -> None:
        """Free the storage."""
        self._columns = np.zeros((0, self.rows))


def deal_equations(rank_of: Integer, counts: Integer) -> tuple[Integer, Integer]:
    """The order of the equations (rows,) in which those at the places of a rank are its own, as far as that goes.

    rank_of (rows,): whose a place is. counts (ranks,): equations of each rank, one rank after the other. Also, of those
    that change ranks, from which to which (m, 2), in the order of both.
    """
    begins = np.cumsum(counts) - counts
    equations, left, empty = np.empty(len(rank_of), dtype=np.int64), [], []
    for rank, (begin, count) in enumerate(zip(begins, counts, strict=True)):
        places = np.flatnonzero(rank_of == rank)
        kept = min(len(places), count)
        equations[places[:kept]] = np.arange(begin, begin + kept)
        left.append(np.arange(begin + kept, begin + count))
        empty.append(places[kept:])
    from_rank = np.repeat(np.arange(len(counts)), [len(each) for each in left])
    equations[np.concatenate(empty)] = np.concatenate(left)
    return equations, np.stack([from_rank, rank_of[np.concatenate(empty)]], axis=1)
