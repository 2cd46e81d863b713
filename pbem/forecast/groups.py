"""What the preconditioner's groups of bodies take: of cracks most unknowns are eliminated, of bodies none."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pbem.arrays import Integer
from pbem.bem.group_sizes import (
    BODY_ELEMENTS,
    BODY_SHARE,
    GROUP_ELEMENTS,
    MOST_LEFT_OF_BODIES,
    MOST_TIMES,
    NEIGHBOUR_SHARE,
    NEIGHBOUR_UNKNOWNS,
    PART_ELEMENTS,
    PART_SHARE,
    do_cracks_meet,
    join_elements,
)
from pbem.mesh.mesh import Mesh
from pbem.mesh.strips import run_side_by_side

# Unknowns that are left of a node of a body, and as a rule of one of a crack: its traction is eliminated.
LEFT, LEFT_OF_CRACK = 2.0, 1.2
# Elements of a part of a network that settles by itself, as a part of the most: groups are halved to that.
USUAL_PART = 0.7


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
            room = max(MOST_LEFT_OF_BODIES, MOST_TIMES * own) - own
            around = min(BODY_SHARE * elements, room / each, float(mesh.elements) - elements)
        else:
            around = min(max(NEIGHBOUR_UNKNOWNS, NEIGHBOUR_SHARE * own) / each, float(mesh.elements) - elements)
        left, rows = own + each * around, 2 * width * (elements + around)
        found = Groups(
            found.count + parts,
            found.kept + parts * own * left,
            found.entries + parts * rows * 2 * rows,
            found.operations + parts * (2 / 3 * left**3 + 2 * own * left**2),
            # The matrix, with the eliminated rows of small groups beside it; the inverse and what it is solved for.
            max(found.largest, left**2 + 2 * own * left + (rows * left if size <= GROUP_ELEMENTS else 0.0)),
        )
    return found


def _list_sizes(mesh: Mesh) -> Integer:
    """Elements (s,) of each set of bodies' elements that have ends in common or face each other."""
    own = np.flatnonzero(~mesh.crack)
    return np.unique(join_elements(mesh, own)[own], return_counts=True)[1]


def count_settling(mesh: Mesh) -> float:
    """Numbers of four bytes that the parts of a network of cracks keep of their stiffness, or of cracks side by side;
    none of another model."""
    if not (mesh.crack.all() and (do_cracks_meet(mesh) or run_side_by_side(mesh))):
        return 0.0
    elements = USUAL_PART * PART_ELEMENTS
    return mesh.elements / elements * (2 * (mesh.order + 1) * (1 + PART_SHARE) * elements) ** 2
