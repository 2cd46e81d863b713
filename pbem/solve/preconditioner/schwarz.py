"""A preconditioner of overlapping groups: each group's part of the solution of its equations and its neighbours'.

For every group the tangent operator of the group and of those around it is formed exactly and factored; of the local
solution only the group's own part is used (restricted additive Schwarz: X.-C. Cai, M. Sarkis, SIAM J. Sci. Comput. 21,
1999). Only the rows of the local inverse that give this part are kept.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from pbem.arrays import Bool, Integer, Real
from pbem.bem.group_sizes import MOST_LEFT_OF_BODIES, MOST_TIMES
from pbem.bem.rigid_motions import RigidMotions
from pbem.clock import clock
from pbem.contact.anchor import Anchor
from pbem.contact.constraints import ConstraintMap
from pbem.mesh.mesh import Mesh
from pbem.mesh.numbering import list_nodes, number_components
from pbem.model.material import Material
from pbem.solve.preconditioner.elimination import Elimination, eliminate_tractions
from pbem.solve.preconditioner.inversion import invert_rows
from pbem.solve.preconditioner.local_operator import LocalOperator
from pbem.solve.preconditioner.subdomains import MOST_AROUND, Subdomain
from pbem.solve.system.halo import place_unknowns

Single = NDArray[np.float32]

# Unknowns that are left in the matrix of a group of cracks and the nearest elements around it, at most.
MOST_LEFT = 900
# Rows of two constraint maps that are compared at a time.
COMPARED = 65_536
# Models with so many unknowns keep the inverses of groups in single precision.
SINGLE = 20_000


@dataclass
class LocalInverse:
    """own: rows of the group's unknowns in this rank's vector; around: unknowns (of the model) of group and neighbours.

    inside: places of the group's own unknowns in around; seen: places of the unknowns around it, less those eliminated,
    in the residual that `apply` is given. matrix (solved, seen): rows of the local inverse, less what is
    eliminated within a node, of some of the own unknowns, on turned equations; None where there is none.
    formed: whether it has been tried; drift: by how much the constraint map has changed in what it sees since then.
    """

    group: Subdomain
    own: Integer
    around: Integer
    inside: Integer
    seen: Integer
    solved: Integer
    matrix: Real | Single | None = None
    formed: bool = False
    drift: float = 0.0


class SchwarzPreconditioner:
    """The local inverses of this rank's groups, formed anew where the constraint map has changed."""

    def __init__(
        self, mesh: Mesh, materials: Sequence[Material], length: float, anchors: Sequence[Anchor],
        groups: Sequence[Subdomain], nodes: Integer, rigid: Sequence[RigidMotions] = (),
    ) -> None:
        self._mesh, self._nodes = mesh, nodes
        self._local = LocalOperator(mesh, materials, length, anchors, rigid)
        self.free = self._local.free
        self._node_crack = mesh.node_crack
        self._formed: sparse.csr_matrix | None = None
        self._widening = 1
        self._less: Elimination | None = None
        self.singular = 0  # groups whose matrix was singular, of those formed last
        self.most_drift = 0.0  # inverses serve until the constraint map has changed by more than this part
        self._take_groups(groups)

    @property
    def whole(self) -> bool:
        """Whether it is the inverse of the whole, or nearly, in place of the groups' (see BodiesPreconditioner)."""
        return False

    def give_up(self) -> None:
        """Serve otherwise from now on, at last by the groups."""

    def drop_inverses(self) -> None:
        """Drop all inverses; `update` would form them anew."""
        self._formed = None
        for inverse in self.inverses:
            inverse.matrix, inverse.formed = None, False

    def regroup(self, groups: Sequence[Subdomain], widening: int) -> None:
        """Take other surroundings of the same groups, so many times as many; `update` then forms all inverses.

        Until then `apply` leaves residuals as they are.
        """
        self._formed, self._widening = None, widening
        self._take_groups(groups)

    def _take_groups(self, groups: Sequence[Subdomain]) -> None:
        """beyond: nodes, rising, that the groups see and that are not this rank's. _seen: unknowns (of the model) that
        they see."""
        self.inverses = [self._place(group) for group in groups]
        elements = np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *(group.around for group in groups)]))
        seen = list_nodes(self._mesh, elements)
        self.beyond = np.setdiff1d(seen, self._nodes)
        self._seen = np.zeros(2 * self._mesh.nodes, dtype=bool)
        self._seen[number_components(seen)] = True
        # Of the own nodes' equations, and of those beyond.
        self._turn = np.zeros((0, 2, 2)) if self._less is None else self._choose_turn(self._less)

    def _choose_turn(self, less: Elimination) -> Real:
        seen = np.concatenate([self._nodes, self.beyond])
        return less.turn if len(self._nodes) == self._mesh.nodes else less.turn[seen]

    def _place(self, group: Subdomain) -> LocalInverse:
        at = np.searchsorted(self._nodes, list_nodes(self._mesh, group.elements))
        around = list_nodes(self._mesh, group.around)
        inside = number_components(np.searchsorted(around, list_nodes(self._mesh, group.elements)))
        return LocalInverse(group, number_components(at), number_components(around), inside, inside, inside)

    def update(self, constraints: ConstraintMap) -> int:
        """Form the inverses of the groups that see a change of the constraint map; returns their number."""
        change = self._take_map(constraints)
        by_column = _take_columns(constraints.matrix, self._seen)
        assert self._less is not None
        count, self.singular = 0, 0
        with clock.piece("preconditioner"):
            for inverse in self.inverses:
                inverse.drift += float(change[inverse.around].max())
                if not inverse.formed or inverse.drift > self.most_drift:
                    self._invert(inverse, by_column, self._free, self._less)
                    inverse.drift = 0.0
                    count += 1
        return count

    def pass_over(self, constraints: ConstraintMap) -> None:
        """Take a constraint map without inverses, as others serve for it; `update` then forms all of them anew."""
        self._take_map(constraints)
        self.drop_inverses()

    def _take_map(self, constraints: ConstraintMap) -> Real:
        """Take another constraint map; by which part of itself each of its columns (unknowns,) has changed."""
        matrix = constraints.matrix
        former = None if self._less is None else (self._less.local, self._less.first)
        change = _measure_changes(self._formed, matrix)
        self._formed = matrix
        change[self._local.find_anchored(constraints)] = np.inf
        self._free = (self.free @ matrix).tocsr()
        self._less = None
        less = self._less = eliminate_tractions(matrix, self._free, self._node_crack)
        self._turn = self._choose_turn(less)
        if former is not None:
            change[((less.local != former[0]) | (less.first != former[1])).ravel()] = np.inf
        return change

    def apply(self, residual: Real, result: Real) -> None:
        """Put this rank's part of the preconditioned residual into result (own unknowns,) (theory, 63).

        residual: of the own unknowns, and of those of the nodes `beyond` after them.
        """
        less, nodes = self._less, self._nodes
        assert less is not None
        turned = np.einsum("nij,nj->ni", self._turn, residual.reshape(-1, 2)).ravel()
        # Single precision has few powers of ten, which lengths in small units would fall out of. By a power of two, so
        # that its rounding is the same however many ranks there are.
        size = float(np.ldexp(0.5, np.frexp(np.abs(turned).max(initial=0.0))[1]))
        single = (turned / size).astype(np.float32)
        own = turned[: 2 * len(nodes)].reshape(-1, 2)
        eliminated = np.einsum("nij,nj->ni", less.inverse[nodes], own).ravel()
        for inverse in self.inverses:
            if inverse.matrix is not None:
                result[inverse.own] = eliminated[inverse.own]
                seen = (single if inverse.matrix.dtype == np.float32 else turned / size)[inverse.seen]
                result[inverse.own[inverse.solved]] += size * (inverse.matrix @ seen)
            else:
                # A group without an inverse, as of a matrix that overflows: its residual serves as it is.
                result[inverse.own] = residual[inverse.own]

    def turn(self, residual: Real) -> Real:
        """This rank's equations (own unknowns,), turned so that those which determine eliminated unknowns stand alone.
        """
        assert self._less is not None
        return np.asarray((self._less.turn[self._nodes] @ residual.reshape(-1, 2, 1)).ravel())

    def turn_back(self, turned: Real) -> Real:
        """The inverse of `turn`."""
        assert self._less is not None
        transposed = self._less.turn[self._nodes].transpose(0, 2, 1)
        return np.asarray((transposed @ turned.reshape(-1, 2, 1)).ravel())

    @property
    def judged(self) -> Real:
        """1 for turned equations of this rank that contain no eliminated unknowns, 0 for those that determine them."""
        assert self._less is not None
        return np.asarray(~self._less.first[self._nodes].ravel(), dtype=float)

    def correct(self, residual: Real) -> tuple[Real, Real]:
        """What the eliminated unknowns are off by (own unknowns,), from this rank's part of K x - b, and what is left.

        No other equation contains them, so that their own are fulfilled without a product.
        """
        less, nodes = self._less, self._nodes
        assert less is not None
        turned = self.turn(residual).reshape(-1, 2)
        off = (less.inverse[nodes] @ turned[..., None])[..., 0]
        return off.ravel(), np.where(less.first[nodes], 0.0, turned).ravel()

    def _invert(
        self, inverse: LocalInverse, constraints: sparse.csc_matrix, free: sparse.csr_matrix, less: Elimination
    ) -> None:
        """Form the rows of a group's inverse; what is eliminated is not in the factors, but follows from the rest."""
        elements, around, inside = self._narrow(inverse, less)
        local, first = less.local.ravel()[around], less.first.ravel()[around]
        inverse.seen = place_unknowns(self._nodes, self.beyond, around[~first])
        inverse.matrix, inverse.formed = None, True
        if local.all():
            inverse.matrix, inverse.solved = np.zeros((0, 0), dtype=np.float32), np.zeros(0, dtype=np.int64)
            return
        # In large groups the eliminated follow their own residual alone: what the others do to them GMRES sees in its
        # next iteration, and no other equation contains them.
        apart = len(inverse.group.nearest) > 0
        own = np.zeros(len(around), dtype=bool)
        own[inside] = not apart
        rows = np.flatnonzero(~first | own)
        left = np.flatnonzero(~local)
        whole = self._local.form(elements, around, rows, left, constraints, free, less)
        rest = ~first[rows]
        # Rows wanted: of the own unknowns that are left, and of the eliminated ones what the others do to them.
        kept = np.flatnonzero(~local[inside])
        inverse.solved = kept if apart else np.arange(len(inside))
        wanted = np.zeros((len(inverse.solved), len(left)))
        if not apart:
            at = np.flatnonzero(~rest)
            wanted[np.searchsorted(inside, rows[at])] = whole[at]
            back = less.inverse[around[inside[::2]] // 2]
            wanted = -(back @ wanted.reshape(len(back), 2, -1)).reshape(wanted.shape)
        wanted[np.searchsorted(inverse.solved, kept), np.searchsorted(left, inside[kept])] = 1.0
        if not rest.all():
            whole = whole[rest]
        matrix, found = invert_rows(
            whole, wanted, lambda: self._local.form(elements, around, rows[rest], left, constraints, free, less)
        )
        if matrix is not None:
            # All groups together are much of what is stored: of large models in single precision.
            stored: Real | Single = np.ascontiguousarray(matrix)
            if len(around) < 2 * self._mesh.nodes >= SINGLE:
                with np.errstate(over="ignore"):
                    stored = stored.astype(np.float32)
            inverse.matrix = stored if np.isfinite(stored).all() else None
        self.singular += found > 0 or inverse.matrix is None

    def respond(
        self, constraints: sparse.csr_matrix, offsets: sparse.csr_matrix, elements: Integer, unknowns: Integer
    ) -> Real:
        """What columns of B times offsets (4 n, 2 n) do to the unknowns of the same numbers, (k, k), all else free.

        Of the model the elements alone are there, the nodes of the unknowns among them; constraints: those of `update`.
        """
        less = self._less
        assert less is not None
        around = number_components(list_nodes(self._mesh, elements))
        asked = np.searchsorted(around, unknowns)
        at = np.sort(asked)  # pairs need not be in the order of their nodes
        local, first = less.local.ravel()[around], less.first.ravel()[around]
        wanted = np.zeros(len(around), dtype=bool)
        wanted[at] = True
        rows, left = np.flatnonzero(~first | wanted), np.flatnonzero(~local)
        whole, forces = (
            self._local.form(elements, around, rows, columns, matrix.tocsc(), (self.free @ matrix).tocsr(), less)
            for columns, matrix in ((left, constraints), (at, offsets))
        )
        rest = ~first[rows]
        result = np.zeros((len(around), len(at)))
        result[left] = -np.linalg.solve(whole[rest], forces[rest])
        turned = np.zeros_like(result)
        turned[rows[~rest]] = (-forces - whole @ result[left])[~rest]
        back = less.inverse[around[::2] // 2]
        result += (back @ turned.reshape(len(back), 2, -1)).reshape(result.shape)
        return np.asarray(result[np.ix_(asked, np.searchsorted(at, asked))])

    def form_block(self, constraints: sparse.csr_matrix, elements: Integer, nodes: Integer) -> Real:
        """Rows of the tangent operator of a constraint map and its columns, of some nodes of elements: (2 k, 2 k)."""
        around = list_nodes(self._mesh, elements)
        asked = number_components(np.searchsorted(around, nodes))
        at = np.sort(asked)
        free = (self.free @ constraints).tocsr()
        formed = self._local.form(elements, number_components(around), at, at, constraints.tocsc(), free, None)
        place = np.searchsorted(at, asked)
        return formed[np.ix_(place, place)]

    def _narrow(self, inverse: LocalInverse, less: Elimination) -> tuple[Integer, Integer, Integer]:
        """Elements of a group and around it, few enough; their unknowns, and the places of the own ones among these."""
        group = inverse.group
        if not len(group.nearest):
            return group.around, inverse.around, inverse.inside
        own, width = group.elements, 2 * (self._mesh.order + 1)
        left = (~less.local).reshape(-1, width).sum(axis=1)
        sums = left[own].sum() + np.cumsum(left[group.nearest])
        least = MOST_LEFT if self._mesh.crack[own].all() else MOST_LEFT_OF_BODIES
        most = max(least, MOST_TIMES * left[own].sum()) * self._widening
        most = min(most, max(MOST_AROUND, MOST_TIMES * left[own].sum()))
        elements = np.union1d(own, group.nearest[sums <= most])
        around = list_nodes(self._mesh, elements)
        inside = number_components(np.searchsorted(around, list_nodes(self._mesh, own)))
        return elements, number_components(around), inside


def _measure_changes(before: sparse.csr_matrix | None, matrix: sparse.csr_matrix) -> Real:
    """By which part of itself each column (unknowns,) of a constraint map differs from what it was before."""
    if before is None:
        return np.full(matrix.shape[1], np.inf)
    change = np.zeros(matrix.shape[1])
    for begin in range(0, matrix.shape[0], COMPARED):
        part = slice(begin, begin + COMPARED)
        change = np.maximum(change, _find_largest(matrix[part] - before[part]))
    changed = change > 0
    change[changed] /= np.maximum(_find_largest(before), _find_largest(matrix))[changed]
    return change


def _take_columns(matrix: sparse.csr_matrix, chosen: Bool) -> sparse.csc_matrix:
    """The matrix by columns, all of them empty but the chosen ones (unknowns,)."""
    at = np.flatnonzero(chosen[matrix.indices])
    row = np.searchsorted(matrix.indptr, at, side="right") - 1
    return sparse.coo_matrix((matrix.data[at], (row, matrix.indices[at])), shape=matrix.shape).tocsc()


def _find_largest(matrix: sparse.csr_matrix) -> Real:
    """The largest size of an entry in each column."""
    largest = np.zeros(matrix.shape[1])
    np.maximum.at(largest, matrix.indices, np.abs(matrix.data))
    return largest
