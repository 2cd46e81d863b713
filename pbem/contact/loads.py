"""The load history: prescribed values of every outer node and fluid pressure of every pair at any time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbem.mesh.mesh import Mesh
from pbem.model.model import Model

Real = NDArray[np.float64]
Integer = NDArray[np.int64]
Bool = NDArray[np.bool_]


@dataclass(frozen=True)
class OuterNodes:
    """Nodes (k,) on curves of one region, with their two directions and what is known along each.

    direction (k, 2): complex unit vectors. displacement_known (k, 2). condition (k,): index of the condition.
    """

    node: Integer
    direction: NDArray[np.complex128]
    displacement_known: Bool
    condition: Integer


@dataclass(frozen=True)
class Load:
    """values (k, 2): known displacement or traction of the outer nodes; pressure (m,): fluid pressure of the pairs."""

    values: Real
    pressure: Real


def collect_outer_nodes(model: Model, mesh: Mesh) -> OuterNodes:
    """All nodes of outer curves, in mesh order."""
    conditions = list(model.conditions.values())
    number = {mesh.curve_names.index(condition.curve): k for k, condition in enumerate(conditions)}
    curve = mesh.node_curve
    node = np.flatnonzero(np.isin(curve, list(number)))
    which = np.array([number[c] for c in curve[node]], dtype=np.int64)
    local = np.array([condition.frame == "local" for condition in conditions])[which] if conditions else which > 0
    first = np.where(local, mesh.normal[node], 1.0)
    known = np.array([[quantity == "displacement" for quantity in c.known] for c in conditions]).reshape(-1, 2)
    return OuterNodes(node, np.stack([first, 1j * first], axis=1), known[which], which)


def evaluate_load(model: Model, mesh: Mesh, outer: OuterNodes, stage: int, factor: float) -> Load:
    """Values at the fraction `factor` of a stage, linear between the ends of the stages (zero before the first)."""
    after = model.stages[stage]
    before = model.stages[stage - 1] if stage > 0 else None
    values = np.zeros((len(model.conditions), 2))
    for row, name in enumerate(model.conditions):
        old = np.array(before.boundary.get(name, (0.0, 0.0))) if before else np.zeros(2)
        values[row] = old + factor * (np.array(after.boundary.get(name, (0.0, 0.0))) - old)
    pressure = np.zeros(len(mesh.interface_names))
    for row, name in enumerate(mesh.interface_names):
        reached = before.pressure.get(name, 0.0) if before else 0.0
        pressure[row] = reached + factor * (after.pressure.get(name, 0.0) - reached)
    return Load(values[outer.condition], pressure[mesh.pairs.interface])


def find_needed_columns(model: Model, mesh: Mesh, outer: OuterNodes) -> Bool:
    """Entries (4 nodes,) of v = (u, t) that can differ from zero at any time of the load history."""
    needed = np.ones(4 * mesh.nodes, dtype=bool)
    ever = np.zeros((len(outer.node), 2), dtype=bool)
    for stage in range(len(model.stages)):
        ever |= evaluate_load(model, mesh, outer, stage, 1.0).values != 0
    parts = np.stack([outer.direction.real, outer.direction.imag], axis=2) != 0  # (k, direction, component)
    for first, free in ((0, ~outer.displacement_known), (2 * mesh.nodes, outer.displacement_known)):
        wanted = ((free | ever)[:, :, None] & parts).any(axis=1)
        needed[first + 2 * outer.node[:, None] + np.arange(2)] = wanted
    return needed
