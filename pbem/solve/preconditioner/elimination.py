"""Unknowns of the contact pairs that act in their own node's equations alone, and those equations without them.

The tractions of a crack's pair appear nowhere but in the two equations of its node. In stick both unknowns are such
tractions, in slip one of them is. An orthogonal change of the node's two equations leaves as many of them without these
unknowns as the node has others: of cracks that stick nothing is left to be factored, of those that slip one half.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pbem.arrays import Bool, Real
from pbem.solve.preconditioner.near_map import NearMap

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


def eliminate_tractions(near: NearMap, blocks: Real, on_crack: Bool, largest: float) -> Elimination:
    """What can be eliminated from K = B M of the h nodes of a map; blocks (h, 2, 2): of its `take_blocks`.

    on_crack (h,): nodes whose tractions no other equation contains. largest: entry of the blocks of all the model.
    """
    count = len(on_crack)
    local = _find_local(near) & on_crack[:, None]
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


def _find_local(near: NearMap) -> Bool:
    """Columns of M (h, 2) whose entries are tractions of their own node alone."""
    columns, nodes = near.columns, near.nodes
    first_traction = columns.shape[0] // 2
    place = np.repeat(np.arange(2 * len(nodes)), np.diff(columns.indptr))
    inside = (columns.indices >= first_traction) & ((columns.indices - first_traction) // 2 == nodes[place // 2])
    outside = np.bincount(place[~inside & (columns.data != 0)], minlength=2 * len(nodes))
    return np.asarray(outside.reshape(-1, 2) == 0)
