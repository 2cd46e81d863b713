"""Why a march ends: the errors of steps that fail, with the loads that forces in the contacts could balance."""

from __future__ import annotations

import numpy as np

from pbem.arrays import Real
from pbem.contact.cohesive import SEPARATION
from pbem.contact.laws import Memory, resists_slip
from pbem.contact.separating import find_bonded
from pbem.errors import ConvergenceError
from pbem.solve.problem.given import is_driven
from pbem.solve.problem.problem import Problem
from pbem.solve.problem.step import Former
from pbem.solve.steps.ceiling import Ceiling
from pbem.solve.steps.limit_load import can_balance, find_balanced_fraction, find_held, find_sliding_fraction

# Reasons for which a step without equilibrium can fail.
UNSETTLED = ("iteration limit", "mode cycle", "singular tangent", "no admissible modes")
# What is said where forces could balance the loads, but no modes were found in which a body is held.
LOOSE = "no pair holds a body of those that were closed, or stuck, to do so; use shorter elements where it touches"
# The end of what is said of a limit load.
BEYOND = "prescribe a displacement in place of the load to go beyond"


def refuse_load(problem: Problem, memory: Memory, stage: int, target: float, now: Memory) -> ConvergenceError | None:
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


def find_reason(
    problem: Problem, memory: Memory, stage: int, target: float, error: ConvergenceError
) -> ConvergenceError:
    """The error of a step that fails, with a truer reason if a body is free only in modes that are no equilibrium.

    Found by the first rank, for all.
    """
    unless = error.unless
    if unless is None:
        return error
    load = problem.evaluate_load(stage, target)

    def is_doubtful() -> bool:
        driven = is_driven(problem, load, unless.motions)
        if unless.error is None and driven and resists_slip(problem.laws).any():
            return False  # what friction does not hold can slide away from forces that could balance it
        return (driven or unless.may_stick) and bool(can_balance(problem, memory, stage, target))

    found: ConvergenceError = unless.error or ConvergenceError("mode cycle", LOOSE)
    return found if problem.decide(is_doubtful) else error


def find_balanced(problem: Problem, memory: Memory, stage: int, reached: float, target: float) -> float:
    """The largest fraction up to the target that forces in the contacts could balance, as the first rank finds it."""
    found = problem.decide(lambda: find_balanced_fraction(problem, memory, stage, reached, target))
    return target if found is None else found


def end_at_limit(
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


# Joints that carry this part of what their friction holds are named where bodies slide.
USED_UP = 0.9


def find_sliding(
    problem: Problem, memory: Memory, former: Former | None, stage: int, reached: float, target: float
) -> float:
    """The fraction at which bodies slide under the pressures that were reached, as the first rank finds it; infinite if
    they do not up to the target."""
    found = problem.decide(lambda: find_sliding_fraction(problem, memory, former, stage, reached, target))
    return np.inf if found is None or found <= reached else found


def end_by_sliding(
    problem: Problem, memory: Memory, former: Former | None, stage: int, reached: float, slides: float,
    traction_s: Real,
) -> ConvergenceError:
    """The error where friction is used up; traction_s (m,): of the pairs at the fraction that was reached."""
    held = find_held(problem, memory, former, stage, reached, slides)
    assert held is not None
    pairs = problem.mesh.pairs
    facing = np.flatnonzero(~pairs.crack)
    weight, interface = pairs.weight[facing], pairs.interface[facing]
    count = len(problem.mesh.interface_names)
    most, used = (np.bincount(interface, weight * each[facing], count) for each in (held.bound, np.abs(traction_s)))
    names = [repr(problem.mesh.interface_names[k]) for k in np.flatnonzero((most > 0) & (used >= USED_UP * most))]
    where = f" on {', '.join(names)}" if names else ""
    name = problem.model.stages[stage].name
    return ConvergenceError(
        "limit load",
        f"limit load reached at fraction {reached:.6g} of stage {name!r}: bodies slide{where}, as under the pressures "
        f"in the contacts friction bears no more than the loads at {slides:.6g}; {BEYOND}",
    )


def _describe_bound(balanced: float) -> str:
    return f"no forces that the contacts can carry balance the loads beyond {balanced:.6g}"


def end_at_rest(problem: Problem, stage: int, target: float, error: ConvergenceError) -> ConvergenceError:
    """The error of a first step whose problem is the same at every fraction."""
    name = problem.model.stages[stage].name
    return ConvergenceError(
        error.reason,
        f"stage {name!r} stopped at the fraction 0; the load grows in proportion from rest, and what fails at "
        f"{target:.6g} fails at every fraction: {error.detail}",
        error.places,
    )


def _list_softening(problem: Problem, memory: Memory) -> str:
    """The interfaces whose bonds have given way in part, quoted; "" if none."""
    bonded = find_bonded(problem.laws, memory)
    if not bonded.any():
        return ""
    own = np.unique(problem.mesh.pairs.interface[bonded & (memory.internal[SEPARATION.name] > 0)])
    return ", ".join(repr(problem.mesh.interface_names[number]) for number in own)


def end_march(
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
    softening = _list_softening(problem, memory) if error.reason in UNSETTLED else ""
    if softening:
        return ConvergenceError(
            "limit load",
            f"limit load reached at fraction {reached:.6g} of stage {name!r}: the bonds of {softening} soften, and no "
            f"equilibrium was found at {target:.6g} ({error.detail}); they cannot carry more, or the response "
            f"snaps back; {BEYOND}",
        )
    # Of the whole stage: whether a try went beyond the bound depends on the steps.
    balanced = find_balanced(problem, memory, stage, reached, 1.0)
    bound = f"; {_describe_bound(balanced)}" if balanced < 1.0 else ""
    return ConvergenceError(
        error.reason,
        f"stage {name!r} stopped at the fraction {reached:.6g}; the step to {target:.6g} failed and is the "
        f"smallest allowed (solver.min_step = {problem.model.solver.min_step:g}): {error.detail}{bound}",
        error.places,
    )
