"""Displacement and stress at many points by the cluster trees: nothing is stored, near elements are evaluated anew."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pbem.arrays import Complex, Integer, Real
from pbem.bem.expansion import FieldPoints
from pbem.bem.farfield import SourceTree, TargetTree, see_sources
from pbem.bem.hierarchical import (
    HierarchicalOperator,
    Sorted,
    list_columns,
    log_lengths,
    name_media,
    prepare_sources,
    sort_elements,
)
from pbem.bem.interior import Values
from pbem.bem.location import Location
from pbem.bem.rigid_motions import take_off_rigid_motions
from pbem.bem.rows import evaluate_rows
from pbem.bem.seen_entries import take_elements
from pbem.bem.sharing import keep_whole
from pbem.bem.tree import RATIO, Forest, Interactions, build_forest, find_interactions
from pbem.mesh.mesh import Mesh
from pbem.mesh.numbering import list_nodes, split_components
from pbem.model.material import Material

# Points in a leaf at most.
LEAF_POINTS = 32


@dataclass(frozen=True)
class PointRows:
    """Points (k,) in cluster trees of their own, and the clusters of elements that these see.

    region (k,): of each point. on (k,): the element (of the mesh) that a point lies on, or -1; local (k,): its
    coordinate there.
    """

    parts: Sorted
    sources: SourceTree
    forest: Forest
    targets: TargetTree
    met: Interactions
    point: Complex
    on: Integer
    local: Real

    def displacement(self, v: Real) -> Complex:
        """-int T u + int U t at the points (k,), on an element the mean of both sides; all ranks call this together."""
        return self._evaluate(v, (None,))[:, 0]

    def stress(self, v: Real) -> Real:
        """sxx, syy, sxy (k, 3) at points off all elements; all ranks call this together (theory, 3)."""
        along = self._evaluate(v, (1.0, 1j))
        return np.stack([along[:, 0].real, along[:, 1].imag, 0.5 * (along[:, 0].imag + along[:, 1].real)], axis=1)

    def sample(self, v: Real, strained: Real) -> tuple[Complex, Real]:
        """Displacement (k, c) and stress (k, c, 3) at points off all elements, for many densities (4 nodes, c) at once.

        strained: the same without what makes no stress. Near elements are evaluated once for all of them.
        """
        far = [self._carry(each) for each in v.T]
        far_strained = far if strained is v else [self._carry(each) for each in strained.T]
        shape = (len(self.point), v.shape[1])
        values = np.zeros((3, *shape), dtype=complex)
        for k, normal in enumerate((None, 1.0, 1j)):
            fields = far if normal is None else far_strained
            values[k] = np.stack([self._evaluate_far(each, normal) for each in fields], axis=1)
        forest = self.forest
        leaves = forest.leaves
        begin, end = (np.searchsorted(self.met.near_target, leaves, side=side) for side in ("left", "right"))
        for leaf, low, high in zip(leaves, begin, end, strict=True):
            chosen = forest.items(leaf)
            near = self.met.near_source[low:high]
            for k, normal in enumerate((None, 1.0, 1j)):
                value = self._add_near(int(leaf), chosen, near, normal, v if normal is None else strained)
                values[k, chosen] += value[0::2] + 1j * value[1::2]
        moved, along_x, along_y = values
        return moved, np.stack([along_x.real, along_y.imag, 0.5 * (along_x.imag + along_y.real)], axis=-1)

    def _carry(self, v: Real) -> Complex:
        """Coefficients of the far field in all clusters of points (k, 2, p + 1)."""
        sources = self.sources
        moments = sources.collect(take_elements(v, sources.elements, sources.width))
        return self.targets.spread(moments, self.targets.start(moments))

    def _evaluate_far(self, fields: Complex, normal: complex | None) -> Complex:
        """The far field at all points: displacement, or traction on the normal."""
        forest = self.forest
        leaves = forest.leaves
        kappa, modulus = name_media(self.parts, forest.region[leaves])
        at = FieldPoints(
            leaves, np.append(forest.first[leaves], len(self.point)), self.point[forest.order],
            np.full(len(self.point), normal or 0.0, dtype=complex), kappa, modulus,
        )  # fmt: skip
        result = np.empty(len(self.point), dtype=complex)
        result[forest.order] = at.evaluate(fields, forest)
        return result

    def _evaluate(self, v: Real, normals: tuple[complex | None, ...]) -> Complex:
        far = self._carry(v)
        forest = self.forest
        leaves = forest.leaves
        begin, end = (np.searchsorted(self.met.near_target, leaves, side=side) for side in ("left", "right"))
        result = np.stack([self._evaluate_far(far, normal) for normal in normals], axis=1)
        for leaf, low, high in zip(leaves, begin, end, strict=True):
            chosen = forest.items(leaf)
            near = self.met.near_source[low:high]
            for k, normal in enumerate(normals):
                value = self._add_near(int(leaf), chosen, near, normal, v)
                result[chosen, k] += value[0::2] + 1j * value[1::2]
        return result

    def _add_near(self, leaf: int, chosen: Integer, near: Integer, normal: complex | None, v: Real) -> Real:
        parts = self.parts
        if len(near) == 0:
            return np.zeros((2 * len(chosen), *v.shape[1:]))
        elements = np.sort(np.concatenate([parts.forest.items(source) for source in near]))
        region = int(self.forest.region[leaf])
        sources = parts.sources[region].select(elements - parts.first_element[region])
        bounded = bool((sources.family == 0).any())
        on = np.where(self.on[chosen] >= 0, np.searchsorted(elements, self.on[chosen]), -1)
        normals = None if normal is None else np.full(len(chosen), normal, dtype=complex)
        values = evaluate_rows(sources, self.point[chosen], on, normals, bounded, self.local[chosen])
        whole = [value for value in values if value is not None]
        columns = list_columns(parts.mesh, list_nodes(parts.mesh, elements), sum(value.shape[1] for value in whole))
        width = whole[0].shape[1]
        total: Real = whole[0] @ v[columns[:width]]
        return total if len(whole) == 1 else total + whole[1] @ v[columns[width:]]


def place_points(
    parts: Sorted, sources: SourceTree, point: Complex, region: Integer, on: Integer, local: Real
) -> PointRows:
    """Sort points (k,) of regions into trees; on, local: see PointRows. All ranks call this together."""
    forest = build_forest(point, point, np.zeros(len(point)), region, np.full(len(parts.materials), LEAF_POINTS))
    # A leaf of one point has no radius to measure its powers in.
    least = 1e-9 * np.abs(parts.mesh.end - parts.mesh.start).max()
    forest = forest.widen(least)
    met = find_interactions(forest, parts.forest, RATIO)
    targets = see_sources(sources, forest, np.ones(forest.clusters, dtype=bool), log_lengths(parts, forest), met)
    return PointRows(parts, sources, forest, targets, met, point, on, local)


def spread_points(
    mesh: Mesh, materials: Sequence[Material], terms: int, point: Complex, region: Integer
) -> PointRows:
    """Trees of points (k,) in regions, off all elements, and of all elements; by one process, without operator."""
    parts = sort_elements(mesh, materials, terms)
    everything = np.ones(4 * mesh.nodes, dtype=bool)
    sources = prepare_sources(parts, everything, keep_whole(mesh.elements))
    return place_points(parts, sources, point, region, np.full(len(point), -1), np.zeros(len(point)))


class TreeRows:
    """The elastic field at points inside regions, like pbem.bem.interior.InteriorRows, by cluster trees."""

    def __init__(self, operator: HierarchicalOperator, points: Complex, location: Location) -> None:
        self._mesh = operator.parts.mesh
        self._outside = location.region < 0
        self._inside = np.flatnonzero((location.region >= 0) & (location.element < 0))
        self._rigid = operator.rigid
        nowhere = np.full(len(self._inside), -1)
        self._rows = place_points(
            operator.parts, operator.sources, points[self._inside], location.region[self._inside], nowhere,
            np.zeros(len(nowhere)),
        )  # fmt: skip

    def evaluate(self, displacement: Complex, traction: Complex) -> Values:
        """What the elastic field has inside; its displacement and traction (nodes,) on the boundary, jumps on cracks.

        Zero at points on the boundary, NaN outside. All ranks call this together.
        """
        traction = np.where(self._mesh.node_crack, 0.0, traction)  # on a crack those of both faces cancel
        v = split_components(np.concatenate([displacement, traction]))
        moved = np.where(self._outside, np.nan, 0.0) + 0j
        stress = np.where(self._outside, np.nan, 0.0)[:, None] * np.ones(3)
        moved[self._inside] = self._rows.displacement(v)
        # The stress of what a body moves without strain would be the error of its expansions.
        stress[self._inside] = self._rows.stress(take_off_rigid_motions(v, self._rigid))
        return Values(moved, stress)
