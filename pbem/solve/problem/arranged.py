"""The problem as it is in a stage of a construction, on the system of equations that serves them all."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pbem.arrays import Real
from pbem.contact.arrangement import begin_memory, find_arrangement
from pbem.contact.at_rest import bear_in_situ
from pbem.contact.closure import find_closure
from pbem.contact.laws import Memory, start_memory
from pbem.contact.loads import evaluate_load
from pbem.contact.seat import read_dilation
from pbem.model.construction import arrange_model
from pbem.model.model import Construction
from pbem.model.support_motions import find_settled_motion
from pbem.solve.problem.problem import Problem
from pbem.solve.problem.step import ContactState
from pbem.solve.problem.tangent import TangentOperator


def describe_rest(problem: Problem) -> ContactState:
    """The pairs before any load: they bear the in-situ stress."""
    laws = problem.laws
    memory = start_memory(laws)
    first = find_arrangement(problem.model, problem.mesh, problem.outer, 0)
    p_n, p_s, _ = bear_in_situ(problem.model, problem.mesh, first.regions if first else None)
    return ContactState(memory.modes.mode, laws.gap, np.zeros(laws.count), p_n, p_s, memory.internal)


def arrange_problem(problem: Problem, stage: int, factor: float, contact: ContactState) -> Problem:
    """The problem in a stage, of which a fraction has gone by, with the state of the pairs then.

    What faces that open still carry is that of the stage's beginning times the part of it that is left (theory, 95).
    """
    arrangement = find_arrangement(problem.model, problem.mesh, problem.outer, stage)
    motion = find_settled_motion(problem.model, stage)
    if arrangement is None:
        return replace(problem, settled_motion=motion) if motion else problem
    pressure = evaluate_load(problem.model, problem.mesh, problem.outer, stage, factor).pressure
    borne = np.stack([contact.traction_n + pressure, contact.traction_s], axis=1)
    opens = arrangement.opening & ~problem.laws.parted & ~problem.laws.follows & (factor < 1)
    carried = np.where(opens[:, None], borne, 0.0) / (1 - factor if factor < 1 else 1.0)
    laws = arrangement.hold(problem.laws, find_rest(problem, contact, pressure))
    return replace(
        problem, model=arrange_model(problem.model, stage), laws=laws, arrangement=arrangement, carried=carried,
        settled_motion=motion, supports={},
    )


def find_rest(problem: Problem, contact: ContactState, pressure: Real) -> Real:
    """The openings (m,) without those of elastic joints, under a pressure of fluid (m,), and without dilation."""
    rest: Real = contact.opening - find_closure(problem.laws, contact.traction_n, pressure)[0]
    return rest - read_dilation(problem.laws, contact.internal)


def begin_stage(problem: Problem, stage: int, memory: Memory, contact: ContactState) -> Memory:
    """What the pairs bring into a stage from the end of the one before."""
    before, now = (
        find_arrangement(problem.model, problem.mesh, problem.outer, each) if each >= 0 else None
        for each in (stage - 1, stage)
    )
    if before is None and now is None:
        return memory
    pressure = evaluate_load(problem.model, problem.mesh, problem.outer, stage, 0.0).pressure
    return begin_memory(before, now, problem.laws, memory, find_rest(problem, contact, pressure))


class Arranged:
    """The problem of the present stage and its tangent operator, made anew where a construction changes them.

    kept: a tangent operator of the problem without any, which is used and not destroyed.
    """

    def __init__(self, problem: Problem, kept: TangentOperator | None) -> None:
        self._whole, self._kept = problem, kept
        self._there: Construction | None = None
        self._tangent: TangentOperator | None = None

    def enter(self, stage: int, factor: float, contact: ContactState) -> tuple[Problem, TangentOperator]:
        """For a stage of which a fraction has gone by, with the state of the pairs then."""
        problem = arrange_problem(self._whole, stage, factor, contact)
        there = problem.model.stages[stage].construction
        if self._tangent is None or there != self._there:
            self.leave()
            plain = problem is self._whole and self._kept is not None
            self._tangent = self._kept if plain else problem.make_tangent()
        elif problem is not self._whole:
            self._tangent.take_over(problem)
        self._there = there
        assert self._tangent is not None
        return problem, self._tangent

    def leave(self) -> None:
        """Free the storage, but of what is kept."""
        if self._tangent is not None and self._tangent is not self._kept:
            self._tangent.destroy()
        self._tangent = None
