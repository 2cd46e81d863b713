"""What two facing curves with different meshes give each other: displacements and tractions by weighted averages.

The first curve's nodes take the displacement of the second curve averaged with their own shape functions, and the
second curve's nodes take the traction of the first averaged with theirs. The two averages are adjoint: forces are kept
exactly, and the traction does not oscillate between unequal meshes as it does with interpolation from point to
point. Shapes on Gauss nodes are orthogonal, so that each average is that of one node alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbem.mesh.elements import Elements
from pbem.mesh.projection import project_nodes
from pbem.mesh.shapes import interpolate_shapes

Complex = NDArray[np.complex128]
Integer = NDArray[np.int64]
Real = NDArray[np.float64]

# Gauss points on every piece of an element that faces one element of the other side.
POINTS, WEIGHTS = np.polynomial.legendre.leggauss(8)
# A node is no pair if less than this part of its weight faces the other curve.
LEAST_COVER = 0.5


@dataclass(frozen=True)
class Coupling:
    """Weights between the nodes of the first curve (n1) and the second (n2), both in their chain's order of nodes.

    cover (n1,): part of a node's weight that faces the second curve. distance (n1,): mean distance along the normal.
    first, second, product (l,): for every two nodes that see each other, the integral of the product of their shapes.
    """

    cover: Real
    distance: Real
    first: Integer
    second: Integer
    product: Real


def couple_curves(one: Elements, other: Elements, local: Real, reach: float, overlap: float) -> Coupling:
    """Integrate products of shapes over the parts of the first curve whose normals meet the second curve."""
    shapes = interpolate_shapes(local)
    count = len(local)
    cover, distance = np.zeros(one.count * count), np.zeros(one.count * count)
    first: list[Integer] = []
    second: list[Integer] = []
    product: list[Real] = []
    own_weight = one.weights(local)
    for element in range(one.count):
        single = one.select(np.array([element]))
        s, weight = _divide_element(single, other)
        seen = project_nodes(single.place(s)[0], single.normals(s)[0], other, reach, overlap)
        hit = seen.element >= 0
        length = weight * single.stretch(s)[0]
        mine = (s[:, None] ** np.arange(count) @ shapes)[hit] * length[hit, None]
        nodes = element * count + np.arange(count)
        cover[nodes] = mine.sum(axis=0) / own_weight[element]
        distance[nodes] = (mine * seen.distance[hit, None]).sum(axis=0) / own_weight[element]
        theirs = seen.local[hit][:, None] ** np.arange(count) @ shapes
        for facing in np.unique(seen.element[hit]):
            at = seen.element[hit] == facing
            first.append(np.repeat(nodes, count))
            second.append(np.tile(facing * count + np.arange(count), count))
            product.append((mine[at].T @ theirs[at]).ravel())
    none = np.zeros(0)
    return Coupling(
        cover=cover,
        distance=distance,
        first=np.concatenate([none, *first]).astype(np.int64),
        second=np.concatenate([none, *second]).astype(np.int64),
        product=np.concatenate([none, *product]),
    )


def _divide_element(single: Elements, other: Elements) -> tuple[Real, Real]:
    """Gauss points and weights on [-1, 1], cut where the normal passes the ends of the other curve's elements."""
    ends = np.unique(np.concatenate([other.start, other.end]))
    cuts = single.locate(ends)
    inside = np.sort(cuts[np.abs(cuts) < 1 - 1e-12])
    borders = np.concatenate([[-1.0], inside, [1.0]])
    half, middle = 0.5 * np.diff(borders)[:, None], 0.5 * (borders[1:] + borders[:-1])[:, None]
    return (middle + half * POINTS).ravel(), (half * WEIGHTS).ravel()
