"""A second solution on a coarser mesh, step by step beside the first: what differs measures the discretisation."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from pbem.bem.choice import is_hierarchical
from pbem.contact.laws import SLIP, Memory, ModeState, commit, start_memory
from pbem.errors import ConvergenceError
from pbem.mesh.carry import Carry, carry_nodes
from pbem.mesh.generate import generate_mesh
from pbem.mesh.mesh import Mesh
from pbem.model.model import Model
from pbem.model.refinement import CoarseModel, coarsen_model
from pbem.solve.assembly import assemble_problem
from pbem.solve.krylov import make_tangent
from pbem.solve.march import describe_step
from pbem.solve.newton import Solution, solve_step
from pbem.solve.problem import Problem
from pbem.solve.step import ContactState, SilentReporter, Step
from pbem.solve.tangent import AnyTangent

Bool = NDArray[np.bool_]
Integer = NDArray[np.int64]
Real = NDArray[np.float64]

# The second solution starts from the modes of the first, so that it settles soon or never.
MOST_ITERATIONS = 12
# Of a hierarchical operator a difference of meshes asks for less than the solution itself.
TOLERANCE, NEWTON_TOLERANCE = 1e-6, 1e-7

NOTHING_COARSER = "elements cannot be merged in pairs, and the order cannot be lowered"


@dataclass(frozen=True)
class Beside:
    """A coarser model and mesh beside those of a run, and how values of the run are read there.

    kind: how it was made, see `pbem.model.refinement`. carry: to the coarse mesh's nodes. seen (c,): of each of its
    pairs, whether all fine pairs that it is compared with are there. pair_of_node (n,): the fine pair whose first node
    a fine node is, or -1. nearest (c,): the nearest fine pair, or -1.
    """

    kind: str
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
        at_nodes[self.fine.pairs.first] = values
        matrix = self.carry.rooted if jumps else self.carry.plain
        return np.asarray((matrix @ at_nodes)[self.mesh.pairs.first])


def put_beside(model: Model, mesh: Mesh) -> Beside | None:
    """A coarser model beside a given one; None if there is none (NOTHING_COARSER)."""
    coarse = coarsen_model(model)
    if coarse is None:
        return None
    second = _ease_solver(coarse, is_hierarchical(model, mesh))
    second_mesh = generate_mesh(second)
    carry = carry_nodes(model, mesh, second, second_mesh)
    pair_of_node = np.full(mesh.nodes, -1)
    pair_of_node[mesh.pairs.first] = np.arange(mesh.pairs.count)
    first = second_mesh.pairs.first
    lacking = (abs(carry.plain) @ (pair_of_node < 0).astype(float))[first]
    nearest = pair_of_node[carry.nearest[first]]
    return Beside(coarse.kind, second, second_mesh, mesh, carry, lacking == 0, pair_of_node, nearest)


def _ease_solver(coarse: CoarseModel, hierarchical: bool) -> Model:
    solver = coarse.model.solver
    eased = replace(
        solver,
        operator="hierarchical" if hierarchical else "dense",
        tolerance=max(solver.tolerance, TOLERANCE) if hierarchical else solver.tolerance,
        newton_tolerance=max(solver.newton_tolerance, NEWTON_TOLERANCE) if hierarchical else solver.newton_tolerance,
        newton_max_iterations=min(solver.newton_max_iterations, MOST_ITERATIONS),
    )
    return replace(coarse.model, solver=eased, interior_points=(), interior_grid=None, notes=())


class SecondSolution:
    """Marches on the coarser mesh behind a run; all ranks together, with the same numbers on all."""

    def __init__(self, beside: Beside, comm: MPI.Intracomm, start: Step | None = None) -> None:
        """Begins at rest, or with the memory of a step of the run, carried over.

        Raises ConvergenceError where the operator cannot be assembled well enough.
        """
        self.beside = beside
        self.problem: Problem = assemble_problem(beside.model, beside.mesh, comm)
        self.tangent: AnyTangent = make_tangent(self.problem)
        self.memory: Memory = start_memory(self.problem.laws)
        if start is not None:
            self._take_over(start.contact)

    def follow(self, step: Step) -> Step:
        """The same load step on the coarser mesh, from its own memory, begun with the run's modes.

        Raises ConvergenceError; the next step then starts from the run's memory, carried over.
        """
        load = self.problem.evaluate_load(step.stage, step.factor)
        try:
            solution = self._solve(step, load)
        except ConvergenceError:
            self._take_over(step.contact)
            raise
        self.memory = commit(self.problem.laws, solution.memory, solution.modes, solution.pairs)
        return describe_step(self.problem, solution, self.memory, step.number, step.stage, step.factor)

    def _solve(self, step: Step, load: object) -> Solution:
        silent = SilentReporter()
        begun = replace(self.memory, modes=self._guess_modes(step.contact))
        try:
            return solve_step(self.problem, self.tangent, begun, load, silent)  # type: ignore[arg-type]
        except ConvergenceError:
            return solve_step(self.problem, self.tangent, self.memory, load, silent)  # type: ignore[arg-type]

    def _guess_modes(self, contact: ContactState) -> ModeState:
        nearest, own = self.beside.nearest, self.memory.modes
        known = (nearest >= 0) & ~self.problem.laws.bonded & ~self.problem.laws.parted
        mode = np.where(known, contact.mode[nearest], own.mode).astype(np.int8)
        sign = np.where(contact.traction_s[nearest] < 0, -1.0, 1.0)
        return ModeState(mode, np.where(known & (mode == SLIP), sign, own.sign))

    def _take_over(self, contact: ContactState) -> None:
        """The memory of the run's pairs, carried over."""
        beside, laws = self.beside, self.problem.laws
        slip = beside.carry_pairs(contact.slip, jumps=True)
        tangential = beside.carry_pairs(contact.traction_s, jumps=False)
        broken = laws.brittle & (beside.nearest >= 0) & contact.broken[beside.nearest]
        self.memory = Memory(
            self._guess_modes(contact), slip - laws.compliance_s * tangential,
            np.maximum(beside.carry_pairs(contact.slip_path, jumps=True), 0.0), broken,
            beside.carry_pairs(contact.traction_n, jumps=False),
        )

    def destroy(self) -> None:
        """Free the storage; after an exception of one rank it is not called."""
        self.tangent.destroy()
