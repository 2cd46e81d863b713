"""Whether a step's problem is the same at every fraction of its load, so that a smaller step cannot help."""

from __future__ import annotations

import numpy as np

from pbem.contact.laws import Memory, PairLaws, start_memory
from pbem.solve.problem.problem import Problem


def is_proportional(problem: Problem, memory: Memory, stage: int, reached: float) -> bool:
    """Whether states of this step at a fraction f of its load are f times those at the whole load.

    So it is from rest in the first stage, where all that is prescribed grows with the load from nothing, with laws that
    know no length and no stress of their own: friction alone, without gap, cohesion, tensile strength or fluid.
    """
    return _has_no_scale(problem.laws) and _grows_from_rest(problem, memory, stage, reached)


def is_proportional_at_last(problem: Problem, memory: Memory, stage: int, reached: float) -> bool:
    """Whether states of this step come to be proportional to its load, the smaller that is, and are not trivial there.

    So it is as above with cohesion besides, which no traction reaches in the end: faces without tensile strength then
    either part or stick, and where no choice of these is admissible no smaller step finds one. Bonds with tensile
    strength hold in the end; those without are lost where they part, and what friction then does knows no stress.
    Friction that weakens with slip has not yet done so, as slips get small beside the distance that this takes.
    """
    laws = problem.laws
    parts = ~(laws.bonded | laws.parted) & ~(laws.tensile_strength > 0)
    plain = all(group.law.pivots_at_slip for group in laws.strengths if parts[group.pairs].any())
    if laws.gap[parts].any() or not parts.any() or not plain:
        return False
    return _grows_from_rest(problem, memory, stage, reached)


def _grows_from_rest(problem: Problem, memory: Memory, stage: int, reached: float) -> bool:
    """Whether this is the first step, with all that is prescribed growing from nothing, and no fluid."""
    if stage > 0 or reached > 0 or problem.model.timed:
        return False
    rest = start_memory(problem.laws)
    untouched = not memory.slip.any() and not memory.normal_traction.any()
    same = np.array_equal(memory.modes.mode, rest.modes.mode) and all(
        np.array_equal(memory.internal[name], values) for name, values in rest.internal.items()
    )
    first = problem.evaluate_load(0, 0.0)
    whole = problem.evaluate_load(0, 1.0)
    starts = (first.values, first.known, *first.fields.list_all(), first.carried)
    return untouched and same and not any(part.any() for part in starts) and not whole.pressure.any()


def _has_no_scale(laws: PairLaws) -> bool:
    """Whether the laws are friction alone."""
    may_touch = ~(laws.bonded | laws.parted)
    if laws.tensile_strength[may_touch].any() or laws.gap[may_touch].any():
        return False
    return all(
        group.law.linear and not group.parameters["cohesion"][may_touch[group.pairs]].any()
        for group in laws.strengths
        if may_touch[group.pairs].any()
    )
