"""The field at points beside faces from densities that are continuous from element to element, as after a run.

A run has a polynomial of its own on each element. What two of them differ by at their common end is a dislocation
there, whose stress close to it is that difference over the distance (see pbem.mesh.resampling).
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

from pbem.arrays import Complex, Integer, Real
from pbem.bem.interior import Values, evaluate_field
from pbem.bem.location import Location
from pbem.bem.operator import collect_sources
from pbem.bem.rigid_motions import RigidMotions, take_off_rigid_motions
from pbem.bem.rows import Sources
from pbem.mesh.mesh import Mesh
from pbem.mesh.numbering import list_nodes, number_components, split_components
from pbem.mesh.resampling import resample
from pbem.model.material import Material

# Points no further from the middle of an element than so many times its length are beside it.
REACH = 1.5
# Points whose elements are evaluated together.
GROUP = 32


@dataclass(frozen=True)
class _Rows:
    """point (k,): those beside faces; matrix (5 k, 4 nodes): ux, uy, sxx, syy, sxy, each of all of them, by values of
    displacement and traction; node (k,): one on a boundary beside each point, if any is; carried (5 k, 2): what the
    matrix makes of unit translations of boundaries: the rounding of entries that are large beside short elements.
    """

    point: Integer
    matrix: sparse.csr_matrix
    node: Integer
    carried: Real

    def apply(self, v: Real) -> Real:
        """ux, uy, sxx, syy, sxy (5, k), of displacements relative to that of the node."""
        values = self.matrix @ v
        for axis in (0, 1):
            values -= self.carried[:, axis] * np.tile(v[2 * self.node + axis], 5)
        return np.asarray(values.reshape(5, -1))


@dataclass(frozen=True)
class BesideFaces:
    """What densities that are continuous change at points (q,) beside faces, those of a run being its own.

    rigid: see pbem.bem.interior.InteriorRows. A point's values depend on no other point.
    """

    mesh: Mesh
    materials: Sequence[Material]
    points: Complex
    location: Location
    rigid: Sequence[RigidMotions]

    def evaluate(self, displacement: Complex, traction: Complex) -> Values:
        """To be added to what the representation makes of the displacement and traction (nodes,) of the elastic field,
        jumps on cracks: zero at points that are not beside faces, on them, or outside."""
        traction = np.where(self.mesh.node_crack, 0.0, traction)  # on a crack those of both faces cancel
        v = split_components(np.concatenate([displacement, traction]))
        moved, stress = np.zeros(len(self.points), dtype=complex), np.zeros((len(self.points), 3))
        rows = self._rows
        if rows is not None:
            values = rows.apply(v)
            moved[rows.point] = values[0] + 1j * values[1]
            stress[rows.point] = rows.apply(take_off_rigid_motions(v, self.rigid))[2:].T
        return Values(moved, stress)

    @cached_property
    def _rows(self) -> _Rows | None:
        mesh = self.mesh
        point, element = self._find_pairs()
        at, number = np.unique(point, return_inverse=True)
        if not len(at):
            return None
        joined = resample(mesh)
        own, fine = (collect_sources(each, self.materials) for each in (mesh, joined.mesh))
        # The unit of the logarithm is that of the run.
        fine = [replace(each, length=other.length) for each, other in zip(fine, own, strict=True)]
        parts = joined.parts[element]
        pieces = np.repeat((np.cumsum(joined.parts) - joined.parts)[element], parts)
        pieces += np.arange(len(pieces)) - np.repeat(np.cumsum(parts) - parts, parts)
        number, points = number.ravel(), self.points[at]
        after = _add_pairs(joined.mesh, fine, points, np.repeat(number, parts), pieces)
        along = sparse.block_diag([sparse.kron(each, sparse.eye(2)) for each in (joined.displacement, joined.traction)])
        matrix = sparse.csr_matrix(after @ along - _add_pairs(mesh, own, points, number, element))
        bounding = np.flatnonzero(~mesh.crack[element])
        node = np.zeros(len(at), dtype=np.int64)
        node[number[bounding[::-1]]] = element[bounding[::-1]] * (mesh.order + 1)
        translations = np.zeros((4 * mesh.nodes, 2))
        for axis in (0, 1):
            translations[axis:2 * mesh.nodes:2, axis] = ~mesh.node_crack
        return _Rows(at, matrix, node, matrix @ translations)

    def _find_pairs(self) -> tuple[Integer, Integer]:
        """Points and the elements of their regions that they are beside, by the points."""
        mesh = self.mesh
        inside = np.flatnonzero((self.location.region >= 0) & (self.location.element < 0))
        none = np.zeros(0, dtype=np.int64)
        if not len(inside):
            return none, none
        tree = cKDTree(np.column_stack([self.points.real, self.points.imag])[inside])
        middle = mesh.geometry.place_fractions(np.full((mesh.elements, 1), 0.5))[:, 0]
        found = tree.query_ball_point(np.column_stack([middle.real, middle.imag]), REACH * mesh.geometry.lengths)
        element = np.repeat(np.arange(mesh.elements), [len(each) for each in found])
        point = inside[np.concatenate([none, *(np.array(each, dtype=np.int64) for each in found if each)])]
        own = self.location.region[point] == mesh.region[element]
        order = np.lexsort((element[own], point[own]))
        return point[own][order], element[own][order]


def _add_pairs(
    mesh: Mesh, sources: Sequence[Sources], points: Complex, point: Integer, element: Integer
) -> sparse.csr_matrix:
    """ux, uy, sxx, syy, sxy, each of all points (k,), from pairs of a point and an element: (5 k, 4 nodes)."""
    count, size = len(points), 2 * (mesh.order + 1)
    first = np.searchsorted(mesh.region, np.arange(len(sources)))
    nearest = np.zeros(count, dtype=np.int64)
    nearest[point[::-1]] = element[::-1]
    # Points that are near each other, region by region, are beside the same elements.
    order = np.argsort(nearest, kind="stable")
    region = mesh.region[nearest[order]]
    rows, columns, values = [], [], []
    place = np.empty(count, dtype=np.int64)
    place[order] = np.arange(count)
    by_place = np.argsort(place[point], kind="stable")
    ends = np.searchsorted(place[point[by_place]], np.arange(count + 1))
    for begin, end in _list_groups(region):
        chosen = order[begin:end]
        pairs = by_place[ends[begin]:ends[end]]
        elements = np.unique(element[pairs])
        own = int(region[begin])
        matrix = evaluate_field(sources[own].select(elements - first[own]), points[chosen]).reshape(
            5, len(chosen), 2, len(elements), size)
        i, j = place[point[pairs]] - begin, np.searchsorted(elements, element[pairs])
        components = number_components(list_nodes(mesh, element[pairs])).reshape(-1, size)
        for quantity in range(5):
            for part in range(2):
                rows.append(np.repeat(quantity * count + point[pairs], size))
                columns.append((components + part * 2 * mesh.nodes).ravel())
                values.append(matrix[quantity, i, part, j].ravel())
    return sparse.csr_matrix(
        (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=(5 * count, 4 * mesh.nodes))


def _list_groups(region: Integer) -> list[tuple[int, int]]:
    """Begin and end of groups of points, each of one region (k,)."""
    bounds = [0, *(np.flatnonzero(np.diff(region)) + 1).tolist(), len(region)]
    return [
        (begin, min(begin + GROUP, end)) for low, end in itertools.pairwise(bounds) for begin in range(low, end, GROUP)
    ]
