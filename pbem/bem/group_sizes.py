"""What elements are connected, and how large the preconditioner's groups of them are; for these and their forecast."""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from pbem.arrays import Integer
from pbem.mesh.mesh import Mesh

# Elements of a group at most; both sides of an interface count.
GROUP_ELEMENTS = 48
# Of bodies that are more than a group, of whose unknowns none are eliminated, and through which forces go from one end
# to the other; and the elements around such a group, as a multiple of its own.
BODY_ELEMENTS, BODY_SHARE = 192, 3.0
# Unknowns that are left in the matrix of such a group and the nearest elements around it, at most; or so many times
# those of the group alone.
MOST_LEFT_OF_BODIES, MOST_TIMES = 1700, 2.0
# Groups around a group are taken until they have so many unknowns together, or so many times those of the group.
NEIGHBOUR_UNKNOWNS, NEIGHBOUR_SHARE = 100, 0.5
# The groups of a network are divided into parts of so many elements at most, which settle with the elements nearest to
# them, so many times as many: what they take grows with the square of these numbers. Half as many around take 230 MB
# for 412 of kb11 (8 iterations for 9), but of 3 200 pieces 570 of 122 000 pairs go on changing, which end after 10
# with these; parts of 32 elements take 15 iterations for the 9 of kb11.
PART_ELEMENTS, PART_SHARE = 48, 1.0

# Unknowns at most of a cluster of a network that settles by itself, and of the elements that follow it: their matrix.
MOST_CONDENSED = 4000


def join_elements(mesh: Mesh, own: Integer) -> Integer:
    """Of every element the number of the first one of its set, where some of them (k,) are connected.

    Elements are connected that have an end in common, or face each other in a contact.
    """
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
    _, first, inverse = np.unique(label[: mesh.elements], return_index=True, return_inverse=True)
    return np.asarray(first[inverse.ravel()])


def do_cracks_meet(mesh: Mesh) -> bool:
    """Whether any cracks have an end in common."""
    own = np.flatnonzero(mesh.crack)
    sets = join_elements(mesh, own)[own]
    curve_of_set = np.unique(np.stack([sets, mesh.curve[own]]), axis=1)
    return bool(len(curve_of_set[0]) > len(np.unique(sets)))
