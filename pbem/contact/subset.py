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
    loses = (problem.adhesion > 0) | (tensile_limit(subset.laws, subset.memory) > 0)
    none = np.zeros(len(loses), dtype=bool)
    stepped = _step(problem, subset.modes, response, judge, holds)
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


def _step(
    problem: PairProblem, modes: ModeState, response: Response, judge: Callable[[ModeState, PairState], Proposal],
    holds: Callable[[ModeState], bool],
) -> ModeState | None:
    """Modes by Newton's steps among these pairs alone; None where they come back, take too many or free a body.

    Along a slender wedge the end of contact moves by an element or two in a step, however many there are.
    """
    for share in SHARES:
        if share == 1.0 and len(modes.mode) > MOST_STEPS:  # it would not come to the end
            break
        seen: set[bytes] = set()
        while len(seen) < MOST_STEPS and not problem.effort.is_spent and modes.fingerprint() not in seen:
            seen.add(modes.fingerprint())
            d = solve_in_modes(problem, modes) if holds(modes) else None
            if d is None:
                return None
            proposal = judge(modes, response.evaluate(d))
            if not proposal.changed.any():
                return modes
            modes = limit_changes(modes, proposal, share)
    return None


def _release(
    subset: Subset, response: Response, compliance: Real, loses: Bool,
    judge: Callable[[ModeState, PairState], Proposal], holds: Callable[[ModeState], bool],
) -> ModeState | None:
    """Modes where pairs lose what they can lose as they part, one after the other; None where they slip without it.

    Whatever parts in the solution of a problem has no cohesion in the next one, but still touches where it has to. Each
    problem is one of friction alone. Pairs that slip on less than they would have are given back what they lost, once.
    """
    if not loses.any() or len(loses) > MOST_RELEASED:
        return None
    whole, nothing = pose(subset, response), np.zeros(len(loses), dtype=bool)
    for lost in (nothing, loses & (subset.modes.mode == OPEN)):
        back = nothing
        while not subset.effort.is_spent:
            broken = subset.memory.broken | lost
            modes = pivot_pairs(
                pose(replace(subset, memory=subset.memory.lose(broken)), response), compliance, nothing
            )
            if modes is None or not holds(modes):
                break
            parted = loses & (modes.mode == OPEN) & ~lost
            if parted.any():
                lost = lost | parted
                continue
            weak = lost & (modes.mode == SLIP)
            if not weak.any():
                d = solve_in_modes(whole, modes)
                if d is not None and not judge(modes, response.evaluate(d)).changed.any():
                    return modes
                break
            if (weak & back).any():
                break
            lost, back = lost & ~weak, back | weak
    return None
