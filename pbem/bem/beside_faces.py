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

from pbem.arrays import Bool, Complex, Integer, Real
from pbem.bem.interior import Values, evaluate_field
from pbem.bem.location import Location
from pbem.bem.operator import collect_sources
from pbem.bem.rigid_motions import RigidMotions, take_off_rigid_motions
from pbem.bem.rows import Sources
from pbem.mesh.mesh import Mesh
from pbem.mesh.numbering import split_components
from pbem.mesh.resampling import Resampling, resample
from pbem.model.material import Material

# Points no further from the middle of an element than so many times its length are beside it.
REACH = 1.5
# Points whose elements are evaluated together, and the most that is kept for the next step, in bytes.
GROUP = 32
KEPT_BYTES = 100_000_000


@dataclass(frozen=True)
class _Rows:
    """Pairs (m,) of points and elements of one mesh: what each point has of each element.

    element (m,): its number; point (m,): that of the point among those of the group, rising; bounding (m,): elements
    that are not of cracks; values (5, 2, m, 2 (p + 1)): ux, uy, sxx, syy, sxy from displacements, then tractions.
    """

    element: Integer
    point: Integer
    bounding: Bool
    values: Real

    def apply(self, moved: _Moved, traction: Complex, apart: Complex) -> Real:
        """ux, uy, sxx, syy, sxy (5, k), of displacements of boundaries relative to `apart` (k,): that of a place
        nearby, as the rounding of entries that are large beside short elements must not count for all of it."""
        each = self.values.shape[-1] // 2
        nodes = self.element[:, None] * each + np.arange(each)
        base = np.where(self.bounding, moved.base[self.element] - apart[self.point], 0.0)
        given = np.stack([moved.beyond[nodes] + base[:, None], traction[nodes]]).view(float)
        return np.asarray(np.add.reduceat(
            np.einsum("qpms,pms->qm", self.values, given), np.flatnonzero(np.diff(self.point, prepend=-1)), axis=1))


@dataclass(frozen=True)
class _Moved:
    """Displacements of elements: base (e,) of one, and how much further (nodes,) its nodes are; on cracks jumps."""

    base: Complex
    beyond: Complex


@dataclass(frozen=True)
class _Group:
    """point (k,): those of a group, all of one region; node (k,): one on a boundary beside each, or -1 if none is;
    own, joined: their rows on the elements of the run and on those of continuous densities."""

    point: Integer
    node: Integer
    own: _Rows
    joined: _Rows


@dataclass(frozen=True)
class BesideFaces:
    """What densities that are continuous change at points (q,) beside faces, those of a run being its own.

    rigid: see pbem.bem.interior.InteriorRows. A point's values depend on no other point. Rows are kept from step to
    step as far as they fit into the memory allowed.
    """

    mesh: Mesh
    materials: Sequence[Material]
    points: Complex
    location: Location
    rigid: Sequence[RigidMotions]

    def evaluate(self, displacement: Complex, traction: Complex) -> Values:
        """To be added to what the representation makes of the displacement and traction (nodes,) of the elastic field,
        jumps on cracks: zero at points that are not beside faces, on them, or outside."""
        moved, stress = np.zeros(len(self.points), dtype=complex), np.zeros((len(self.points), 3))
        if not len(self._pairs[0]):
            return Values(moved, stress)
        traction = np.where(self.mesh.node_crack, 0.0, traction)  # on a crack those of both faces cancel
        strained = take_off_rigid_motions(split_components(displacement), self.rigid).view(complex)
        joined = self._resampling
        carried = joined.traction @ traction
        own = np.zeros(self.mesh.elements, dtype=complex)
        both = [(_Moved(own, each), self._join(each)) for each in (displacement, strained)]
        for number, kept in enumerate(self._kept):
            group = kept or self._evaluate_group(number)
            of_all, of_strains = (
                group.joined.apply(after, carried, apart) - group.own.apply(before, traction, apart)
                for before, after in both
                for apart in [np.where(group.node >= 0, before.beyond[group.node], 0.0)]
            )
            moved[group.point] = of_all[0] + 1j * of_all[1]
            stress[group.point] = of_strains[2:].T
        return Values(moved, stress)

    def _join(self, displacement: Complex) -> _Moved:
        """Continuous displacements, of each element relative to its own: what is the same for all nodes is not rounded.
        """
        mesh, matrix = self.mesh, self._resampling.displacement
        parent = np.repeat(self._beside, self._resampling.parts)
        base = np.where(mesh.crack[parent], 0.0, displacement[parent * (mesh.order + 1)])
        of = np.repeat(base, self._resampling.mesh.order + 1).repeat(np.diff(matrix.indptr))
        terms = matrix.data * (displacement[matrix.indices] - np.where(mesh.node_crack[matrix.indices], 0.0, of))
        beyond = sparse.csr_matrix((terms, matrix.indices, matrix.indptr), shape=matrix.shape).sum(axis=1)
        return _Moved(base, np.asarray(beyond).ravel())

    @cached_property
    def _pairs(self) -> tuple[Integer, Integer]:
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

    @cached_property
    def _beside(self) -> Integer:
        """The elements that any point is beside."""
        return np.unique(self._pairs[1])

    @cached_property
    def _resampling(self) -> Resampling:
        return resample(self.mesh, self._beside)

    @cached_property
    def _sources(self) -> tuple[list[Sources], list[Sources]]:
        """Of every region all elements of the run, and the continuous ones of those that any point is beside."""
        own, fine = collect_sources(self.mesh, self.materials), self._resampling.mesh
        bounds = np.searchsorted(fine.region, np.arange(len(own) + 1))
        family = fine.family
        # The unit of the logarithm is that of the run.
        return own, [
            replace(
                each, start=fine.start[low:high], end=fine.end[low:high], center=fine.center[low:high],
                sweep=fine.sweep[low:high], family=family[low:high], local=fine.local, crack_local=fine.crack_local,
            )
            for each, (low, high) in zip(own, itertools.pairwise(bounds.tolist()), strict=True)
        ]

    @cached_property
    def _groups(self) -> list[tuple[Integer, Integer]]:
        """Points (k,), and places of their pairs, by the points: near each other they are beside the same elements."""
        point, element = self._pairs
        at, first = np.unique(point, return_index=True)
        order = np.argsort(element[first], kind="stable")
        ends = np.append(first, len(point))
        return [
            (at[chosen], np.concatenate([np.arange(ends[each], ends[each + 1]) for each in chosen]))
            for begin, end in _list_groups(self.mesh.region[element[first[order]]])
            for chosen in [order[begin:end]]
        ]

    @cached_property
    def _kept(self) -> list[_Group | None]:
        """The groups whose rows are kept for the next step, as far as these fit; None in place of the others."""
        size = 5 * 2 * 2 * np.dtype(float).itemsize  # of what a point has of a node, see _Rows
        kept: list[_Group | None] = []
        taken = 0
        for number, (_, places) in enumerate(self._groups):
            parts = self._resampling.parts[np.searchsorted(self._beside, self._pairs[1][places])]
            taken += size * int((self.mesh.order + 1 + parts * (self._resampling.mesh.order + 1)).sum())
            kept.append(self._evaluate_group(number) if taken <= KEPT_BYTES else None)
        return kept

    def _evaluate_group(self, number: int) -> _Group:
        """The points of a group, with their rows on the elements that each is beside."""
        mesh, joined = self.mesh, self._resampling
        chosen, places = self._groups[number]
        point, element = (each[places] for each in self._pairs)
        row = np.repeat(np.arange(len(chosen)), np.diff(np.append(np.flatnonzero(np.diff(point, prepend=-1)),
                                                                  len(point))))
        of_joined = np.searchsorted(self._beside, element)
        parts = joined.parts[of_joined]
        pieces = np.repeat((np.cumsum(joined.parts) - joined.parts)[of_joined], parts)
        pieces += np.arange(len(pieces)) - np.repeat(np.cumsum(parts) - parts, parts)
        node = np.full(len(chosen), -1)
        bounding = np.flatnonzero(~mesh.crack[element])[::-1]
        node[row[bounding]] = element[bounding] * (mesh.order + 1)
        own, fine = self._sources
        return _Group(
            chosen, node, _evaluate_rows(mesh, own, self.points[chosen], row, element),
            _evaluate_rows(joined.mesh, fine, self.points[chosen], np.repeat(row, parts), pieces))


def _evaluate_rows(
    mesh: Mesh, sources: Sequence[Sources], points: Complex, point: Integer, element: Integer
) -> _Rows:
    """Of pairs of a point (k,) and an element of one region."""
    region, size = int(mesh.region[element[0]]), 2 * (mesh.order + 1)
    elements, column = np.unique(element, return_inverse=True)
    first = int(np.searchsorted(mesh.region, region))
    matrix = evaluate_field(sources[region].select(elements - first), points)
    values = matrix.reshape(5, len(points), 2, len(elements), size)[:, point, :, column.ravel()]
    return _Rows(element, point, ~mesh.crack[element], np.ascontiguousarray(values.transpose(1, 2, 0, 3)))


def _list_groups(region: Integer) -> list[tuple[int, int]]:
    """Begin and end of groups of points, each of one region (k,)."""
    bounds = [0, *(np.flatnonzero(np.diff(region)) + 1).tolist(), len(region)]
    return [
        (begin, min(begin + GROUP, end)) for low, end in itertools.pairwise(bounds) for begin in range(low, end, GROUP)
    ]
