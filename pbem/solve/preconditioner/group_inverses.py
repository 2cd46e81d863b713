"""The local inverses of groups of elements: what is formed for each, and the rows of its inverse that are kept."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pbem.arrays import Bool, Integer, Real, Single
from pbem.bem.group_sizes import MOST_LEFT_OF_BODIES, MOST_TIMES
from pbem.mesh.mesh import Mesh
from pbem.mesh.numbering import list_nodes, number_components
from pbem.solve.preconditioner.elimination import Elimination
from pbem.solve.preconditioner.inversion import invert_rows
from pbem.solve.preconditioner.local_operator import LocalOperator, Wanted
from pbem.solve.preconditioner.near_map import NearMap
from pbem.solve.preconditioner.small_groups import AT_ONCE, SmallGroups
from pbem.solve.preconditioner.subdomains import MOST_AROUND, Subdomain

# Unknowns that are left in the matrix of a group of cracks and the nearest elements around it, at most.
MOST_LEFT = 900
# Models with so many unknowns keep the inverses of groups in single precision.
SINGLE = 20_000


@dataclass
class LocalInverse:
    """own: rows of the group's unknowns in this rank's vector; around: those of group and neighbours among the unknowns
    of all nodes that the groups see, as of the residual that the preconditioner is given.

    inside: places of the group's own unknowns in around; seen: those around, less what is eliminated. matrix
    (solved, seen): rows of the local inverse, less what is eliminated within a node, of some of the own unknowns, on
    turned equations; None where there is none.
    small: whether it is formed with others at once. formed: whether it has been tried; drift: by how much the
    constraint map has changed in what it sees since then.
    """

    group: Subdomain
    own: Integer
    around: Integer
    inside: Integer
    seen: Integer
    solved: Integer
    matrix: Real | Single | None = None
    small: bool = False
    formed: bool = False
    drift: float = 0.0


@dataclass(frozen=True)
class _Asked:
    """What is formed for a group. inside: places of its own unknowns; rest: rows that contain nothing eliminated; kept:
    places among the own unknowns of those that are left; apart: whether what is eliminated follows its own residual
    alone."""

    wanted: Wanted
    inside: Integer
    rest: Bool
    kept: Integer
    apart: bool


class GroupInverses:
    """Forms the inverses of groups for one constraint map after the other."""

    def __init__(self, mesh: Mesh, local: LocalOperator) -> None:
        self._mesh, self._local, self._small = mesh, local, SmallGroups(mesh, local)

    def place(self, group: Subdomain, own: Integer, around: Integer) -> LocalInverse:
        """A group's inverse, not formed yet; own, around: see LocalInverse."""
        nodes = list_nodes(self._mesh, group.elements)
        inside = number_components(np.searchsorted(list_nodes(self._mesh, group.around), nodes))
        small = not len(group.nearest) and self._small.suit(group.around)
        return LocalInverse(group, own, around, inside, inside, inside, small=small)

    def form(self, inverses: Sequence[LocalInverse], near: NearMap, less: Elimination, widening: int) -> int:
        """Form the rows of groups' inverses; what is eliminated is not in the factors, but follows from the rest.

        widening: so many times as many unknowns may be left in a matrix. Returns how many matrices were singular.
        """
        small: list[tuple[LocalInverse, _Asked]] = []
        singular = unknowns = 0
        # What overflows is not kept.
        with np.errstate(over="ignore"):
            for inverse in inverses:
                asked = self._ask(inverse, near, less, widening)
                if asked is None:
                    continue
                if not inverse.small:
                    singular += self._invert(inverse, asked, self._local.form(asked.wanted, near, less), near, less)
                    continue
                small.append((inverse, asked))
                unknowns += len(asked.wanted.places)
                if unknowns >= AT_ONCE:
                    singular += self._form_small(small, near, less)
                    small, unknowns = [], 0
            return singular + self._form_small(small, near, less)

    def _form_small(self, groups: Sequence[tuple[LocalInverse, _Asked]], near: NearMap, less: Elimination) -> int:
        matrices = self._small.form([asked.wanted for _, asked in groups], near, less) if groups else []
        return sum(
            self._invert(inverse, asked, matrix, near, less)
            for (inverse, asked), matrix in zip(groups, matrices, strict=True)
        )

    def _ask(self, inverse: LocalInverse, near: NearMap, less: Elimination, widening: int) -> _Asked | None:
        """What is formed for a group; None where that is nothing, as its pairs and those around it all stick."""
        elements, inside, places = self._narrow(inverse, near, less, widening)
        local, first = less.local.ravel()[places], less.first.ravel()[places]
        inverse.seen = places[~first]
        inverse.matrix, inverse.formed = None, True
        if local.all():
            inverse.matrix, inverse.solved = np.zeros((0, 0), dtype=np.float32), np.zeros(0, dtype=np.int64)
            return None
        # In large groups the eliminated follow their own residual alone: what the others do to them GMRES sees in its
        # next iteration, and no other equation contains them.
        apart = len(inverse.group.nearest) > 0
        formed = ~first
        if not apart:
            formed[inside] = True
        wanted = Wanted(elements, places, formed.nonzero()[0], (~local).nonzero()[0])
        return _Asked(wanted, inside, ~first[wanted.rows], (~local[inside]).nonzero()[0], apart)

    def _invert(
        self, inverse: LocalInverse, asked: _Asked, whole: Real, near: NearMap, less: Elimination
    ) -> bool:
        """Invert what is formed, whole (rows, left), of a group; whether it was singular."""
        inside, rest, kept = asked.inside, asked.rest, asked.kept
        rows, left, places = asked.wanted.rows, asked.wanted.left, asked.wanted.places
        # Rows wanted: of the own unknowns that are left, and of the eliminated ones what the others do to them.
        inverse.solved = kept if asked.apart else np.arange(len(inside))
        wanted = np.zeros((len(inverse.solved), len(left)))
        if not asked.apart:
            at = (~rest).nonzero()[0]
            wanted[inside.searchsorted(rows[at])] = whole[at]
            back = less.inverse[places[inside[::2]] // 2]
            wanted = -(back @ wanted.reshape(len(back), 2, -1)).reshape(wanted.shape)
        wanted[inverse.solved.searchsorted(kept), left.searchsorted(inside[kept])] = 1.0
        if not rest.all():
            whole = whole[rest]
        # All groups together are much of what is stored: of large models in single precision.
        single = len(places) < 2 * self._mesh.nodes >= SINGLE
        matrix, found = invert_rows(
            whole, wanted, lambda: self._local.form(replace(asked.wanted, rows=rows[rest]), near, less), single
        )
        if matrix is not None:
            stored: Real | Single = np.ascontiguousarray(matrix, dtype=np.float32 if single else None)
            inverse.matrix = stored if np.isfinite(stored).all() else None
        return found > 0 or inverse.matrix is None

    def _narrow(
        self, inverse: LocalInverse, near: NearMap, less: Elimination, widening: int
    ) -> tuple[Integer, Integer, Integer]:
        """Elements of a group and around it, few enough; the places of the own unknowns among theirs; and the places of
        theirs in the near map."""
        group = inverse.group
        if not len(group.nearest):
            return group.around, inverse.inside, inverse.around
        own, width = group.elements, 2 * (self._mesh.order + 1)
        left = (~less.local).reshape(-1, width).sum(axis=1)
        of_own, of_nearest = (left[near.find(width * each) // width] for each in (own, group.nearest))
        sums = of_own.sum() + np.cumsum(of_nearest)
        least = MOST_LEFT if self._mesh.crack[own].all() else MOST_LEFT_OF_BODIES
        most = max(least, MOST_TIMES * of_own.sum()) * widening
        most = min(most, max(MOST_AROUND, MOST_TIMES * of_own.sum()))
        elements = np.union1d(own, group.nearest[sums <= most])
        around = list_nodes(self._mesh, elements)
        inside = number_components(np.searchsorted(around, list_nodes(self._mesh, own)))
        return elements, inside, near.find(number_components(around))
