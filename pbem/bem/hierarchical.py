"""The operator B in hierarchical form: near elements exactly, far ones by expansions about clusters.

Its storage and the time of a product grow in proportion to the number of unknowns. Rows and signs are those of
pbem.bem.operator; all regions share one forest of cluster trees.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import sparse

from pbem.arrays import Bool, Complex, Integer, Real
from pbem.bem.expansion import FieldPoints, place_densities
from pbem.bem.farfield import SourceTree, TargetTree, mark_ancestors, see_sources, share_leaves
from pbem.bem.near import LeafRows, NearRows, pack_rows
from pbem.bem.operator import collect_free_terms, collect_sources, scale_equations
from pbem.bem.region_sums import (
    Functional,
    RegionSums,
    list_motions,
    share_functionals,
    spread_motions,
)
from pbem.bem.rigid_motions import RigidMotions, find_rigid_motions
from pbem.bem.rigid_region import form_rigid_rows
from pbem.bem.rows import Sources, evaluate_rows
from pbem.bem.seen_entries import SeenEntries, take_elements
from pbem.bem.sharing import Share
from pbem.bem.tree import RATIO, Forest, build_forest, find_interactions
from pbem.formed import form_runs
from pbem.mesh.mesh import Mesh
from pbem.mesh.numbering import list_nodes, number_components, split_components
from pbem.model.material import Material
from pbem.uniform import fold_uniform

# Elements in a leaf at most: fewer make more work of the expansions, more make more of the near elements.
LEAF_ELEMENTS = 8
# A region of so few elements is one leaf: what is near is all of it.
SMALL_REGION = 48


@dataclass(frozen=True)
class FarRows:
    """What rows of nodes (n,) are of the fields in their leaves: numbers of the rows (n, 2), and factors (n,)."""

    points: FieldPoints
    rows: Integer
    factor: Real


@dataclass(frozen=True)
class Anchoring:
    """Equations of a region's nodes (k,) get pattern times functional . u: see add_anchor of pbem.bem.operator."""

    region: int
    nodes: Integer
    pattern: Complex
    functional: Complex


@dataclass(frozen=True)
class Sorted:
    """The model's elements in cluster trees, and those of each region as the kernels see them."""

    mesh: Mesh
    materials: tuple[Material, ...]
    sources: tuple[Sources, ...]
    forest: Forest
    terms: int

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


def prepare_sources(parts: Sorted, needed: Bool, share: Share) -> SourceTree:
    """This rank's leaves: those of whose elements it owns the most; needed (4 nodes,): see assemble_hierarchical.

    All ranks call this together.
    """
    forest, mesh, rank = parts.forest, parts.mesh, share.ranks.rank
    of_leaf = _find_owners(forest, share.of_element)
    owner, divided = share_leaves(forest, of_leaf)
    leaves = forest.leaves[of_leaf == rank]
    clusters = forest.take(np.flatnonzero(mark_ancestors(forest, leaves)))
    partial = np.flatnonzero(divided[clusters.number] & (owner[clusters.number] != rank))
    own = [forest.items(leaf) for leaf in leaves]
    elements = np.concatenate([np.zeros(0, dtype=np.int64), *own])
    first = np.cumsum([0, *(len(each) for each in own)])
    kappa, modulus = name_media(parts, forest.region[leaves])
    width = 2 * (mesh.order + 1)
    kept = take_elements(needed, elements, width)
    number = clusters.number[partial]
    return SourceTree(
        forest, share, parts.terms, clusters, np.searchsorted(clusters.number, leaves),
        place_densities(mesh, elements, parts.terms, np.repeat(forest.radius[leaves], np.diff(first))), first, kappa,
        modulus, elements, width,
        None if kept.all() else kept, owner, partial,
        share.ranks.find_ghosts(number, owner[number], clusters.number),
    )  # fmt: skip


def _find_owners(forest: Forest, of_element: Integer) -> Integer:
    """The rank that owns most elements of each leaf, the first of these."""
    leaves = forest.leaves
    leaf = np.repeat(np.arange(len(leaves)), forest.last[leaves] - forest.first[leaves])
    item = of_element[forest.order]
    ranks = int(of_element.max(initial=0)) + 1
    pair, count = np.unique(leaf * ranks + item, return_counts=True)
    order = np.lexsort((pair, -count, pair // ranks))
    begin = np.searchsorted(pair[order] // ranks, np.arange(len(leaves)))
    return np.asarray(pair[order][begin] % ranks)


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

    near: rows of near elements. seen: entries of v that this rank needs; of_sources: places among its elements of those
    of the source tree. motions (seen, f), held (rows, f): what the functionals in `sums` take off before the product,
    and add to it. anchorings: of all ranks.
    """

    parts: Sorted
    nodes: Integer
    sources: SourceTree
    targets: TargetTree
    near: NearRows
    far: FarRows
    free: sparse.csr_matrix
    needed: Bool
    seen: SeenEntries
    of_sources: Integer
    sums: RegionSums
    motions: sparse.csr_matrix
    held: sparse.csr_matrix
    rigid: tuple[RigidMotions, ...]
    anchorings: tuple[Anchoring, ...] = ()

    @property
    def rows(self) -> int:
        return 2 * len(self.nodes)

    def apply(self, v: Real) -> Real:
        """This rank's rows of B v, lengths, for v of shape (4 nodes,); all ranks call this together."""
        return self.apply_seen(self.seen.take(v))

    def apply_seen(self, v: Real) -> Real:
        """The same for the entries of v that are seen; near rows are done while coefficients are on their way."""
        sums = self.sums.evaluate(v)
        strained = v - self.motions @ sums if self.motions.nnz else v
        moments = self.sources.collect(take_elements(strained, self.of_sources, self.seen.width))
        arriving = self.targets.start(moments)
        result: Real = self.free @ strained
        self.near.add(strained, result)
        fields = self.targets.spread(moments, arriving)
        values = self.far.factor * self.far.points.evaluate(fields, self.targets.clusters)
        result[self.far.rows] += np.stack([values.real, values.imag], axis=1)
        return result + self.held @ sums if self.held.nnz else result


def anchor_rows(operator: HierarchicalOperator, anchorings: Sequence[Anchoring]) -> HierarchicalOperator:
    """The operator with pattern (functional . u) added to the equations of regions' nodes: see add_anchor.

    All ranks call this together, once.
    """
    functionals = [
        Functional(each.region, number_components(each.nodes), split_components(each.functional)) for each in anchorings
    ]
    motions = list_motions(operator.rigid)
    sums = share_functionals(
        operator.parts.mesh.region, operator.seen, operator.sources.share, [*motions, *functionals]
    )
    held = sparse.lil_matrix((operator.rows, len(sums.number)))
    for at in np.flatnonzero(sums.number >= len(motions)):
        each = anchorings[sums.number[at] - len(motions)]
        _, row, own = np.intersect1d(operator.nodes, each.nodes, assume_unique=True, return_indices=True)
        held[number_components(row), at] = split_components(each.pattern[own])[:, None]
    return replace(
        operator, anchorings=tuple(anchorings), sums=sums, held=held.tocsr(),
        motions=spread_motions(operator.seen, operator.rigid, sums),
    )  # fmt: skip


def assemble_hierarchical(
    parts: Sorted, sources: SourceTree, nodes: Integer, needed: Bool, length: float, finite: Sequence[int] = (),
    weak: float = 0.0,
) -> HierarchicalOperator:
    """Rows of B of the given nodes (k,); needed (4 nodes,), length: as of pbem.bem.operator.assemble_rows.

    finite: numbers of regions that have an outer boundary. weak: see pbem.bem.near.choose_weak. All ranks call this
    together.
    (theory, 130)
    """
    mesh, forest, share = parts.mesh, parts.forest, sources.share
    row_of_node = np.full(mesh.nodes, -1)
    row_of_node[nodes] = np.arange(len(nodes))
    owned = [leaf for leaf in forest.leaves if (row_of_node[list_nodes(mesh, forest.items(leaf))] >= 0).any()]
    wanted = mark_ancestors(forest, owned)
    met = find_interactions(forest, forest, RATIO, wanted)
    targets = see_sources(sources, forest, wanted, log_lengths(parts, forest), met)
    scale = scale_equations(mesh, parts.materials, length, nodes)
    position, normal = mesh.position[nodes], mesh.normal[nodes]
    begin, end = np.searchsorted(met.near_target, owned), np.searchsorted(met.near_target, owned, side="right")
    near_clusters = [met.near_source[low:high] for low, high in zip(begin, end, strict=True)]
    seen = _see_elements(parts, sources, np.unique(met.near_source))
    leaves: list[LeafRows] = []
    far: list[tuple[int, Integer]] = []
    for leaf, clusters in zip(owned, near_clusters, strict=True):
        at = list_nodes(mesh, forest.items(leaf))
        at = at[row_of_node[at] >= 0]
        row = row_of_node[at]
        elements = np.sort(np.concatenate([forest.items(source) for source in clusters]))
        columns, near = _evaluate_leaf(parts, int(leaf), at, (position[row], normal[row]), elements, needed)
        near *= -np.repeat(scale[row], 2)[:, None]
        elastic = parts.materials[int(forest.region[leaf])].rigid is None
        rows, width = number_components(row), 2 * (mesh.order + 1)
        strong = pack_rows(rows, columns, near, width, 2 * mesh.nodes, weak if elastic else 0.0)
        leaves.append(strong if seen.whole else strong.place(seen.find))
        if elastic:
            far.append((int(leaf), at))
    free = collect_free_terms(mesh, nodes, scale)
    # Expansions of the parts of a rigid motion cancel only up to their error, which would be felt where a body moves by
    # much more than it is strained: what fits best is taken off before. Small regions have no expansions.
    rigid = tuple(
        motions for motions in find_rigid_motions(mesh, finite, needed)
        if motions.interpolated or len(motions.columns) > 2 * SMALL_REGION * (mesh.order + 1)
    )
    sums = share_functionals(mesh.region, seen, share, list_motions(rigid))
    none = sparse.csr_matrix((2 * len(nodes), len(sums.number)))
    operator = HierarchicalOperator(
        parts, nodes, sources, targets, NearRows(leaves, seen.count, 2 * len(nodes)),
        _place_far_rows(parts, far, targets, row_of_node, scale), seen.place_columns(free),
        form_runs(fold_uniform(needed)),
        seen, np.searchsorted(seen.elements, sources.elements), sums,
        sparse.csr_matrix((seen.count, len(sums.number))), none, rigid,
    )  # fmt: skip
    free_of_all = _free_translations(operator, [each.region for each in find_rigid_motions(mesh, finite, needed)])
    return replace(operator, free=free_of_all, motions=spread_motions(seen, rigid, sums))


def _free_translations(operator: HierarchicalOperator, regions: Sequence[int]) -> sparse.csr_matrix:
    """The free terms, and beside them what lets B of translations of regions be zero: see assemble_rows.

    What rounding and expansions leave of them is taken off each node's own columns. Nodes on cracks, whose own column
    is a jump, stay as they are. All ranks call this together.
    (theory, 130)
    """
    parts, mesh = operator.parts, operator.parts.mesh
    elastic = [region for region in regions if parts.materials[region].rigid is None]
    if not elastic:
        return operator.free
    moved = np.isin(mesh.node_region, elastic) & ~mesh.node_crack
    translations = np.zeros((2, mesh.nodes, 2, 2))
    translations[0] = moved[:, None, None] * np.eye(2)
    left = np.stack([operator.apply(each) for each in translations.reshape(-1, 2).T], axis=1).reshape(-1, 2, 2)
    own = np.flatnonzero(moved[operator.nodes])
    rows = np.broadcast_to((2 * own[:, None] + np.arange(2))[:, :, None], (len(own), 2, 2))
    columns = np.broadcast_to((2 * operator.nodes[own, None] + np.arange(2))[:, None], (len(own), 2, 2))
    taken = sparse.csr_matrix(
        (-left[own].ravel(), (rows.ravel(), columns.ravel())), shape=(operator.rows, 4 * mesh.nodes)
    )
    return operator.free + operator.seen.place_columns(taken)


def _see_elements(parts: Sorted, sources: SourceTree, near: Integer) -> SeenEntries:
    """The entries of this rank's own elements, those of its leaves, and those of near clusters."""
    seen = sources.share.own
    seen[sources.elements] = True
    for leaf in near:
        seen[parts.forest.items(leaf)] = True
    return SeenEntries(np.flatnonzero(seen), parts.mesh.elements, sources.width)


def _place_far_rows(
    parts: Sorted, seen: list[tuple[int, Integer]], targets: TargetTree, row_of_node: Integer, scale: Real
) -> FarRows:
    """The rows of nodes in leaves, pairs (leaf, nodes), on the fields there; scale (rows / 2,): of their equations."""
    mesh = parts.mesh
    leaves = np.array([leaf for leaf, _ in seen], dtype=np.int64)
    nodes = np.concatenate([np.zeros(0, dtype=np.int64), *(at for _, at in seen)])
    kappa, modulus = name_media(parts, parts.forest.region[leaves])
    points = FieldPoints(
        np.searchsorted(targets.clusters.number, leaves), np.cumsum([0, *(len(at) for _, at in seen)]),
        mesh.position[nodes], np.where(mesh.traction_equation[nodes], mesh.normal[nodes], 0.0), kappa, modulus,
    )  # fmt: skip
    return FarRows(points, number_components(row_of_node[nodes]).reshape(-1, 2), -scale[row_of_node[nodes]])


def _evaluate_leaf(
    parts: Sorted, leaf: int, nodes: Integer, places: tuple[Complex, Complex], elements: Integer, needed: Bool
) -> tuple[Integer, Real]:
    """Columns of v, and the near rows of a leaf's nodes on them; places: positions and normals of the nodes."""
    mesh, forest = parts.mesh, parts.forest
    region = int(forest.region[leaf])
    chosen = parts.sources[region].select(elements - parts.first_element[region])
    material = parts.materials[region]
    bounded = bool((chosen.family == 0).any())
    on = np.searchsorted(elements, nodes // (mesh.order + 1))
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
        normal = places[1][at] if traction else None
        values = evaluate_rows(chosen, places[0][at], on[at], normal, bounded, mesh.take_local(own))
        whole = np.concatenate([value for value in values if value is not None], axis=1)
        near[number_components(at)] = whole[:, kept]
    return columns[kept], near
