"""Contact of all pairs that comes to rest: dashpots bear a part of the tractions until nothing moves any more.

A search that looks for the equilibrium at once has nothing to go by where bodies are nearly free, or where there is no
equilibrium. With dashpots beside the pairs, p of the law = p - k (g - g'), g' the jumps before, every body is held, and
for any friction the modes of one instant are found by pivoting (pbem.contact.subset). From instant to instant the
dashpots become weaker. Where the bodies come to rest they carry nothing: that is an equilibrium. Where instead the
same modes lead on and on, by a motion that grows as 1 / k and that no traction resists, the loads drive a mechanism.
The method is the proximal point algorithm (R. T. Rockafellar, SIAM J. Control Optim. 14, 1976; theory, 129).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from pbem.arrays import Real
from pbem.contact.complementarity import Response, Subset, find_compliance, pose, solve_in_modes
from pbem.contact.laws import OPEN, ModeState, PairState, plastic_slip
from pbem.contact.modes import Proposal, measure_law_error
from pbem.contact.pivoting import OperationCount
from pbem.contact.running import NEAR, Rest
from pbem.contact.subset import find_losing, find_weak, part_for_good, step_subset

# Stiffness of the dashpots at first, relative to the median of the pairs' own; the part to which it falls from instant
# to instant; and how many instants there are. Of a motion that goes on quickly the way may matter: slowly as well.
SCHEDULES = ((0.1, 0.1, 12), (1.0, 0.4, 30))
# Dashpots that hold all bodies, and change nothing of what single pairs do.
SOFTEST = 1e-4
# A motion goes on steadily if it grows as 1 / k but for this part, so many times in turn.
STEADY, IN_TURN = 0.05, 2
# What open faces come nearer by, of the largest motion, that is none.
APPROACH = 1e-6
# Problems of contact of a schedule at most, of so many pairs, as in pbem.contact.running; of more pairs fewer. Friction
# that changes with slip is taken at the slips of the problem before, in one instant so often at most.
MOST_SOLVED, OF_PAIRS, MOST_TAKEN = 1000, 100, 100
# Newton's steps of an instant before it is pivoted: those that lead to its modes are few.
MOST_STEPS = 25
# Instants in turn in which faces lack the strength that they lost in them: what follows leads to no equilibrium either.
# And problems of one such instant, where friction changes with slip.
MOST_PARTED, MOST_LACKING = 3, 10
# Operations that they may take, all together.
MOST_EFFORT = 5e10

Judge = Callable[[ModeState, PairState], Proposal]
Lay = Callable[[ModeState, PairState], tuple[ModeState, Judge] | None]


@dataclass(frozen=True)
class Damped:
    """Where all pairs come to rest.

    rest: the equilibrium; None if it was not found. runs: modes in which the bodies move on, whatever the path; None
    if they do not, or if that was not found out. instants: how many were solved.
    """

    rest: Rest | None
    runs: ModeState | None
    instants: int


def come_to_rest(
    subset: Subset, response: Response, judge: Judge, holds: Callable[[ModeState], bool], before: Real,
    lay: Lay = lambda modes, state: None,
) -> Damped:
    """Follow all pairs (s,) to where they rest, from the jumps g_n, g_s before (s, 2), a length.

    judge: see settle_subset; holds: whether all bodies are held in these modes. lay: where they are not, the modes with
    bodies laid down that nothing drives, and the judge of these; None if others are free. Nothing is found on meshes on
    which single pairs give way in the wrong sense. (theory, 129)
    """
    own, instants = _measure_stiffness(response), 0
    subset = replace(subset, effort=OperationCount(MOST_EFFORT))
    if not _is_sound(subset, _damp(response, SOFTEST * own, response.values[:, 2:])):
        return Damped(None, None, 0)
    runs: ModeState | None = None
    for first, part, most in SCHEDULES:
        left = round(MOST_SOLVED * min(OF_PAIRS / subset.laws.count, 1.0) ** 2)
        stiffness, motion, steady, lacking = first * own, np.zeros_like(before), 0, 0
        modes, present, jumps = subset.modes, response, before / response.length_unit
        for _ in range(most):
            found = _solve_instant(replace(subset, modes=modes), present, judge, stiffness, jumps, left)
            if found is None:
                break
            now, present, left, lawful = found
            instants, lacking, held = instants + 1, 0 if lawful else lacking + 1, holds(now)
            stays = (now, judge) if held else lay(now, present.evaluate(np.zeros(2 * subset.laws.count)))
            rest = _stay(replace(subset, modes=stays[0]), present, stays[1]) if stays else None
            if rest:
                return Damped(rest, None, instants)
            moved, same = present.values[:, 2:] - jumps, now.fingerprint() == modes.fingerprint()
            off = np.abs(moved - motion / part).max(initial=0.0)
            # What holds the bodies resists only once it has been strained.
            goes_on = same and not held and off <= STEADY * np.abs(moved).max(initial=0.0) and not _closes(now, moved)
            steady = steady + 1 if goes_on and lawful else 0
            if steady == IN_TURN or lacking == MOST_PARTED:
                break
            modes, jumps, motion, stiffness = now, present.values[:, 2:], moved, stiffness * part
        if steady < IN_TURN:
            return Damped(None, None, instants)
        runs = modes
    return Damped(None, runs, instants)


def _closes(modes: ModeState, moved: Real) -> bool:
    """Whether a motion g_n, g_s (s, 2) brings open faces nearer to each other: if it goes on, they stop it."""
    return bool((moved[modes.mode == OPEN, 0] < -APPROACH * np.abs(moved).max(initial=0.0)).any())


def _is_sound(subset: Subset, damped: Response) -> bool:
    """Whether no single pair opens under compression, or slips against the shear, as on meshes that carry no contact.
    """
    compliance, _ = find_compliance(pose(subset, damped))
    return compliance is not None and bool((np.diag(compliance) < 0).all())


def _measure_stiffness(response: Response) -> float:
    """The median of what the pairs' own jumps do to their own tractions, in the response's units."""
    tractions, jumps = (response.change[:, k : k + 2].reshape(-1, response.change.shape[2]) for k in (0, 2))
    return float(np.median(np.abs(np.diag(np.linalg.lstsq(jumps.T, tractions.T, rcond=None)[0]))))


def _damp(response: Response, stiffness: float, jumps: Real) -> Response:
    """The response with dashpots that keep the jumps (s, 2) with a stiffness, all in its units."""
    values, change = response.values.copy(), response.change.copy()
    values[:, :2] -= stiffness * (response.values[:, 2:] - jumps)
    change[:, :2] -= stiffness * response.change[:, 2:]
    return replace(response, values=values, change=change)


def _move(response: Response, d: Real) -> Response:
    """The response from the states for d on."""
    return replace(response, values=response.values + response.change @ d)


def _solve_instant(
    subset: Subset, response: Response, judge: Judge, stiffness: float, jumps: Real, left: int
) -> tuple[ModeState, Response, int, bool] | None:
    """The modes of one instant, the response from its states on, how many problems are left, and whether the laws hold
    in it; None if not found.

    Where friction changes with slip the bound is taken at the slips of the last time, as in pbem.contact.running. Where
    Newton's steps find no modes, what parts in this instant has no strength in it, and if it touches again none before
    the next one.
    """
    before, lost = subset, np.zeros(subset.laws.count, dtype=bool)
    for taken in range(1, min(left, MOST_TAKEN) + 1):
        damped = _damp(response, stiffness, jumps)
        problem = pose(subset, damped)
        found = None
        if not lost.any():
            found = step_subset(problem, subset.modes, damped, judge, most=MOST_STEPS, shares=(0.0,))
        if found is None:
            loses = find_losing(before, pose(before, damped))
            parted = part_for_good(before, damped, loses & (before.modes.mode == OPEN))
            if parted is None or (lost.any() and taken > MOST_LACKING):
                return None
            found, lost = parted
            subset = replace(before, memory=before.memory.lose(before.memory.broken | lost))
            problem = pose(subset, damped)
        d = solve_in_modes(problem, found)
        if d is None:
            return None
        stays = not judge(found, damped.evaluate(d)).changed.any()
        if not stays and not lost.any():  # friction alone has modes: what is refused of them is ill-conditioned
            return None
        before, subset, response = replace(before, modes=found), replace(subset, modes=found), _move(response, d)
        if _fulfils(subset, _damp(response, stiffness, jumps)):
            return found, response, left - taken, stays and not find_weak(found, lost).any()
    return None


def _stay(subset: Subset, response: Response, judge: Judge) -> Rest | None:
    """The equilibrium in the modes of the subset without dashpots; None if the judge does not leave them as they are.
    """
    for _ in range(MOST_TAKEN):
        d = solve_in_modes(pose(subset, response), subset.modes)
        if d is None:
            return None
        response = _move(response, d)
        state = response.evaluate(np.zeros_like(d))
        if judge(subset.modes, state).changed.any():
            return None
        if _fulfils(subset, response):
            return Rest(subset.modes, state.p_n, plastic_slip(subset.laws, state))
    return None


def _fulfils(subset: Subset, response: Response) -> bool:
    """Whether friction is what it is at the slips of the response's states."""
    state = response.evaluate(np.zeros(response.change.shape[2]))
    return measure_law_error(
        subset.laws, subset.modes, state, subset.memory, subset.pressure, response.traction_unit) <= NEAR
