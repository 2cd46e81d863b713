"""LU factors of a dense matrix whose columns are dealt to several ranks in panels, in the place of the matrix.

Panel by panel the rank that has it eliminates with row interchanges and passes it on, and every rank brings its own
columns up to date (theory, source 38); the rank that has the next panel begins with that, so that nobody waits for it.
Almost all is products of matrices, as wide as the processor likes them; with ScaLAPACK solutions for many right-hand
sides take four times as long.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np
from mpi4py import MPI
from scipy.linalg import lapack

from pbem.arrays import Integer, Real
from pbem.errors import ConvergenceError
from pbem.parallel import add_up, gather_rows
from pbem.solve.petsc.linear import OPERATIONS_OF_A_CALL, OPERATIONS_OF_AN_ENTRY, SINGLE
from pbem.solve.petsc.refactoring import FactorWork
from pbem.solve.tangent.panel_passing import Coming, Passing, receive_ahead
from pbem.solve.tangent.part_products import divide_by_triangle, take_off_product

# Columns of a panel: each rank has at least so many panels, as it idles with the last one.
WIDEST, LEAST, PANELS = 192, 16, 8
# Columns of a transposed array that are copied at a time: what is near to them in memory stays in the cache.
COPIED = 128
# Of so many right-hand sides it pays that each rank solves for some of them, to which all panels have to come.
MANY = 16


class PanelFactors:
    """Factors of a matrix (rows, rows) of which each rank gives some neighbouring rows; solved with for any columns.

    All methods are called by all ranks together. work: of the last factorisation, counted.
    """

    def __init__(self, comm: MPI.Intracomm, local_rows: int, rows: int) -> None:
        self.comm, self.rows = comm, rows
        ends = np.concatenate([[0], np.cumsum(comm.allgather(local_rows))])
        self._rows_of = [slice(int(a), int(b)) for a, b in pairwise(ends)]
        width = int(np.clip(rows // (PANELS * comm.size), LEAST, WIDEST))
        self._cuts = [*range(0, rows, width), rows]
        self._panel_of = np.arange(rows) // width
        # Transposed: of this rank's columns, one after the other; every column is contiguous.
        self._columns = np.zeros((0, rows))
        self._pivots, self._order = np.zeros(rows, dtype=np.int32), np.arange(rows)
        self.work = FactorWork(0.0, 0.0, 0.0, 0.0)

    @property
    def stored(self) -> int:
        """Bytes of this rank's columns."""
        return self._columns.nbytes

    def begin_filling(self) -> None:
        """Make an empty matrix in place of the former and its factors."""
        own = np.count_nonzero(self._panel_of % self.comm.size == self.comm.rank)
        self._columns = np.zeros((0, 0))  # the former first
        self._columns = np.empty((own, self.rows))

    def fill_columns(self, first: int, values: Real) -> None:
        """Set some columns (local_rows, k), from the first on, of this rank's rows."""
        end, size = first + values.shape[1], self.comm.size
        given: list[list[Real]] = [[] for _ in range(size)]
        for panel in range(self._panel_of[first], self._panel_of[end - 1] + 1):
            begin, stop = max(self._cuts[panel], first), min(self._cuts[panel + 1], end)
            given[panel % size].append(values[:, begin - first : stop - first].T)
        at, after = self._place(np.array([first, end])).tolist()
        shapes = [(after - at, rows.stop - rows.start) for rows in self._rows_of]
        for rows, part in zip(self._rows_of, self._exchange(given, shapes), strict=True):
            self._columns[at:after, rows] = part

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
            whole = self._solve_few(gather_rows(self.comm, rhs)[self._order].T)
            return np.ascontiguousarray(whole[:, self._rows_of[self.comm.rank]].T)
        share = np.linspace(0, rhs.shape[1], self.comm.size + 1).astype(int)
        cuts = [slice(a, b) for a, b in pairwise(share)]
        mine = cuts[self.comm.rank].stop - cuts[self.comm.rank].start
        lengths = [rows.stop - rows.start for rows in self._rows_of]
        parts = self._exchange([[rhs[:, cut].T] for cut in cuts], [(mine, length) for length in lengths])
        values = np.take(np.concatenate(parts, axis=1), self._order, axis=1)
        self._solve_many(values)
        here = lengths[self.comm.rank]
        found = self._exchange([[values[:, rows]] for rows in self._rows_of],
                               [(cut.stop - cut.start, here) for cut in cuts])
        result = np.empty((here, rhs.shape[1]))
        fill_by_blocks(result, np.concatenate(found, axis=0).T)
        return result

    def _solve_many(self, values: Real) -> None:
        """Put the solutions in the place of this rank's right-hand sides (k, rows), in the order of the pivots."""
        panels = range(len(self._cuts) - 1)
        for panel, lower in zip(panels, self._pass_on(panels, below=True), strict=True):
            first, last = self._cuts[panel], self._cuts[panel + 1]
            divide_by_triangle(values[:, first:last], lower[:, : last - first], lower=True)
            take_off_product(values[:, last:], values[:, first:last], lower[:, last - first :])
        for panel, upper in zip(panels[::-1], self._pass_on(panels[::-1], below=False), strict=True):
            first, last = self._cuts[panel], self._cuts[panel + 1]
            divide_by_triangle(values[:, first:last], upper[:, first:], lower=False)
            take_off_product(values[:, :first], values[:, first:last], upper[:, :first])

    def _solve_few(self, values: Real) -> Real:
        """The solutions (k, rows) for right-hand sides that all ranks know; panels stay where they are."""
        panels, size, own = len(self._cuts) - 1, self.comm.size, self.comm.rank
        solved = np.zeros_like(values)
        for lower in (True, False):
            taken = np.zeros_like(values)  # what this rank's panels take from the right-hand sides
            for panel in range(panels) if lower else reversed(range(panels)):
                first, last = self._cuts[panel], self._cuts[panel + 1]
                part = np.ascontiguousarray(taken[:, first:last])
                total = np.empty_like(part)
                self.comm.Reduce(part, total, root=panel % size)
                if panel % size == own:
                    at = self._count_before(panel)
                    columns = self._columns[at : at + last - first]
                    given = np.ascontiguousarray((values if lower else solved)[:, first:last]) - total
                    divide_by_triangle(given, columns[:, first:last], lower)
                    solved[:, first:last] = given
                    rest = slice(last, self.rows) if lower else slice(0, first)
                    taken[:, rest] += solved[:, first:last] @ columns[:, rest]
        return add_up(self.comm, solved)

    def _pass_on(self, panels: Sequence[int], below: bool) -> Iterator[Real]:
        """The panels' columns (w, rows), transposed, on every rank: of their first row and all below it, or all above
        it and their own.
        """
        passing = Passing(self.comm)
        for (found,) in receive_ahead(self._send(panel, below, passing) for panel in panels):
            yield found
        passing.finish()

    def _send(self, panel: int, below: bool, passing: Passing) -> Coming:
        first, last = self._cuts[panel], self._cuts[panel + 1]
        rows = slice(first, self.rows) if below else slice(0, last)
        root, at = panel % self.comm.size, self._count_before(panel)
        shape = (last - first, rows.stop - rows.start)
        mine = root == self.comm.rank
        found = np.ascontiguousarray(self._columns[at : at + last - first, rows]) if mine else np.empty(shape)
        return passing.send((found,), root)

    def _count_before(self, panel: int) -> int:
        """How many of this rank's columns are in panels before this one."""
        return int(self._place(np.array([self._cuts[panel]]))[0])

    def _place(self, columns: Integer) -> Integer:
        """How many of this rank's columns are before these (k,): where they are, if they are its own."""
        size, rank, width = self.comm.size, self.comm.rank, self._cuts[1]
        panel = columns // width
        before = (panel + size - 1 - rank) // size  # own panels before
        within = np.where((panel % size == rank), columns - panel * width, 0)
        return np.minimum(before * width + within, len(self._columns))

    def _exchange(self, given: list[list[Real]], shapes: list[tuple[int, int]]) -> list[Real]:
        """Arrays of these shapes from all ranks, for the arrays given to each, one below the other."""
        sizes, counts = [sum(part.size for part in parts) for parts in given], [rows * width for rows, width in shapes]
        sent, taken, end = np.empty(sum(sizes)), np.empty(sum(counts)), 0
        for part in (part for parts in given for part in parts):
            fill_by_blocks(sent[end : end + part.size].reshape(part.shape), part)
            end += part.size
        self.comm.Alltoallv([sent, sizes], [taken, counts])
        ends = np.cumsum(counts)[:-1]
        return [part.reshape(shape) for part, shape in zip(np.split(taken, ends), shapes, strict=True)]

    def destroy(self) -> None:
        """Free the storage."""
        self._columns = np.zeros((0, self.rows))


def fill_by_blocks(target: Real, source: Real) -> None:
    """target[:] = source, three times as fast where one of them is the transpose of an array."""
    for begin in range(0, source.shape[1], COPIED):
        target[:, begin : begin + COPIED] = source[:, begin : begin + COPIED]
