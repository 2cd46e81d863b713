"""A preconditioner of overlapping groups: each group's part of the solution of its equations and its neighbours'.

For every group the tangent operator of the group and of those around it is formed exactly and factored; of the local
solution only the group's own part is used (restricted additive Schwarz: X.-C. Cai, M. Sarkis, SIAM J. Sci. Comput. 21,
1999). Only the rows of the local inverse that give this part are kept.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from mpi4py import MPI
from scipy.linalg import lapack

from pbem.arrays import Integer, Real
from pbem.bem.rigid_motions import RigidMotions
from pbem.clock import clock
from pbem.contact.anchor import Anchor
from pbem.contact.constraints import ConstraintMap
from pbem.mesh.mesh import Mesh
from pbem.mesh.numbering import list_nodes, number_components
from pbem.model.material import Material
from pbem.parallel import largest_of_parts
from pbem.solve.preconditioner.elimination import Elimination, eliminate_tractions
from pbem.solve.preconditioner.group_inverses import GroupInverses, LocalInverse
from pbem.solve.preconditioner.inversion import SINGULAR, find_norm
from pbem.solve.preconditioner.local_operator import LocalOperator, Wanted
from pbem.solve.preconditioner.near_map import NearMap, take_near
from pbem.solve.preconditioner.subdomains import Subdomain
from pbem.solve.system.halo import place_unknowns


class SchwarzPreconditioner:
    """The local inverses of this rank's groups, formed anew where the constraint map has changed."""

    def __init__(
        self, comm: MPI.Intracomm, mesh: Mesh, materials: Sequence[Material], length: float, anchors: Sequence[Anchor],
        groups: Sequence[Subdomain], nodes: Integer, rigid: Sequence[RigidMotions] = (),
    ) -> None:
        self._comm, self._mesh, self._nodes = comm, mesh, nodes
        self._local = LocalOperator(mesh, materials, length, anchors, rigid)
        self._groups = GroupInverses(mesh, self._local)
        self._near: NearMap | None = None
        self._comparable = False  # whether inverses are those of the map, or of earlier ones with what has changed
        self._largest = 0.0  # free term of a node's own unknowns, of all the model
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
        self._comparable = False
        for inverse in self.inverses:
            inverse.matrix, inverse.formed = None, False

    def regroup(self, groups: Sequence[Subdomain], widening: int) -> None:
        """Take other surroundings of the same groups, so many times as many; `update` then forms all inverses.

        Until then `apply` must not be asked.
        """
        self._widening = widening
        self._take_groups(groups)

    def _take_groups(self, groups: Sequence[Subdomain]) -> None:
        """beyond: nodes, rising, that the groups see and that are not this rank's."""
        elements = np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *(group.around for group in groups)]))
        self.beyond = np.setdiff1d(list_nodes(self._mesh, elements), self._nodes)
        self.inverses = [self._place(group) for group in groups]
        self._near = self._less = None
        self._comparable = False

    def _place(self, group: Subdomain) -> LocalInverse:
        own, around = (list_nodes(self._mesh, each) for each in (group.elements, group.around))
        seen = place_unknowns(self._nodes, self.beyond, number_components(around))
        return self._groups.place(group, number_components(np.searchsorted(self._nodes, own)), seen)

    def update(self, constraints: ConstraintMap) -> int:
        """Form the inverses of the groups that see a change of the constraint map; returns their number.

        All ranks call this together, as `pass_over`.
        """
        change = self._take_map(constraints)
        changed: list[LocalInverse] = []
        with clock.piece("preconditioner"):
            for inverse in self.inverses:
                inverse.drift += float(change[inverse.around].max())
                if not inverse.formed or inverse.drift > self.most_drift:
                    inverse.drift = 0.0
                    changed.append(inverse)
            near, less = self._near, self._less
            assert near is not None and less is not None
            self.singular = self._groups.form(changed, near, less, self._widening)
        return len(changed)

    def pass_over(self, constraints: ConstraintMap) -> None:
        """Take a constraint map without inverses, as others serve for it; `update` then forms all of them anew."""
        self._take_map(constraints)
        self.drop_inverses()

    def _take_map(self, constraints: ConstraintMap) -> Real:
        """Take another constraint map; by which part of itself each of its columns has changed, of the unknowns of the
        own nodes and of those beyond."""
        before, former = self._near if self._comparable else None, self._less
        near = self._near = self.take_near(constraints, self._nodes, self.beyond)
        change, self._comparable = near.measure_changes(before), True
        change[self._local.find_anchored(constraints, near.nodes)] = np.inf
        self._less = None
        blocks = near.take_blocks()
        self._largest = largest_of_parts(self._comm, blocks[: len(self._nodes)])
        less = self._less = self._eliminate(near, blocks)
        if former is not None:
            change[((less.local != former.local) | (less.first != former.first)).ravel()] = np.inf
        return change

    def take_near(self, constraints: ConstraintMap, own: Integer, beyond: Integer | None = None) -> NearMap:
        """What groups of nodes need of a constraint map; nodes: see NearMap."""
        free = self._local.collect_free(own if beyond is None else np.concatenate([own, beyond]))
        return take_near(constraints, free, own, beyond)

    def _eliminate(self, near: NearMap, blocks: Real) -> Elimination:
        on_crack = self._mesh.crack[near.nodes // (self._mesh.order + 1)]
        return eliminate_tractions(near, blocks, on_crack, self._largest)

    def apply(self, residual: Real, result: Real) -> None:
        """Put this rank's part of the preconditioned residual into result (own unknowns,) (theory, 63).

        residual: of the own unknowns, and of those of the nodes `beyond` after them.
        """
        less = self._less
        assert less is not None
        turned = less.apply(residual)
        # Single precision has few powers of ten, which lengths in small units would fall out of. By a power of two, so
        # that its rounding is the same however many ranks there are.
        size = float(np.ldexp(0.5, np.frexp(np.abs(turned).max(initial=0.0))[1]))
        turned /= size
        single = turned.astype(np.float32)
        count = len(self._nodes)
        own = turned[: 2 * count].reshape(-1, 2)
        solved, without = np.zeros(2 * count), []
        for inverse in self.inverses:
            matrix = inverse.matrix
            if matrix is None:
                without.append(inverse.own)
            elif matrix.size:
                seen = (single if matrix.dtype == np.float32 else turned)[inverse.seen]
                rows = inverse.own if len(matrix) == len(inverse.own) else inverse.own[inverse.solved]
                solved[rows] = matrix @ seen
        # Each of the unknowns is in one group.
        solved += np.einsum("nij,nj->ni", less.inverse[:count], own).ravel()
        np.multiply(solved, size, out=result)
        for rows in without:
            # A group without an inverse, as of a matrix that overflows: its residual serves as it is.
            result[rows] = residual[rows]

    @property
    def _own(self) -> Elimination:
        """What is eliminated of this rank's own nodes."""
        less, count = self._less, len(self._nodes)
        assert less is not None
        return Elimination(less.turn[:count], less.local[:count], less.first[:count], less.inverse[:count])

    def turn(self, residual: Real) -> Real:
        """This rank's equations (own unknowns,), turned so that those which determine eliminated unknowns stand alone.
        """
        return self._own.apply(residual)

    def turn_back(self, turned: Real) -> Real:
        """The inverse of `turn`."""
        return np.asarray(np.einsum("nji,nj->ni", self._own.turn, turned.reshape(-1, 2)).ravel())

    @property
    def judged(self) -> Real:
        """1 for turned equations of this rank that contain no eliminated unknowns, 0 for those that determine them."""
        return np.asarray(~self._own.first.ravel(), dtype=float)

    def correct(self, residual: Real) -> tuple[Real, Real]:
        """What the eliminated unknowns are off by (own unknowns,), from this rank's part of K x - b, and what is left.

        No other equation contains them, so that their own are fulfilled without a product.
        """
        less = self._own
        turned = self.turn(residual).reshape(-1, 2)
        off = np.einsum("nij,nj->ni", less.inverse, turned)
        return off.ravel(), np.where(less.first, 0.0, turned).ravel()

    def respond(
        self, constraints: ConstraintMap, offsets: ConstraintMap, elements: Integer, unknowns: Integer
    ) -> Real:
        """What columns of B times a map of offsets do to the unknowns of the same numbers, (k, k), all else free.

        Of the model the elements alone are there, the nodes of the unknowns among them; constraints: those of `update`.
        """
        nodes = list_nodes(self._mesh, elements)
        around = number_components(nodes)
        asked = np.searchsorted(around, unknowns)
        at = np.sort(asked)  # pairs need not be in the order of their nodes
        # The elements can be those of other ranks.
        near, moved = (self.take_near(each, nodes) for each in (constraints, offsets))
        less = self._eliminate(near, near.take_blocks())
        local, first = less.local.ravel(), less.first.ravel()
        wanted = np.zeros(len(around), dtype=bool)
        wanted[at] = True
        rows, left = np.flatnonzero(~first | wanted), np.flatnonzero(~local)
        places = np.arange(len(around))  # the maps are those of these nodes
        whole = self._local.form(Wanted(elements, places, rows, left), near, less)
        forces = self._local.form(Wanted(elements, places, rows, at), moved, less)
        rest = ~first[rows]
        result = np.zeros((len(around), len(at)))
        result[left] = -np.linalg.solve(whole[rest], forces[rest])
        turned = np.zeros_like(result)
        turned[rows[~rest]] = (-forces - whole @ result[left])[~rest]
        result += (less.inverse @ turned.reshape(len(nodes), 2, -1)).reshape(result.shape)
        return np.asarray(result[np.ix_(asked, np.searchsorted(at, asked))])

    def condense(
        self, constraints: ConstraintMap, free: ConstraintMap, elements: Integer, nodes: Integer
    ) -> Real | None:
        """Rows and columns (2 k, 2 k) of the tangent operator of a map `free` for some nodes of elements, all other
        unknowns of these following by the map of the constraints; None where these are not determined by that.

        Of the model the elements alone are there; constraints: those of `update`. (theory, 137)
        """
        all_nodes = list_nodes(self._mesh, elements)
        places = np.arange(2 * len(all_nodes))  # the maps are those of these nodes
        asked = number_components(np.searchsorted(all_nodes, nodes))
        at = np.sort(asked)
        other = np.ones(len(places), dtype=bool)
        other[at] = False
        # The elements can be those of other ranks.
        near, loose = (self.take_near(each, all_nodes) for each in (constraints, free))
        less = self._eliminate(near, near.take_blocks())
        # What is eliminated of the others is in no other equation.
        rows, left = np.flatnonzero(other & ~less.first.ravel()), np.flatnonzero(other & ~less.local.ravel())
        block = self._local.form(Wanted(elements, places, at, at), loose, None)
        if len(left):
            matrix = self._local.form(Wanted(elements, places, rows, left), near, less)
            size = find_norm(matrix)
            # The transposed matrix is factorised where it is: a copy would be a hundred megabytes.
            factors, pivots, zero = lapack.dgetrf(matrix.T, overwrite_a=True)
            if zero or not lapack.dgecon(factors, size)[0] > SINGULAR:
                return None
            forces = self._local.form(Wanted(elements, places, rows, at), loose, less)
            follows = lapack.dgetrs(factors, pivots, forces, trans=1)[0]
            block -= self._local.form(Wanted(elements, places, at, left), near, None) @ follows
        place = np.searchsorted(at, asked)
        return np.asarray(block[np.ix_(place, place)])

    def form_block(self, near: NearMap, elements: Integer, nodes: Integer) -> Real:
        """Rows of the tangent operator of a constraint map and its columns, of some nodes of elements: (2 k, 2 k).

        near: the map of all nodes of the elements, and of others (see take_near).
        """
        around = list_nodes(self._mesh, elements)
        asked = number_components(np.searchsorted(around, nodes))
        at = np.sort(asked)
        formed = self._local.form(Wanted(elements, near.find(number_components(around)), at, at), near, None)
        place = np.searchsorted(at, asked)
        return formed[np.ix_(place, place)]
