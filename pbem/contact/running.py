"""Friction that weakens with slip: the pairs of a group run on, from where they were, to where they come to rest.

With the bound of each iteration taken at the slip of the last one, contact is a problem of Coulomb's friction; slips
weaken the faces and lead to the next problem, until the bound no longer changes: the first equilibrium on the way from
the state before the step, which is the one that faces reach that slip slowly (a fixed point of friction; J. Haslinger
et al., Numerical methods for unilateral problems in solid mechanics, 1996). It can take hundreds of problems, as faces
that pass by a state which is nearly an equilibrium run on slowly: each is solved among the pairs of the group alone,
whose states are affine in what their laws demand while all others keep their modes (pbem.contact.complementarity).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from pbem.arrays import Bool, Real
from pbem.contact.complementarity import Response, Subset, pose, solve_in_modes
from pbem.contact.laws import SLIP, STICK, ModeState, PairLaws, PairState, plastic_slip, resists_slip
from pbem.contact.modes import Proposal, measure_law_error
from pbem.contact.subset import settle_subset

# Problems of friction at most, of so many pairs; of more pairs fewer, as each costs more, but so many at least.
MOST_RUN, OF_PAIRS, LEAST_RUN = 2000, 100, 50
# How far the laws may be from holding in the end: Newton's steps with all pairs go on.
NEAR = 1e-9


@dataclass(frozen=True)
class Rest:
    """Where pairs (s,) come to rest: their modes, and normal tractions and plastic slips at which their laws hold."""

    modes: ModeState
    normal_traction: Real
    slip: Real


def find_running(laws: PairLaws) -> Bool:
    """The pairs (m,) whose friction changes with slip, and is Coulomb's at a given one."""
    runs = np.zeros(laws.count, dtype=bool)
    for group in laws.strengths:
        runs[group.pairs] = group.law.pivots_at_slip and not group.law.pivots
    return runs


def run_on(
    subset: Subset, response: Response, judge: Callable[[ModeState, PairState], Proposal],
    holds: Callable[[ModeState], bool],
) -> Rest | None:
    """Where the pairs of a subset come to rest that begin the step as its memory says; None if that is not found.

    judge, holds: see settle_subset. Errors of the laws are related to the largest traction of the model. (theory, 56)
    """
    laws, memory = subset.laws, subset.memory
    # Slips of the step so far count for pairs that slip: at first none does that could stick.
    begins = np.where((memory.modes.mode == SLIP) & resists_slip(laws), STICK, memory.modes.mode)
    modes, present = ModeState(begins.astype(np.int8), memory.modes.sign), response
    most = round(MOST_RUN * min(OF_PAIRS / laws.count, 1.0) ** 2)
    for _ in range(max(most, LEAST_RUN)):
        if subset.effort.is_spent:
            return None
        frozen = replace(subset, modes=modes)
        problem = pose(frozen, present)
        d = solve_in_modes(problem, modes) if holds(modes) else None
        if d is None or judge(modes, present.evaluate(d)).changed.any():
            found = settle_subset(frozen, present, judge, holds).modes
            d = None if found is None else solve_in_modes(problem, found)
            if found is None or d is None:
                return None
            modes = found
        present = replace(present, values=present.values + present.change @ d)
        state = present.evaluate(np.zeros(2 * laws.count))
        error = measure_law_error(laws, modes, state, memory, subset.pressure, response.traction_unit)
        if error <= NEAR:
            return Rest(modes, state.p_n, plastic_slip(laws, state))
    return None
