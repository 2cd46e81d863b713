"""A coarser model and mesh beside those of a run, on which a second solution measures the discretisation."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from pbem.arrays import Bool, Integer, Real
from pbem.bem.operator_choice import choose_operator
from pbem.mesh.carry import Carry, carry_nodes
from pbem.mesh.generate import generate_mesh
from pbem.mesh.mesh import Mesh
from pbem.model.model import Contact, Model
from pbem.model.refinement import coarsen_model

# The second solution starts from the modes of the first, so that it settles soon or never.
MOST_ITERATIONS = 8

NOTHING_COARSER = "elements cannot be merged in pairs, and the order cannot be lowered"


@dataclass(frozen=True)
class Beside:
    """A coarser model and mesh beside those of a run, and how values of the run are read there.

    kind: how it was made, see `pbem.model.refinement`. carry: to the coarse mesh's nodes. seen (c,): of each of its
    pairs, whether all fine pairs that it is compared with are there. pair_of_node (n,): the fine pair whose slave node
    a fine node is, or -1. nearest (c,): the nearest fine pair, or -1.
    """

    kind: Literal["merged", "order"]
    model: Model
    mesh: Mesh
    fine: Mesh
    carry: Carry
    seen: Bool
    pair_of_node: Integer
    nearest: Integer

    def carry_pairs(self, values: Real, jumps: bool) -> Real:
        """Values (m,) of the fine pairs at the coarse pairs (c,); zero where there is no pair.

        jumps: on crack-tip elements with the shape of the square root.
        """
        at_nodes = np.zeros(self.fine.nodes)
        at_nodes[self.fine.pairs.slave] = values
        matrix = self.carry.rooted if jumps else self.carry.plain
        return np.asarray((matrix @ at_nodes)[self.mesh.pairs.slave])


def put_beside(model: Model, mesh: Mesh) -> Beside | None:
    """A coarser model beside a given one; None if there is none (NOTHING_COARSER)."""
    coarse = coarsen_model(model)
    if coarse is None:
        return None
    eased = choose_operator(model, mesh).ease(coarse.model.solver)
    eased = replace(eased, newton_max_iterations=min(eased.newton_max_iterations, MOST_ITERATIONS))
    contacts = _keep_slaves(coarse.model, mesh)
    second = replace(coarse.model, solver=eased, interior_points=(), interior_grid=None, notes=(), contacts=contacts)
    return relate_meshes(coarse.kind, model, mesh, second, generate_mesh(second))


def _keep_slaves(model: Model, mesh: Mesh) -> dict[str, Contact]:
    """Contacts whose pairs belong to the same curve as those of a mesh: on the other one nothing can be compared."""
    curve = mesh.node_curve
    found = {}
    for name, contact in model.contacts.items():
        slaves = mesh.pairs.slave[mesh.pairs.interface == mesh.interface_names.index(name)]
        found[name] = replace(contact, slave=mesh.curve_names[curve[slaves[0]]]) if len(slaves) else contact
    return found


def relate_meshes(
    kind: Literal["merged", "order"], model: Model, mesh: Mesh, second: Model, second_mesh: Mesh
) -> Beside:
    """What reads values of a run on the mesh of another model, each of whose elements is made of whole ones."""
    carry = carry_nodes(model, mesh, second, second_mesh)
    pair_of_node = np.full(mesh.nodes, -1)
    pair_of_node[mesh.pairs.slave] = np.arange(mesh.pairs.count)
    slave = second_mesh.pairs.slave
    lacking = (abs(carry.plain) @ (pair_of_node < 0).astype(float))[slave]
    nearest = pair_of_node[carry.nearest[slave]]
    return Beside(kind, second, second_mesh, mesh, carry, lacking == 0, pair_of_node, nearest)
