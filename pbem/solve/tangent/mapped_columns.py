"""Rows of B M of a constraint map M, dense: most columns of M have one or two entries."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from pbem.arrays import Integer, Real
from pbem.bem.operator import RegionRows, RowOperator


@dataclass(frozen=True)
class MappedColumns:
    """What some of a block's rows of B M are, dense, in some columns of the constraint map M.

    Most columns of M have one or two entries: the products are those of single columns of B, taking one entry of every
    column of M at a time. parts: columns of the result (None: all of them), the block's columns, and factors. chosen
    (4 nodes, c): these columns of M.
    """

    operator: RowOperator
    block: RegionRows
    parts: tuple[tuple[Integer | None, Integer, Real], ...]
    chosen: sparse.csr_matrix

    def evaluate(self, wanted: Integer, values: Real) -> None:
        """Put rows (wanted,), positions in block.rows that rise, in an array (wanted, c)."""
        rows = take_rows(self.block.matrix, wanted)
        if not self.parts or self.parts[0][0] is not None:
            values.fill(0.0)
        for of, at, factors in self.parts:
            if of is None:
                # The indices are right: numpy need not keep a copy in case they are not.
                np.take(rows, at, axis=1, out=values, mode="clip")
                values *= factors
            else:
                values[:, of] += np.take(rows, at, axis=1) * factors
        free = (self.operator.free[self.block.rows[wanted]] @ self.chosen).tocoo()
        values[free.row, free.col] += free.data


def map_columns(
    operator: RowOperator, block: RegionRows, constraints: sparse.csr_matrix, columns: Integer
) -> MappedColumns:
    """See MappedColumns."""
    chosen = constraints[:, columns]
    stored = chosen[block.columns].tocsc()
    counts, parts = np.diff(stored.indptr), []
    for depth in range(int(counts.max(initial=0))):
        of = np.flatnonzero(counts > depth)
        at = stored.indptr[of] + depth
        every = depth == 0 and len(of) == len(columns)
        parts.append((None if every else of, stored.indices[at], stored.data[at]))
    return MappedColumns(operator, block, tuple(parts), chosen)


def form_columns(
    operator: RowOperator, block: RegionRows, constraints: sparse.csr_matrix, columns: Integer, wanted: Integer
) -> Real:
    """Some of a block's rows of B M, dense (wanted, columns), in some columns of the constraint map M.

    wanted: positions in block.rows, rising.
    """
    values = np.empty((len(wanted), len(columns)))
    map_columns(operator, block, constraints, columns).evaluate(wanted, values)
    return values


def apply_narrow(operator: RowOperator, v: Real) -> Real:
    """This rank's rows of B v, as operator.apply, for a v (4 nodes,) of few entries that lie near to each other."""
    result: Real = operator.free @ v
    for block in operator.blocks:
        at = np.flatnonzero(v[block.columns])
        if len(at):
            span = slice(int(at[0]), int(at[-1]) + 1)
            result[block.rows] += block.matrix[:, span] @ v[block.columns[span]]
    return result


def take_rows(matrix: Real, rows: Integer) -> Real:
    """Some rows, rising; without a copy if they are neighbours."""
    if len(rows) and rows[-1] - rows[0] + 1 == len(rows):
        return matrix[rows[0] : rows[-1] + 1]
    return matrix[rows]
