"""A second solution on a coarser mesh, step by step beside the first: what differs measures the discretisation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from mpi4py import MPI

from pbem.contact.laws import SLIP, Memory, ModeState, commit, start_memory
from pbem.contact.loads import Load
from pbem.errors import ConvergenceError
from pbem.parallel import StopSignals
from pbem.solve.assembly import assemble_problem
from pbem.solve.beside import Beside
from pbem.solve.krylov import make_tangent
from pbem.solve.march import describe_step
from pbem.solve.newton import Solution, solve_step
from pbem.solve.problem import Problem
from pbem.solve.step import ContactState, SilentReporter, Step
from pbem.solve.tangent import AnyTangent
from pbem.solve.watch import Watch


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
        self._watch = Watch(comm, SilentReporter(), StopSignals())
        self._watch.look_after(self.problem.laws)
        if start is not None:
            self._take_over(start.contact)

    def follow(self, step: Step) -> Step:
        """The same load step on the coarser mesh, from its own memory, begun with the run's modes.

        Raises ConvergenceError; the next step then starts from the run's memory, carried over. Raises LawError where a
        custom law fails with what it is asked here; there is no further step then.
        """
        load = self.problem.evaluate_load(step.stage, step.factor)
        try:
            solution = self._solve(step, load)
        except ConvergenceError:
            self._watch.check()  # a law that failed has answered with no strength
            self._take_over(step.contact)
            raise
        self.memory = commit(self.problem.laws, solution.memory, solution.modes, solution.pairs)
        self._watch.check()
        return describe_step(self.problem, solution, self.memory, step.number, step.stage, step.factor)

    def _solve(self, step: Step, load: Load) -> Solution:
        begun = replace(self.memory, modes=self._guess_modes(step.contact))
        try:
            return solve_step(self.problem, self.tangent, begun, load, self._watch)
        except ConvergenceError:
            self._watch.check()
            return solve_step(self.problem, self.tangent, self.memory, load, self._watch)

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
