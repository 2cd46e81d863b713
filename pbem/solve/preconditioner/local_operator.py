"""The tangent operator between elements that are near to each other, formed exactly, as preconditioners need it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import sparse

from pbem.arrays import Bool, Complex, Integer, Real
from pbem.bem.operator import CHUNK_BYTES, collect_free_terms, collect_sources, scale_equations
from pbem.bem.rigid_motions import RigidMotions
from pbem.bem.rigid_region import form_rigid_rows
from pbem.bem.rows import Sources, evaluate_rows
from pbem.contact.anchor import Anchor
from pbem.contact.constraints import ConstraintMap
from pbem.mesh.mesh import Mesh
from pbem.mesh.numbering import list_nodes, number_components, split_components
from pbem.model.material import Material
from pbem.solve.preconditioner.elimination import Elimination
from pbem.solve.preconditioner.near_map import NearMap

# Nodes whose equations are formed at a time: of a large group all of them would take twice what is wanted of them.
NODES_AT_ONCE = 64
# Anchors that act by no more than this part do not act.
NOTHING = 1e-12


class LocalOperator:
    """Rows of B of any nodes on any elements of their region, and of the tangent operator made of these."""

    def __init__(
        self, mesh: Mesh, materials: Sequence[Material], length: float, anchors: Sequence[Anchor],
        rigid: Sequence[RigidMotions] = (),
    ) -> None:
        self._mesh, self._anchors, self._materials = mesh, tuple(anchors), tuple(materials)
        self._rigid = [motions for motions in rigid if motions.interpolated]
        self._sources = collect_sources(mesh, materials)
        self._length, self._per_element = length, mesh.order + 1
        self._first_element = np.searchsorted(mesh.region, np.arange(len(materials)))
        self._anchors_of_region: dict[int, list[int]] = {}
        for number, anchor in enumerate(anchors):
            self._anchors_of_region.setdefault(anchor.region, []).append(number)
        self._acting = np.eye(len(anchors))  # projection onto the combinations of anchors that act

    def collect_free(self, nodes: Integer) -> sparse.csr_matrix:
        """The free terms (2 k, 4 n) in the equations of nodes (k,)."""
        return collect_free_terms(self._mesh, nodes, self._scale(nodes))

    def _scale(self, nodes: Integer) -> Real:
        return scale_equations(self._mesh, self._materials, self._length, nodes)

    def form(
        self, elements: Integer, around: Integer, rows: Integer, left: Integer, near: NearMap,
        less: Elimination | None,
    ) -> Real:
        """Turned rows of the tangent operator, and its columns that are left, of the nodes of elements, dense.

        rows, left: places in around (k,), the unknowns of elements, rising; near, less: of their nodes, and of others.
        """
        columns = around[left]
        if not len(columns):  # where all pairs stick nothing is left
            return np.zeros((len(rows), 0))
        column, row, value = take_entries(near.columns, near.find(columns))
        node = around[rows] // 2
        assert (np.diff(rows) > 0).all() and (np.diff(left) > 0).all()
        nodes, result = np.unique(node), np.empty((len(rows), len(left)))
        # The rows of a rigid body are made all at once.
        rigid = any(self._materials[region].rigid is not None for region in np.unique(self._mesh.region[elements]))
        step = max(1, len(nodes)) if rigid else NODES_AT_ONCE
        for begin in range(0, len(nodes), step):
            some = nodes[begin : begin + step]
            formed = self._form_nodes(elements, some, columns, (row, column, value), near)
            if less is not None:
                formed = (less.turn[near.find_nodes(some)] @ formed.reshape(len(some), 2, -1)).reshape(formed.shape)
            own = slice(*np.searchsorted(node, [some[0], some[-1] + 1]))
            result[own] = formed[np.searchsorted(number_components(some), around[rows[own]])]
        return result

    def _form_nodes(
        self, elements: Integer, nodes: Integer, columns: Integer, entries: tuple[Integer, Integer, Real],
        near: NearMap,
    ) -> Real:
        """Rows of the tangent operator of some nodes (k,), rising, on some of its columns: (2 k, columns).

        entries: of the constraint map in these columns, see `_add_products`.
        """
        mesh = self._mesh
        formed = np.zeros((2 * len(nodes), len(columns)))
        row, column, value = take_entries(near.free, near.find(number_components(nodes)))
        place, known = find_places(columns, column)
        formed[row[known], place[known]] = value[known]
        # The unknowns also move nodes beyond, where the other side of a pair is in none of these groups.
        sources = np.unique(entries[0] // 2 % mesh.nodes // self._per_element)
        for region in np.unique(mesh.region[elements]):
            own = np.flatnonzero(mesh.region[nodes // self._per_element] == region)
            seen = sources[mesh.region[sources] == region]
            if len(own) and len(seen):
                self._add_products(formed, int(region), seen, nodes, own, entries)
        return formed

    def _add_products(
        self, formed: Real, region: int, seen: Integer, nodes: Integer, own: Integer,
        constraints: tuple[Integer, Integer, Real],
    ) -> None:
        """Add to the rows of nodes[own] of a region what elements seen do, as the constraint map's entries combine it.

        formed (2 nodes, columns); constraints: entry of v, column, and value of each entry. Some rows at a time: all
        entries of B of a large group would take several times what is formed of them.
        """
        row, column, value = constraints
        step = max(1, CHUNK_BYTES // (8 * 2 * 4 * (self._mesh.order + 1) * len(seen)))
        if self._materials[region].rigid is not None:
            step = len(own)
        chosen = None
        for begin in range(0, len(own), step):
            part = own[begin : begin + step]
            values, places = self.evaluate(region, seen, nodes[part])
            if chosen is None:
                place, known = find_places(places, row)
                entries = (value[known], (column[known], place[known]))
                chosen = sparse.csr_matrix(entries, shape=(formed.shape[1], len(places)))
            formed[number_components(part)] += (chosen @ values.T).T

    def evaluate(self, region: int, elements: Integer, nodes: Integer) -> tuple[Real, Integer]:
        """Rows of B of nodes, less the free terms, on the entries of v of elements of the same region; and these."""
        values, columns = self.evaluate_unheld(region, elements, nodes)
        return self.hold(values, nodes, list_nodes(self._mesh, elements), region), columns

    def evaluate_unheld(self, region: int, elements: Integer, nodes: Integer) -> tuple[Real, Integer]:
        """The same without what the region's anchors add."""
        mesh = self._mesh
        sources: Sources = self._sources[region].select(elements - self._first_element[region])
        bounded = bool((sources.family == 0).any())
        place, there = find_places(elements, nodes // self._per_element)
        on = np.where(there, place, -1)
        seen = list_nodes(mesh, elements)
        columns = number_components(seen)
        if bounded:
            columns = np.concatenate([columns, 2 * mesh.nodes + columns])
        material = self._materials[region]
        if material.rigid is not None:
            whole = form_rigid_rows(mesh, region, material)
            first, count = self._first_element[region] * (mesh.order + 1), whole.shape[1] // 2
            at = np.concatenate([number_components(seen - first), count + number_components(seen - first)])
            return whole[np.ix_(number_components(nodes - first), at)], columns
        local = mesh.take_local(nodes)
        values = np.empty((2 * len(nodes), len(columns)))
        for traction in (False, True):
            at = np.flatnonzero(mesh.traction_equation[nodes] == traction)
            if len(at):
                own = nodes[at]
                normal = mesh.normal[own] if traction else None
                parts = evaluate_rows(sources, mesh.position[own], on[at], normal, bounded, local[at])
                values[number_components(at)] = np.concatenate([part for part in parts if part is not None], axis=1)
        values *= -np.repeat(self._scale(nodes), 2)[:, None]
        for motions in self._rigid:
            place, there = find_places(columns, motions.columns)
            if motions.region == region and there.all():
                rotation = np.zeros(4 * mesh.nodes)
                rotation[motions.columns] = motions.basis[-1]
                left = (self.collect_free(nodes) @ rotation) + values @ rotation[columns]
                values[:, place] -= np.outer(left, motions.basis[-1])
        return values, columns

    def hold(self, values: Real, nodes: Integer, seen: Integer, region: int) -> Real:
        """Rows of nodes on the displacements of others, with what the region's anchors add; values stays as it is."""
        own = self._anchors_of_region.get(region, [])
        acting = [(one, other) for one in own for other in own if abs(self._acting[one, other]) > NOTHING]
        result = values.copy() if acting else values
        for one, other in acting:
            self._anchor(result, nodes, seen, one, other)
        return result

    def find_anchored(self, constraints: ConstraintMap, nodes: Integer) -> Bool:
        """Unknowns (2 k,) of nodes (k,) of the regions on which other anchors act than before."""
        released = constraints.released
        acting = np.eye(len(self._anchors))
        if released is not None:
            acting -= released @ released.T
        moved = np.flatnonzero(np.abs(acting - self._acting).max(axis=1, initial=0.0) > 0)
        self._acting = acting
        regions = [self._anchors[number].region for number in moved]
        return np.repeat(np.isin(self._mesh.region[nodes // self._per_element], regions), 2)

    def _anchor(self, values: Real, nodes: Integer, seen: Integer, one: int, other: int) -> None:
        """Add the pattern of one anchor in the equations of nodes, by the functional of another of the same region."""
        at, pattern = _look_up(self._anchors[one].nodes, self._anchors[one].pattern, nodes)
        on, functional = _look_up(self._anchors[other].nodes, self._anchors[other].functional, seen)
        where = np.ix_(number_components(at), number_components(on))
        values[where] += self._acting[one, other] * np.outer(split_components(pattern), split_components(functional))


def _look_up(
    known: Integer, value: Complex, nodes: Integer
) -> tuple[Integer, Complex]:
    """Places in nodes (k,) of those that are known (sorted), and their values."""
    place, there = find_places(known, nodes)
    at = np.flatnonzero(there)
    return at, value[place[at]]


def take_entries(matrix: sparse.csr_matrix | sparse.csc_matrix, chosen: Integer) -> tuple[Integer, Integer, Real]:
    """Entries of chosen rows of a matrix by rows, or columns of one by columns: place in chosen, other index, value.

    Slices of scipy's take time in proportion to the whole matrix.
    """
    first = matrix.indptr[chosen].astype(np.int64)
    count = matrix.indptr[chosen + 1] - first
    at = np.arange(count.sum()) + np.repeat(first - (np.cumsum(count) - count), count)
    return np.repeat(np.arange(len(chosen)), count), matrix.indices[at].astype(np.int64), matrix.data[at]


def find_places(known: Integer, numbers: Integer) -> tuple[Integer, Bool]:
    """Where numbers are in a sorted list, and whether they are."""
    place = np.minimum(np.searchsorted(known, numbers), len(known) - 1)
    return place, known[place] == numbers
