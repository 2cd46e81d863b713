"""The constraint map as the groups of one rank need it: the columns of the unknowns that they see."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from pbem.arrays import Integer, Real
from pbem.contact.constraints import ConstraintMap
from pbem.contact.map_entries import ChosenNodes
from pbem.solve.system.halo import place_unknowns


@dataclass(frozen=True)
class NearMap:
    """Of h nodes, the own ones (k,) and then those beyond (h - k,), each rising: columns (4 n, 2 h) of the constraint
    map M (4 n, 2 n), those of their unknowns; free (2 h, 2 n): their free terms times M.
    """

    own: Integer
    beyond: Integer
    columns: sparse.csc_matrix
    free: sparse.csr_matrix

    @property
    def nodes(self) -> Integer:
        """All nodes (h,), in their order."""
        return np.concatenate([self.own, self.beyond]) if len(self.beyond) else self.own

    def find(self, unknowns: Integer) -> Integer:
        """Places, among those of the nodes here, of unknowns of the model, each of which is one of them."""
        return place_unknowns(self.own, self.beyond, unknowns)

    def take_blocks(self) -> Real:
        """The blocks (h, 2, 2) of every node's own unknowns in the free terms of its own equations."""
        entries = self.free.tocoo()
        place = entries.row // 2
        own = self.nodes[place] == entries.col // 2
        blocks = np.zeros((len(self.own) + len(self.beyond), 2, 2))
        np.add.at(blocks, (place[own], entries.row[own] % 2, entries.col[own] % 2), entries.data[own])
        return blocks

    def measure_changes(self, before: NearMap | None) -> Real:
        """By which part of itself each column (2 h,) differs from what it was before, of the same nodes."""
        if before is None:
            return np.full(self.columns.shape[1], np.inf)
        change = _find_largest(self.columns - before.columns)
        changed = change > 0
        change[changed] /= np.maximum(_find_largest(before.columns), _find_largest(self.columns))[changed]
        return change


def take_near(
    constraints: ConstraintMap, free: sparse.csr_matrix, own: Integer, beyond: Integer | None = None
) -> NearMap:
    """The map of nodes own, and of those beyond, from what is formed of it for them; free (2 h, 4 n): their free terms,
    each in the node's own entries."""
    beyond = np.zeros(0, dtype=np.int64) if beyond is None else beyond
    if 4 * len(own) == free.shape[1]:
        return NearMap(own, beyond, constraints.matrix.tocsc(), (free @ constraints.matrix).tocsr())
    nodes = np.concatenate([own, beyond])
    rows = np.sort(nodes)
    place = ChosenNodes(free.shape[1] // 4, rows).place_entries
    near = sparse.csr_matrix((free.data, place(free.indices), free.indptr), shape=(free.shape[0], 4 * len(rows)))
    return NearMap(own, beyond, constraints.take_columns(nodes), (near @ constraints.take_rows(rows)).tocsr())


def _find_largest(columns: sparse.csc_matrix) -> Real:
    """The largest size of an entry in each column."""
    largest = np.zeros(columns.shape[1])
    filled = np.flatnonzero(np.diff(columns.indptr))
    if len(filled):
        largest[filled] = np.maximum.reduceat(np.abs(columns.data), columns.indptr[filled])
    return largest
