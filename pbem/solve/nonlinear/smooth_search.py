"""Statuses of a contact whose laws are smoothed less and less, where those of the true one do not settle.

In open fractures hang thin blocks that single pairs hold. What holds them changes from one iteration to the next, they
turn by a multiple of what there is room for, and take the statuses of all around with them. Under smoothed laws every
pair holds what is near to it, the more the nearer it comes: blocks stay where there is room for them, and the solutions
change little from one width to the next (X. Chen, Math. Programming 134, 2012, reviews such methods). Short pairs have
larger widths, which makes the hyperbola a barrier of the same weight for each: Newton's method converges from one width
to the next only so (Y. Nesterov, A. Nemirovskii, Interior-point polynomial algorithms, 1994: barriers must not be less
curved than they rise steeply). From the statuses of the last width the search goes on with the true laws; of the
smoothed ones nothing is left but where it begins.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pbem.arrays import Real
from pbem.contact.constraints import evaluate_pairs
from pbem.contact.laws import SLIP, Memory, ModeState, PairState
from pbem.contact.loads import Load
from pbem.contact.smoothed import (
    close_all,
    find_smooth,
    linearise_smoothly,
    measure_violation,
    read_modes,
    take_off_proximal,
)
from pbem.errors import ConvergenceError
from pbem.solve.nonlinear.forcing import Forcing
from pbem.solve.nonlinear.hold import Hold
from pbem.solve.nonlinear.recorded import Record
from pbem.solve.problem.problem import Problem
from pbem.solve.problem.tangent import TangentOperator

# The laws are smoothed where after so many iterations ...
FIRST = 3
# ... no less than this part of the fewest pairs that changed before change (where blocks are held well it is a third at
# most), and more than this part of all and so many, as pivoting does for fewer;
SLOWLY = 0.5
MANY, LEAST = 0.03, 60
# or, after any number of iterations, as many times as many as at best before.
SOARED = 2
# The first width is this part of the mean violation of the true laws; the last one this part of the largest traction:
# with less, blocks that touch nothing would be held by nothing but rounding.
WIDTH, NARROWEST = 0.1, 1e-6
# It falls to this part of itself after an iteration that leaves this part of all pairs off the smoothed laws by more
# than their width, not if more are; if fewer are, to less by the root of how many fewer, at least so many times that.
FALL, OFF, LEAST_FALL = 0.3, 0.05, 0.1
# Where in so many iterations with one width no fewer pairs were off than at best before, the last one was too wide a
# step: the width rises again as far as it falls at most where OFF are off, and to fall it takes so many times as few.
STALLED, FEWER = 2, 0.3
# Pairs that are shorter than the mean have larger widths, by the root of how much shorter they are, up to so much.
MOST_WIDENED = 1e3
# The proximal stiffness is this part of that of the surroundings of each pair alone: enough for systems to be regular
# where tangents cancel these, and so little that blocks hardly feel it.
PROXIMAL = 1e-5
# It ends after so many iterations, or one with the last width in which no more than this part of all pairs, or so many,
# change: with the true laws the few blocks that are left settle sooner.
LONGEST, FEW, FEWEST = 40, 1e-2, 10
# The part of the residual that is left, as blocks that are nearly free move by far more than it tells: for the first
# width, for narrower ones less, by the root of how much narrower they are, ...
CLOSELY = 1e-3
# ... and in the iterations with the true laws that follow.
CLOSELIEST = 1e-5


@dataclass(frozen=True)
class Width:
    """A width (stress), the first one and the last one, and what it was like with it.

    fewest: pairs that were off their laws after an iteration with it, at best; stalled: iterations since then; most: so
    many pairs may be off for it to fall.
    """

    value: float
    first: float
    last: float
    most: float
    fewest: float = np.inf
    stalled: int = 0

    def choose_next(self, off: int) -> Width:
        """The width of the next iteration, after one that leaves so many pairs off. (theory, 122)"""
        if off <= self.most and self.value > self.last:
            part = FALL * max(float(np.sqrt(off / self.most)), LEAST_FALL)
            return replace(self, value=max(part * self.value, self.last), fewest=np.inf, stalled=0)
        stalled = 0 if off < self.fewest else self.stalled + 1
        if stalled < STALLED or self.value == self.first:
            return replace(self, fewest=min(off, self.fewest), stalled=stalled)
        risen = min(self.value / FALL, self.first)
        return replace(self, value=risen, most=FEWER * self.most, fewest=np.inf, stalled=0)


@dataclass(frozen=True)
class SmoothCourse:
    """What an iteration with smoothed laws begins with: modes, the state of all pairs that they were read from, the
    modes that hold all bodies, and the width."""

    modes: ModeState
    state: PairState
    holding: ModeState
    width: Width


class SmoothSearch:
    """Whether the laws are smoothed in a search, once, and the modes that this leads to.

    Decided by counts, modes and violations that all ranks have from the first one. allowed: whether it may be at all.
    smooth (m,): pairs whose laws can be.
    """

    def __init__(self, problem: Problem, memory: Memory, load: Load, allowed: bool) -> None:
        laws = problem.laws
        self._problem, self._memory, self._load = problem, memory, load
        self.smooth = find_smooth(laws, memory, load.pressure) if allowed else np.zeros(laws.count, dtype=bool)
        self._allowed = bool((self.smooth | laws.bonded | laws.parted | laws.follows).all() and self.smooth.any())
        self._first: PairState | None = None
        self.taken = 0  # iterations so far
        self.begun = False  # whether `find` is to be asked, or has not ended yet
        self._course: SmoothCourse | None = None
        self._shape = self._shape_widths()

    def _shape_widths(self) -> Real:
        """By what the width of each pair (m,) is multiplied: short ones have the others' product of force and opening
        (theory, 122)."""
        weight = self._problem.mesh.pairs.weight
        if not self._allowed:
            return np.ones(len(weight))
        mean = float(weight[self.smooth].mean())
        return np.asarray(np.sqrt(mean / np.clip(weight, mean / MOST_WIDENED**2, mean)))

    def begins(self, counts: Sequence[int], state: PairState) -> bool:
        """Whether laws are to be smoothed after an iteration, by the numbers of pairs that changed in those so far.

        state: of all pairs in this one; that of the first is where it begins.
        """
        if self._first is None:
            self._first = state
        many, fewest = counts[-1] > max(MANY * self._problem.laws.count, LEAST), min(counts[:-1], default=np.inf)
        stalls = len(counts) >= FIRST and counts[-1] >= SLOWLY * fewest
        if not (self._allowed and many and (stalls or counts[-1] > SOARED * fewest)):
            return False
        self._allowed = False
        return True

    def find(
        self, tangent: TangentOperator, hold: Hold, forcing: Forcing, modes: ModeState, record: Record,
        most: int = LONGEST, pause: Callable[[], None] = lambda: None,
    ) -> tuple[ModeState, PairState]:
        """Modes (m,), and the state of all pairs that they were read from, after `most` iterations at most; modes:
        those before. pause: called between iterations, where the run may be stopped; `find` then goes on from there.

        Raises ConvergenceError of the first system: "singular tangent", "linear solver"; from a later one that is not
        solved it comes back with what was before.
        """
        problem, memory, load = self._problem, self._memory, self._load
        if self._course is None:
            self._course = self._start(modes)
        modes, state, holding = self._course.modes, self._course.state, self._course.holding
        width = self._course.width
        proximal = PROXIMAL * problem.laws.own_stiffness
        for taken in range(self.taken, min(LONGEST, most)):
            self._course = SmoothCourse(modes, state, holding, width)
            pause()
            if not 0 < width.value < np.inf:
                break
            begin = time.perf_counter()
            law = linearise_smoothly(
                problem.laws, self.smooth, state, memory, load.pressure, problem.traction_scale,
                width.value * self._shape, proximal,
            )
            constraints = hold.release(problem.constrain(law, load), holding)
            closely = max(CLOSELY * np.sqrt(width.value / width.first), CLOSELIEST)
            try:
                solved = tangent.solve(constraints, load, law, min(forcing.choose(False), closely))
            except ConvergenceError:
                if not taken:
                    raise
                return modes, state
            forcing.used |= solved.loosely
            found = evaluate_pairs(problem.mesh, law, solved.unknowns)
            before, state = modes, take_off_proximal(problem.laws, self.smooth, found, state, proximal)
            modes, off = problem.decide(lambda at=state, e=width.value: (  # type: ignore[misc]
                read_modes(problem.laws, self.smooth, at, memory, load.pressure), self._count_off(at, e)))
            changed = (before.mode != modes.mode) | ((modes.mode == SLIP) & (before.sign != modes.sign))
            record.add(solved, modes, changed, begin)
            self.taken += 1
            if width.value <= width.last and np.count_nonzero(changed) <= max(FEW * len(changed), FEWEST):
                break
            width = width.choose_next(off)
        return modes, state

    def _start(self, modes: ModeState) -> SmoothCourse:
        problem, load, first = self._problem, self._load, self._first
        assert first is not None
        largest, violation = problem.decide(lambda: (
            float(max(np.abs(first.p_n + load.pressure).max(), np.abs(first.p_s).max())), self._measure(first)))
        last = NARROWEST * largest
        begin = max(WIDTH * violation, last)
        width = Width(begin, begin, last, OFF * problem.laws.count)
        return SmoothCourse(modes, first, close_all(problem.laws, modes), width)

    def _measure(self, state: PairState) -> float:
        """The mean violation of the true laws along all pairs (stress)."""
        weight = np.where(self.smooth, self._problem.mesh.pairs.weight, 0.0)
        return float(weight @ self._find_violation(state, 0.0) / weight.sum())

    def _count_off(self, state: PairState, width: float) -> int:
        """The number of pairs that are off their smoothed laws by more than their width."""
        return int(np.count_nonzero(self._find_violation(state, width) > width * self._shape))

    def _find_violation(self, state: PairState, width: float) -> Real:
        return measure_violation(
            self._problem.laws, self.smooth, state, self._memory, self._load.pressure, width * self._shape)
