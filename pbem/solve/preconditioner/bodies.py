"""Many small bodies in contact: LU factors of the whole tangent operator as the preconditioner.

The equations of a body contain its own unknowns and those of the pairs on its boundary alone. Of many small bodies the
tangent operator is sparse therefore, a block for each body, and its factors take less than the inverses of overlapping
groups: what goes through many bodies, as bending and shear of a stack or a wall, is solved for exactly, however many
there are. The blocks are formed entry by entry; GMRES mends what the products of the hierarchical operator are off by.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from scipy import sparse

from pbem.arrays import Bool, Integer, Real
from pbem.bem.rigid_motions import RigidMotions
from pbem.clock import clock
from pbem.contact.anchor import Anchor
from pbem.contact.constraints import ConstraintMap
from pbem.contact.map_entries import ChosenNodes
from pbem.errors import ConvergenceError
from pbem.mesh.mesh import Mesh
from pbem.mesh.numbering import list_nodes, number_components
from pbem.model.material import Material
from pbem.parallel import add_up, gather_parts, largest_of_parts
from pbem.solve.petsc.linear import LinearSolver
from pbem.solve.petsc.session import PREFIX
from pbem.solve.preconditioner.local_operator import LocalOperator, take_entries
from pbem.solve.preconditioner.schwarz import SchwarzPreconditioner
from pbem.solve.preconditioner.subdomains import Subdomain

# PETSc's options for these factors alone begin with this.
OWN_PREFIX = PREFIX + "bodies_"
# Factors serve as they are until more columns of the constraint map than this have changed.
FEW_CHANGED = 6


@dataclass(frozen=True)
class BodyRows:
    """Rows of B of a region's nodes on this rank, without free terms and anchors.

    rows (2 k,): places among this rank's rows. nodes (k,), seen (s,): of the rows, and of the region. columns (c,): of
    B; transposed (c, 2 k): the entries.
    """

    region: int
    rows: Integer
    nodes: Integer
    seen: Integer
    columns: Integer
    transposed: Real


class BodyFactors:
    """Factors of the tangent operator of a constraint map; this rank has the rows of its nodes (k,), rising."""

    def __init__(self, comm: MPI.Intracomm, mesh: Mesh, local: LocalOperator, nodes: Integer) -> None:
        self._local, self._nodes = local, nodes
        # Of every unknown its place in vectors that the ranks share, and where this rank's places begin.
        order = number_components(gather_parts(comm, nodes.astype(float)).astype(np.int64))
        self._place = np.empty(len(order), dtype=np.int64)
        self._place[order] = np.arange(len(order))
        self._first = sum(comm.allgather(2 * len(nodes))[: comm.rank])
        self._solver = LinearSolver(comm, "mumps", 2 * len(nodes), len(order), lambda part: part, OWN_PREFIX)
        self._blocks = [_make_block(mesh, local, nodes, int(region)) for region in np.unique(mesh.node_region[nodes])]
        # The nodes whose rows of constraint maps are asked for: of these regions.
        self._seen = np.unique(np.concatenate([nodes, *(block.seen for block in self._blocks)]))
        self._place_entries = ChosenNodes(mesh.nodes, self._seen).place_entries

    def factorise(self, constraints: ConstraintMap) -> bool:
        """Factorise K = B M for a constraint map, with the anchors that act with it (theory, 119).

        Returns on all ranks alike whether there are factors: not of a singular K, without memory for them, or where
        the user's options put something else in their place. Too little memory to form K, which one rank can lack
        alone, is raised.
        """
        rows, free = constraints.take_rows(self._seen), self._local.collect_free(self._nodes)
        places = (free.data, self._place_entries(free.indices), free.indptr)
        freed = (sparse.csr_matrix(places, shape=(free.shape[0], rows.shape[0])) @ rows).tocsr()
        begin, end = self._first, self._first + 2 * len(self._nodes)
        entries = [
            (take_entries(rows, self._place_entries(block.columns)), take_entries(freed, block.rows))
            for block in self._blocks
        ]
        seen = [np.unique(self._place[np.concatenate([each[1] for each in pair])]) for pair in entries]
        inside, outside = np.zeros((2, end - begin), dtype=np.int64)
        for block, places in zip(self._blocks, seen, strict=True):
            here = np.count_nonzero((places >= begin) & (places < end))
            inside[block.rows], outside[block.rows] = here, len(places) - here
        self._solver.begin_filling((inside, outside))
        for block, places, (moved, own) in zip(self._blocks, seen, entries, strict=True):
            values = self._form(block, places, moved)
            row, unknown, value = own
            values[row, np.searchsorted(places, self._place[unknown])] += value
            self._solver.fill(block.rows, places, values)
        try:
            self._solver.factorise()
        except (ConvergenceError, MemoryError):
            return False
        return self._solver.factored

    def _form(self, block: BodyRows, places: Integer, moved: tuple[Integer, Integer, Real]) -> Real:
        """A block's rows of K (2 k, c) without free terms in the columns of unknowns at places (c,).

        moved: entries of the constraint map in the block's columns: which of them, unknown, value.
        """
        column, unknown, value = moved
        at = np.searchsorted(places, self._place[unknown])
        chosen = sparse.csr_matrix((value, (at, column)), shape=(len(places), len(block.columns)))
        rows = self._local.hold(block.transposed.T, block.nodes, block.seen, block.region)
        return np.ascontiguousarray((chosen @ rows.T).T)

    def solve(self, part: Real) -> Real:
        """This rank's part of the solution for its part (2 k,) of a right-hand side, by the factors alone."""
        return self._solver.solve_columns(part[:, None])[:, 0]

    def destroy(self) -> None:
        """Free PETSc's storage."""
        self._solver.destroy()


class BodiesPreconditioner(SchwarzPreconditioner):
    """Factors of the whole; the groups take their place where the operator is singular or the factors serve badly."""

    def __init__(
        self, comm: MPI.Intracomm, mesh: Mesh, materials: Sequence[Material], length: float, anchors: Sequence[Anchor],
        groups: Sequence[Subdomain], nodes: Integer, rigid: Sequence[RigidMotions] = (),
    ) -> None:
        super().__init__(comm, mesh, materials, length, anchors, groups, nodes, rigid)
        self._factors: BodyFactors | None = BodyFactors(comm, mesh, self._local, nodes)
        self._drift: Real | None = None

    @property
    def whole(self) -> bool:
        """See SchwarzPreconditioner."""
        return self._factors is not None

    def update(self, constraints: ConstraintMap) -> int:
        """Make the factors anew where the constraint map has changed; returns how many."""
        if self._factors is None:
            return super().update(constraints)
        change = self._take_map(constraints)
        self._drift = change if self._drift is None else self._drift + change
        if self._count_own(self._drift > self.most_drift) <= FEW_CHANGED:
            return 0
        with clock.piece("preconditioner"):
            factored = self._factors.factorise(constraints)
        if not factored:
            self._drop()
            return super().update(constraints)
        self._drift = np.zeros_like(change)
        return 1

    def give_up(self) -> None:
        """See SchwarzPreconditioner; factors of another constraint map are made anew first."""
        if self._drift is not None and self._count_own(self._drift > 0):
            self._drift = np.full_like(self._drift, np.inf)
        else:
            self._drop()

    def _count_own(self, columns: Bool) -> int:
        """How many columns of the constraint map, among those of all ranks' own unknowns."""
        return int(add_up(self._comm, np.array([float(np.count_nonzero(columns[: 2 * len(self._nodes)]))]))[0])

    def _drop(self) -> None:
        if self._factors is not None:
            self._factors.destroy()
        self._factors, self._comparable = None, False

    def drop_inverses(self) -> None:
        """See SchwarzPreconditioner."""
        super().drop_inverses()
        self._drop()

    def apply(self, residual: Real, result: Real) -> None:
        """See SchwarzPreconditioner (theory, 119)."""
        if self._factors is None:
            super().apply(residual, result)
            return
        # MUMPS scales its matrix, but not a right-hand side of lengths in small units.
        own = residual[: 2 * len(self._nodes)]
        size = largest_of_parts(self._comm, own) or 1.0
        result[:] = size * self._factors.solve(own / size)


def _make_block(mesh: Mesh, local: LocalOperator, nodes: Integer, region: int) -> BodyRows:
    at = np.flatnonzero(mesh.node_region[nodes] == region)
    elements = np.flatnonzero(mesh.region == region)
    values, columns = local.evaluate_unheld(region, elements, nodes[at])
    return BodyRows(
        region, number_components(at), nodes[at], list_nodes(mesh, elements), columns, np.ascontiguousarray(values.T)
    )
