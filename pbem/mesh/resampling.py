"""Displacements and tractions of a run once more, on elements of order 3 and continuous from element to element.

A run has a polynomial of its own on each element. Where two of them meet they differ a little, and close to a face the
stress would be that of a dislocation there: the difference over the distance. Between elements of a smooth curve the
value is read from the nodes of both; each element is then read from its own nodes and the values at its ends.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from pbem.arrays import Bool, Integer, Real
from pbem.geometry.elements import Elements
from pbem.mesh.elements import weigh_nodes
from pbem.mesh.interpolation import interpolate
from pbem.mesh.mesh import Mesh

# Nodes with both ends among them, so that neighbours agree there; on cracks just off the ends, where a tip's shapes
# vanish.
LOBATTO = np.array([-1.0, -np.sqrt(0.2), np.sqrt(0.2), 1.0])
OFF_END = 1e-6
# Directions that differ by less (radians) are one.
SMOOTH = 1e-6


@dataclass(frozen=True)
class Resampling:
    """mesh: of finer elements of order 3, without pairs; parts (e,): into how many each chosen element of the run is
    cut, in turn; displacement, traction (new nodes, nodes): from the values at the nodes of the run to those at its
    nodes."""

    mesh: Mesh
    parts: Integer
    displacement: sparse.csr_matrix
    traction: sparse.csr_matrix


def resample(mesh: Mesh, chosen: Integer | None = None) -> Resampling:
    """Elements of order 3 for those of a mesh, or for chosen ones (e,) that rise, and what takes values there."""
    chosen = np.arange(mesh.elements) if chosen is None else chosen
    parts = np.where((mesh.tip[chosen] > 0) | (mesh.order < 2), 1, 2)
    parent, of = np.repeat(chosen, parts), np.repeat(parts, parts)
    piece = np.arange(len(parent)) - np.repeat(np.cumsum(parts) - parts, parts)
    first, last = piece / of, (piece + 1) / of
    fine = _cut(mesh, parent, first, last)
    along = first[:, None] + (last - first)[:, None] * fine.geometry.fractions(_place(fine))
    return Resampling(fine, parts, _join_displacements(mesh, parent, along), _join_tractions(mesh, fine, parent, along))


def _place(mesh: Mesh) -> Real:
    return np.where(mesh.crack[:, None], mesh.crack_local, mesh.local)


def _cut(mesh: Mesh, parent: Integer, first: Real, last: Real) -> Mesh:
    """The pieces of the elements; neighbours share exactly the same point."""
    whole = mesh.geometry.select(parent)
    pieces = whole.cut(first, last)
    middle = whole.place_fractions(np.full((len(parent), 1), 0.5))[:, 0]
    start = np.where(first == 0, whole.start, middle)
    end = np.where(last == 1, whole.end, middle)
    pieces = Elements(start, end, pieces.center, pieces.sweep)
    local, crack_local = LOBATTO, LOBATTO * np.where(np.abs(LOBATTO) == 1, 1 - OFF_END, 1.0)
    crack = mesh.crack[parent]
    nodes = np.where(crack[:, None], crack_local, local)
    return replace(
        mesh, order=3, local=local, crack_local=crack_local, start=start, end=end, center=pieces.center,
        sweep=pieces.sweep, region=mesh.region[parent], curve=mesh.curve[parent], crack=crack, tip=mesh.tip[parent],
        position=pieces.place(nodes).ravel(), normal=pieces.normals(nodes).ravel(),
        weight=weigh_nodes(pieces, local).ravel(), traction_equation=np.zeros(4 * len(parent), dtype=bool),
    )  # fmt: skip


def _join_displacements(mesh: Mesh, parent: Integer, along: Real) -> sparse.csr_matrix:
    """along (new elements, 4): the new nodes' fractions of the length of their old element."""
    count, each = mesh.elements, mesh.order + 1
    nodes = mesh.geometry.fractions(_place(mesh))
    ends = _close_around(mesh) @ _read_ends(mesh, nodes)  # (2 count, nodes) in the quotient by the roots at tips
    node_root = _take_roots(mesh, np.arange(count), nodes)
    new_root = _take_roots(mesh, parent, along)
    known = np.column_stack([np.zeros(count), nodes, np.ones(count)])
    shapes = interpolate(2 * known[parent] - 1, 2 * along - 1)  # (new elements, 4, each + 2)
    rows = np.arange(along.size)
    quotient = sparse.diags(1 / node_root.ravel())
    own = sparse.csr_matrix(
        (shapes[:, :, 1:-1].ravel(), (np.repeat(rows, each),
         np.repeat(parent[:, None] * each + np.arange(each), 4, axis=0).ravel())),
        shape=(along.size, count * each),
    )  # fmt: skip
    at_ends = sparse.csr_matrix(
        (shapes[:, :, [0, -1]].ravel(), (np.repeat(rows, 2),
         np.repeat(2 * parent[:, None] + np.arange(2), 4, axis=0).ravel())),
        shape=(along.size, 2 * count),
    )  # fmt: skip
    return (sparse.diags(new_root.ravel()) @ (own + at_ends @ ends) @ quotient).tocsr()


def _join_tractions(mesh: Mesh, fine: Mesh, parent: Integer, along: Real) -> sparse.csr_matrix:
    """The run's own: tractions may jump between elements."""
    each = mesh.order + 1
    inner = mesh.geometry.select(parent)
    places = inner.preimage(fine.position.reshape(-1, 4)).real
    shapes = interpolate(np.tile(mesh.local, (len(parent), 1)), places)
    shapes *= inner.crowding(places)[:, :, None] / inner.crowding(mesh.local)[:, None, :]
    shapes *= ~fine.crack[:, None, None]
    columns = np.repeat(parent[:, None] * each + np.arange(each), 4, axis=0)
    rows = np.repeat(np.arange(along.size), each)
    return sparse.csr_matrix((shapes.ravel(), (rows, columns.ravel())), shape=(along.size, mesh.nodes))


def _read_ends(mesh: Mesh, nodes: Real) -> sparse.csr_matrix:
    """Values at the starts and ends (2 e) of the elements from nodal values (n), both without the roots at tips.

    nodes (e, p + 1): fractions of the length at which the nodes lie.
    """
    count, each = nodes.shape
    own = interpolate(2 * nodes - 1, np.tile([-1.0, 1.0], (count, 1)))  # (e, 2, p + 1)
    weights = np.zeros((count, 2, 2, each))  # of the element itself, and of its neighbour there
    weights[:, :, 0] = own
    other = np.tile(np.arange(count)[:, None], (1, 2))
    following, smooth = find_neighbours(mesh)
    before = np.flatnonzero(following >= 0)
    after, smooth = following[before], smooth[before]
    # In units of both lengths together, from where they meet.
    length = mesh.geometry.lengths
    both = length[before] + length[after]
    there = np.column_stack([(nodes[before] - 1) * (length[before] / both)[:, None],
                             nodes[after] * (length[after] / both)[:, None]])  # fmt: skip
    joint = interpolate(there, np.zeros((len(before), 1)))[:, 0].reshape(-1, 2, each)
    mean = 0.5 * np.stack([own[before, 1], own[after, 0]], axis=1)
    joint = np.where(smooth[:, None, None], joint, mean)
    weights[before, 1], weights[after, 0] = joint, joint[:, ::-1]
    other[before, 1], other[after, 0] = after, before
    columns = np.stack([np.tile(np.arange(count)[:, None], (1, 2)), other], axis=2)[..., None] * each + np.arange(each)
    rows = np.repeat(np.arange(2 * count), 2 * each)
    return sparse.csr_matrix((weights.ravel(), (rows, columns.ravel())), shape=(2 * count, count * each))


def _close_around(mesh: Mesh) -> sparse.csr_matrix:
    """From values at the ends (2 e) of the elements to those that close around places where more than two ends meet, or
    two of cracks: mouths on boundaries and crossings.

    Around a place inside or on a boundary displacements come back to what they were: those of elements that start
    there, jumps on cracks, are together those of elements that end there. What is left is a dislocation, whose stress
    is as large as its distance is small; it is parted among all of them alike.
    """
    count = mesh.elements
    following, _ = find_neighbours(mesh)
    vertices = np.stack([mesh.start, mesh.end], axis=1).ravel()
    left = np.ones((count, 2), dtype=bool)
    goes_on = np.flatnonzero(following >= 0)
    left[goes_on, 1] = left[following[goes_on], 0] = False
    _, place, number = np.unique(
        np.column_stack([np.repeat(mesh.region, 2), vertices.real, vertices.imag]), axis=0, return_inverse=True,
        return_counts=True)  # fmt: skip
    place = place.ravel()
    at_tip = np.stack([mesh.tip == 1, mesh.tip == 2], axis=1).ravel()
    closed = (number >= 2) & (np.bincount(place, at_tip | ~left.ravel(), minlength=len(number)) == 0)
    chosen = np.flatnonzero(closed[place])
    chosen = chosen[np.argsort(place[chosen], kind="stable")]
    sizes = number[place[chosen]]  # as often as there are ends
    first = np.searchsorted(place[chosen], place[chosen])
    rows = np.repeat(chosen, sizes)
    columns = chosen[np.repeat(first, sizes) + np.arange(len(rows)) - np.repeat(np.cumsum(sizes) - sizes, sizes)]
    sense = np.where(np.arange(2 * count) % 2 == 0, 1.0, -1.0)
    root = _take_roots(mesh, np.arange(count), np.tile([0.0, 1.0], (count, 1))).ravel()
    parts = sense[rows] * sense[columns] * root[columns] / (root[rows] * np.repeat(sizes, sizes))
    return sparse.identity(2 * count, format="csr") - sparse.csr_matrix(
        (parts, (rows, columns)), shape=(2 * count, 2 * count))


def find_neighbours(mesh: Mesh) -> tuple[Integer, Bool]:
    """The element (e,) in which each goes on with the same displacement, or -1; and whether it does so smoothly.

    That is where two ends meet, and no others: where a crack begins, displacements differ.
    """
    vertices = np.concatenate([mesh.start, mesh.end])
    region = np.tile(mesh.region, 2)
    _, place, counts = np.unique(
        np.column_stack([region, vertices.real, vertices.imag]), axis=0, return_inverse=True, return_counts=True
    )
    place = place.ravel()
    at_start = np.full(len(counts), -1)
    at_start[place[: mesh.elements]] = np.arange(mesh.elements)
    following = np.where(counts[place[mesh.elements :]] == 2, at_start[place[mesh.elements :]], -1)
    after = np.maximum(following, 0)
    following[mesh.crack[after] != mesh.crack] = -1
    following[mesh.crack & (mesh.curve[after] != mesh.curve)] = -1
    following[following == np.arange(mesh.elements)] = -1
    begin, end = (each / np.abs(each) for each in mesh.geometry.directions())
    smooth = (np.abs(end - begin[after]) < SMOOTH) & (mesh.curve[after] == mesh.curve)
    return following, smooth


def _take_roots(mesh: Mesh, element: Integer, along: Real) -> Real:
    """Roots of the distances to the tips of a crack, relative to its length; 1 elsewhere. along (m, p): fractions."""
    length = mesh.geometry.lengths
    borders = np.flatnonzero((np.diff(mesh.curve) != 0) | (np.diff(mesh.crack) != 0) | (np.diff(mesh.region) != 0)) + 1
    chain = np.zeros(mesh.elements, dtype=np.int64)
    chain[borders] = 1
    chain = np.cumsum(chain)
    total = np.bincount(chain, length)
    before = np.cumsum(length) - length
    before -= before[np.concatenate([[0], borders])][chain]
    begins = np.bincount(chain, mesh.tip == 1) > 0
    ends = np.bincount(chain, mesh.tip == 2) > 0
    own = chain[element]
    place = (before[element, None] + along * length[element, None]) / total[own][:, None]
    root = np.where(begins[own][:, None], np.sqrt(np.maximum(place, 0)), 1.0)
    return np.asarray(root * np.where(ends[own][:, None], np.sqrt(np.maximum(1 - place, 0)), 1.0))
