"""Sums of few columns, or of few rows and columns, of dense matrices: what laws and constraint maps make of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pbem.arrays import Integer, Real, Single
from pbem.bem import _expansions


@dataclass(frozen=True)
class Combination:
    """n columns made of others: column j is the sum of factor[k] times column place[k], k from first[j] on and below
    first[j + 1]; first (n + 1,), place and factor (k,)."""

    first: Integer
    place: Integer
    factor: Real

    def add(self, matrix: Real, rows: Integer, result: Real) -> None:
        """Add to the rows (m,) of the result (r, n), in C order, what this makes of the rows of a matrix (m, w).

        Each row by itself, in one order: it does not depend on those beside it.
        """
        _expansions.add_combined(np.ascontiguousarray(matrix), rows, self.first, self.place, self.factor, result)


def make_combination(count: int, column: Integer, place: Integer, factor: Real) -> Combination:
    """The combination of entries (k,) by column, rising, of `count` columns in all."""
    return Combination(np.searchsorted(column, np.arange(count + 1)), place, factor)


def combine_pairs(matrix: Single, row: Integer, weight: Real, column: Integer, factor: Real) -> Single:
    """Sums (n, n) of two rows and two columns each of a matrix (m, m) in single precision.

    row, weight, column, factor (n, 2): entry i, j is the sum of weight[i, a] factor[j, b] matrix[row[i, a],
    column[j, b]] over a and b.
    """
    result = np.empty((len(row), len(column)), dtype=np.float32)
    _expansions.combine_pairs(
        np.ascontiguousarray(matrix), np.ascontiguousarray(row), np.ascontiguousarray(weight, dtype=np.float32),
        np.ascontiguousarray(column), np.ascontiguousarray(factor, dtype=np.float32), result,
    )
    return result
