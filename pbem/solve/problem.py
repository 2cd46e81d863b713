"""One discretised problem on the ranks: its operator, its constraints, and residuals."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from pbem.bem.hierarchical import HierarchicalOperator
from pbem.bem.operator import Block, RowOperator
from pbem.bem.pointwise import PointRows
from pbem.contact.anchor import Anchor
from pbem.contact.constraints import ConstraintMap, build_constraints
from pbem.contact.laws import PairLaws
from pbem.contact.loads import Load, OuterNodes, evaluate_load
from pbem.contact.modes import Linearisation
from pbem.contact.support import describe_free_motions
from pbem.mesh.mesh import Mesh, second_face_nodes
from pbem.model.model import Model
from pbem.model.support import Tie
from pbem.parallel import gather_parts, norm_of_parts
from pbem.solve.groups import Group

Real = NDArray[np.float64]
Integer = NDArray[np.int64]
Complex = NDArray[np.complex128]


@dataclass(frozen=True)
class Problem:
    """What stays the same through a run; equal on all ranks but for `operator`, which holds this rank's rows.

    traction_scale: modulus/length, the unit of traction unknowns. equation_scale (nodes,): factors of the equations.
    crack_rows, crack_nodes: this rank's share of the rows that recover the mean displacement of crack faces; of the
    hierarchical operator crack_points take their place.
    block_columns: for every block of a dense operator, the unknowns on which its region depends.
    groups: this rank's groups of elements, of the hierarchical operator; widen_groups makes them with so many
    times as many around them. notes: what the user should know of it.
    """

    comm: MPI.Intracomm
    model: Model
    mesh: Mesh
    outer: OuterNodes
    laws: PairLaws
    operator: RowOperator | HierarchicalOperator
    crack_rows: tuple[Block, ...]
    crack_nodes: Integer
    traction_scale: float
    equation_scale: Real
    block_columns: tuple[Integer, ...]
    anchors: tuple[Anchor, ...]
    crack_points: PointRows | None = None
    groups: tuple[Group, ...] = ()
    widen_groups: Callable[[int], tuple[Group, ...]] | None = None
    notes: tuple[str, ...] = ()

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
        own = self.operator.nodes
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
        if self.crack_points is not None:
            mean = self.crack_points.displacement(elastic)
            part[0::2], part[1::2] = mean.real, mean.imag
        whole = gather_parts(self.comm, part)
        return whole[0::2] + 1j * whole[1::2] + load.background[self.all_crack_nodes]
