"""What integrates quantities of contact pairs along their curves: the quadrature of the elements that carry them."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from pbem.arrays import Integer, Real
from pbem.mesh.mesh import Mesh
from pbem.mesh.shape_functions import integrate_shapes, tip_shapes
from pbem.results.contents import Elements

# Jumps, which vanish at the tips of cracks like the root of the distance, but for gaps.
JUMPS = ("opening", "slip")


def weigh_pairs(elements: Elements, position: Real, order: int, node: Integer) -> tuple[Real, Real]:
    """Weights (m,) of tractions and of jumps at the pairs with the given nodes (m,): lengths.

    position (n, 2): of all nodes, element after element. A pair has a node of either of its sides. Beside the tip of a
    crack jumps have the square-root shape.
    """
    if not len(node):
        return np.zeros(0), np.zeros(0)
    plain, rooted = _weigh_nodes(elements, position, order)
    return plain[node], rooted[node]


def weigh_values(quantity: str, values: Real, gap: Real, weights: tuple[Real, Real]) -> Real:
    """What each pair adds (..., m) to the integral of a quantity with these values (..., m): its unit times length.

    gap (m,): lengths, the part of openings that does not vanish at tips: the gap, what joints have closed by at rest
    included. weights: as `weigh_pairs` returns them.
    """
    plain, rooted = weights
    if quantity not in JUMPS:
        return values * plain
    return values * rooted + (gap * (plain - rooted) if quantity == "opening" else 0.0)


def weigh_mesh_pairs(mesh: Mesh) -> tuple[Real, Real]:
    """The same weights (m,) of all pairs of a mesh, in its order."""
    vertices = np.stack([mesh.start, mesh.end], axis=1)
    elements = Elements(
        np.stack([vertices.real, vertices.imag], axis=-1), mesh.sweep, mesh.region, mesh.curve, mesh.crack,
        mesh.tip.astype(np.int64))
    position = np.column_stack([mesh.position.real, mesh.position.imag])
    return weigh_pairs(elements, position, mesh.order, mesh.pairs.slave)


def find_nodes(position: Real, pairs: Real) -> Integer:
    """The nodes (m,) nearest to the places of pairs (m, 2), for files that do not name the nodes.

    It is not that of the pair where pairs are told on the other curve of a contact, across a gap.
    """
    if not len(pairs):
        return np.zeros(0, dtype=np.int64)
    _, node = cKDTree(position).query(pairs)
    return np.asarray(node)


def _weigh_nodes(elements: Elements, position: Real, order: int) -> tuple[Real, Real]:
    count = len(elements.vertices)
    places = (position @ np.array([1, 1j])).reshape(count, order + 1)
    local = elements.geometry.preimage(places).real
    kinds, kind = np.unique(np.round(local, 6), axis=0, return_inverse=True)
    stretch = elements.geometry.stretch(local)
    plain, rooted = np.empty_like(stretch), np.empty_like(stretch)
    integrals = 1 / (np.arange(order + 1) + 1.5)
    length = elements.geometry.lengths
    for number, nodes in enumerate(kinds):
        own = kind.ravel() == number
        plain[own] = stretch[own] * integrate_shapes(nodes)
        rooted[own] = plain[own]
        for end, shapes in enumerate(tip_shapes(tuple(nodes)) if elements.tip[own].any() else ()):
            there = own & (elements.tip == end + 1)
            rooted[there] = length[there, None] * (integrals @ shapes)
    return plain.ravel(), rooted.ravel()
