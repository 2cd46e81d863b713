"""Entries of the constraint map, all of them or those of some nodes: what the map consists of, put together."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from pbem.arrays import Bool, Complex, Integer, Real
from pbem.mesh.numbering import number_components

DISPLACEMENT, TRACTION = 0, 1


class ChosenNodes:
    """Some nodes (k,) of a mesh, each once, or all of its nodes; and where they are."""

    def __init__(self, all_nodes: int, nodes: Integer | None = None) -> None:
        self._all, self._nodes = all_nodes, nodes
        self.count = all_nodes if nodes is None else len(nodes)
        if nodes is not None:
            self._order = np.argsort(nodes, kind="stable")
            self._sorted = nodes[self._order]

    @cached_property
    def _there(self) -> Bool:
        there = np.zeros(self._all, dtype=bool)
        there[self._sorted] = True
        return there

    def contain(self, nodes: Integer) -> Bool:
        """Which ones of nodes are among these."""
        return np.ones(len(nodes), dtype=bool) if self._nodes is None else self._there[nodes]

    def select(self, nodes: Integer) -> Integer | slice:
        """Places in a list of nodes of those that are among these."""
        return slice(None) if self._nodes is None else np.flatnonzero(self._there[nodes])

    def place(self, nodes: Integer) -> Integer:
        """Where nodes are among these, each of which is one of them."""
        return nodes if self._nodes is None else self._order[np.searchsorted(self._sorted, nodes)]

    def place_components(self, numbers: Integer) -> Integer:
        """Where unknowns, or components of displacement, of nodes are, two for each of these nodes."""
        return numbers if self._nodes is None else 2 * self.place(numbers // 2) + numbers % 2

    def place_entries(self, entries: Integer) -> Integer:
        """Where entries of v (4 nodes,) are among those of these nodes (4 k,)."""
        if self._nodes is None:
            return entries
        half, rest = np.divmod(entries, 2 * self._all)
        return np.asarray(2 * self.count * half + self.place_components(rest))


class MapEntries:
    """Collects contributions in the rows of nodes, or in columns: at a node, for u or t, the complex coefficient of one
    unknown. Nothing depends on nodes that are gone, and they on nothing."""

    def __init__(self, rows: ChosenNodes | None, columns: ChosenNodes | None, nodes: int, gone: Integer | None) -> None:
        self._of_rows, self._of_columns, self._nodes = rows, columns, nodes
        self._gone = gone if gone is not None and len(gone) else None
        # As the matrix will have them; all entries together take several times its room.
        self._index = np.int32 if 4 * nodes < np.iinfo(np.int32).max else np.int64
        self._rows: list[NDArray[Any]] = []
        self._columns: list[NDArray[Any]] = []
        self._values: list[Real] = []

    def select(self, at: Integer, of: Integer) -> Integer | slice:
        """Places in a list of contributions of those that are wanted: at nodes, of unknowns of nodes."""
        if self._of_columns is not None:
            return self._of_columns.select(of)
        assert self._of_rows is not None
        return self._of_rows.select(at)

    def add(self, field: int, node: Integer, unknown: Integer, coefficient: Complex) -> None:
        """Contributions that are wanted."""
        for component, value in enumerate((coefficient.real, coefficient.imag)):
            kept = value != 0
            self._append((2 * self._nodes * field + 2 * node + component)[kept], unknown[kept], value[kept])

    def add_entries(self, rows: Integer, columns: Integer, values: Real) -> None:
        """Entries as they are, of which those that are wanted are taken."""
        own = self.select(rows // 2 % self._nodes, columns // 2)
        rows, columns, values = rows[own], columns[own], values[own]
        kept = values != 0
        self._append(rows[kept], columns[kept], values[kept])

    def hold_still(self, traction_scale: float) -> None:
        """Add that the tractions of nodes that are gone are their own unknowns; after all else. (theory, 96)"""
        gone, self._gone = self._gone, None
        if gone is not None:
            own = number_components(gone[self.select(gone, gone)])
            self._append(2 * self._nodes + own, own, np.full(len(own), traction_scale))

    def _append(self, rows: Integer, columns: Integer, values: Real) -> None:
        if self._gone is not None:
            kept = ~(np.isin(rows // 2 % self._nodes, self._gone) | np.isin(columns // 2, self._gone))
            rows, columns, values = rows[kept], columns[kept], values[kept]
        if self._of_rows is not None:
            rows = self._of_rows.place_entries(rows)
        if self._of_columns is not None:
            columns = self._of_columns.place_components(columns)
        self._rows.append(rows.astype(self._index))
        self._columns.append(columns.astype(self._index))
        self._values.append(values)

    def to_rows(self) -> sparse.csr_matrix:
        """The matrix of all entries by rows; they are forgotten."""
        return self._build().tocsr()

    def to_columns(self) -> sparse.csc_matrix:
        """The same by columns."""
        return self._build().tocsc()

    def _build(self) -> sparse.coo_matrix:
        lists = (self._values, self._rows, self._columns)
        values, rows, columns = (np.concatenate(parts) for parts in lists)
        for parts in lists:
            parts.clear()
        size = (4 * (self._of_rows.count if self._of_rows else self._nodes),
                2 * (self._of_columns.count if self._of_columns else self._nodes))
        # Made and checked once; sparse.csr_matrix of entries copies and checks the matrix twice more.
        return sparse.coo_matrix((values, (rows, columns)), shape=size)


def are_equal(one: sparse.csr_matrix, other: sparse.csr_matrix) -> bool:
    """Whether two constraint maps are the same numbers in the same places."""
    parts = ((one.indptr, other.indptr), (one.indices, other.indices), (one.data, other.data))
    return all(np.array_equal(mine, yours) for mine, yours in parts)
