"""What a user should know of a converged step: forces that do not balance, what is beyond linear theory, overlap."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pbem.contact.seat import find_unlifted
from pbem.errors import ConvergenceError
from pbem.geometry.tolerance import TIE
from pbem.parallel import do_on_first
from pbem.solve.nonlinear.imbalance import describe_imbalance
from pbem.solve.nonlinear.newton import Solution
from pbem.solve.problem.problem import Problem
from pbem.solve.problem.step import Reporter, Step
from pbem.solve.steps.closed_gaps import find_closed_gap
from pbem.solve.steps.linearity import describe_nonlinearity, measure_excess
from pbem.solve.steps.open_faces import PushedFaces, describe_pushed, find_pushed
from pbem.solve.steps.passing import Passing, describe_passing, find_passing
from pbem.wording import list_names

# What has grown by so much is noted again. Under proportional loads it doubles exactly from the first step to the
# second and to the fourth: rounding must not choose.
GROWN = 2 * (1 - TIE)
# So many interfaces are named.
MOST_NAMED = 5


def note_imbalance(problem: Problem, step: Step, noted: float, reporter: Reporter) -> float:
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
    if text is None or amount <= GROWN * noted:
        return noted
    reporter.note(f"Step {step.number}: {text}.")
    return amount


def note_nonlinearity(problem: Problem, step: Step, noted: float, reporter: Reporter) -> float:
    """Note what is beyond linear theory if it is twice as much as was noted before; returns what has been noted now."""
    assert step.linearity is not None
    amount = measure_excess(step.linearity)
    mesh = problem.mesh
    if amount > GROWN * noted:
        notes = describe_nonlinearity(mesh.region_names, mesh.interface_names, step.linearity)
        for text in notes:
            reporter.note(f"Step {step.number}: {text}.")
        return amount if notes else noted
    return noted


def note_passing(
    problem: Problem, step: Step, noted: Mapping[tuple[str, str], float], reporter: Reporter
) -> Mapping[tuple[str, str], float]:
    """Note bodies that have moved into each other, and sides across a gap, if twice as deep as was noted of the same
    two before; returns the depths by the names of both that are noted now."""
    model, mesh = problem.model, problem.mesh

    def find() -> list[Passing]:
        found = (find_passing(model, mesh, step.displacement[: mesh.nodes]),
                 find_closed_gap(model, mesh, step.displacement))
        deepest = sorted((each for each in found if each is not None), key=lambda each: -each.depth)
        # What lies in another body across a gap is found in both ways.
        return [each for k, each in enumerate(deepest) if each.names not in [other.names for other in deepest[:k]]]

    found = do_on_first(problem.comm, ConvergenceError, find)
    new = [each for each in found if each.depth > GROWN * noted.get(each.names, 0.0)]
    for each in new:
        reporter.note(f"Step {step.number}: {describe_passing(each)}.")
    return {**noted, **{each.names: each.depth for each in new}}


def note_pushed(problem: Problem, step: Step, noted: Mapping[str, float], reporter: Reporter) -> Mapping[str, float]:
    """Note curves whose faces are open and pushed into each other, if twice as deep as was noted of them before;
    returns the depths by curve that are noted now."""
    pairs, names = problem.mesh.pairs, problem.mesh.interface_names

    def find() -> list[PushedFaces]:
        place, by_law = pairs.position + problem.model.origin, np.ones(len(names), dtype=bool)
        if problem.arrangement is not None:
            by_law[pairs.interface[problem.arrangement.opened]] = False
        return find_pushed(names, by_law, pairs.interface, np.stack([place.real, place.imag], axis=1),
                           problem.laws.parted, step.contact.opening, step.contact.slip)

    found = do_on_first(problem.comm, ConvergenceError, find)
    new = [each for each in found if each.depth > GROWN * noted.get(each.name, 0.0)]
    for text in describe_pushed(new):
        reporter.note(f"Step {step.number}: {text}.")
    return {**noted, **{each.name: each.depth for each in new}}


def note_unlifted(
    problem: Problem, solution: Solution, step: Step, noted: frozenset[str], reporter: Reporter
) -> frozenset[str]:
    """Note, once for each name, faces that have parted though their slip would have lifted them further: two states may
    be in equilibrium; returns the names that are noted now."""
    def find() -> list[str]:
        found = find_unlifted(problem.laws, solution.modes, solution.memory, solution.pairs, solution.pressure)
        numbers = np.unique(problem.mesh.pairs.interface[found])
        return [problem.mesh.interface_names[number] for number in numbers]

    new = [name for name in do_on_first(problem.comm, ConvergenceError, find) if name not in noted]
    if new:
        names = list_names(map(repr, new), MOST_NAMED)
        reporter.note(
            f"Step {step.number}: faces of {names} are open, and nearer than their slip would have pushed them "
            "apart by their dilation: closed, with the cohesion or the friction that they lost as they parted, they "
            'may be in equilibrium as well. cohesion_lost = true, or with fluids pressurised = "all", leaves one state.'
        )
    return noted | {*new}
