"""The integral equations with every entry of B stored: a block of rows per region."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from pbem.arrays import Complex, Integer, Real
from pbem.bem.direct_method import choose_method
from pbem.bem.interior import InteriorRows
from pbem.bem.location import Location
from pbem.bem.operator import RegionRows, RowOperator, add_anchor, assemble_displacement_rows, assemble_rows
from pbem.bem.rigid_motions import find_rigid_motions, free_rotations, need_rotations
from pbem.clock import clock
from pbem.contact.anchor import Anchor
from pbem.contact.dependence import find_unknowns_of_regions
from pbem.contact.laws import PairLaws, find_changing
from pbem.contact.loads import OuterNodes, evaluate_load, find_needed_columns
from pbem.mesh.mesh import Mesh
from pbem.model.model import Model
from pbem.parallel import gather_parts, share_nodes
from pbem.solve.petsc.session import list_factor_options, list_options
from pbem.solve.petsc.shares import cut_equally, refuse_shares
from pbem.solve.problem.problem import Problem
from pbem.solve.problem.tangent import TangentOperator
from pbem.solve.tangent.condensed import CondensedTangent
from pbem.solve.tangent.factored import FactoredTangent
from pbem.solve.tangent.reference import TangentRows
from pbem.solve.tangent.release import ReleasedTangent

# Contact unknowns are few up to this part of all: all their columns then cost less than the factors.
FEW = 0.25


@dataclass(frozen=True)
class DenseSystem:
    """See pbem.solve.problem.problem.System.

    block_unknowns: for every block of the operator, the unknowns (rising) on which its region can depend. crack_rows:
    of the mean displacement at this rank's share of the crack nodes.
    """

    comm: MPI.Intracomm
    operator: RowOperator
    block_unknowns: tuple[Integer, ...]
    crack_rows: tuple[RegionRows, ...]

    @staticmethod
    def refuse_ranks(model: Model, mesh: Mesh, ranks: int) -> str | None:
        """What to say when a model cannot be shared by so many ranks; None if it can."""
        lu = choose_method(model.solver.linear, mesh.region_nodes, bool(list_factor_options())) == "lu"
        return refuse_shares(mesh.nodes, ranks, lu and not factors_in_panels(model))

    @staticmethod
    def assemble(
        comm: MPI.Intracomm, model: Model, mesh: Mesh, outer: OuterNodes, laws: PairLaws, anchors: tuple[Anchor, ...]
    ) -> DenseSystem:
        """This rank's rows; shares are balanced by the number of entries."""
        materials, finite = [region.material for region in model.regions], model.finite_regions
        node_region = mesh.node_region
        costs = np.bincount(node_region, minlength=len(materials)).astype(float)[node_region]
        offsets = share_nodes(costs, comm.size)
        first, last = int(offsets[comm.rank]), int(offsets[comm.rank + 1])
        needed = need_rotations(mesh, finite, find_needed_columns(model, mesh, outer))
        operator = assemble_rows(mesh, materials, first, last, needed, model.size, finite)
        free_rotations(operator, find_rigid_motions(mesh, finite, needed), 4 * mesh.nodes)
        for anchor in anchors:
            add_anchor(operator, mesh, anchor.region, anchor.nodes, anchor.pattern, anchor.functional)
        own_cracks = cut_equally(np.flatnonzero(mesh.node_crack), comm)
        unknowns = find_unknowns_of_regions(mesh, outer, laws.leader, evaluate_load(model, mesh, outer, 0, 1.0))
        return DenseSystem(
            comm=comm,
            operator=operator,
            block_unknowns=tuple(unknowns[block.region] for block in operator.blocks),
            crack_rows=tuple(assemble_displacement_rows(mesh, materials, own_cracks, needed)),
        )

    @property
    def nodes(self) -> Integer:
        """See System."""
        return self.operator.nodes

    @property
    def tolerance(self) -> float:
        """See System."""
        return 0.0

    @property
    def notes(self) -> tuple[str, ...]:
        """See System."""
        return ()

    @property
    def tangent_rows(self) -> TangentRows:
        """What tangent operators are made of."""
        return TangentRows(self.operator, self.block_unknowns)

    @property
    def stored(self) -> int:
        """See System."""
        return sum(block.matrix.nbytes for block in self.operator.blocks)

    @property
    def products(self) -> int:
        """See System."""
        return 0

    def apply(self, v: Real) -> Real:
        """See System; also for many v (4 nodes, c) at a time."""
        with clock.piece("product", self.stored):
            return self.operator.apply(v)

    def free_products(self) -> None:
        """See System: the tangent operator may have used the matrices' storage."""

    def recover(self, v: Real) -> Real:
        """See System (theory, 13)."""
        part = np.zeros(sum(len(block.rows) for block in self.crack_rows))
        for block in self.crack_rows:
            part[block.rows] = block.matrix @ v[block.columns]
        return gather_parts(self.comm, part)

    def make_tangent(self, problem: Problem) -> TangentOperator:
        """Condensed, or by GMRES if that is asked for; freed from the anchors if there are any."""
        rows, laws = self.tangent_rows, problem.laws
        varying = find_changing(laws)
        tangent: TangentOperator
        if asks_for_gmres(problem.model):
            tangent = FactoredTangent(problem, rows)
        else:
            few = 2 * np.count_nonzero(varying) <= FEW * problem.unknowns
            panels = problem.comm.size > 1 and factors_in_panels(problem.model)
            tangent = CondensedTangent(problem, rows, varying, few, panels)
        return ReleasedTangent(problem, tangent) if problem.anchors else tangent

    def place_interior(self, model: Model, mesh: Mesh, points: Complex, location: Location) -> InteriorRows:
        """See System."""
        return place_directly(model, mesh, points, location)


def asks_for_gmres(model: Model) -> bool:
    """Whether a Krylov solver does the work: its options are heeded where it does."""
    return model.solver.linear == "gmres" or any(name.startswith(("ksp_", "pc_type")) for name in list_options())


def factors_in_panels(model: Model) -> bool:
    """Whether several ranks factorise a dense matrix without PETSc, whose options are heeded where it does the work."""
    return not asks_for_gmres(model) and not any(name.startswith(("pc_", "mat_")) for name in list_options())


def place_directly(model: Model, mesh: Mesh, points: Complex, location: Location) -> InteriorRows:
    """The elastic field at interior points (q,), by every element of their regions."""
    everywhere = np.ones(4 * mesh.nodes, dtype=bool)
    rigid = find_rigid_motions(mesh, model.finite_regions, everywhere)
    return InteriorRows(mesh, [region.material for region in model.regions], points, location, rigid)
