"""On which unknowns the equations of each region can depend."""

from __future__ import annotations

import numpy as np

from pbem.arrays import Integer
from pbem.contact.constraints import ConstraintMap
from pbem.contact.loads import Load, OuterNodes
from pbem.contact.modes import Linearisation
from pbem.mesh.mesh import Mesh


def find_unknowns_of_regions(mesh: Mesh, outer: OuterNodes, leader: Integer, load: Load) -> list[Integer]:
    """Unknowns, in rising order, on which each region's displacements and tractions can depend in any mode."""
    # A law that depends on everything has the entries of all modes at once.
    everything = np.tile(1 + 0.1 * np.arange(8.0).reshape(4, 2), (mesh.pairs.count, 1, 1))
    law = Linearisation(everything, np.zeros((mesh.pairs.count, 4)), leader)
    matrix = ConstraintMap(mesh, outer, np.zeros(mesh.pairs.count), law, load, 1.0).matrix
    region_of_row = np.tile(np.repeat(mesh.node_region, 2), 2)
    return [
        np.unique(matrix[np.flatnonzero(region_of_row == region)].indices) for region in range(len(mesh.region_names))
    ]
