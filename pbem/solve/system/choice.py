"""The system of equations of the operator that is chosen in pbem.bem.operator_choice."""

from __future__ import annotations

from pbem.bem.operator_choice import choose_operator
from pbem.mesh.mesh import Mesh
from pbem.model.model import Model
from pbem.solve.system.dense import DenseSystem
from pbem.solve.system.hierarchical import HierarchicalSystem

SYSTEMS: dict[str, type[DenseSystem] | type[HierarchicalSystem]] = {
    "dense": DenseSystem, "hierarchical": HierarchicalSystem,
}


def choose_system(model: Model, mesh: Mesh) -> type[DenseSystem] | type[HierarchicalSystem]:
    """As the model asks, else what is forecast to take less; the class assembles the system."""
    return SYSTEMS[choose_operator(model, mesh).name]
