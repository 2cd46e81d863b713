"""Numbers of nodes and of their two components, as the arrays u, t, v and the unknowns hold them."""

from __future__ import annotations

import numpy as np

from pbem.arrays import Complex, Integer, Real
from pbem.mesh.mesh import Mesh


def list_nodes(mesh: Mesh, elements: Integer) -> Integer:
    """The nodes (k (order + 1),) of elements (k,), in their order."""
    per_element = mesh.order + 1
    return (elements[:, None] * per_element + np.arange(per_element)).ravel()


def number_components(nodes: Integer) -> Integer:
    """Numbers (2 k,) of the x and y components of nodes (k,): 2 node, 2 node + 1."""
    return (2 * nodes[:, None] + np.arange(2)).ravel()


def split_components(values: Complex) -> Real:
    """x and y components (2 k,) of complex vectors (k,), by turns."""
    return np.stack([values.real, values.imag], axis=1).ravel()
