"""The operator B = [H, -G] of the collocated boundary integral equations, by rows of collocation points.

The vector v = (u, t) holds the displacement of every node, x and y, then the traction of every node; on a crack u is
the jump u_r - u_l and t the traction on the first face. B v = 0 states every node's equation, free term included:

    displacement equation   u/2 - A u - B t = 0
    traction equation       t/2 - A u - B t = 0     (on a crack t - A u - B t = 0: both faces lie there)

Traction equations are multiplied by the element's length over the shear modulus, so that all rows are lengths.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from pbem.arrays import Bool, Complex, Integer, Real
from pbem.bem.rigid_region import form_rigid_rows
from pbem.bem.rows import Sources, evaluate_rows
from pbem.mesh.mesh import Mesh
from pbem.mesh.numbering import number_components
from pbem.model.material import Material

# Scratch memory of one call of the kernels, in bytes: about that of the caches.
CHUNK_BYTES = 2_000_000


@dataclass(frozen=True)
class RegionRows:
    """Dense rows of one region: rows (2 k,) from this rank's first row on; columns index v; matrix (2 k, columns)."""

    region: int
    rows: Integer
    columns: Integer
    matrix: Real


@dataclass(frozen=True)
class RowOperator:
    """The rows of B of the nodes first_node .. last_node - 1: a dense block per region, and the sparse free terms."""

    first_node: int
    last_node: int
    blocks: tuple[RegionRows, ...]
    free: sparse.csr_matrix

    @property
    def nodes(self) -> Integer:
        """The nodes whose rows these are."""
        return np.arange(self.first_node, self.last_node)

    @property
    def rows(self) -> int:
        return 2 * (self.last_node - self.first_node)

    def apply(self, v: Real) -> Real:
        """This rank's rows of B v, lengths, for v of shape (4 nodes,) or, for many at a time, (4 nodes, c)."""
        result: Real = self.free @ v
        for block in self.blocks:
            result[block.rows] += block.matrix @ v[block.columns]
        return result

    def multiply_block(self, block: RegionRows, constraints: sparse.csr_matrix, columns: Integer) -> Real:
        """A block's rows of B M, dense, in the given columns of the constraint map M."""
        chosen = constraints[:, columns]
        product: Real = (chosen[block.columns].T @ block.matrix.T).T
        product += (self.free[block.rows] @ chosen).toarray()
        return np.ascontiguousarray(product)


def collect_sources(mesh: Mesh, materials: Sequence[Material]) -> list[Sources]:
    """The elements of every region; lengths in the logarithm are divided by 8 times the region's extent."""
    sources = []
    bounds = np.searchsorted(mesh.region, np.arange(len(materials) + 1))  # regions follow each other
    family = mesh.family
    for region, material in enumerate(materials):
        own = slice(bounds[region], bounds[region + 1])
        start, end = mesh.start[own], mesh.end[own]
        points = np.concatenate([start, end])
        extent = 2 * np.abs(points - points.mean()).max()  # the same however the model is turned
        sources.append(
            Sources(
                start=start, end=end, center=mesh.center[own], sweep=mesh.sweep[own], family=family[own],
                local=mesh.local, crack_local=mesh.crack_local,
                kappa=material.kappa, shear_modulus=material.shear_modulus, length=8 * extent,
            )
        )
    return sources


def assemble_rows(
    mesh: Mesh, materials: Sequence[Material], first_node: int, last_node: int, needed: Bool, length: float,
    finite: Sequence[int] = (),
) -> RowOperator:
    """Rows of B of the nodes in [first_node, last_node) (theory, 7, 8).

    needed (4 nodes,): entries of v that can ever differ from zero; the other columns are not stored.
    length: the model's size; see scale_equations. finite: regions (numbers) that have an outer boundary: B of their
    translations is zero but for the rounding of sums (theory, 130).
    """
    nodes = np.arange(first_node, last_node)
    scale = scale_equations(mesh, materials, length)
    sources = collect_sources(mesh, materials)
    node_region = mesh.node_region
    blocks = []
    for region in np.unique(node_region[nodes]):
        own = nodes[node_region[nodes] == region]
        columns = _needed_columns(mesh, int(region), needed)
        rows = number_components(own - first_node)
        if materials[region].rigid is not None:
            whole = form_rigid_rows(mesh, int(region), materials[region])
            matrix = whole[np.ix_(number_components(own - _region_nodes(mesh, int(region))[0]), _own_columns(
                mesh, int(region), columns))]
            blocks.append(RegionRows(int(region), rows, columns, matrix))
            continue
        matrix = np.empty((2 * len(own), len(columns)))
        evaluate = _RowsOfRegion(mesh, sources[region], int(region), columns, int(region) in finite)
        for part, where in _list_chunks(own, mesh.traction_equation, evaluate.points):
            evaluate.put(part, bool(mesh.traction_equation[part[0]]), -scale[part], matrix, where)
        blocks.append(RegionRows(int(region), rows, columns, matrix))
    return RowOperator(first_node, last_node, tuple(blocks), collect_free_terms(mesh, nodes, scale[nodes]))


def assemble_displacement_rows(
    mesh: Mesh, materials: Sequence[Material], nodes: Integer, needed: Bool
) -> list[RegionRows]:
    """Blocks whose product with v is the displacement -int T u + int U t at the given crack nodes (theory, 13).

    There it is the mean displacement of the two faces. RegionRows.rows count from the first of the given nodes.
    """
    sources = collect_sources(mesh, materials)
    node_region = mesh.node_region
    blocks = []
    for region in np.unique(node_region[nodes]):
        at = np.flatnonzero(node_region[nodes] == region)
        columns = _needed_columns(mesh, int(region), needed)
        matrix = np.empty((2 * len(at), len(columns)))
        evaluate = _RowsOfRegion(mesh, sources[region], int(region), columns)
        for part, where in _list_chunks(nodes[at], np.zeros(mesh.nodes, dtype=bool), evaluate.points):
            evaluate.put(part, False, np.ones(len(part)), matrix, where)
        blocks.append(RegionRows(int(region), number_components(at), columns, matrix))
    return blocks


def add_anchor(
    operator: RowOperator, mesh: Mesh, region: int, nodes: Integer, pattern: Complex, functional: Complex
) -> None:
    """Add pattern (functional . u) to the equations of a region's nodes (k,) in place, before the operator is used.

    Makes the equations of a body without supports regular: where the loads balance, the functional of the solution
    vanishes. pattern, functional (k,): complex.
    (theory, 61)
    """
    own = (nodes >= operator.first_node) & (nodes < operator.last_node)
    columns = number_components(nodes)
    values = np.stack([functional.real, functional.imag], axis=1).ravel()
    added = np.stack([pattern.real, pattern.imag], axis=1)[own].ravel()
    rows = number_components(nodes[own] - operator.first_node)
    for block in operator.blocks:
        if block.region == region:
            at = np.searchsorted(block.columns, columns)
            stored = (at < len(block.columns)) & (block.columns[np.minimum(at, len(block.columns) - 1)] == columns)
            _add_outer(block.matrix, np.searchsorted(block.rows, rows), at[stored], added, values[stored])


def _add_outer(matrix: Real, rows: Integer, columns: Integer, added: Real, values: Real) -> None:
    """Add the product of a column (r,) and a row (c,) to these rows and columns of a matrix, in place.

    What lies side by side is not copied: a body's matrix is large, and this took longer than its kernels.
    """
    beside, across = join_neighbours(rows), join_neighbours(columns)
    if not (isinstance(beside, slice) and isinstance(across, slice)):
        matrix[np.ix_(rows, columns)] += np.outer(added, values)
        return
    for row, factor in zip(matrix[beside, across], added, strict=True):
        row += factor * values


def scale_equations(mesh: Mesh, materials: Sequence[Material], length: float, nodes: Integer | None = None) -> Real:
    """Factor (k,) of the equations of nodes (k,), by themselves or all of them: length/shear modulus for traction
    equations, 1 for the others.

    The length is that of the node's element, at most the given one: the hypersingular integrals over an element are its
    displacements times shear modulus over length, so that all rows have entries of the same size on graded meshes too.
    (theory, 14)
    """
    element = mesh.node_element if nodes is None else nodes // (mesh.order + 1)
    shear_modulus = np.array([material.shear_modulus for material in materials])[mesh.region[element]]
    own = np.minimum(np.abs(mesh.end[element] - mesh.start[element]), length)
    traction = mesh.traction_equation if nodes is None else mesh.traction_equation[nodes]
    return np.where(traction, own / shear_modulus, 1.0)


def collect_free_terms(mesh: Mesh, nodes: Integer, scale: Real) -> sparse.csr_matrix:
    """The free terms in the equations of nodes (k,): matrix (2 k, 4 nodes); scale (k,) as of scale_equations.

    (theory, 13)
    """
    value = np.where(mesh.crack[nodes // (mesh.order + 1)], 1.0, 0.5) * scale
    first_column = np.where(mesh.traction_equation[nodes], 2 * mesh.nodes, 0) + 2 * nodes
    columns = (first_column[:, None] + np.arange(2)).ravel()
    rows = np.arange(2 * len(nodes))
    entries = (np.repeat(value, 2), (rows, columns))
    return sparse.coo_matrix(entries, shape=(2 * len(nodes), 4 * mesh.nodes)).tocsr()


def _region_nodes(mesh: Mesh, region: int) -> Integer:
    return np.flatnonzero(mesh.node_region == region)


def _needed_columns(mesh: Mesh, region: int, needed: Bool) -> Integer:
    """Entries of v that act on a region: displacements of its nodes, tractions of those not on cracks."""
    nodes = _region_nodes(mesh, region)
    bounding = nodes[~mesh.node_crack[nodes]]
    columns = np.concatenate([2 * nodes, 2 * nodes + 1, 2 * (mesh.nodes + bounding), 2 * (mesh.nodes + bounding) + 1])
    columns.sort()
    return columns[needed[columns]]


def _own_columns(mesh: Mesh, region: int, columns: Integer) -> Integer:
    """Places of entries of v among a region's own: its displacements, then its tractions."""
    nodes = _region_nodes(mesh, region)
    return np.where(
        columns < 2 * mesh.nodes, columns - 2 * nodes[0], columns - 2 * (mesh.nodes + nodes[0]) + 2 * len(nodes)
    )


def _list_chunks(nodes: Integer, traction: Bool, most: int) -> list[tuple[Integer, Integer]]:
    """Runs of at most so many nodes with the same equation, and their rows in the block."""
    chunks = []
    for kind in (False, True):
        at = np.flatnonzero(traction[nodes] == kind)
        for begin in range(0, len(at), most):
            part = at[begin : begin + most]
            chunks.append((nodes[part], number_components(part)))
    return chunks


class _RowsOfRegion:
    """Values at nodes of a region in some columns of v, with room for those of `points` nodes at a time."""

    def __init__(
        self, mesh: Mesh, sources: Sources, region: int, columns: Integer, free: bool = False
    ) -> None:
        """free: translations of the region leave nothing, see _restore_translations."""
        own = _region_nodes(mesh, region)
        self._mesh, self._sources, self._first = mesh, sources, int(own[0])
        of_displacement = columns < 2 * mesh.nodes
        self._displacements = join_neighbours(columns[of_displacement] - 2 * self._first)
        self._tractions = join_neighbours(columns[~of_displacement] - 2 * (mesh.nodes + self._first))
        self._count = int(np.count_nonzero(of_displacement))
        self._with_tractions = self._count < len(columns)
        self._bounding = ~mesh.node_crack[own] if free else None
        self._translations = _translate(~mesh.node_crack[own]) if free else np.zeros((0, 2))
        width = 2 * sources.count * len(sources.local)
        self.points = max(1, CHUNK_BYTES // (2 * 2 * 8 * width))
        self._scratch = np.empty((2 * self.points, width)), np.zeros((2 * self.points, width))

    def put(self, nodes: Integer, traction: bool, factors: Real, matrix: Real, where: Integer) -> None:
        """Put factors (k,) times the values at nodes (k,), displacement, or traction on the node's normal, in rows of a
        matrix (rows, columns).
        """
        mesh, first = self._mesh, self._first
        displacement, tractions = evaluate_rows(
            self._sources, mesh.position[nodes], mesh.node_element[nodes] - mesh.node_element[first],
            mesh.normal[nodes] if traction else None, self._with_tractions, mesh.node_local[nodes], self._scratch,
        )
        if self._bounding is not None:
            _restore_translations(
                displacement, self._translations, self._bounding, nodes - first, 0.0 if traction else 0.5)
        rows, scale = join_neighbours(where), np.repeat(factors, 2)[:, None]
        _multiply_into(matrix, rows, slice(0, self._count), displacement[:, self._displacements], scale)
        if tractions is not None:
            _multiply_into(matrix, rows, slice(self._count, None), tractions[:, self._tractions], scale)


def join_neighbours(places: Integer) -> slice | Integer:
    """The same places as a slice if each is the one after the last: what is taken with it is not copied."""
    if len(places) and places[-1] - places[0] == len(places) - 1 and (np.diff(places) == 1).all():
        return slice(int(places[0]), int(places[-1]) + 1)
    return places


def _multiply_into(matrix: Real, rows: slice | Integer, columns: slice, values: Real, scale: Real) -> None:
    """matrix[rows, columns] = scale * values, at once where the rows are neighbours."""
    if isinstance(rows, slice):
        np.multiply(values, scale, out=matrix[rows, columns])
    else:
        matrix[rows, columns] = values * scale


def _translate(bounding: Bool) -> Real:
    """Displacements (2 n, 2) of a region's nodes in its translations along x and y, jumps on cracks."""
    return np.where(np.repeat(bounding, 2)[:, None], np.tile(np.eye(2), (len(bounding), 1)), 0.0)


def _restore_translations(rows: Real, translations: Real, bounding: Bool, own: Integer, half: float) -> None:
    """Let rows (2 k, 2 n) of a region's displacements give half of its translations, which the free terms take off.

    What rounding leaves is taken off the points' own columns, in place. bounding (n,): nodes that are on no crack.
    own (k,): which of the nodes the points are. Points on cracks, whose own column is a jump, stay as they are.
    (theory, 130)
    """
    left = (rows @ translations).reshape(-1, 2, 2) - half * np.eye(2)
    on = np.flatnonzero(bounding[own])
    at, columns = (2 * each[:, None] + np.arange(2) for each in (on, own[on]))
    rows[at[:, :, None], columns[:, None, :]] -= left[on]
