"""Groups of pairs that are solved by pivoting within a search, with all other pairs as they are; and how a search ends.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pbem.contact.complementarity import Subset, take_subset
from pbem.contact.constraints import ConstraintMap
from pbem.contact.laws import Memory, ModeState, follow_leaders
from pbem.contact.loads import Load
from pbem.contact.modes import Linearisation, Proposal
from pbem.contact.pivoting import OperationCount
from pbem.contact.subset import Settled, settle_subset
from pbem.errors import ConvergenceError
from pbem.parallel import broadcast
from pbem.solve.nonlinear.damped import MOST_AT_LAST, can_be_damped, rest_late
from pbem.solve.nonlinear.hold import Hold
from pbem.solve.nonlinear.judging import make_judge
from pbem.solve.nonlinear.search import Search
from pbem.solve.nonlinear.unsettled import describe_unsettled
from pbem.solve.problem.response import find_response
from pbem.solve.problem.tangent import Solved, TangentOperator
from pbem.solve.tangent.nearby import MOST_ASKED, settle_parts


def end_search(hold: Hold, reason: str, modes: ModeState, proposal: Proposal, search: Search) -> ConvergenceError:
    """The error of a search that does not settle in these modes, with the truest reason that is known; that of the
    first rank."""
    search.unsettled = reason != "no admissible modes"
    if search.collapse:
        return ConvergenceError("limit load", search.collapse)
    spent = search.is_spent() and reason == "mode cycle"

    def describe() -> ConvergenceError:
        error = describe_unsettled(
            hold.problem, "iteration limit" if spent else reason, modes, proposal, search.failed_group, search.failed,
            np.zeros(hold.problem.laws.count) if hold.load is None else hold.load.pressure)
        if search.is_spent() and error.reason == "iteration limit":
            taken = "pivoting has taken all that so many iterations may (solver.newton_max_iterations)"
            error = ConvergenceError(error.reason, f"{error.detail}; {taken}", error.places, error.unless)
        hold.doubt_free_motion(proposal.modes, error)
        return hold.describe_floating(proposal.modes) or error

    try:
        error = hold.problem.decide(describe)
    except ConvergenceError as free:
        error = free
    error.restless = search.restless
    return error


def pivot_group(
    hold: Hold, tangent: TangentOperator, constraints: ConstraintMap, modes: ModeState, memory: Memory, load: Load,
    law: Linearisation, solved: Solved, search: Search,
) -> ModeState | None:
    """The modes that all groups of a crack network settle on by themselves, or else with those of the search's group
    solved by pivoting; None if it has none or they have no solution.

    Raises ConvergenceError: "no admissible modes" of these pairs while all others settle.
    """
    problem = hold.problem
    judge = make_judge(problem, solved, search.globalisation)
    if search.may_sweep():
        swept = tangent.sweep(constraints, modes, memory, load, law, solved, judge)
        if swept.fingerprint() != modes.fingerprint():
            search.swept = True
            return swept
    group = search.choose_group()
    if not len(group):
        return None
    response = find_response(problem, tangent, constraints, load, law, solved, group)
    whole = take_subset(problem.laws, memory, load.pressure, modes, group)

    # Pairs that cannot be in a group would else keep the modes that they are leaving as long as others are pivoted.
    alone = search.excluded
    start = ModeState(
        np.where(alone, search.proposal.modes.mode, modes.mode).astype(np.int8),
        np.where(alone, search.proposal.modes.sign, modes.sign),
    )

    def complete(own: ModeState) -> ModeState:
        return follow_leaders(problem.laws, start.put(group, own))

    def settle(effort: OperationCount) -> Settled:
        subset = replace(whole, effort=effort)
        if tangent.settling.nearby and len(group) > MOST_ASKED:
            return settle_parts(subset, response, search.proposal.modes, group, judge)
        found, refused = _settle(subset, True)
        # Modes that other anchors hold are still nearer, where there are none with those that act.
        return _settle(subset, False)[0] if found.modes is None and refused else found

    def _settle(subset: Subset, anchored: bool) -> tuple[Settled, bool]:
        """What is found, and whether modes were refused only as other anchors than those that act would hold them."""
        refused = False

        def holds(own: ModeState) -> bool:
            nonlocal refused
            # A body that nothing drives is laid down again where these modes leave it free, until modes come back so.
            if not hold.leaves_free(complete(own), anchored, laid=not search.level):
                return True
            refused = refused or (anchored and not hold.leaves_free(complete(own)))
            return False

        found = settle_subset(
            subset, response, lambda m, s: judge(subset.laws, m, s, subset.memory, subset.pressure), holds)
        return found, refused

    found = search.pivot(problem, settle)
    ends = search.conclude(found)
    if found.modes is None and search.widen(ends):
        return pivot_group(hold, tangent, constraints, modes, memory, load, law, solved, search)
    # Pairs that hold a body are moved on from state to state: their group is not to be judged by one of them.
    if ends and not broadcast(problem.comm, len(hold.pairs)):
        resting = _rest_without_bonds(hold, tangent, memory, load, search)
        if resting is None:
            raise end_search(hold, "no admissible modes", modes, search.proposal, search)
        return resting
    if found.modes is None:
        return None
    settled = complete(found.modes)
    if tangent.settling.nearby and settled.fingerprint() == modes.fingerprint():
        return None  # what is near says otherwise than the whole model did
    return settled


def _rest_without_bonds(
    hold: Hold, tangent: TangentOperator, memory: Memory, load: Load, search: Search
) -> ModeState | None:
    """The modes in which bodies come to rest after bonds have failed in this step; None if they do not, or none has.

    A body that the last of its bonds holds turns about it: modes that free it are none of its group, and no others are
    found. Then the search is told that it moves on. Asked once in a search.
    """
    lost = broadcast(hold.problem.comm, bool((memory.broken & ~hold.memory.broken).any()))
    if not lost or search.bondless or not can_be_damped(hold.problem, tangent, MOST_AT_LAST):
        return None
    search.bondless = True
    rest = rest_late(hold.problem, tangent, memory, load, search, hold.rested)
    if rest is None:
        return None
    search.futile = 0
    return follow_leaders(hold.problem.laws, rest.modes)
