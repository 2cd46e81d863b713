"""The march through the load history: steps, halved where they fail, each committed once when it has converged."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from pbem.contact.laws import Memory, ModeState, commit, start_memory
from pbem.errors import ConvergenceError
from pbem.parallel import do_on_first
from pbem.solve.balance import describe_imbalance, measure_balance
from pbem.solve.krylov import make_tangent
from pbem.solve.limit_load import can_balance, find_balanced_fraction
from pbem.solve.linearity import describe_nonlinearity, measure_excess, measure_linearity
from pbem.solve.newton import Solution, solve_step
from pbem.solve.passing import describe_passing, find_passing
from pbem.solve.problem import Problem
from pbem.solve.proportional import is_proportional, is_proportional_at_last
from pbem.solve.step import ContactState, Reporter, Step
from pbem.solve.tangent import AnyTangent

# A limit load is told where no more than this part of it is missing.
NEAR = 0.02
# Of what forces in the contacts could still balance, a step takes this part.
SAFE = 0.97
# After so many tries from rest the least step is tried, where that tells what becomes of all small ones.
TRIED_FROM_REST = 2
# The end of what is said of a limit load.
BEYOND = "prescribe a displacement in place of the load to go beyond"


@dataclass(frozen=True)
class Ceiling:
    """What is known of the fractions of a stage that could not be reached.

    failed: the least one at which a try failed that was not reached since; free: the least one at which a body was
    found to move freely, or nothing to balance the loads once bonds had failed; balanced: the largest one at which
    forces in the contacts could balance the loads. Infinity if none. error: of the last try that failed, at `tried`.
    """

    failed: float = np.inf
    free: float = np.inf
    balanced: float = np.inf
    tried: float = 0.0
    error: ConvergenceError | None = None

    def choose(self, reached: float, planned: float, least: float) -> float:
        """The fraction to try next: one that failed is tried again from nearer, and none above it before.

        Free bodies are halved towards, as they are free from everywhere.
        """
        target = min(planned, self.failed)
        if self.free <= target:
            middle = 0.5 * (reached + self.free)
            target = middle if middle - reached >= least else self.free
        if self.balanced < target:
            target = reached + max(SAFE * (self.balanced - reached), least)
        return target

    def is_reached(self, reached: float, target: float, least: float) -> bool:
        """Whether hardly anything is left between what was reached and what cannot be.

        A search that fails further below, where bodies part and slip where they are loaded most, says nothing of the
        loads: its own reason is told in the end, whatever the steps.
        """
        lowest = min(self.balanced, self.free)
        return lowest <= target and lowest - reached < max(least, NEAR * lowest)

    def lower(self, target: float, balanced: float, error: ConvergenceError) -> Ceiling:
        """With a try that failed; balanced: up to the target, which it is if all of it may be in balance."""
        collapsed = error.reason == "free motion" or (error.reason == "limit load" and balanced >= target)
        return Ceiling(
            min(self.failed, target), min(self.free, target if collapsed else np.inf),
            min(self.balanced, balanced if balanced < target else np.inf), target, error,
        )  # fmt: skip

    def pass_by(self, reached: float) -> Ceiling:
        """With a try that has come so far."""
        return replace(
            self, failed=self.failed if self.failed > reached else np.inf,
            free=self.free if self.free > reached else np.inf,
            balanced=self.balanced if self.balanced > reached else np.inf,
        )  # fmt: skip


@dataclass(frozen=True)
class Start:
    """Where a march begins: after a number of steps, at a fraction of a stage, with the memory of the pairs."""

    number: int
    stage: int
    factor: float
    memory: Memory


def start_from_rest(problem: Problem) -> Start:
    """The unloaded state: closed pairs stick."""
    return Start(0, 0, 0.0, start_memory(problem.laws))


def start_from(problem: Problem, number: int, stage: int, factor: float, contact: ContactState) -> Start:
    """The state of a stored step."""
    modes = ModeState(contact.mode, np.where(contact.traction_s < 0, -1.0, 1.0))
    elastic = problem.laws.compliance_s * contact.traction_s
    memory = Memory(modes, contact.slip - elastic, contact.internal, contact.traction_n)
    return Start(number, stage, factor, memory)


def march(problem: Problem, reporter: Reporter, start: Start | None = None) -> Iterator[Step]:
    """Yield the converged steps of all stages in turn.

    A step that fails is halved, down to solver.min_step of a stage, unless its problem is the same at every fraction;
    the factors of a stage's own steps are always met. Raises ConvergenceError with the reason of the last failure, or
    "limit load" or "not in balance", after the steps before it were yielded.
    """
    begin = start or start_from_rest(problem)
    tangent = make_tangent(problem)
    number, memory, noted, told, depth = begin.number, begin.memory, 0.0, 0.0, 0.0
    try:
        for stage in range(begin.stage, len(problem.model.stages)):
            steps = problem.model.stages[stage].steps
            reached = begin.factor if stage == begin.stage else 0.0
            ceiling = Ceiling()
            while reached < 1.0:
                planned = next(k / steps for k in range(1, steps + 1) if k / steps > reached * (1 + 1e-12))
                solution, reached, ceiling = _advance(
                    problem, tangent, memory, stage, reached, planned, ceiling, reporter
                )
                memory = commit(problem.laws, solution.memory, solution.modes, solution.pairs)
                number += 1
                step = describe_step(problem, solution, memory, number, stage, reached)
                noted = _note_imbalance(problem, step, noted, reporter)
                told = _note_nonlinearity(problem, step, told, reporter)
                depth = _note_passing(problem, step, depth, reporter)
                reporter.accept(step)
                yield step
    except (ConvergenceError, GeneratorExit):
        # Not after other exceptions: one rank alone would wait here for the others, which takes all of them.
        tangent.destroy()
        raise
    tangent.destroy()


def _note_imbalance(problem: Problem, step: Step, noted: float, reporter: Reporter) -> float:
    """Note what is left over if it is twice as much as was noted before; returns what has been noted now.

    Raises ConvergenceError ("not in balance") where it makes the result wrong; a smaller step would not mend it.
    """
    assert step.balance is not None
    balance, name = step.balance, problem.model.stages[step.stage].name
    try:
        text = do_on_first(problem.comm, ConvergenceError, lambda: describe_imbalance(problem, balance))
    except ConvergenceError as error:
        detail = f"the step to the fraction {step.factor:.6g} of stage {name!r} is wrong: {error.detail}"
        raise ConvergenceError(error.reason, detail) from error
    amount = max(float(balance.relative.max(initial=0.0)), float(balance.part_relative.max(initial=0.0)))
    if text is None or amount <= 2 * noted:
        return noted
    reporter.note(f"Step {step.number}: {text}.")
    return amount


def _note_nonlinearity(problem: Problem, step: Step, noted: float, reporter: Reporter) -> float:
    """Note what is beyond linear theory if it is twice as much as was noted before; returns what has been noted now."""
    assert step.linearity is not None
    amount = measure_excess(step.linearity)
    mesh = problem.mesh
    if amount > 2 * noted:
        notes = describe_nonlinearity(mesh.region_names, mesh.interface_names, step.linearity)
        for text in notes:
            reporter.note(f"Step {step.number}: {text}.")
        return amount if notes else noted
    return noted


def _note_passing(problem: Problem, step: Step, noted: float, reporter: Reporter) -> float:
    """Note bodies that have moved into each other, if twice as deep as was noted before; returns what is noted now."""
    moved = step.displacement[: problem.mesh.nodes]
    found = do_on_first(problem.comm, ConvergenceError, lambda: find_passing(problem.model, problem.mesh, moved))
    if found is None or found.depth <= 2 * noted:
        return noted
    reporter.note(f"Step {step.number}: {describe_passing(found)}.")
    return found.depth


def _advance(
    problem: Problem, tangent: AnyTangent, memory: Memory, stage: int, reached: float, planned: float, ceiling: Ceiling,
    reporter: Reporter,
) -> tuple[Solution, float, Ceiling]:
    """One converged step towards the planned fraction of the stage; returns it, the fraction reached, and the ceiling.

    Raises ConvergenceError: of the last try, or "limit load".
    """
    least = problem.model.solver.min_step
    if ceiling.error is not None and ceiling.is_reached(reached, planned, least):
        raise _end_at_limit(problem, stage, reached, ceiling, ceiling.error)
    target, proportional = ceiling.choose(reached, planned, least), is_proportional(problem, memory, stage, reached)
    tries, alike = 0, is_proportional_at_last(problem, memory, stage, reached)
    while True:
        reporter.start_step(stage, reached, target)
        # From rest nothing is gained by an early end.
        refuse = _never if proportional else partial(_refuse, problem, memory, stage, target)
        try:
            load, hurried = problem.evaluate_load(stage, target), ceiling.balanced < np.inf
            begin = replace(memory, duration=problem.model.stages[stage].duration * (target - reached))
            solution = solve_step(problem, tangent, begin, load, reporter, refuse, hurried)
            return solution, target, ceiling.pass_by(target)
        except ConvergenceError as error:
            balanced = _find_balanced(problem, memory, stage, reached, target)
            if proportional:
                if balanced < target and error.reason != "free motion":
                    ceiling = ceiling.lower(target, balanced, error)
                    raise _end_at_limit(problem, stage, reached, ceiling, error) from error
                raise _end_at_rest(problem, stage, target, error) from error
            ceiling = ceiling.lower(target, balanced, error)
            if ceiling.is_reached(reached, target, least):
                raise _end_at_limit(problem, stage, reached, ceiling, error) from error
            half = SAFE * (balanced - reached) if balanced < target else 0.5 * (target - reached)
            if half < least:
                raise _end_march(problem, memory, stage, reached, target, error) from error
            reporter.reject(error.reason, error.detail)
            tries += 1
            target = reached + (least if alike and tries == TRIED_FROM_REST else half)


def _never(_: Memory) -> ConvergenceError | None:
    return None


def _refuse(problem: Problem, memory: Memory, stage: int, target: float, now: Memory) -> ConvergenceError | None:
    """The error of a step whose loads nothing balances with the bonds that are left now; None if something may.

    As the first rank finds it.
    """
    possible = problem.decide(lambda: can_balance(problem, now, stage, target))
    if possible is not False:
        return None
    if np.array_equal(memory.broken, now.broken):
        return ConvergenceError("limit load", "no forces that the contacts can carry balance the loads")
    return ConvergenceError(
        "limit load", "bonds fail one after the other until no forces that the contacts can carry balance the loads"
    )


def _find_balanced(problem: Problem, memory: Memory, stage: int, reached: float, target: float) -> float:
    """The largest fraction up to the target that forces in the contacts could balance, as the first rank finds it."""
    found = problem.decide(lambda: find_balanced_fraction(problem, memory, stage, reached, target))
    return target if found is None else found


def _end_at_limit(
    problem: Problem, stage: int, reached: float, ceiling: Ceiling, error: ConvergenceError
) -> ConvergenceError:
    """The error at the largest load that the contacts bear; error: of the try at ceiling.tried."""
    name = problem.model.stages[stage].name
    known = error.reason in ("free motion", "limit load")
    why = f"at {ceiling.tried:.6g} {error.detail if known else 'no modes of the contacts were found that settle'}"
    if ceiling.balanced < np.inf:
        some = f"{why}; up to {ceiling.balanced:.6g} some could"
        why = some if error.reason == "limit load" else f"{_describe_bound(ceiling.balanced)}; {why}"
    return ConvergenceError(
        "limit load", f"limit load reached at fraction {reached:.6g} of stage {name!r}: {why}; {BEYOND}"
    )


def _describe_bound(balanced: float) -> str:
    return f"no forces that the contacts can carry balance the loads beyond {balanced:.6g}"


def _end_at_rest(problem: Problem, stage: int, target: float, error: ConvergenceError) -> ConvergenceError:
    name = problem.model.stages[stage].name
    return ConvergenceError(
        error.reason,
        f"stage {name!r} stopped at the fraction 0; the load grows in proportion from rest, and what fails at "
        f"{target:.6g} fails at every fraction: {error.detail}",
    )


def _end_march(
    problem: Problem, memory: Memory, stage: int, reached: float, target: float, error: ConvergenceError
) -> ConvergenceError:
    """The error of a step that is as small as allowed.

    A contact that held up to here and becomes a mechanism under more load has come to the largest load that it bears.
    """
    name = problem.model.stages[stage].name
    if error.reason == "free motion" and (stage > 0 or reached > 0):
        return ConvergenceError(
            "limit load",
            f"limit load reached at fraction {reached:.6g} of stage {name!r}, no equilibrium at {target:.6g}: there "
            f"{error.detail}; {BEYOND}",
        )
    # Of the whole stage: whether a try went beyond the bound depends on the steps.
    balanced = _find_balanced(problem, memory, stage, reached, 1.0)
    bound = f"; {_describe_bound(balanced)}" if balanced < 1.0 else ""
    return ConvergenceError(
        error.reason,
        f"stage {name!r} stopped at the fraction {reached:.6g}; the step to {target:.6g} failed and is the "
        f"smallest allowed (solver.min_step = {problem.model.solver.min_step:g}): {error.detail}{bound}",
    )


def describe_step(
    problem: Problem, solution: Solution, memory: Memory, number: int, stage: int, factor: float
) -> Step:
    """Displacements and tractions on all faces, crack faces recovered from their displacement equation, and contact."""
    mesh = problem.mesh
    values = solution.v[0::2] + 1j * solution.v[1::2]
    displacement, traction = values[: mesh.nodes].copy(), values[mesh.nodes :]
    cracks = problem.all_crack_nodes
    jump = displacement[cracks]
    load = problem.evaluate_load(stage, factor)
    mean = problem.recover_crack_displacement(solution.v, load)
    displacement[cracks] = mean + jump / 2
    opposite = np.zeros(mesh.nodes, dtype=complex)
    opposite[cracks] = mean - jump / 2
    order = problem.second_faces
    pairs = solution.pairs
    everywhere = np.concatenate([displacement, opposite[order]])
    return Step(
        number=number,
        stage=stage,
        factor=factor,
        iterations=solution.iterations,
        residual=solution.residual,
        displacement=everywhere,
        traction=np.concatenate([traction, -traction[order]]),
        contact=ContactState(
            mode=solution.modes.mode,
            opening=pairs.g_n,
            slip=pairs.g_s,
            traction_n=pairs.p_n,
            traction_s=pairs.p_s,
            internal=memory.internal,
        ),
        balance=measure_balance(problem, solution.v, load, problem.find_support(solution.modes)),
        linearity=measure_linearity(mesh, everywhere, pairs.g_s),
        duration=solution.memory.duration,
    )
