"""The tangent operator between elements that are near to each other, formed exactly, as preconditioners need it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from pbem.arrays import Bool, Complex, Integer, Real
from pbem.bem.combinations import Combination, make_combination
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


@dataclass(frozen=True)
class Wanted:
    """Rows and columns of the tangent operator of some elements (e,), rising, without the others.

    places (k,): of the unknowns of these elements, rising, among those of a near map; rows, left: places in these,
    rising, of the rows and the columns that are wanted.
    """

    elements: Integer
    places: Integer
    rows: Integer
    left: Integer


@dataclass(frozen=True)
class _Part:
    """Elements of a region that are seen, rising, and what the constraint map makes of the entries of v there."""

    region: int
    seen: Integer
    combination: Combination


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
        return collect_free_terms(self._mesh, nodes, self.scale(nodes))

    def scale(self, nodes: Integer) -> Real:
        """The factors (k,) of the equations of nodes (k,)."""
        return scale_equations(self._mesh, self._materials, self._length, nodes)

    def is_plain(self, region: int) -> bool:
        """Whether the rows of a region are those of the kernels, with nothing else: no anchors, nor a rigid body."""
        held = region in self._anchors_of_region or any(motions.region == region for motions in self._rigid)
        return self._materials[region].rigid is None and not held

    def select(self, region: int, elements: Integer) -> Sources:
        """Elements of a region, as the kernels see them."""
        return self._sources[region].select(elements - self._first_element[region])

    def form(self, wanted: Wanted, near: NearMap, less: Elimination | None) -> Real:
        """Turned rows of the tangent operator, and its columns that are left, of the nodes of elements, dense.

        near, less: of their nodes, and of others.
        """
        elements, places, rows, left = wanted.elements, wanted.places, wanted.rows, wanted.left
        if not len(left):  # where all pairs stick nothing is left
            return np.zeros((len(rows), 0))
        assert (np.diff(rows) > 0).all() and (np.diff(left) > 0).all()
        around = number_components(list_nodes(self._mesh, elements))
        columns, node = around[left], rows // 2
        nodes, result = np.unique(node), np.empty((len(rows), len(left)))
        parts = self._list_parts(elements, places[left], near)
        # The rows of a rigid body are made all at once.
        rigid = any(self._materials[part.region].rigid is not None for part in parts)
        step = max(1, len(nodes)) if rigid else NODES_AT_ONCE
        for begin in range(0, len(nodes), step):
            some = nodes[begin : begin + step]
            formed = self._form_nodes(around[2 * some] // 2, places[2 * some] // 2, columns, parts, near)
            if less is not None:
                formed = turn_rows(less, places[2 * some] // 2, formed)
            own = slice(*np.searchsorted(node, [some[0], some[-1] + 1]))
            if own.stop - own.start < len(formed):
                formed = formed[np.searchsorted(number_components(some), rows[own])]
            result[own] = formed
        return result

    def _list_parts(self, elements: Integer, columns: Integer, near: NearMap) -> list[_Part]:
        """What unknowns of elements move, at places `columns` (k,) of the near map, region by region of the elements.

        They also move nodes beyond, where the other side of a pair is in none of these groups.
        """
        column, row, value = take_entries(near.columns, columns)
        sources = np.unique(row // 2 % self._mesh.nodes // self._per_element)
        parts = []
        for region in np.unique(self._mesh.region[elements]):
            seen = sources[self._mesh.region[sources] == region]
            if len(seen):
                place, known = find_places(self._list_entries(int(region), seen), row)
                combination = make_combination(len(columns), column[known], place[known], value[known])
                parts.append(_Part(int(region), seen, combination))
        return parts

    def _form_nodes(
        self, nodes: Integer, at: Integer, columns: Integer, parts: Sequence[_Part], near: NearMap
    ) -> Real:
        """Rows of the tangent operator of some nodes (k,), rising, on some of its columns: (2 k, columns).

        at (k,): places of the nodes in the near map.
        """
        formed = np.zeros((2 * len(nodes), len(columns)))
        row, column, value = take_entries(near.free, number_components(at))
        place, known = find_places(columns, column)
        formed[row[known], place[known]] = value[known]
        region = self._mesh.region[nodes // self._per_element]
        for part in parts:
            own = np.flatnonzero(region == part.region)
            if len(own):
                self._add_products(formed, part, nodes, own)
        return formed

    def _add_products(self, formed: Real, part: _Part, nodes: Integer, own: Integer) -> None:
        """Add to the rows of nodes[own] of a region what its elements do, as the constraint map combines it.

        formed (2 nodes, columns). Some rows at a time: all entries of B of a large group would take several times what
        is formed of them.
        """
        step = max(1, CHUNK_BYTES // (8 * 2 * 4 * (self._mesh.order + 1) * len(part.seen)))
        if self._materials[part.region].rigid is not None:
            step = len(own)
        for begin in range(0, len(own), step):
            some = own[begin : begin + step]
            values, _ = self.evaluate(part.region, part.seen, nodes[some])
            part.combination.add(values, number_components(some), formed)

    def evaluate(self, region: int, elements: Integer, nodes: Integer) -> tuple[Real, Integer]:
        """Rows of B of nodes, less the free terms, on the entries of v of elements of the same region; and these."""
        values, columns = self.evaluate_unheld(region, elements, nodes)
        return self.hold(values, nodes, list_nodes(self._mesh, elements), region), columns

    def evaluate_unheld(self, region: int, elements: Integer, nodes: Integer) -> tuple[Real, Integer]:
        """The same without what the region's anchors add."""
        mesh = self._mesh
        columns, material = self._list_entries(region, elements), self._materials[region]
        if material.rigid is not None:
            whole, seen = form_rigid_rows(mesh, region, material), list_nodes(mesh, elements)
            first, count = self._first_element[region] * (mesh.order + 1), whole.shape[1] // 2
            at = np.concatenate([number_components(seen - first), count + number_components(seen - first)])
            return whole[np.ix_(number_components(nodes - first), at)], columns
        values = self._evaluate_rows(region, elements, nodes)
        values *= -np.repeat(self.scale(nodes), 2)[:, None]
        for motions in self._rigid:
            place, there = find_places(columns, motions.columns)
            if motions.region == region and there.all():
                rotation = np.zeros(4 * mesh.nodes)
                rotation[motions.columns] = motions.basis[-1]
                left = (self.collect_free(nodes) @ rotation) + values @ rotation[columns]
                values[:, place] -= np.outer(left, motions.basis[-1])
        return values, columns

    def _list_entries(self, region: int, elements: Integer) -> Integer:
        """The entries of v that elements of a region act by, in the order of `evaluate`."""
        columns = number_components(list_nodes(self._mesh, elements))
        bounded = (self._sources[region].family[elements - self._first_element[region]] == 0).any()
        return np.concatenate([columns, 2 * self._mesh.nodes + columns]) if bounded else columns

    def _evaluate_rows(self, region: int, elements: Integer, nodes: Integer) -> Real:
        """The kernels' rows of nodes, each with its own kind of equation, as `evaluate_unheld` scales them."""
        mesh = self._mesh
        sources = self.select(region, elements)
        bounded = bool((sources.family == 0).any())
        place, there = find_places(elements, nodes // self._per_element)
        on, local, is_traction = np.where(there, place, -1), mesh.take_local(nodes), mesh.traction_equation[nodes]
        found: list[tuple[Integer, Real]] = []
        for traction in (False, True):
            at = np.flatnonzero(is_traction == traction)
            if len(at):
                own = nodes[at]
                normal = mesh.normal[own] if traction else None
                first, second = evaluate_rows(sources, mesh.position[own], on[at], normal, bounded, local[at])
                found.append((at, first if second is None else np.concatenate([first, second], axis=1)))
        if len(found) == 1:
            return found[0][1]
        values = np.empty((2 * len(nodes), found[0][1].shape[1]))
        for at, part in found:
            values[number_components(at)] = part
        return values

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


def turn_rows(less: Elimination, nodes: Integer, rows: Real) -> Real:
    """Equations (2 k, n) of nodes, at places (k,) of a near map, turned."""
    return (less.turn[nodes] @ rows.reshape(len(nodes), 2, -1)).reshape(rows.shape)


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
