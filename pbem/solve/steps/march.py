"""The march through the load history: steps, halved where they fail, each committed once when it has converged."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cache, partial

import numpy as np

from pbem.arrays import Real
from pbem.contact.laws import Memory, ModeState, commit, start_memory
from pbem.contact.loads import Load
from pbem.errors import ConvergenceError, StopError
from pbem.solve.nonlinear.checkpoint import describe_error, from_plain, recall_error, to_plain
from pbem.solve.nonlinear.newton import Solution, solve_step
from pbem.solve.problem.arranged import Arranged, begin_stage, describe_rest
from pbem.solve.problem.problem import Problem
from pbem.solve.problem.step import ContactState, Former, Step, Supervisor, Unfinished
from pbem.solve.problem.tangent import TangentOperator
from pbem.solve.steps.attempt import Attempt, describe_ceiling, recall_ceiling, take_up
from pbem.solve.steps.ceiling import SAFE, Ceiling
from pbem.solve.steps.ends import (
    UNSETTLED,
    end_at_limit,
    end_at_rest,
    end_by_sliding,
    end_march,
    find_balanced,
    find_reason,
    find_sliding,
    refuse_load,
)
from pbem.solve.steps.proportional import is_proportional, is_proportional_at_last
from pbem.solve.steps.recovery import describe_step
from pbem.solve.steps.softly import solve_softly
from pbem.solve.steps.step_notes import note_imbalance, note_nonlinearity, note_passing, note_pushed, note_unlifted
from pbem.solve.steps.values import refuse_without_value

# After so many tries from rest the least step is tried, where that tells what becomes of all small ones.
TRIED_FROM_REST = 2


# The modes that are expected at a fraction of a stage, from the memory before it and the fluid's pressure; None where
# nothing is.
Guess = Callable[[int, float, Memory, Real], ModeState | None]


@dataclass(frozen=True)
class Start:
    """Where a march begins: after a number of steps, at a fraction of a stage, with the memory and state of the pairs.

    former: the step before the last one, if it was of the same stage; ceiling: what is known of fractions beyond.
    """

    number: int
    stage: int
    factor: float
    memory: Memory
    contact: ContactState
    former: Former | None = None
    ceiling: Ceiling = field(default_factory=Ceiling)


@dataclass(frozen=True)
class Course:
    """Of the state that a step begins with: the step before it in its stage, if any, and the shear tractions (m,)."""

    former: Former | None
    traction_s: Real


def start_from_rest(problem: Problem) -> Start:
    """The unloaded state: closed pairs stick."""
    return Start(0, 0, 0.0, start_memory(problem.laws), describe_rest(problem))


def resume_modes(contact: ContactState) -> ModeState:
    """The modes of a step that was reached."""
    return ModeState(contact.mode, np.where(contact.traction_s < 0, -1.0, 1.0))


def start_from(problem: Problem, last: Step, former: Former | None) -> Start:
    """The state of a stored step; former: see Start."""
    contact = last.contact
    modes = resume_modes(contact)
    elastic = problem.laws.compliance_s * contact.traction_s
    memory = Memory(modes, contact.slip - elastic, contact.internal, contact.traction_n, contact.opening)
    return Start(last.number, last.stage, last.factor, memory, contact, former, recall_ceiling(last.ahead))


def march(
    problem: Problem, reporter: Supervisor, start: Start | None = None, kept: TangentOperator | None = None,
    guess: Guess | None = None, recover: bool = True, unfinished: Unfinished | None = None,
) -> Iterator[Step]:
    """Yield the converged steps of all stages in turn.

    A step that fails is halved, down to solver.min_step of a stage, unless its problem is the same at every fraction.
    Where small steps from rest are all alike (see is_proportional_at_last) the least is tried after TRIED_FROM_REST: if
    that fails, fractions in between are not tried, though faces may slip there. The factors of a stage's own steps are
    always met. Raises ConvergenceError with the reason of the last failure, or "limit load" or "not in balance", after
    the steps before it were yielded. kept: a tangent operator that is used and not destroyed. guess: the modes
    with which the search for those of a step begins. recover: see `describe_step`. unfinished: the step in which a
    run was stopped that had come to `start`; it is gone on with where it was. Unless the tangent operator is kept,
    its storage is free by the time of the last step, after which nothing is solved for any more.
    """
    begin = start or start_from_rest(problem)
    arranged, whole = Arranged(problem, kept), problem
    number, memory, contact = begin.number, begin.memory, begin.contact
    noted, told = 0.0, 0.0
    pushed: Mapping[str, float] = {}
    passed: Mapping[tuple[str, str], float] = {}
    unlifted: frozenset[str] = frozenset()
    try:
        for stage in range(begin.stage, len(problem.model.stages)):
            steps = problem.model.stages[stage].steps
            reached = begin.factor if stage == begin.stage else 0.0
            if reached == 0.0:
                memory = begin_stage(whole, stage, memory, contact)
            if reached < 1.0:
                problem, tangent = arranged.enter(stage, reached, contact)
            ceiling, former = (begin.ceiling, begin.former) if stage == begin.stage else (Ceiling(), None)
            while reached < 1.0:
                planned = next(k / steps for k in range(1, steps + 1) if k / steps > reached * (1 + 1e-12))
                attempt = take_up(unfinished, stage, reached, planned, type(tangent).__name__) or Attempt(ceiling)
                course = Course(former, contact.traction_s)
                former = Former(reached, memory.normal_traction)
                solution, reached, ceiling = _advance(
                    problem, tangent, memory, stage, reached, planned, attempt, reporter, guess, course
                )
                unfinished = None
                memory = commit(problem.laws, solution.memory, solution.modes, solution.pairs, solution.pressure)
                number += 1
                step, memory = describe_step(problem, solution, memory, number, stage, reached, recover)
                step = replace(step, ahead=describe_ceiling(ceiling))
                noted = note_imbalance(problem, step, noted, reporter)
                told = note_nonlinearity(problem, step, told, reporter)
                passed = note_passing(problem, step, passed, reporter)
                pushed = note_pushed(problem, step, pushed, reporter)
                unlifted = note_unlifted(problem, solution, step, unlifted, reporter)
                contact = step.contact
                with note_place(step, solution.modes):
                    reporter.accept(step)
                if reached >= 1.0 and stage == len(whole.model.stages) - 1:
                    arranged.leave()
                    del tangent  # it holds maps and factors' shapes even so, while the step is judged and written
                yield step
    except (ConvergenceError, GeneratorExit):
        # Not after other exceptions: one rank alone would wait here for the others, which takes all of them.
        arranged.leave()
        raise
    arranged.leave()


def free_at_last(problem: Problem, steps: Iterator[Step]) -> Iterator[Step]:
    """The steps of a march; with the last one what products need is freed, as a second solution takes as much."""
    for step in steps:
        if step.stage == len(problem.model.stages) - 1 and step.factor >= 1.0:
            problem.system.free_products()
        yield step


def _advance(
    problem: Problem, tangent: TangentOperator, memory: Memory, stage: int, reached: float, planned: float,
    attempt: Attempt, reporter: Supervisor, guess: Guess | None, course: Course,
) -> tuple[Solution, float, Ceiling]:
    """One converged step towards the planned fraction of the stage; returns it, the fraction reached, and the ceiling.

    Raises ConvergenceError: of the last try, or "limit load".
    """
    least, ceiling, kind = problem.model.solver.min_step, attempt.ceiling, type(tangent).__name__
    if attempt.target is None and ceiling.slides < np.inf:  # with the pressures that are known now
        ceiling = replace(ceiling, slides=find_sliding(problem, memory, course.former, stage, reached, 1.0))
        attempt = replace(attempt, ceiling=ceiling)
    if attempt.target is None and ceiling.error is not None:
        if ceiling.is_reached(reached, planned, least):
            if not ceiling.is_found_free():
                raise end_at_limit(problem, stage, reached, ceiling, ceiling.error)
            attempt = attempt.aim(ceiling.free)  # that was found from further below
        elif course.former is not None and ceiling.is_sliding(reached, planned, least):
            raise end_by_sliding(
                problem, memory, course.former, stage, reached, ceiling.slides, course.traction_s)
    attempt = attempt.aim(ceiling.choose(reached, planned, least))
    proportional = cache(lambda: is_proportional(problem, memory, stage, reached))  # what a right guess never asks
    while True:
        ceiling, target = attempt.ceiling, attempt.target
        assert target is not None
        with attempt.note_try(stage, reached, memory.modes, kind):
            reporter.start_step(stage, reached, target)
        refuse_without_value(problem, stage, reached, target)
        load, hurried = problem.evaluate_load(stage, target), min(ceiling.balanced, ceiling.slides) < np.inf
        begin = replace(memory, duration=problem.model.stages[stage].duration * (target - reached))
        try:
            with attempt.note_try(stage, reached, memory.modes, kind):
                guessed = attempt.guess or (guess and guess(stage, target, begin, load.pressure))
                solution = _solve_guessed(problem, tangent, begin, load, reporter, guessed, attempt)
                if solution is None:
                    # From rest nothing is gained by an early end.
                    refuse = _never if proportional() else partial(refuse_load, problem, memory, stage, target)
                    solution = _solve_usually(problem, tangent, begin, load, reporter, refuse, hurried, attempt)
            return solution, target, ceiling.pass_by(target)
        except ConvergenceError as failure:
            error = find_reason(problem, memory, stage, target, failure)
            balanced = find_balanced(problem, memory, stage, reached, target)
            slides = np.inf
            if balanced >= target and error.reason in (*UNSETTLED, "limit load") and not proportional():
                slides = find_sliding(problem, memory, course.former, stage, reached, 1.0)
            if balanced >= target and slides > target:
                softly = attempt.find_phase("softly")
                with (
                    attempt.note_try(stage, reached, memory.modes, kind),
                    attempt.note_phase("softly", error=describe_error(error)),
                ):
                    found = solve_softly(
                        problem, tangent, begin, load, reporter, error, softly and softly["inner"], hurried)
                if isinstance(found, Solution):
                    return found, target, ceiling.pass_by(target)
                error = found or error
            if proportional():
                if balanced < target and error.reason != "free motion":
                    ceiling = ceiling.lower(target, balanced, error)
                    raise end_at_limit(problem, stage, reached, ceiling, error) from failure
                raise end_at_rest(problem, stage, target, error) from failure
            ceiling = replace(ceiling.lower(target, balanced, error), slides=slides)
            if ceiling.is_reached(reached, target, least):
                raise end_at_limit(problem, stage, reached, ceiling, error) from failure
            if course.former is not None and ceiling.is_sliding(reached, target, least):
                raise end_by_sliding(
                    problem, memory, course.former, stage, reached, slides, course.traction_s) from failure
            lowest = min(balanced, slides)
            half = SAFE * (lowest - reached) if lowest < target else 0.5 * (target - reached)
            if half < least:
                raise end_march(problem, memory, stage, reached, target, error) from failure
            reporter.reject(error.reason, error.detail)
            tries = attempt.tries + 1
            smallest = tries == TRIED_FROM_REST and is_proportional_at_last(problem, memory, stage, reached)
            attempt = Attempt(ceiling, tries, reached + (least if smallest else half))


def _solve_guessed(
    problem: Problem, tangent: TangentOperator, begin: Memory, load: Load, reporter: Supervisor,
    guessed: ModeState | None, attempt: Attempt,
) -> Solution | None:
    """The solution of a search that begins with other modes than those of the memory; None if it does not settle."""
    resumed = attempt.find_phase("guess")
    if resumed:
        guessed = from_plain(resumed["guessed"])
    if guessed is None or (attempt.resumed and not resumed):
        return None
    try:
        with attempt.note_phase("guess", guessed=to_plain(guessed)):
            solution = solve_step(problem, tangent, replace(begin, modes=guessed), load, reporter, hurried=True,
                                  resumed=resumed and resumed["inner"])
    except ConvergenceError:
        return None
    return replace(solution, memory=replace(solution.memory, modes=begin.modes))


def _solve_usually(
    problem: Problem, tangent: TangentOperator, begin: Memory, load: Load, reporter: Supervisor,
    refuse: Callable[[Memory], ConvergenceError | None], hurried: bool, attempt: Attempt,
) -> Solution:
    """The solution of the search that begins with the memory's modes; it may have failed before the run was stopped."""
    if softly := attempt.find_phase("softly"):
        raise recall_error(softly["error"])
    resumed = attempt.find_phase("usual")
    with attempt.note_phase("usual"):
        return solve_step(problem, tangent, begin, load, reporter, refuse, hurried,
                          resumed=resumed and resumed["inner"])


@contextmanager
def note_place(step: Step, modes: ModeState | None = None) -> Iterator[None]:
    """Where the run is stopped within, say in which step, and with which modes of the pairs it can go on."""
    try:
        yield
    except StopError as stop:
        modes = modes or resume_modes(step.contact)
        stop.unfinished = Unfinished(step.stage, step.factor, modes.mode, modes.sign, {"ceiling": step.ahead})
        raise


def _never(_: Memory) -> ConvergenceError | None:
    return None
