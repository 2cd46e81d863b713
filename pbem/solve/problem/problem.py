"""One discretised problem on the ranks: its system of equations, its constraints, and residuals."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Protocol, TypeVar

import numpy as np
from mpi4py import MPI
from scipy import sparse

from pbem.arrays import Complex, Integer, Real
from pbem.bem.interior import Values
from pbem.bem.location import Location
from pbem.contact.anchor import Anchor
from pbem.contact.approach import approach_pairs
from pbem.contact.arrangement import Arrangement
from pbem.contact.constraints import ConstraintMap
from pbem.contact.custom import asked_by_one_rank
from pbem.contact.cut_parts import CutMotion, CutParts
from pbem.contact.free_motions import FreeMotions, find_free_motions, find_ties
from pbem.contact.laws import ModeState, PairLaws, stick_creeping
from pbem.contact.loads import Load, OuterNodes, evaluate_load
from pbem.contact.modes import Linearisation
from pbem.errors import ConvergenceError
from pbem.mesh.mesh import Mesh, second_face_nodes
from pbem.mesh.numbering import number_components, split_components
from pbem.mesh.parts import Parts, find_parts
from pbem.model.model import Model
from pbem.model.rigid_body_modes import RigidBodyMode, find_plane_translations
from pbem.model.support_motions import Motion
from pbem.parallel import do_on_first, norm_of_parts
from pbem.solve.problem.tangent import TangentOperator

T = TypeVar("T")


class InteriorRows(Protocol):
    """The elastic field at this rank's interior points, from its values on the boundary."""

    def evaluate(self, displacement: Complex, traction: Complex) -> Values:
        """Displacement and stress at the points; displacement and traction (nodes,), jumps on cracks.

        Zero at points on the boundary, NaN outside. All ranks call this together.
        """


class System(Protocol):
    """The integral equations B v = 0 of all collocation points, each rank with its rows; anchors are in them for good.

    What the solution asks of them, however they are stored (pbem.solve.system.dense, pbem.solve.system.hierarchical):
    the system is chosen in pbem.bem.operator_choice, and nowhere else is it asked which it is. All ranks call all
    methods together.
    """

    @property
    def nodes(self) -> Integer:
        """The collocation points (k,) whose equations this rank holds, rising."""

    @property
    def tolerance(self) -> float:
        """Relative error of products with B that the user allows; 0 where they are exact to rounding."""

    @property
    def notes(self) -> tuple[str, ...]:
        """What the user should know of it."""

    @property
    def stored(self) -> int:
        """Bytes of this rank's matrices that a product reads."""

    @property
    def products(self) -> int:
        """How often `apply` was called so far, where a product is what the solution consists of; else 0."""

    def apply(self, v: Real) -> Real:
        """This rank's rows (2 k,) of B v, lengths, for v (4 nodes,)."""

    def free_products(self) -> None:
        """Free what `apply` alone needs, where that is much; it is not called any more."""

    def recover(self, v: Real) -> Real:
        """Mean displacement of both faces at all crack nodes in mesh order, by components; on every rank."""

    def make_tangent(self, problem: Problem) -> TangentOperator:
        """The tangent operator K = B M of the problem whose system it is."""

    def place_interior(self, model: Model, mesh: Mesh, points: Complex, location: Location) -> InteriorRows:
        """What evaluates the elastic field at this rank's points (q,) inside."""


@dataclass(frozen=True)
class Problem:
    """What stays the same through a run; equal on all ranks but for `system`, which holds this rank's rows.

    traction_scale: modulus/length, the unit of traction unknowns. equation_scale (k,): factors of its equations.
    anchors: in the system, for good; anchored: the free motions for which they were made. arrangement: of a stage in
    which not all is as the laws say, whose problem it is (see pbem.solve.problem.arranged); carried (m, 2): traction of
    the pairs that open in it at its beginning; settled_motion: where supports had moved the bodies by
    then. supports: what was found to hold the bodies, by what interfaces hold.
    """

    comm: MPI.Intracomm
    model: Model
    mesh: Mesh
    outer: OuterNodes
    laws: PairLaws
    system: System
    traction_scale: float
    equation_scale: Real
    anchors: tuple[Anchor, ...]
    anchored: tuple[RigidBodyMode, ...]
    arrangement: Arrangement | None = None
    carried: Real | None = None
    settled_motion: Motion = field(default_factory=dict)
    supports: dict[str, FreeMotions] = field(default_factory=dict)

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
        """The crack nodes of all ranks, in the order of their recovered displacements."""
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
    def cut(self) -> CutParts:
        """What holds the parts that cracks cut off."""
        return CutParts(self.model, self.mesh, self.outer, self.parts)

    def find_cut_motions(self, modes: ModeState) -> tuple[CutMotion, ...]:
        """Free motions of parts that cracks cut off, in given modes; remembered, as modes are asked of several times.
        """
        if not len(self.cut_parts):
            return ()
        return self._cut_motions(stick_creeping(self.laws, modes).mode.tobytes())

    @cached_property
    def _cut_motions(self) -> Callable[[bytes], tuple[CutMotion, ...]]:
        sign = np.ones(self.mesh.pairs.count)
        return lru_cache(maxsize=64)(
            lambda mode: self.cut.find_motions(ModeState(np.frombuffer(mode, dtype=np.int8), sign))
        )

    @cached_property
    def plane_translations(self) -> tuple[RigidBodyMode, ...]:
        """Translations of an infinite region that no prescribed displacement and no spring holds."""
        return find_plane_translations(self.model)

    def find_free_motions(self, modes: ModeState) -> FreeMotions:
        """What holds the bodies in given modes; remembered, as modes are asked of several times."""
        return self._supports(stick_creeping(self.laws, modes).mode.tobytes())

    @cached_property
    def _supports(self) -> Callable[[bytes], FreeMotions]:
        sign = np.ones(self.mesh.pairs.count)

        def find(mode: bytes) -> FreeMotions:
            ties = find_ties(self.model, self.mesh, ModeState(np.frombuffer(mode, dtype=np.int8), sign))
            key = str(sorted(ties.items())) if all(isinstance(tie, str) for tie in ties.values()) else None
            if key is None or key not in self.supports:
                support = find_free_motions(self.model, self.mesh, self.anchors, self.anchored, ties)
                if key is None:
                    return support
                self.supports[key] = support
            return self.supports[key]

        return lru_cache(maxsize=64)(find)

    @cached_property
    def approached(self) -> Real:
        """Initial openings (m,) of all pairs, once the loads have moved what only contacts hold that do not touch yet.
        """
        return approach_pairs(self.model, self.mesh, self.laws.gap)

    def constrain(self, law: Linearisation, load: Load) -> ConstraintMap:
        """The constraint map for linearised laws and a load."""
        gone = None if self.arrangement is None else self.arrangement.nodes
        return ConstraintMap(self.mesh, self.outer, self.laws.gap, law, load, self.traction_scale, gone)

    def apply(self, v: Real, load: Load, released: Real | None = None) -> Real:
        """This rank's rows of the integral equations, less the part that comes from far away; lengths (theory, 15, 44).

        released (a, r): combinations of the anchors that do not act.
        """
        result: Real = self.system.apply(v - load.known) - self.find_far(load)
        return result - self.find_released(v - load.known, released)

    def find_far(self, load: Load) -> Real:
        """This rank's part of the equations that comes from far away; lengths (theory, 15)."""
        own = self.system.nodes
        of_tractions = self.mesh.traction_equation[own]
        far = load.fields.take_far(own)
        return split_components(self.equation_scale * np.where(of_tractions, far[1], far[0]))

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
        count, own = len(self.anchors), self.system.nodes
        pattern = sparse.lil_matrix((2 * len(own), count))
        functional = sparse.lil_matrix((count, 4 * self.mesh.nodes))
        for number, anchor in enumerate(self.anchors):
            _, row, at = np.intersect1d(own, anchor.nodes, assume_unique=True, return_indices=True)
            pattern[number_components(row), number] = split_components(anchor.pattern[at])
            functional[number, number_components(anchor.nodes)] = split_components(anchor.functional)
        return pattern.tocsr(), functional.tocsr()

    def evaluate_load(self, stage: int, factor: float) -> Load:
        """What acts at a fraction of a stage; remembered, as the last one is asked for several times."""
        return self._loads(stage, factor)

    @cached_property
    def _loads(self) -> Callable[[int, float], Load]:
        def find(stage: int, factor: float) -> Load:
            load = evaluate_load(self.model, self.mesh, self.outer, stage, factor)
            if self.arrangement is None or self.carried is None:
                return load
            return self.arrangement.adapt(load, self.mesh, self.outer, (1 - factor) * self.carried)

        return lru_cache(maxsize=1)(find)

    def measure(self, part: Real) -> float:
        """Norm of a vector spread over the ranks."""
        return norm_of_parts(self.comm, part)

    def recover_crack_displacement(self, v: Real, load: Load) -> Complex:
        """Mean displacement of the two faces at all crack nodes (complex, in mesh order), on every rank.

        (theory, 13)
        """
        whole = self.system.recover(v - load.known)
        return whole[0::2] + 1j * whole[1::2] + load.fields.take_particular(self.all_crack_nodes)

    def make_tangent(self) -> TangentOperator:
        """The tangent operator that belongs to the system."""
        return self.system.make_tangent(self)
