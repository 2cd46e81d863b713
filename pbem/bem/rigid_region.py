"""Equations of a rigid tool, in the place of the integral equations of an elastic region.

Their rows are B v = u - R F q(u) - R F (R^T W t) / G, with the unit motions R (columns), q(u) the motion that fits the
displacements u best, the resultants R^T W t of the tractions, and F the projection onto the motions whose forces are
given; the others are q(u) itself. B v = R y then says that u is a rigid motion, that its given parts are those of y,
and that the tractions are in balance with the given forces, -G y.
"""

from __future__ import annotations

import numpy as np

from pbem.arrays import Complex, Integer, Real
from pbem.mesh.mesh import Mesh
from pbem.mesh.numbering import split_components
from pbem.model.material import Material
from pbem.model.rigid_body import unit_motions


def list_region_nodes(mesh: Mesh, region: int) -> Integer:
    """The nodes (k,) of a region, which follow each other."""
    first, last = np.searchsorted(mesh.region, [region, region + 1]) * (mesh.order + 1)
    return np.arange(first, last)


def move_rigidly(mesh: Mesh, region: int, material: Material) -> tuple[Complex, float]:
    """Displacements (k, 3) of a tool's nodes by the unit motions, the rotation divided by the length that is given."""
    assert material.rigid is not None
    motions = unit_motions(mesh.position[list_region_nodes(mesh, region)], material.rigid.about)
    size = float(np.abs(motions[:, 2]).max())
    return motions / np.array([1.0, 1.0, size]), size


def form_rigid_rows(mesh: Mesh, region: int, material: Material) -> Real:
    """Rows (2 k, 4 k) of B of a tool's k nodes less the free terms u/2; columns: their displacements, their tractions.

    (theory, 93)
    """
    assert material.rigid is not None
    nodes = list_region_nodes(mesh, region)
    motions, _ = move_rigidly(mesh, region, material)
    columns = np.stack([split_components(motions[:, k]) for k in range(3)], axis=1)
    sums = columns.T * np.repeat(mesh.weight[nodes], 2)
    forced = np.diag(np.array(material.rigid.forced, dtype=float))
    fitted = columns @ forced @ np.linalg.solve(sums @ columns, sums)
    balanced = columns @ forced @ sums / material.shear_modulus
    return np.concatenate([0.5 * np.eye(len(columns)) - fitted, -balanced], axis=1)


def load_rigid_rows(mesh: Mesh, region: int, material: Material, given: Real) -> Complex:
    """Right-hand sides (k,) complex, lengths, for given (3,) forces and motions (rotation in radians)."""
    assert material.rigid is not None
    motions, size = move_rigidly(mesh, region, material)
    forced = np.array(material.rigid.forced)
    parts = given * np.where(forced, np.array([1.0, 1.0, 1 / size]) / material.shear_modulus, [1.0, 1.0, size])
    return np.asarray(motions @ parts)
