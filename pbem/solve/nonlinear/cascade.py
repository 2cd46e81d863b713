"""Brittle bonds that fail one after the other in one step: the whole cascade between two solutions of Newton's method.

Where a bond fails its load goes to its neighbours, and a front of failures runs along an interface, often by a pair at
a time. With all other pairs kept in their modes the states of all brittle pairs are affine in few numbers (see
pbem.contact.subset): the broken ones are settled, the load of the intact ones follows, and the worst of them
fail next, in the same order as with a solution of the whole problem for each. What the cascade leaves is confirmed, and
mended where other pairs change with it, by Newton's iterations that follow.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from pbem.arrays import Bool, Complex, Integer, Real
from pbem.contact.complementarity import Response, Subset, take_subset
from pbem.contact.constraints import ConstraintMap
from pbem.contact.laws import Memory, ModeState, PairState, follow_leaders, plastic_slip
from pbem.contact.loads import Load
from pbem.contact.modes import Linearisation, Proposal, find_failures, linearise, update_active_set
from pbem.contact.subset import settle_subset
from pbem.mesh.numbering import number_components
from pbem.solve.problem.problem import Problem
from pbem.solve.problem.response import find_response
from pbem.solve.problem.tangent import Solved, TangentOperator

# Newton's steps among the broken pairs alone before they are settled by pivoting.
MOST_STEPS = 15
# So few pairs at a time are not worth the solutions that their response takes.
LEAST_FOLLOWED = 100


@dataclass(frozen=True)
class Cascade:
    """Bonds (m,) that are lost at its end, and all pairs' modes then; None where they could not be settled."""

    broken: Bool
    modes: ModeState | None


def run_cascade(
    problem: Problem, tangent: TangentOperator, constraints: ConstraintMap, modes: ModeState, memory: Memory,
    load: Load, law: Linearisation, solved: Solved, failing: Bool, floor: float, most: int,
    holds: Callable[[ModeState], bool] = lambda modes: True,
) -> Cascade:
    """Let bonds fail, the worst first, until no other fails; all ranks together.

    modes, solved: a settled state, in which the bonds `failing` (m,) are overloaded. floor: a stress that counts as
    rounding does (see pbem.contact.modes). most: the largest number of brittle pairs that are followed at once; of more
    those that are nearest to the failing ones, to which their load goes. What fails beyond them fails next. holds:
    whether modes of all pairs hold all bodies, asked on the first rank; where bonds that are lost leave one free what
    the others do hangs on the last bits of its motion, and the cascade ends.
    """
    broken = memory.broken | failing
    leader = problem.laws.leader
    pairs = np.flatnonzero(problem.laws.brittle & ~problem.laws.follows)
    if len(pairs) > most:
        if most < LEAST_FOLLOWED:
            return Cascade(broken, None)
        pairs = _find_nearest(problem.mesh.pairs.position, pairs, np.flatnonzero(failing), most)
    response = find_response(problem, tangent, constraints, load, law, solved, pairs)
    scale = problem.traction_scale
    start = memory.lose(broken)
    subset = take_subset(problem.laws, start, load.pressure, modes, pairs)

    def complete(own: ModeState) -> ModeState:
        return follow_leaders(problem.laws, modes.put(pairs, own))

    lost, own = problem.decide(lambda: _follow(subset, response, scale, floor, lambda now: holds(complete(now))))
    broken[pairs] = lost
    return Cascade(broken[leader], None if own is None else complete(own))


def _find_nearest(position: Complex, pairs: Integer, failing: Integer, most: int) -> Integer:
    """Of pairs (s,), rising, the given number that are nearest to failing ones."""
    places = np.stack([position.real, position.imag], axis=1)
    distance, _ = cKDTree(places[failing]).query(places[pairs])
    return np.sort(pairs[np.argsort(distance, kind="stable")[:most]])


def _follow(
    subset: Subset, response: Response, scale: float, floor: float, holds: Callable[[ModeState], bool]
) -> tuple[Bool, ModeState | None]:
    """The bonds of s pairs that are lost in the end, and their modes; None if some round could not be settled."""
    broken = subset.memory.broken.copy()
    while True:
        memory = subset.memory.lose(broken)
        found = _settle(replace(subset, memory=memory), response, scale, floor, holds)
        if found is None:
            return broken, None
        modes, state = found
        subset = replace(subset, modes=modes)
        failing = find_failures(subset.laws, state, memory, subset.pressure, floor)
        if not failing.any():
            return broken, modes
        broken = broken | failing


def _settle(
    subset: Subset, response: Response, scale: float, floor: float, holds: Callable[[ModeState], bool]
) -> tuple[ModeState, PairState] | None:
    """Modes and states of all pairs while the intact ones stick: of those that are lost by Newton's steps among them
    alone, by pivoting where these do not end."""
    lost = np.flatnonzero(subset.memory.broken)
    columns = number_components(lost)
    part = replace(response, values=response.values[lost], change=response.change[lost][:, :, columns])
    own = take_subset(subset.laws, subset.memory, subset.pressure, subset.modes, lost)

    def judge(chosen: ModeState, state: PairState) -> Proposal:
        return update_active_set(own.laws, chosen, state, own.memory, own.pressure, 1.0, floor)

    def hold(chosen: ModeState) -> bool:
        return holds(subset.modes.put(lost, chosen))

    modes, d = _step(own, part, scale, judge, hold)
    if modes is None:
        modes = settle_subset(own, part, judge, hold).modes
        d = None if modes is None else _solve_laws(own, modes, part, scale)
    if modes is None or d is None:
        return None
    return subset.modes.put(lost, modes), replace(response, change=response.change[:, :, columns]).evaluate(d)


def _step(
    subset: Subset, response: Response, scale: float, judge: Callable[[ModeState, PairState], Proposal],
    holds: Callable[[ModeState], bool],
) -> tuple[ModeState | None, Real | None]:
    """Modes that no longer change, and d; None if that takes too many steps or frees a body."""
    modes = subset.modes
    for _ in range(MOST_STEPS):
        d = _solve_laws(subset, modes, response, scale) if holds(modes) else None
        if d is None:
            break
        proposal = judge(modes, response.evaluate(d))
        if not proposal.changed.any():
            return modes, d
        modes = proposal.modes
    return None, None


def _solve_laws(subset: Subset, modes: ModeState, response: Response, scale: float) -> Real | None:
    """d (2 s,) for which the states of s pairs fulfil their laws in these modes; None if there is none."""
    state, count = response.evaluate(np.zeros(2 * subset.laws.count)), subset.laws.count
    slip = plastic_slip(subset.laws, state)
    law = linearise(subset.laws, modes, state.p_n, slip, subset.memory, subset.pressure, scale)
    units = np.array([response.traction_unit] * 2 + [response.length_unit] * 2)
    # What is orthogonal to the law's tangent has to vanish in state - offset.
    across = np.linalg.svd(law.tangent / units[:, None])[0][:, :, 2:].transpose(0, 2, 1)
    try:
        d: Real = np.linalg.solve(
            (across @ response.change).reshape(2 * count, 2 * count),
            (across @ (law.offset / units - response.values)[..., None]).ravel(),
        )
    except np.linalg.LinAlgError:
        return None
    return d if np.isfinite(d).all() else None
