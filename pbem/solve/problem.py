"""One discretised problem on the ranks: its operator, its constraints, and residuals."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from pbem.bem.operator import (
    Block,
    RowOperator,
    add_anchor,
    assemble_displacement_rows,
    assemble_rows,
    scale_equations,
)
from pbem.contact.anchor import Anchor, anchor_motions
from pbem.contact.constraints import ConstraintMap, build_constraints
from pbem.contact.laws import PairLaws, collect_laws
from pbem.contact.loads import Load, OuterNodes, collect_outer_nodes, evaluate_load, find_needed_columns
from pbem.contact.modes import Linearisation
from pbem.contact.support import describe_free_motions
from pbem.mesh.mesh import Mesh, second_face_nodes
from pbem.model.model import Model
from pbem.model.support import Tie, find_free_motions
from pbem.parallel import gather_parts, norm_of_parts, share_nodes

Real = NDArray[np.float64]
Integer = NDArray[np.int64]
Complex = NDArray[np.complex128]


@dataclass(frozen=True)
class Problem:
    """What stays the same through a run; equal on all ranks but for `operator`, which holds this rank's rows.

    traction_scale: modulus/length, the unit of traction unknowns. equation_scale (nodes,): factors of the equations.
    crack_rows, crack_nodes: this rank's share of the rows that recover the mean displacement of crack faces.
    block_columns: for every block of the operator, the unknowns on which its region depends.
    """

    comm: MPI.Intracomm
    model: Model
    mesh: Mesh
    outer: OuterNodes
    laws: PairLaws
    operator: RowOperator
    crack_rows: tuple[Block, ...]
    crack_nodes: Integer
    traction_scale: float
    equation_scale: Real
    block_columns: tuple[Integer, ...]
    anchors: tuple[Anchor, ...]

    @property
    def unknowns(self) -> int:
        return 2 * self.mesh.nodes

    @cached_property
    def all_crack_nodes(self) -> Integer:
        """The crack nodes of all ranks, in the order in which their recovered displacements are gathered."""
        return np.flatnonzero(self.mesh.node_crack)

    @cached_property
    def second_faces(self) -> Integer:
        """Nodes of the cracks' second faces in the order in which results append them."""
        return second_face_nodes(self.mesh)

    @cached_property
    def free_motions(self) -> Callable[[tuple[tuple[str, Tie], ...]], str | None]:
        """What moves freely for given ties of the interfaces (name and tie); remembered, as modes rarely change it."""
        return lru_cache(lambda ties: describe_free_motions(self.model, dict(ties), len(self.anchors)))

    def constrain(self, law: Linearisation, load: Load) -> ConstraintMap:
        """The constraint map for linearised laws and a load."""
        return build_constraints(self.mesh, self.outer, self.laws.gap, law, load, self.traction_scale)

    def apply(self, v: Real, load: Load) -> Real:
        """This rank's rows of the integral equations, less the part that comes from far away; lengths."""
        first, last = self.operator.first_node, self.operator.last_node
        own = slice(first, last)
        far = np.where(self.mesh.traction_equation[own], load.far[1, own], load.far[0, own]) * self.equation_scale[own]
        result: Real = self.operator.apply(v - load.known) - np.stack([far.real, far.imag], axis=1).ravel()
        return result

    def evaluate_load(self, stage: int, factor: float) -> Load:
        return evaluate_load(self.model, self.mesh, self.outer, stage, factor)

    def measure(self, part: Real) -> float:
        """Norm of a vector spread over the ranks."""
        return norm_of_parts(self.comm, part)

    def recover_crack_displacement(self, v: Real, load: Load) -> Complex:
        """Mean displacement of the two faces at all crack nodes (complex, in mesh order), on every rank."""
        elastic = v - load.known
        part = np.zeros(2 * len(self.crack_nodes))
        for block in self.crack_rows:
            part[block.rows] = block.matrix @ elastic[block.columns]
        whole = gather_parts(self.comm, part)
        return whole[0::2] + 1j * whole[1::2] + load.background[self.all_crack_nodes]


def assemble_problem(model: Model, mesh: Mesh, comm: MPI.Intracomm) -> Problem:
    """Assemble this rank's rows; shares are balanced by the number of matrix entries."""
    materials = [region.material for region in model.regions]
    outer = collect_outer_nodes(model, mesh)
    needed = find_needed_columns(model, mesh, outer)
    node_region = mesh.node_region
    costs = np.bincount(node_region, minlength=len(materials)).astype(float)[node_region]
    offsets = share_nodes(costs, comm.size)
    first, last = int(offsets[comm.rank]), int(offsets[comm.rank + 1])
    anchors = anchor_motions(mesh, find_free_motions(model))
    operator = assemble_rows(mesh, materials, first, last, needed, model.size)
    for anchor in anchors:
        add_anchor(operator, mesh, anchor.region, anchor.nodes, anchor.pattern, anchor.functional)
    crack_nodes = np.flatnonzero(mesh.node_crack)
    shares = np.linspace(0, len(crack_nodes), comm.size + 1).astype(int)
    own_cracks = crack_nodes[shares[comm.rank] : shares[comm.rank + 1]]
    unknowns = find_unknowns_of_regions(mesh, outer, evaluate_load(model, mesh, outer, 0, 1.0))
    modulus = float(np.exp(np.mean([np.log(material.shear_modulus) for material in materials])))
    return Problem(
        comm=comm,
        model=model,
        mesh=mesh,
        outer=outer,
        laws=collect_laws(model, mesh),
        operator=operator,
        crack_rows=tuple(assemble_displacement_rows(mesh, materials, own_cracks, needed)),
        crack_nodes=own_cracks,
        traction_scale=modulus / model.size,
        equation_scale=scale_equations(mesh, materials, model.size),
        anchors=anchors,
        block_columns=tuple(unknowns[block.region] for block in operator.blocks),
    )


def find_unknowns_of_regions(mesh: Mesh, outer: OuterNodes, load: Load) -> list[Integer]:
    """Unknowns, in rising order, on which each region's displacements and tractions can depend in any mode."""
    # A law that depends on everything has the entries of all modes at once.
    everything = np.tile(1 + 0.1 * np.arange(8.0).reshape(4, 2), (mesh.pairs.count, 1, 1))
    law = Linearisation(everything, np.zeros((mesh.pairs.count, 4)))
    matrix = build_constraints(mesh, outer, np.zeros(mesh.pairs.count), law, load, 1.0).matrix
    region_of_row = np.tile(np.repeat(mesh.node_region, 2), 2)
    return [
        np.unique(matrix[np.flatnonzero(region_of_row == region)].indices) for region in range(len(mesh.region_names))
    ]
