"""Which operator a model is computed with; what it takes is counted in pbem.forecast."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np

from pbem.mesh.mesh import Mesh
from pbem.model.model import Model, Operator, SolverOptions

# With more unknowns in one region than this the hierarchical operator is the faster one.
DENSE_UNKNOWNS = 10_000
# Of the hierarchical operator a difference of meshes asks for less than the solution itself.
EASED_TOLERANCE, EASED_NEWTON_TOLERANCE = 1e-6, 1e-7


class DenseChoice:
    """Every entry of the matrix is stored."""

    name: ClassVar[Operator] = "dense"

    @staticmethod
    def ease(solver: SolverOptions) -> SolverOptions:
        """The settings for a second solution on another mesh: the same operator, as exact."""
        return replace(solver, operator="dense")



class HierarchicalChoice:
    """Far elements by their expansions."""

    name: ClassVar[Operator] = "hierarchical"

    @staticmethod
    def ease(solver: SolverOptions) -> SolverOptions:
        """The settings for a second solution on another mesh: the same operator, no more exact than it has to be."""
        return replace(
            solver, operator="hierarchical", tolerance=max(solver.tolerance, EASED_TOLERANCE),
            newton_tolerance=max(solver.newton_tolerance, EASED_NEWTON_TOLERANCE),
        )



def choose_operator(model: Model, mesh: Mesh) -> type[DenseChoice] | type[HierarchicalChoice]:
    """What a model is computed with: as it asks, else by its largest region."""
    solver = model.solver
    if solver.operator == "auto":
        large = 2 * int(np.bincount(mesh.node_region).max()) > DENSE_UNKNOWNS
        return HierarchicalChoice if large and solver.linear not in ("lu", "mumps") else DenseChoice
    return HierarchicalChoice if solver.operator == "hierarchical" else DenseChoice
