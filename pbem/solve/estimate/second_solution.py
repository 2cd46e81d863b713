"""A second solution on a coarser mesh, step by step beside the first: what differs measures the discretisation."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from pbem.contact.constraints import evaluate_pairs
from pbem.contact.declaration import BROKEN, list_variables
from pbem.contact.laws import SLIP, Memory, ModeState, commit, find_creeping, follow_leaders, start_memory
from pbem.contact.loads import Load
from pbem.contact.modes import linearise, measure_law_error
from pbem.errors import ConvergenceError
from pbem.heap import heap
from pbem.parallel import StopSignals, do_on_first
from pbem.solve.estimate.coarser_mesh import Beside
from pbem.solve.launch.watch import Watch
from pbem.solve.nonlinear.hold import Hold
from pbem.solve.nonlinear.newton import Solution, solve_step
from pbem.solve.problem.arranged import Arranged, begin_stage, describe_rest
from pbem.solve.problem.problem import Problem
from pbem.solve.problem.step import ContactState, SilentReporter, Step
from pbem.solve.steps.recovery import describe_step
from pbem.solve.system.assembly import assemble_problem
from pbem.solve.system.kept import KeptProblems

# Of the largest traction: so nearly the laws of faces that creep have to hold where statuses are those of the run.
FULFILLED = 1e-2


class SecondSolution:
    """Marches on the coarser mesh behind a run; all ranks together, with the same numbers on all."""

    def __init__(
        self, beside: Beside, comm: MPI.Intracomm, start: Step | None = None, kept: KeptProblems | None = None,
        signals: StopSignals | None = None,
    ) -> None:
        """Begins at rest, or with the memory of a step of the run, carried over; with what earlier ones have kept.

        Its operator is not there before the first step: of a run of one step it takes the place of the run's own.
        signals: those by which the run is stopped; then StopError leaves `follow`.
        """
        self.beside = beside
        self._comm, self._kept, self._start = comm, kept, start
        self._watch = Watch(comm, SilentReporter(), signals or StopSignals())
        self._ready = False

    def _prepare(self) -> None:
        """Raises ConvergenceError where the operator cannot be assembled well enough."""
        kept, model, mesh = self._kept, self.beside.model, self.beside.mesh
        self.problem: Problem = kept.assemble(model, mesh) if kept else assemble_problem(model, mesh, self._comm)
        self._whole, start = self.problem, self._start
        self._arranged = Arranged(self.problem, kept.take_tangent(self.problem) if kept else None)
        self.memory: Memory = start_memory(self.problem.laws)
        self._contact, self._stage = describe_rest(self.problem), -1
        self._watch.look_after(self.problem.laws)
        if start is not None:
            self._take_over(start.contact)
            if start.factor < 1:
                self._enter(start.stage, start.factor)
            else:
                self._stage = start.stage
        self._ready = True

    def follow(self, step: Step) -> Step:
        """The same load step on the coarser mesh, from its own memory, begun with the run's modes.

        Raises ConvergenceError; the next step then starts from the run's memory, carried over. Raises LawError where a
        custom law fails with what it is asked here; there is no further step then. With the run's last step the storage
        is freed, before what the steps differ by is measured and written.
        """
        last = step.stage == len(self.beside.model.stages) - 1 and step.factor >= 1.0
        try:
            found = self._follow(step)
        except ConvergenceError:  # of other exceptions one rank alone may know
            if last:
                self.destroy()
            raise
        if last:
            self.destroy()
        return found

    def _follow(self, step: Step) -> Step:
        if not self._ready:
            self._prepare()
        if step.stage != self._stage:
            self.memory = begin_stage(self._whole, step.stage, self.memory, self._contact)
            self._enter(step.stage, 0.0)
        load = self.problem.evaluate_load(step.stage, step.factor)
        try:
            solution = self._solve(step, load)
            memory = commit(self.problem.laws, solution.memory, solution.modes, solution.pairs, solution.pressure)
            self._watch.check()
            found, self.memory = describe_step(self.problem, solution, memory, step.number, step.stage, step.factor)
        except ConvergenceError:
            self._watch.check()  # a law that failed has answered with no strength
            self._take_over(step.contact)
            raise
        self._contact = found.contact
        return found

    def _enter(self, stage: int, factor: float) -> None:
        self.problem, self.tangent = self._arranged.enter(stage, factor, self._contact)
        self._stage = stage

    def _solve(self, step: Step, load: Load) -> Solution:
        begun = replace(self.memory, modes=self._guess_modes(step.contact), duration=step.duration)
        try:
            # It begins with what is nearly the solution; or this mesh wants another one that takes long to find: where
            # the first search did not settle, in none of a hundred models the next one did.
            return solve_step(self.problem, self.tangent, begun, load, self._watch, once=True)
        except ConvergenceError:
            self._watch.check()
            return self._solve_held(step, load)

    def _solve_held(self, step: Step, load: Load) -> Solution:
        """The solution with the statuses of the run's pairs, which need not be those that this mesh wants.

        In narrow wedges, or with cohesion that is lost as faces part, a coarser mesh may have none. Raises
        ConvergenceError where it does not fulfil the laws of faces that creep: their bound changes by all of itself
        with rates that the run's slips do not tell.
        """
        problem, beside, contact = self.problem, self.beside, step.contact
        memory = replace(self.memory, duration=step.duration).lose(self._carry_internal(contact)[BROKEN.name])
        hold = Hold(problem, memory)
        modes = do_on_first(problem.comm, ConvergenceError, lambda: follow_leaders(
            problem.laws, hold.apply(self._guess_modes(contact), problem.laws.gap, np.zeros(problem.laws.count))))
        law = linearise(
            problem.laws, modes, beside.carry_pairs(contact.traction_n, jumps=False),
            beside.carry_pairs(contact.slip, jumps=True), memory, load.pressure, problem.traction_scale, "slip",
        )
        constraints = hold.release(problem.constrain(law, load), modes)
        solved = self.tangent.solve(constraints, load, law)
        if not solved.checked:
            solved = self.tangent.check(solved, constraints, load, law)
        pairs = evaluate_pairs(problem.mesh, law, solved.unknowns)
        if find_creeping(problem.laws).any():
            error = problem.decide(lambda: measure_law_error(problem.laws, modes, pairs, memory, load.pressure))
            if error > FULFILLED:
                raise ConvergenceError(
                    "iteration limit", f"the laws of faces that creep are off by {error:.1e} of the tractions")
        pairs, residual = pairs.bear(load.carried), solved.residual
        v = self.tangent.evaluate(solved, constraints)
        return Solution(solved.unknowns, v, pairs, modes, memory, residual, (), load.pressure)

    def _carry_internal(self, contact: ContactState) -> dict[str, NDArray[Any]]:
        """The internal variables of the run's pairs, carried over as they are declared to be."""
        laws, nearest = self.problem.laws, self.beside.nearest
        internal = dict(start_memory(laws).internal)
        for variable in list_variables(group.law for group in laws.strengths):
            values = contact.internal[variable.name]
            if variable.carry == "as the jump":
                internal[variable.name] = np.maximum(self.beside.carry_pairs(values, jumps=True), 0.0)
            else:
                internal[variable.name] = np.where(nearest >= 0, values[nearest], internal[variable.name])
        internal[BROKEN.name] = laws.brittle & (nearest >= 0) & internal[BROKEN.name]
        return internal

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
        self.memory = Memory(
            self._guess_modes(contact), slip - laws.compliance_s * tangential, self._carry_internal(contact),
            beside.carry_pairs(contact.traction_n, jumps=False), beside.carry_pairs(contact.opening, jumps=True),
        )
        self._contact = ContactState(
            self.memory.modes.mode, beside.carry_pairs(contact.opening, jumps=True), slip,
            beside.carry_pairs(contact.traction_n, jumps=False), tangential, self.memory.internal,
        )

    def destroy(self) -> None:
        """Free the storage, but of what is kept; after an exception of one rank it is not called."""
        if not self._ready:
            return
        self._arranged.leave()
        if self._kept is None:
            self.problem.system.free_products()
        for name in ("problem", "_whole", "_arranged", "tangent"):
            vars(self).pop(name, None)
        self._ready = False
        heap.give_back()
