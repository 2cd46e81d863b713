"""Numbers of nodes and of their two components, as the arrays u, t, v and the unknowns hold them."""

from __future__ import annotations

import numpy as np

from pbem.arrays import Complex, Integer, Real
from pbem.mesh.mesh import Mesh

# NumPy goes over two or three numbers at a time slowly: of so many items it goes over all, part after part.
MANY = 1000


def list_nodes(mesh: Mesh, elements: Integer) -> Integer:
    """The nodes (k (order + 1),) of elements (k,), in their order."""
    return _number_parts(elements, mesh.order + 1)


def number_components(nodes: Integer) -> Integer:
    """Numbers (2 k,) of the x and y components of nodes (k,): 2 node, 2 node + 1."""
    return _number_parts(nodes, 2)


def _number_parts(items: Integer, parts: int) -> Integer:
    """Numbers (k parts,) of the parts of items (k,), each of which has so many."""
    if len(items) < MANY:
        return (items[:, None] * parts + np.arange(parts)).ravel()
    numbers = np.empty((len(items), parts), dtype=np.int64)
    for part in range(parts):
        np.multiply(items, parts, out=numbers[:, part])
        numbers[:, part] += part
    return numbers.ravel()


def split_components(values: Complex) -> Real:
    """x and y components (2 k,) of complex vectors (k,), by turns."""
    return np.stack([values.real, values.imag], axis=1).ravel()
