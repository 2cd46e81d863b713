"""Contact of some pairs while all others keep their modes: the modes of these few, found by pivoting.

By Newton's steps among these pairs alone, else by the complementarity problem of pbem.contact.complementarity. A pair
that parts loses its cohesion and its tensile strength at once, which that problem cannot say. Pairs that part in its
solution lose them in the next one, until no other parts. Where these then slip on less than they would have, such
pairs are taken out of their contact altogether ("detached") or not at all, one choice after another, and what pivoting
finds is asked to agree with the choice. Whatever is found has to pass the same judge as in Newton's method, with states
from its modes by a linear system.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from pbem.arrays import Bool, Real
from pbem.contact.complementarity import (
    PairProblem,
    Response,
    Subset,
    find_compliance,
    pivot_pairs,
    pose,
    solve_in_modes,
)
from pbem.contact.detached import choose_detached, choose_next, count_most_tried
from pbem.contact.laws import (
    OPEN,
    SLIP,
    ModeState,
    PairState,
    tensile_limit,
)
from pbem.contact.modes import Proposal, limit_changes
from pbem.contact.one_by_one import OneByOne

# The most pairs that are pivoted; Newton's steps among them cost a hundredth of it.
MOST_PIVOTED = 300
# In larger groups cohesion is not taken from pairs one after the other: each time is a problem of its own.
MOST_RELEASED = 150
# Newton's steps among the pairs of a group, each far cheaper than a solution with all.
MOST_STEPS = 100
# Where modes come back, only violations of this share of the largest change; at last one pair at a time.
SHARES = (0.0, 0.3, 1.0)


@dataclass(frozen=True)
class Settled:
    """Admissible modes of the pairs, or the reason why there are none.

    modes: None if none were found. exhaustive: whether then every choice was tried and there are none at all (while the
    other pairs keep their modes). tried: number of complementarity problems that were solved. wrong (s,): pairs whose
    own compliance has the wrong sign, on meshes that cannot carry contact; not asked where Newton's steps found modes.
    """

    modes: ModeState | None
    exhaustive: bool
    tried: int
    wrong: Bool


def settle_subset(
    subset: Subset, response: Response, judge: Callable[[ModeState, PairState], Proposal],
    holds: Callable[[ModeState], bool] = lambda modes: True,
) -> Settled:
    """Find modes of s pairs that `judge` leaves as they are; the judge sees modes and states of these pairs alone.

    holds: whether all bodies are held in modes of these pairs; modes that free one are none. Nothing more is looked for
    once the subset's effort is spent.
    """
    problem = pose(subset, response)
    loses = find_losing(subset, problem)
    none = np.zeros(len(loses), dtype=bool)
    stepped = step_subset(problem, subset.modes, response, judge, holds)
    if stepped is not None:
        return Settled(stepped, False, 0, none)
    compliance, sprung = find_compliance(problem)
    if compliance is None or subset.effort.is_spent:
        return Settled(None, False, 0, none)
    wrong = none if sprung else (np.diag(compliance) >= 0).reshape(2, -1).any(axis=0)
    if len(loses) > MOST_PIVOTED:
        return Settled(None, False, 0, wrong)
    kept = _release(subset, response, compliance, loses, judge, holds)
    if kept is not None:
        return Settled(kept, False, 1, wrong)
    tried: set[bytes] = set()
    complete = True
    for detached in choose_detached(subset.modes.mode == OPEN, loses):
        follow: Bool | None = detached
        while follow is not None and follow.tobytes() not in tried and len(tried) < count_most_tried(loses):
            tried.add(follow.tobytes())
            if subset.effort.is_spent:
                return Settled(None, False, len(tried), wrong)
            modes = pivot_pairs(problem, compliance, follow)
            # Whether pivoting ends on a ray or in modes that free a body, and whether their equations then have a
            # solution, is a matter of the last bits: both are no modes.
            if modes is None or not holds(modes):
                complete = False
                break
            d = solve_in_modes(problem, modes)
            if d is None:
                return Settled(modes, False, len(tried), wrong)
            proposal = judge(modes, response.evaluate(d))
            if not proposal.changed.any():
                return Settled(modes, False, len(tried), wrong)
            follow = choose_next(proposal, loses, follow, tried)
    # Friction alone always has admissible modes: what pivoting finds of it and the judge refuses is ill-conditioned.
    return Settled(None, complete and bool(loses.any()) and len(tried) >= 2 ** int(loses.sum()), len(tried), wrong)


def step_subset(
    problem: PairProblem, modes: ModeState, response: Response, judge: Callable[[ModeState, PairState], Proposal],
    holds: Callable[[ModeState], bool] = lambda modes: True, most: int = MOST_STEPS,
    shares: tuple[float, ...] = SHARES,
) -> ModeState | None:
    """Modes by Newton's steps among these pairs alone; None where they come back, take too many or free a body.

    Along a slender wedge the end of contact moves by an element or two in a step, however many there are.
    """
    solver = OneByOne(problem)
    for share in shares:
        if share == 1.0 and len(modes.mode) > most:  # it would not come to the end
            break
        seen: set[bytes] = set()
        while len(seen) < most and not problem.effort.is_spent and modes.fingerprint() not in seen:
            seen.add(modes.fingerprint())
            d = solver.solve(modes) if holds(modes) else None
            if d is None:
                return None
            proposal = judge(modes, response.evaluate(d))
            if not proposal.changed.any() and solver.updated:  # what is settled is said of factors of its own
                d = solver.solve(modes, anew=True)
                if d is None:
                    return None
                proposal = judge(modes, response.evaluate(d))
            if not proposal.changed.any():
                return modes
            modes = limit_changes(modes, proposal, share)
    return None


def find_losing(subset: Subset, problem: PairProblem) -> Bool:
    """The pairs (s,) that have less to bear where they part: cohesion, tensile strength, or friction under a fluid."""
    return (problem.adhesion > 0) | (tensile_limit(subset.laws, subset.memory) > 0)


def part_for_good(
    subset: Subset, response: Response, lost: Bool, compliance: Real | None = None,
    holds: Callable[[ModeState], bool] = lambda modes: True,
) -> tuple[ModeState, Bool] | None:
    """Modes of s pairs where those that part lose what they can lose, also where they touch again; and which have (s,).

    lost: those that have from the beginning. Each problem is one of friction alone: what parts in its solution has no
    strength in the next one, until no other parts. Pairs that slip on less than they would have are given back what
    they lost, once. compliance: see find_compliance. None where a problem has no solution, leaves a body free, or the
    subset's effort is spent.
    """
    whole, back = pose(subset, response), np.zeros_like(lost)
    loses = find_losing(subset, whole)
    if compliance is None:
        compliance, _ = find_compliance(whole)
    while compliance is not None and not subset.effort.is_spent:
        problem = pose(replace(subset, memory=subset.memory.lose(subset.memory.broken | lost)), response)
        modes = pivot_pairs(problem, compliance, np.zeros_like(lost), subset.modes)
        if modes is None or not holds(modes):
            return None
        subset = replace(subset, modes=modes)
        parted, weak = loses & (modes.mode == OPEN) & ~lost, find_weak(modes, lost)
        if parted.any():
            lost = lost | parted
        elif weak.any() and not (weak & back).any():
            lost, back = lost & ~weak, back | weak
        else:
            return modes, lost
    return None


def find_weak(modes: ModeState, lost: Bool) -> Bool:
    """The pairs (s,) that slip on less than they would have, as they have lost some in the same step."""
    return lost & (modes.mode == SLIP)


def _release(
    subset: Subset, response: Response, compliance: Real, loses: Bool,
    judge: Callable[[ModeState, PairState], Proposal], holds: Callable[[ModeState], bool],
) -> ModeState | None:
    """Modes where pairs lose what they can lose as they part, one after the other; None where they slip without it."""
    if not loses.any() or len(loses) > MOST_RELEASED:
        return None
    whole = pose(subset, response)
    for lost in (np.zeros_like(loses), loses & (subset.modes.mode == OPEN)):
        settled = part_for_good(subset, response, lost, compliance, holds)
        if settled is None or find_weak(*settled).any():
            continue
        d = solve_in_modes(whole, settled[0])
        if d is not None and not judge(settled[0], response.evaluate(d)).changed.any():
            return settled[0]
    return None
