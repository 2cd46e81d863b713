"""Linear complementarity problems by Lemke's pivoting: w = q + M z, w >= 0, z >= 0, w . z = 0.

An artificial variable z_0 is added to every row that is negative, w = q + M z + d z_0, and driven out again along
complementary bases: the variable that has just left lets its complement in (C. E. Lemke, Management Science 11, 1965;
R. W. Cottle, J.-S. Pang, R. E. Stone, The Linear Complementarity Problem, SIAM 2009, algorithm 4.4.5). With a
copositive-plus or P matrix it ends with a solution; where it ends on a ray there may be none.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.linalg.blas import dger
from scipy.linalg.lapack import dgecon, dgetrf, dgetrs

from pbem.arrays import Bool, Integer, Real

# Pivots and ratios this small, relative to the largest of their column, are rounding.
ROUNDING = 1e-11
# A problem of n pairs of variables ends with an error of the arithmetic after so many times n pivots.
MOST_PIVOTS = 20


# What a problem takes beside its arithmetic.
ALWAYS = 1e6


@dataclass
class OperationCount:
    """What problems of contact may take yet, floating-point operations: a count, which is the same on every machine.

    Once it is used up nothing is found any more.
    """

    most: float = np.inf
    taken: float = 0.0

    def take(self, operations: float) -> None:
        """Note what a problem took."""
        self.taken += ALWAYS + operations

    @property
    def is_spent(self) -> bool:
        return self.taken >= self.most


@dataclass(frozen=True)
class Pivoted:
    """The end of the pivoting.

    ended: "solution"; "ray", where none was found and there may be none; "limit" of the pivots.
    z (n,): of the solution, else the last basis' values; basic (n,): whether z (not w) is in the basis; pivots: count.
    """

    ended: Literal["solution", "ray", "limit"]
    z: Real
    basic: Bool
    pivots: int


def solve_by_pivoting(matrix: Real, constant: Real) -> Pivoted:
    """Lemke's algorithm for the matrix M (n, n) and the constant q (n,), rows of numbers of one size (theory, 56)."""
    count = len(constant)
    scale = float(np.abs(constant).max(initial=0.0))
    if not count or constant.min() >= -ROUNDING * scale:
        return Pivoted("solution", np.zeros(count), np.zeros(count, dtype=bool), 0)
    # Columns: w (0 to n - 1), z (n to 2 n - 1), z_0 (2 n), and the values of the basic variables.
    table = np.hstack([np.eye(count), -matrix, -np.ones((count, 1)), constant[:, None]])
    basis = np.arange(count)
    row, entering = int(np.argmin(constant)), 2 * count
    for pivots in range(1, MOST_PIVOTS * count + 1):
        leaving = int(basis[row])
        _exchange(table, row, entering)
        basis[row] = entering
        if leaving == 2 * count:
            return _finish("solution", table, basis, pivots)
        entering = leaving + count if leaving < count else leaving - count
        found = _choose_row(table, basis, entering, scale)
        if found is None:
            return _finish("ray", table, basis, pivots)
        row = found
    return _finish("limit", table, basis, MOST_PIVOTS * count)


def pivot_from(matrix: Real, constant: Real, start: Bool) -> Pivoted:
    """As solve_by_pivoting, from the complementary basis in which z is basic where `start` (n,) says so.

    Near to the solution that takes few pivots: a principal transform makes it the basis of w, and is undone at the end.
    Where that leads to no solution, or the basis is singular, it begins anew without.
    """
    own, rest = np.flatnonzero(start), np.flatnonzero(~start)
    factors, places, failed = dgetrf(matrix[np.ix_(own, own)]) if len(own) else (np.zeros((0, 0)), np.zeros(0), 0)
    if failed or not len(own) or not dgecon(factors, np.abs(matrix[np.ix_(own, own)]).sum(axis=0).max())[0] > ROUNDING:
        return solve_by_pivoting(matrix, constant)
    given = np.column_stack([np.eye(len(own)), matrix[np.ix_(own, rest)], constant[own]])
    solved = dgetrs(factors, places, given)[0]
    inverse, across, value = solved[:, : len(own)], solved[:, len(own) : -1], solved[:, -1]
    beside = matrix[np.ix_(rest, own)]
    moved, offset = np.empty_like(matrix), np.empty_like(constant)
    moved[np.ix_(own, own)], moved[np.ix_(own, rest)], offset[own] = inverse, -across, -value
    moved[np.ix_(rest, own)] = beside @ inverse
    moved[np.ix_(rest, rest)] = matrix[np.ix_(rest, rest)] - beside @ across
    offset[rest] = constant[rest] - beside @ value
    found = solve_by_pivoting(moved, offset)
    if found.ended != "solution":
        return solve_by_pivoting(matrix, constant)
    z, w = found.z, offset + moved @ found.z
    basic = found.basic != start
    return Pivoted("solution", np.where(start, np.where(basic, w, 0.0), z), basic, found.pivots)


def _exchange(table: Real, row: int, column: int) -> None:
    """Let the variable of a column into the basis in place of a row's."""
    table[row] /= table[row, column]
    others = table[:, column].copy()
    others[row] = 0.0
    # In place: tables of hundreds of pairs are larger than the caches.
    dger(-1.0, table[row].copy(), others, a=table.T, overwrite_a=1)


def _choose_row(table: Real, basis: Integer, entering: int, scale: float) -> int | None:
    """The row whose variable is the first to reach zero; None if none does: a ray.

    Of several the artificial variable leaves first, else the one of the largest pivot.
    """
    artificial = table.shape[0] * 2
    column, values = table[:, entering], np.maximum(table[:, -1], 0.0)
    rows = np.flatnonzero(column > ROUNDING * max(1.0, float(np.abs(column).max())))
    if not len(rows):
        return None
    ratios = values[rows] / column[rows]
    least = float(ratios.min())
    # Entries of the table may have grown far beyond those that it began with.
    tied = rows[values[rows] - least * column[rows] <= ROUNDING * np.maximum(scale, values[rows])]
    last = tied[basis[tied] == artificial]
    return int(last[0]) if len(last) else int(tied[np.argmax(column[tied])])


def _finish(ended: Literal["solution", "ray", "limit"], table: Real, basis: Integer, pivots: int) -> Pivoted:
    count = len(basis)
    own = (basis >= count) & (basis < 2 * count)
    z, basic = np.zeros(count), np.zeros(count, dtype=bool)
    z[basis[own] - count] = table[own, -1]
    basic[basis[own] - count] = True
    return Pivoted(ended, z, basic, pivots)
