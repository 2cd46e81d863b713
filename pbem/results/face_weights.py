"""What integrates fields over both faces of all elements: the quadrature of the energies."""

from __future__ import annotations

import numpy as np

from pbem.arrays import Real
from pbem.mesh.interpolation import interpolate_tips, locate_nodes
from pbem.mesh.mesh import Mesh, second_face_nodes

# Gauss points along tip elements, in the root of the distance from the tip.
POINTS, WEIGHTS = np.polynomial.legendre.leggauss(12)


def weigh_faces(mesh: Mesh) -> Real:
    """Weights (f,) at the nodes of `list_faces(mesh)` that integrate a traction times a displacement.

    On tip elements they integrate the square-root shapes exactly, elsewhere they are those of the mesh.
    """
    weight = mesh.weight.copy()
    tips = np.flatnonzero(mesh.tip)
    if len(tips):
        root = 0.5 * (1 + POINTS)
        s = np.where(mesh.tip[tips] == 1, 1, -1)[:, None] * (2 * root**2 - 1)
        length = 2 * WEIGHTS * root * mesh.geometry.select(tips).stretch(s)
        shapes = interpolate_tips(mesh.tip[tips], locate_nodes(mesh)[tips], s)
        nodes = tips[:, None] * (mesh.order + 1) + np.arange(mesh.order + 1)
        weight[nodes] = np.einsum("eq,eqj->ej", length, shapes)
    return np.concatenate([weight, weight[second_face_nodes(mesh)]])
