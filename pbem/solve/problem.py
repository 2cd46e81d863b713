"""One discretised problem on the ranks: its operator, its constraints, and residuals."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TypeVar

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from scipy import sparse

from pbem.bem.hierarchical import HierarchicalOperator
from pbem.bem.operator import Block, RowOperator
from pbem.bem.pointwise import PointRows
from pbem.contact.anchor import Anchor
from pbem.contact.constraints import ConstraintMap, build_constraints
from pbem.contact.custom import asked_by_one_rank
from pbem.contact.laws import ModeState, PairLaws, stick_creeping
from pbem.contact.loads import Load, OuterNodes, evaluate_load
from pbem.contact.modes import Linearisation
from pbem.contact.support import Support, find_support, find_ties
from pbem.errors import ConvergenceError
from pbem.mesh.mesh import Mesh, second_face_nodes
from pbem.mesh.numbering import number_components, split_components
from pbem.mesh.parts import Parts, find_parts
from pbem.model.model import Model
from pbem.model.support import FreeMotion, find_plane_translations
from pbem.parallel import do_on_first, gather_parts, norm_of_parts
from pbem.solve.groups import Group

Real = NDArray[np.float64]
Integer = NDArray[np.int64]
Complex = NDArray[np.complex128]
T = TypeVar("T")


@dataclass(frozen=True)
class Problem:
    """What stays the same through a run; equal on all ranks but for `operator`, which holds this rank's rows.

    traction_scale: modulus/length, the unit of traction unknowns. equation_scale (nodes,): factors of the equations.
    crack_rows, crack_nodes: this rank's share of the rows that recover the mean displacement of crack faces; of the
    hierarchical operator crack_points take their place.
    anchors: in the operator, for good; anchored: the free motions for which they were made.
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
    anchored: tuple[FreeMotion, ...]
    crack_points: PointRows | None = None
    groups: tuple[Group, ...] = ()
    widen_groups: Callable[[int], tuple[Group, ...]] | None = None
    notes: tuple[str, ...] = ()

    @property
    def unknowns(self) -> int:
        return 2 * self.mesh.nodes

    def decide(self, action: Callable[[], T]) -> T:
        """What the first rank finds, on all ranks: another could come to other modes where rounding decides.

        What it asks of the friction laws is asked by it alone. Raises its ConvergenceError on all ranks.
        """
        def ask() -> T:
            with asked_by_one_rank(group.law for group in self.laws.strengths):
                return action()

        return do_on_first(self.comm, ConvergenceError, ask)

    @cached_property
    def all_crack_nodes(self) -> Integer:
        """The crack nodes of all ranks, in the order in which their recovered displacements are gathered."""
        return np.flatnonzero(self.mesh.node_crack)

    @cached_property
    def second_faces(self) -> Integer:
        """Nodes of the cracks' second faces in the order in which results append them."""
        return second_face_nodes(self.mesh)

    @cached_property
    def parts(self) -> Parts:
        """Into which cracks cut the regions."""
        return find_parts(self.mesh)

    @cached_property
    def cut_parts(self) -> Integer:
        """Numbers of the parts that share their region with others."""
        return np.flatnonzero(self.parts.cut)

    @cached_property
    def plane_translations(self) -> tuple[FreeMotion, ...]:
        """Translations of an infinite region that no prescribed displacement and no spring holds."""
        return find_plane_translations(self.model)

    def find_support(self, modes: ModeState) -> Support:
        """What holds the bodies in given modes; remembered, as modes are asked of several times."""
        return self._supports(stick_creeping(self.laws, modes).mode.tobytes())

    @cached_property
    def _supports(self) -> Callable[[bytes], Support]:
        sign = np.ones(self.mesh.pairs.count)

        def find(mode: bytes) -> Support:
            ties = find_ties(self.model, self.mesh, ModeState(np.frombuffer(mode, dtype=np.int8), sign))
            key = str(sorted(ties.items())) if all(isinstance(tie, str) for tie in ties.values()) else None
            if key is None or key not in known:
                support = find_support(self.model, self.mesh, self.anchors, self.anchored, ties)
                if key is None:
                    return support
                known[key] = support
            return known[key]

        known: dict[str, Support] = {}
        return lru_cache(maxsize=64)(find)

    def constrain(self, law: Linearisation, load: Load) -> ConstraintMap:
        """The constraint map for linearised laws and a load."""
        return build_constraints(self.mesh, self.outer, self.laws.gap, law, load, self.traction_scale)

    def apply(self, v: Real, load: Load, released: Real | None = None) -> Real:
        """This rank's rows of the integral equations, less the part that comes from far away; lengths (theory, 15, 44).

        released (a, r): combinations of the anchors that do not act.
        """
        own = self.operator.nodes
        far = np.where(self.mesh.traction_equation[own], load.far[1, own], load.far[0, own]) * self.equation_scale[own]
        result: Real = self.operator.apply(v - load.known) - np.stack([far.real, far.imag], axis=1).ravel()
        return result - self.find_released(v - load.known, released)

    def find_released(self, v: Real, released: Real | None) -> Real | float:
        """This rank's rows of what released combinations (a, r) of the anchors add to B v."""
        if released is None or not released.shape[1]:
            return 0.0
        pattern, functional = self.anchor_parts
        result: Real = pattern @ (released @ (released.T @ (functional @ v)))
        return result

    @cached_property
    def anchor_parts(self) -> tuple[sparse.csr_matrix, sparse.csr_matrix]:
        """Patterns (this rank's rows, a) and functionals (a, 4 nodes) of the anchors: B contains their product."""
        count, own = len(self.anchors), self.operator.nodes
        pattern = sparse.lil_matrix((2 * len(own), count))
        functional = sparse.lil_matrix((count, 4 * self.mesh.nodes))
        for number, anchor in enumerate(self.anchors):
            _, row, at = np.intersect1d(own, anchor.nodes, assume_unique=True, return_indices=True)
            pattern[number_components(row), number] = split_components(anchor.pattern[at])
            functional[number, number_components(anchor.nodes)] = split_components(anchor.functional)
        return pattern.tocsr(), functional.tocsr()

    def evaluate_load(self, stage: int, factor: float) -> Load:
        return evaluate_load(self.model, self.mesh, self.outer, stage, factor)

    def measure(self, part: Real) -> float:
        """Norm of a vector spread over the ranks."""
        return norm_of_parts(self.comm, part)

    def recover_crack_displacement(self, v: Real, load: Load) -> Complex:
        """Mean displacement of the two faces at all crack nodes (complex, in mesh order), on every rank.

        (theory, 13)
        """
        elastic = v - load.known
        part = np.zeros(2 * len(self.crack_nodes))
        for block in self.crack_rows:
            part[block.rows] = block.matrix @ elastic[block.columns]
        if self.crack_points is not None:
            mean = self.crack_points.displacement(elastic)
            part[0::2], part[1::2] = mean.real, mean.imag
        whole = gather_parts(self.comm, part)
        return whole[0::2] + 1j * whole[1::2] + load.background[self.all_crack_nodes]
