"""The modes of contacts that come to rest against dashpots, where the search for those of a load step does not settle.

See pbem.contact.damped. A search that takes long asks for them once and goes on from there; where bodies do not come to
rest it soon ends.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pbem.arrays import Integer, Real
from pbem.contact.complementarity import take_subset
from pbem.contact.damped import Damped, come_to_rest
from pbem.contact.laws import (
    OPEN,
    STICK,
    Memory,
    ModeState,
    PairState,
    find_changing,
    find_pivoting,
    plastic_slip,
)
from pbem.contact.loads import Load
from pbem.contact.modes import Proposal, linearise
from pbem.contact.running import Rest, find_running
from pbem.errors import ConvergenceError
from pbem.solve.nonlinear.hold import Hold
from pbem.solve.nonlinear.judging import make_judge
from pbem.solve.nonlinear.resting import find_pairs_around, is_idle, rest_bodies
from pbem.solve.nonlinear.search import GLOBALISATIONS, Search
from pbem.solve.problem.given import is_driven
from pbem.solve.problem.problem import Problem
from pbem.solve.problem.response import find_response
from pbem.solve.problem.tangent import TangentOperator

# Larger models are not asked: pivoting takes a time that grows with the cube of the number of pairs, and more. Those
# up to the second number are asked at last, where the largest load is near or bonds have failed: elsewhere shorter
# elements may settle what moves on with these.
MOST_PAIRS, MOST_AT_LAST = 300, 400


def can_be_damped(problem: Problem, tangent: TangentOperator, most: int = MOST_PAIRS) -> bool:
    """Whether `find_damped` can be asked: for laws whose contact can be pivoted, of models with so many pairs at most.
    """
    laws = problem.laws
    pivots = (find_pivoting(laws) | find_running(laws)).all() and not laws.follows.any()
    some = find_changing(laws).any()
    return bool(pivots and some) and laws.count <= most and not tangent.settling.nearby


def find_damped(
    problem: Problem, tangent: TangentOperator, begin: Memory, load: Load, rested: set[str] | None = None
) -> Damped | None:
    """Where the contact comes to rest under a load, from the memory of the last step; None if that operator is singular
    in which all pairs stick. Two solutions for each pair whose mode can change; all ranks together. (theory, 129)

    In the result modes, normal tractions and slips are those of all pairs (m,); nan where the mode cannot change.
    rested: takes the names of bodies that were laid down; without it none are. (theory, 128)
    """
    laws = problem.laws
    modes = ModeState(np.where(laws.parted, OPEN, STICK).astype(np.int8), begin.modes.sign)
    law = linearise(laws, modes, np.zeros(laws.count), begin.slip, begin, load.pressure, problem.traction_scale)
    hold, pairs = Hold(problem, begin, load), np.flatnonzero(find_changing(laws))
    constraints = hold.release(problem.constrain(law, load), modes)
    try:
        solved = tangent.check(tangent.solve(constraints, load, law), constraints, load, law)
        response = find_response(problem, tangent, constraints, load, law, solved, pairs)
    except ConvergenceError:
        return None
    subset = take_subset(laws, begin, load.pressure, begin.modes, pairs)
    judge = make_judge(problem, solved, GLOBALISATIONS[0])
    before = np.stack([begin.opening, begin.slip], axis=1)[pairs]
    hold.driven = rested is not None  # the response is that of no anchors: what they would hold is to lie
    lying: set[str] = set()

    def ask(own: ModeState, state: PairState) -> Proposal:
        return judge(subset.laws, own, state, subset.memory, subset.pressure)

    def lay(own: ModeState, state: PairState) -> tuple[ModeState, Callable[..., Proposal]] | None:
        whole, opening, slip = modes.put(pairs, own), begin.opening.copy(), np.zeros(laws.count)
        opening[pairs], slip[pairs] = state.g_n, plastic_slip(subset.laws, state) - subset.memory.slip
        names = [motion.regions[0] for motion in hold.list_free(whole) if len(motion.regions) == 1]
        laid, told = rest_bodies(problem, load, whole, opening, slip, list(dict.fromkeys(names)))
        if not told or hold.leaves_free(laid):
            return None
        lying.update(told)
        around = np.isin(pairs, np.concatenate([find_pairs_around(problem.mesh, name)[0] for name in told]))

        def excuse(own: ModeState, state: PairState) -> Proposal:
            idle = around & (own.mode != OPEN) & is_idle(problem, state, subset.pressure)
            return ask(own, state).keep(own, idle)

        return ModeState(laid.mode[pairs], laid.sign[pairs]), excuse

    def follow() -> tuple[Damped, set[str]]:
        lying.clear()
        found = come_to_rest(subset, response, ask, lambda own: not hold.leaves_free(modes.put(pairs, own)), before,
                             *([] if rested is None else [lay]))
        runs = modes.put(pairs, found.runs) if found.runs else None
        # Smooth bodies that no load moves are turned by errors of the mesh, where nothing resists that.
        driven = runs is not None and is_driven(problem, load, hold.list_free(runs))
        rest = found.rest and Rest(modes.put(pairs, found.rest.modes), *(
            _spread(each, pairs, laws.count) for each in (found.rest.normal_traction, found.rest.slip)))
        return Damped(rest, runs if driven else None, found.instants), lying if rest else set()

    found, told = problem.decide(follow)
    if rested is not None:
        rested |= told
    return found


def _spread(values: Real, pairs: Integer, count: int) -> Real:
    """Values of some pairs (s,) among all of them (m,); nan elsewhere."""
    everywhere = np.full(count, np.nan)
    everywhere[pairs] = values
    return everywhere


def describe_run(problem: Problem, begin: Memory, load: Load, modes: ModeState) -> ConvergenceError:
    """The error of a contact that does not come to rest but moves on in these modes; that of the first rank."""
    def describe() -> ConvergenceError:
        free = Hold(problem, begin, load).describe_free_motion(modes)
        moves = free.detail.split("; ")[0] if free else "nothing in the present contact stops them"
        return ConvergenceError("limit load", f"bodies that dashpots slow down move on and come to no rest: {moves}")

    return problem.decide(describe)


def rest_late(
    problem: Problem, tangent: TangentOperator, memory: Memory, load: Load, search: Search, rested: set[str]
) -> Rest | None:
    """Where the contact of a search that takes long comes to rest; the search is told if it does not.

    rested: see find_damped.
    """
    damped = find_damped(problem, tangent, memory, load, rested)
    if damped and damped.runs:
        search.collapse = describe_run(problem, memory, load, damped.runs).detail
    search.restless = damped is None or not (damped.rest or damped.runs)
    return damped.rest if damped else None
