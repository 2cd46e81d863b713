"""Which operator a model is computed with; what it takes is counted in pbem.forecast."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

from pbem.bem.operator_cost import forecast_dense, forecast_hierarchical
from pbem.mesh.mesh import Mesh
from pbem.model.model import Model, Operator, SolverOptions

# The hierarchical operator, whose products have an error, is taken where the dense one would take so many times as
# long, and of models with so many unknowns at least.
WORTH_WHILE, LEAST_UNKNOWNS = 2.0, 4000
# Of the hierarchical operator a difference of meshes asks for less than the solution itself.
EASED_TOLERANCE, EASED_NEWTON_TOLERANCE = 1e-6, 1e-7
# Its search begins with the statuses of the run: in so many iterations it settles, or (a map of a thousand traces) not
# in twice as many either, and is solved with the run's.
EASED_ITERATIONS = 5


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
            newton_max_iterations=min(solver.newton_max_iterations, EASED_ITERATIONS),
        )



def choose_operator(model: Model, mesh: Mesh) -> type[DenseChoice] | type[HierarchicalChoice]:
    """What a model is computed with: as it asks, else what is forecast to take less."""
    solver = model.solver
    if solver.operator == "auto":
        if solver.linear in ("lu", "mumps") or 2 * mesh.nodes < LEAST_UNKNOWNS:
            return DenseChoice
        saves = forecast_dense(model, mesh) > WORTH_WHILE * forecast_hierarchical(model, mesh)
        return HierarchicalChoice if saves else DenseChoice
    return HierarchicalChoice if solver.operator == "hierarchical" else DenseChoice
