"""Unknowns of the contact pairs that act in their own node's equations alone, and those equations without them.

The tractions of a crack's pair appear nowhere but in the two equations of its node. In stick both unknowns are such
tractions, in slip one of them is. An orthogonal change of the node's two equations leaves as many of them without these
unknowns as the node has others: of cracks that stick nothing is left to be factored, of those that slip one half.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from pbem.arrays import Bool, Real

# A column or a block of a node this small, relative to the largest entry of the free terms, is none.
NOTHING = 1e-12


@dataclass(frozen=True)
class Elimination:
    """Of n nodes: turn (n, 2, 2), orthogonal; the node's equations are turned by it.

    local (n, 2): unknowns that are eliminated, with the turned equations `first` (n, 2) that determine them; the other
    equations do not contain them. inverse (n, 2, 2): from the turned equations to the unknowns so determined.
    """

    turn: Real
    local: Bool
    first: Bool
    inverse: Real

    def apply(self, residual: Real) -> Real:
        """The turned equations (2 n,) of a residual (2 n,)."""
        return np.einsum("nij,nj->ni", self.turn, residual.reshape(-1, 2)).ravel()


def eliminate_tractions(matrix: sparse.csr_matrix, free: sparse.csr_matrix, on_crack: Bool) -> Elimination:
    """What can be eliminated from K = B M; matrix: M (4 n, 2 n), free (2 n, 2 n): the free terms times M.

    on_crack (n,): nodes whose tractions no other equation contains.
    """
    count = len(on_crack)
    local = _find_local(matrix, count) & on_crack[:, None]
    blocks = take_blocks(free, count)
    largest = float(np.abs(blocks).max(initial=0.0))
    length = np.linalg.norm(blocks, axis=1)
    local &= length > NOTHING * largest
    determinant = np.abs(np.linalg.det(blocks))
    both = local.all(axis=1) & (determinant > NOTHING * length.prod(axis=1))
    one = local.any(axis=1) & ~local.all(axis=1)
    local &= (both | one)[:, None]
    turn = np.tile(np.eye(2), (count, 1, 1))
    inverse = np.zeros((count, 2, 2))
    inverse[both] = np.linalg.inv(blocks[both])
    at, which = np.flatnonzero(one), np.argmax(local[one], axis=1)
    along = blocks[at, :, which] / length[at, which][:, None]
    turn[at, 0], turn[at, 1, 0], turn[at, 1, 1] = along, -along[:, 1], along[:, 0]
    inverse[at, which, 0] = 1 / length[at, which]
    first = np.stack([both | one, both], axis=1)
    return Elimination(turn, local, first, inverse)


def _find_local(matrix: sparse.csr_matrix, count: int) -> Bool:
    """Columns of M (count, 2) whose entries are tractions of their own node alone."""
    entries = matrix.tocoo()
    inside = (entries.row >= 2 * count) & ((entries.row - 2 * count) // 2 == entries.col // 2)
    outside = np.bincount(entries.col[~inside & (entries.data != 0)], minlength=2 * count)
    return np.asarray(outside.reshape(-1, 2) == 0)


def take_blocks(free: sparse.csr_matrix, count: int) -> Real:
    """The blocks (count, 2, 2) of every node's own unknowns in its own equations."""
    entries = free.tocoo()
    own = entries.row // 2 == entries.col // 2
    blocks = np.zeros((count, 2, 2))
    row, column = entries.row[own], entries.col[own]
    np.add.at(blocks, (row // 2, row % 2, column % 2), entries.data[own])
    return blocks
