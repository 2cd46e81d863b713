"""Values between the nodes: coordinates of nodes on their elements, and the shapes that values there are read with."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pbem.arrays import Complex, Integer, Real
from pbem.mesh.mesh import Mesh, second_face_nodes
from pbem.mesh.numbering import list_nodes


def locate_nodes(mesh: Mesh, elements: Integer | None = None) -> Real:
    """The coordinates s (e, p + 1) of all nodes on their elements, or of the nodes of some elements (e,)."""
    if elements is None:
        return mesh.geometry.preimage(mesh.position.reshape(mesh.elements, -1)).real
    position = mesh.position[list_nodes(mesh, elements)].reshape(len(elements), mesh.order + 1)
    return mesh.geometry.select(elements).preimage(position).real


def interpolate(local: Real, s: Real) -> Real:
    """Values (e, p, j) at s (e, p) of the polynomials that are 1 at node j and 0 at others; local (e, j): the nodes."""
    powers = np.arange(local.shape[1])
    return np.asarray(s[..., None] ** powers @ np.linalg.inv(local[..., None] ** powers))


def differentiate(local: Real, s: Real) -> Real:
    """Derivatives by s of the polynomials of `interpolate`."""
    powers = np.arange(local.shape[1])
    by_power = powers * s[..., None] ** np.maximum(powers - 1, 0)
    return np.asarray(by_power @ np.linalg.inv(local[..., None] ** powers))


def differentiate_at_nodes(local: Real) -> Real:
    """Derivatives (e, j, j) at the nodes themselves, local (e, j), of the polynomials of `interpolate`.

    By barycentric weights (Berrut, Trefethen, SIAM Review 46, 2004), at less cost than the inverse and more exactly.
    """
    apart = local[:, :, None] - local[:, None, :]
    diagonal = np.arange(local.shape[1])
    apart[:, diagonal, diagonal] = 1.0
    product = apart.prod(axis=2)
    result = product[:, :, None] / product[:, None, :] / apart
    result[:, diagonal, diagonal] = 0.0
    result[:, diagonal, diagonal] = -result.sum(axis=2)
    return np.asarray(result)


def interpolate_tips(tip: NDArray[np.integer], local: Real, s: Real) -> Real:
    """As `interpolate`, with shapes t^(k + 1/2), t = 0 at the tip and 1 at the other end; tip (e,): 1 start, 2 end."""
    t, nodes = _measure_from_tip(tip, s), _measure_from_tip(tip, local)
    exponents = np.arange(local.shape[1]) + 0.5
    return np.asarray(t[..., None] ** exponents @ np.linalg.inv(nodes[..., None] ** exponents))


def differentiate_tips(tip: NDArray[np.integer], local: Real, s: Real) -> Real:
    """Derivatives by s of the shapes of `interpolate_tips`; infinite at the tip itself."""
    t, nodes = _measure_from_tip(tip, s), _measure_from_tip(tip, local)
    exponents = np.arange(local.shape[1]) + 0.5
    by_t = exponents * t[..., None] ** (exponents - 1) @ np.linalg.inv(nodes[..., None] ** exponents)
    return np.asarray(by_t * np.where(tip == 1, 0.5, -0.5)[:, None, None])


def _measure_from_tip(tip: NDArray[np.integer], s: Real) -> Real:
    return 0.5 * (1 + np.where(tip == 1, 1, -1)[:, None] * s)


def split_faces(mesh: Mesh, values: Complex) -> tuple[Complex, Complex]:
    """Values (f,) on the nodes of `list_faces(mesh)` at every mesh node (nodes,): those of the first face, and those of
    the face across a crack (elsewhere the same)."""
    first = values[: mesh.nodes]
    opposite = first.copy()
    opposite[second_face_nodes(mesh)] = values[mesh.nodes :]
    return first, opposite
