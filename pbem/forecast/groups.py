"""What the preconditioner's groups of bodies take: of cracks most unknowns are eliminated, of bodies none."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from pbem.arrays import Integer
from pbem.mesh.mesh import Mesh

# See pbem.solve.preconditioner: what is connected and more than so many elements is divided into groups of bodies'
# elements, and has so many times as many around it, with so many unknowns in all, or so many times the group's own.
GROUP_ELEMENTS, BODY_ELEMENTS, BODY_SHARE, MOST_LEFT, MOST_TIMES = 48, 192, 3.0, 1700, 2.0
# Others have so many unknowns around them, or so many times their own.
NEIGHBOUR_UNKNOWNS, NEIGHBOUR_SHARE = 100, 0.5
# Unknowns that are left of a node of a body, and as a rule of one of a crack: its traction is eliminated.
LEFT, LEFT_OF_CRACK = 2.0, 1.2


@dataclass(frozen=True)
class Groups:
    """Of all groups of bodies' elements: numbers of the inverses that are kept, and, for each time that all are formed,
    entries of B and operations; and of the one that takes most the numbers while it is formed. count: of the groups."""

    count: int = 0
    kept: float = 0.0
    entries: float = 0.0
    operations: float = 0.0
    largest: float = 0.0


NO_GROUPS = Groups()


def count_groups(mesh: Mesh) -> Groups:
    """The groups of a model with a hierarchical operator, as their sizes are expected to be."""
    found = NO_GROUPS
    width = mesh.order + 1
    crack = float(mesh.crack.mean())
    for size in _list_sizes(mesh):
        parts = 1 << max(0, int(np.ceil(np.log2(size / BODY_ELEMENTS))))
        elements = size / parts
        own = LEFT * width * elements
        each = width * (LEFT_OF_CRACK * crack + LEFT * (1 - crack))  # unknowns left of an element around
        if size > GROUP_ELEMENTS:
            room = max(MOST_LEFT, MOST_TIMES * own) - own
            around = min(BODY_SHARE * elements, room / each, float(mesh.elements) - elements)
        else:
            around = min(max(NEIGHBOUR_UNKNOWNS, NEIGHBOUR_SHARE * own) / each, float(mesh.elements) - elements)
        left, rows = own + each * around, 2 * width * (elements + around)
        found = Groups(
            found.count + parts,
            found.kept + parts * own * left,
            found.entries + parts * rows * 2 * rows,
            found.operations + parts * (2 / 3 * left**3 + 2 * own * left**2),
            # Rows with the eliminated ones, those without, the inverse and what it is solved for.
            max(found.largest, rows * left + left**2 + 2 * own * left),
        )
    return found


def _list_sizes(mesh: Mesh) -> Integer:
    """Elements of each set of bodies' elements that have ends in common or face each other."""
    own = np.flatnonzero(~mesh.crack)
    points, at = np.unique(np.concatenate([mesh.start[own], mesh.end[own]]), return_inverse=True)
    pairs, element = mesh.pairs, mesh.node_element
    facing = ~pairs.crack
    size = mesh.elements + len(points)
    joined = (
        np.concatenate([np.tile(own, 2), element[pairs.first[facing]]]),
        np.concatenate([mesh.elements + at.ravel(), element[pairs.second[facing]]]),
    )
    meeting = (np.ones(len(joined[0])), joined)
    _, label = csgraph.connected_components(sparse.coo_matrix(meeting, shape=(size, size)), directed=False)
    return np.unique(label[own], return_counts=True)[1]
