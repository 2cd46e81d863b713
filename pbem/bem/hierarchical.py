"""The operator B in hierarchical form: near elements exactly, far ones by expansions about clusters.

Its storage and the time of a product grow in proportion to the number of unknowns. Rows and signs are those of
pbem.bem.operator; all regions share one forest of cluster trees.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import sparse

from pbem.arrays import Bool, Complex, Integer, Real
from pbem.bem.expansion import FieldPoints, place_densities
from pbem.bem.farfield import SourceTree, TargetTree, mark_ancestors
from pbem.bem.near import LeafRows, pack_rows
from pbem.bem.operator import collect_free_terms, collect_sources, scale_equations
from pbem.bem.rigid_motions import RigidMotions, find_rigid_motions, take_off_rigid_motions
from pbem.bem.rigid_region import form_rigid_rows
from pbem.bem.rows import Sources, evaluate_rows
from pbem.bem.tree import Forest, build_forest, find_interactions
from pbem.mesh.mesh import Mesh
from pbem.mesh.numbering import list_nodes, number_components, split_components
from pbem.model.material import Material

# Elements in a leaf at most: fewer make more work of the expansions, more make more of the near elements.
LEAF_ELEMENTS = 8
# A region of so few elements is one leaf: what is near is all of it.
SMALL_REGION = 48
# By this factor at least the errors of expansions fall from term to term.
RATIO = 0.55


@dataclass(frozen=True)
class FarRows:
    """What rows of nodes (n,) are of the fields in their leaves: numbers of the rows (n, 2), and factors (n,)."""

    points: FieldPoints
    rows: Integer
    factor: Real


@dataclass(frozen=True)
class Anchoring:
    """rows get pattern times functional . v[columns]: see add_anchor of pbem.bem.operator."""

    rows: Integer
    pattern: Real
    columns: Integer
    functional: Real


@dataclass(frozen=True)
class Sorted:
    """The model's elements in cluster trees, and those of each region as the kernels see them."""

    mesh: Mesh
    materials: tuple[Material, ...]
    sources: tuple[Sources, ...]
    forest: Forest
    terms: int

    @cached_property
    def node_element(self) -> Integer:
        """Mesh.node_element, which the mesh makes anew at every call."""
        return self.mesh.node_element

    @cached_property
    def node_local(self) -> Real:
        """Mesh.node_local, likewise."""
        return self.mesh.node_local

    @cached_property
    def first_element(self) -> Integer:
        """Number of each region's first element."""
        return np.searchsorted(self.mesh.region, np.arange(len(self.materials)))


def choose_terms(tolerance: float) -> int:
    """Terms of the expansions for a relative error of products; the margin was measured (theory, 42)."""
    return int(np.ceil(np.log(tolerance) / np.log(RATIO)))


def sort_elements(mesh: Mesh, materials: Sequence[Material], terms: int) -> Sorted:
    """Cluster trees of all regions' elements."""
    counts = np.bincount(mesh.region, minlength=len(materials))
    most = np.where(counts <= SMALL_REGION, SMALL_REGION, LEAF_ELEMENTS)
    # Nothing of a tool is far.
    most = np.where([material.rigid is not None for material in materials], np.maximum(counts, 1), most)
    forest = build_forest(mesh.start, mesh.end, mesh.geometry.bulges, mesh.region, most)
    return Sorted(mesh, tuple(materials), tuple(collect_sources(mesh, materials)), forest, terms)


def log_lengths(parts: Sorted, forest: Forest) -> Real:
    """Unit of the logarithm in the region of each cluster of a forest (clusters,)."""
    return np.array([sources.length for sources in parts.sources])[forest.region]


def prepare_sources(
    parts: Sorted, needed: Bool, leaves: Integer, add_up: Callable[[Real], Real]
) -> SourceTree:
    """The coefficients' matrices of the given leaves, this rank's share."""
    forest, mesh = parts.forest, parts.mesh
    own = [forest.items(leaf) for leaf in leaves]
    elements = np.concatenate([np.zeros(0, dtype=np.int64), *own])
    first = np.cumsum([0, *(len(each) for each in own)])
    kappa, modulus = name_media(parts, forest.region[leaves])
    return SourceTree(
        forest, parts.terms, np.asarray(leaves), place_densities(mesh, elements, parts.terms), first, kappa, modulus,
        None if needed.all() else needed, add_up,
    )  # fmt: skip


def name_media(parts: Sorted, region: Integer) -> tuple[Real, Real]:
    """kappa and shear modulus of regions (k,)."""
    kappa = np.array([material.kappa for material in parts.materials], dtype=float)
    modulus = np.array([material.shear_modulus for material in parts.materials], dtype=float)
    return kappa[region], modulus[region]


def list_columns(mesh: Mesh, nodes: Integer, width: int) -> Integer:
    """Entries of v of the nodes' displacements and, if the matrix is so wide, of their tractions."""
    displacement = number_components(nodes)
    return displacement if width == len(displacement) else np.concatenate([displacement, 2 * mesh.nodes + displacement])


@dataclass(frozen=True)
class HierarchicalOperator:
    """The rows of B of some nodes (k,), in their order; sources and targets are the same trees.

    leaves: emptied where no product is asked for any more, as they are most of the storage.
    """

    parts: Sorted
    nodes: Integer
    sources: SourceTree
    targets: TargetTree
    leaves: list[LeafRows]
    far: FarRows
    free: sparse.csr_matrix
    needed: Bool
    anchorings: tuple[Anchoring, ...] = ()
    rigid: tuple[RigidMotions, ...] = ()

    def keep_needed(self, v: Real) -> Real:
        """v with zeros in the entries that the operator was told to leave out."""
        return np.where(self.needed, v, 0.0)

    @property
    def rows(self) -> int:
        return 2 * len(self.nodes)

    def apply(self, v: Real) -> Real:
        """This rank's rows of B v, lengths, for v of shape (4 nodes,); all ranks call this together."""
        strained = take_off_rigid_motions(v, self.rigid)
        fields = self.targets.spread(self.sources.collect(strained), self.sources.forest)
        result: Real = self.free @ strained
        values = self.far.factor * self.far.points.evaluate(fields, self.targets.forest)
        result[self.far.rows] += np.stack([values.real, values.imag], axis=1)
        for each in self.leaves:
            result[each.rows] += each.apply(strained)
        for anchoring in self.anchorings:
            result[anchoring.rows] += anchoring.pattern * (anchoring.functional @ v[anchoring.columns])
        return result


def anchor_rows(
    operator: HierarchicalOperator, nodes: Integer, pattern: Complex, functional: Complex
) -> HierarchicalOperator:
    """The operator with pattern (functional . u) added to the equations of a region's nodes (k,): see add_anchor."""
    _, row, own = np.intersect1d(operator.nodes, nodes, assume_unique=True, return_indices=True)
    added = Anchoring(
        rows=number_components(row),
        pattern=split_components(pattern[own]),
        columns=number_components(nodes),
        functional=split_components(functional),
    )
    return replace(operator, anchorings=(*operator.anchorings, added))


def assemble_hierarchical(
    parts: Sorted, sources: SourceTree, nodes: Integer, needed: Bool, length: float, finite: Sequence[int] = (),
    weak: float = 0.0,
) -> HierarchicalOperator:
    """Rows of B of the given nodes (k,); needed (4 nodes,), length: as of pbem.bem.operator.assemble_rows.

    finite: numbers of regions that have an outer boundary. weak: see pbem.bem.near.choose_weak.
    """
    mesh, forest, terms = parts.mesh, parts.forest, parts.terms
    row_of_node = np.full(mesh.nodes, -1)
    row_of_node[nodes] = np.arange(len(nodes))
    owned = [leaf for leaf in forest.leaves if (row_of_node[list_nodes(mesh, forest.items(leaf))] >= 0).any()]
    wanted = mark_ancestors(forest, owned)
    met = find_interactions(forest, forest, RATIO, wanted)
    targets = TargetTree(
        forest, terms, wanted, log_lengths(parts, forest), met.far_target, met.far_source
    )
    scale = scale_equations(mesh, parts.materials, length)
    begin, end = np.searchsorted(met.near_target, owned), np.searchsorted(met.near_target, owned, side="right")
    leaves: list[LeafRows] = []
    seen: list[tuple[int, Integer]] = []
    for leaf, low, high in zip(owned, begin, end, strict=True):
        at = list_nodes(mesh, forest.items(leaf))
        at = at[row_of_node[at] >= 0]
        elements = np.sort(np.concatenate([forest.items(source) for source in met.near_source[low:high]]))
        columns, near = _evaluate_leaf(parts, int(leaf), at, elements, needed)
        near *= -np.repeat(scale[at], 2)[:, None]
        elastic = parts.materials[int(forest.region[leaf])].rigid is None
        rows, width = number_components(row_of_node[at]), 2 * (mesh.order + 1)
        leaves.append(pack_rows(rows, columns, near, width, 2 * mesh.nodes, weak if elastic else 0.0))
        if elastic:
            seen.append((int(leaf), at))
    free = collect_free_terms(mesh, nodes, scale)
    # Expansions of the parts of a rigid motion cancel only up to their error, which would be felt where a body moves by
    # much more than it is strained: what fits best is taken off before. Small regions have no expansions.
    rigid = tuple(
        motions for motions in find_rigid_motions(mesh, finite, needed)
        if motions.interpolated or len(motions.columns) > 2 * SMALL_REGION * (mesh.order + 1)
    )
    far = _place_far_rows(parts, seen, row_of_node, scale)
    return HierarchicalOperator(parts, nodes, sources, targets, leaves, far, free, needed, rigid=rigid)


def _place_far_rows(parts: Sorted, seen: list[tuple[int, Integer]], row_of_node: Integer, scale: Real) -> FarRows:
    """The rows of nodes in leaves, pairs (leaf, nodes), on the fields there."""
    mesh = parts.mesh
    leaves = np.array([leaf for leaf, _ in seen], dtype=np.int64)
    nodes = np.concatenate([np.zeros(0, dtype=np.int64), *(at for _, at in seen)])
    kappa, modulus = name_media(parts, parts.forest.region[leaves])
    points = FieldPoints(
        leaves, np.cumsum([0, *(len(at) for _, at in seen)]), mesh.position[nodes],
        np.where(mesh.traction_equation[nodes], mesh.normal[nodes], 0.0), kappa, modulus,
    )  # fmt: skip
    return FarRows(points, number_components(row_of_node[nodes]).reshape(-1, 2), -scale[nodes])


def _evaluate_leaf(
    parts: Sorted, leaf: int, nodes: Integer, elements: Integer, needed: Bool
) -> tuple[Integer, Real]:
    """Columns of v, and the near rows of a leaf's nodes on them."""
    mesh, forest = parts.mesh, parts.forest
    region = int(forest.region[leaf])
    chosen = parts.sources[region].select(elements - parts.first_element[region])
    material = parts.materials[region]
    bounded = bool((chosen.family == 0).any())
    on = np.searchsorted(elements, parts.node_element[nodes])
    width = 2 * len(elements) * (mesh.order + 1)
    columns = list_columns(mesh, list_nodes(mesh, elements), 2 * width if bounded else width)
    kept = needed[columns]
    near = np.empty((2 * len(nodes), int(kept.sum())))
    if material.rigid is not None:
        first = list_nodes(mesh, elements)[0]
        near[:] = -form_rigid_rows(mesh, region, material)[number_components(nodes - first)][:, kept]
        return columns[kept], near
    for traction in (False, True):
        at = np.flatnonzero(mesh.traction_equation[nodes] == traction)
        if len(at) == 0:
            continue
        own = nodes[at]
        normal = mesh.normal[own] if traction else None
        values = evaluate_rows(chosen, mesh.position[own], on[at], normal, bounded, parts.node_local[own])
        whole = np.concatenate([value for value in values if value is not None], axis=1)
        near[number_components(at)] = whole[:, kept]
    return columns[kept], near
