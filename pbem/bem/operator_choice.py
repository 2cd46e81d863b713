"""Which operator a model is computed with, and what it takes to store."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from pbem.bem.hierarchical import RATIO, choose_terms, sort_elements
from pbem.bem.operator_cost import forecast_dense, forecast_hierarchical
from pbem.bem.tree import find_interactions
from pbem.mesh.mesh import Mesh
from pbem.model.model import Model, Operator, SolverOptions

# The hierarchical operator, whose products have an error, is taken where the dense one would take so many times as
# long, and of models with so many unknowns at least.
WORTH_WHILE, LEAST_UNKNOWNS = 2.0, 4000
# Bytes an unknown of mesh, laws, constraint map and trees that each rank keeps for the whole model; measured by
# scripts/extrapolate.py.
KEPT_EVERYWHERE = 2300.0
# Of the hierarchical operator a difference of meshes asks for less than the solution itself.
EASED_TOLERANCE, EASED_NEWTON_TOLERANCE = 1e-6, 1e-7


@dataclass(frozen=True)
class Memory:
    """stored: names, and bytes over all ranks; note: what there is beside; everywhere: bytes on every rank."""

    stored: tuple[tuple[str, float], ...]
    note: str
    everywhere: float = 0.0


class DenseChoice:
    """Every entry of the matrix is stored."""

    name: ClassVar[Operator] = "dense"

    @staticmethod
    def ease(solver: SolverOptions) -> SolverOptions:
        """The settings for a second solution on another mesh: the same operator, as exact."""
        return replace(solver, operator="dense")

    @staticmethod
    def estimate_memory(model: Model, mesh: Mesh) -> Memory:
        """What a run takes."""
        operator, tangent = estimate_dense_memory(model, mesh)
        kind, factors = (
            ("dense", "factored in its place") if len(model.regions) == 1
            else ("sparse, by regions", "and its factors once more or a few times that")
        )
        return Memory((("operator", operator), (f"tangent operator ({kind})", tangent)), factors)


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

    @staticmethod
    def estimate_memory(model: Model, mesh: Mesh) -> Memory:
        """What a run takes."""
        stored = (("hierarchical operator", estimate_hierarchical_memory(model, mesh)),)
        return Memory(stored, "preconditioner and GMRES up to as much again", KEPT_EVERYWHERE * 2 * mesh.nodes)


def choose_operator(model: Model, mesh: Mesh) -> type[DenseChoice] | type[HierarchicalChoice]:
    """What a model is computed with: as it asks, else what is forecast to take less."""
    solver = model.solver
    if solver.operator == "auto":
        if solver.linear in ("lu", "mumps") or 2 * mesh.nodes < LEAST_UNKNOWNS:
            return DenseChoice
        saves = forecast_dense(model, mesh) > WORTH_WHILE * forecast_hierarchical(model, mesh)
        return HierarchicalChoice if saves else DenseChoice
    return HierarchicalChoice if solver.operator == "hierarchical" else DenseChoice


def estimate_hierarchical_memory(model: Model, mesh: Mesh) -> float:
    """Bytes of the hierarchical operator's matrices over all ranks: near elements, coefficients, fields at leaves."""
    terms = choose_terms(model.solver.tolerance)
    parts = sort_elements(mesh, [region.material for region in model.regions], terms)
    forest = parts.forest
    met = find_interactions(forest, forest, RATIO)
    per_element = mesh.order + 1
    bounding = np.array([2 - mesh.crack[forest.items(cluster)].mean() for cluster in range(forest.clusters)])
    columns = 2.0 * per_element * (forest.last - forest.first) * bounding  # u, and t where there is no crack
    rows = 2.0 * per_element * (forest.last - forest.first)
    leaves = forest.leaves
    near = float((rows[met.near_target] * columns[met.near_source]).sum())
    ends = float((4 * (terms + 1) * (rows + columns)[leaves]).sum())
    shifts = 2.0 * forest.clusters * (terms + 1) ** 2
    return 8.0 * (near + ends + shifts)


def estimate_dense_memory(model: Model, mesh: Mesh) -> tuple[float, float]:
    """Bytes of the operator B = [H, -G] and of the tangent operator K, over all ranks.

    B is dense per region; a crack's nodes have no columns in G. K is dense with one region, and with several it is
    stored by rows with the unknowns of both sides where an interface meets the region (4 bytes an index more).
    """
    nodes = np.bincount(mesh.node_region, minlength=len(model.regions)).astype(float)
    cracks = np.bincount(mesh.node_region[mesh.node_crack], minlength=len(model.regions))
    shared = np.zeros(mesh.nodes, dtype=bool)
    shared[mesh.pairs.first[~mesh.pairs.crack]] = True
    shared[mesh.pairs.second[~mesh.pairs.crack]] = True
    interface = np.bincount(mesh.node_region[shared], minlength=len(model.regions))
    operator = 8.0 * float((2 * nodes * (4 * nodes - 2 * cracks)).sum())
    entries = float((2 * nodes * (2 * nodes + 2 * interface)).sum())
    return operator, 8.0 * entries if len(model.regions) == 1 else 12.0 * entries
