"""The system of equations of the operator that is chosen in pbem.bem.operator_choice."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pbem.bem.operator_choice import choose_operator
from pbem.mesh.mesh import Mesh
from pbem.model.model import Model
from pbem.solve.system.dense import DenseSystem

if TYPE_CHECKING:
    from pbem.solve.system.hierarchical import HierarchicalSystem


def choose_system(model: Model, mesh: Mesh) -> type[DenseSystem] | type[HierarchicalSystem]:
    """As the model asks, else what is forecast to take less; the class assembles the system."""
    if choose_operator(model, mesh).name == "dense":
        return DenseSystem
    from pbem.solve.system.hierarchical import HierarchicalSystem  # here, as most models are small

    return HierarchicalSystem
