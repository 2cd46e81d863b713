"""Statuses of a contact whose laws are smoothed less and less, where those of the true one do not settle.

In open fractures hang thin blocks that single pairs hold. What holds them changes from one iteration to the next, they
turn by a multiple of what there is room for, and take the statuses of all around with them. Under smoothed laws every
pair holds what is near to it, the more the nearer it comes: blocks stay where there is room for them, and the solutions
change little from one width to the next (X. Chen, Math. Programming 134, 2012, reviews such methods). Short pairs have
larger widths, which makes the hyperbola a barrier of the same weight for each: Newton's method converges from one width
to the next only so (Y. Nesterov, A. Nemirovskii, Interior-point polynomial algorithms, 1994: barriers must not be less
curved than they rise steeply). An iteration aims at a narrower width to the first order in its square, and goes no
further on its way than pairs stay near to the laws of the width that belongs there: a path is followed, as where laws
fall to a width at once the next iterations lead anywhere (S. J. Wright, Primal-dual interior-point methods, SIAM,
1997). From the statuses of the last width the search goes on with the true laws; of the smoothed ones nothing is left
but where it begins.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pbem.arrays import Bool, Integer, Real
from pbem.contact.cluster_laws import FARTHEST, LOST, PROXIMAL, ClusterContact
from pbem.contact.constraints import ConstraintMap, evaluate_pairs
from pbem.contact.deferred_laws import defer_smoothed
from pbem.contact.laws import SLIP, Memory, ModeState, PairState
from pbem.contact.loads import Load
from pbem.contact.smoothed import (
    close_smoothed,
    find_smooth,
    measure_violation,
    read_modes,
    take_off_proximal,
)
from pbem.errors import ConvergenceError
from pbem.solve.nonlinear.cluster_search import ClusterSearch, stack_states, take_cluster
from pbem.solve.nonlinear.forcing import Forcing
from pbem.solve.nonlinear.hold import Hold
from pbem.solve.nonlinear.recorded import Record
from pbem.solve.problem.problem import Problem
from pbem.solve.problem.tangent import PairClusters, TangentOperator

# The laws are smoothed where after so many iterations, or where groups do not settle by themselves after so many, ...
FIRST, FIRST_ALONE = 3, 12
# ... no less than this part of the fewest pairs that changed before change (where blocks are held well it is a third at
# most), and more than this part of all and so many, as pivoting does for fewer;
SLOWLY = 0.5
MANY, LEAST = 0.03, 60
# or, after any number of iterations where groups settle by themselves, as many times as many as at best before.
SOARED = 2
# The first width is this part of the mean violation of the true laws; the last one this part of the largest traction:
# with less, blocks that touch nothing would be held by nothing but rounding. Where no clusters settle by themselves the
# true laws, by which few pairs are pivoted, do better from a larger one.
WIDTH, NARROWEST, NARROWEST_ALONE = 0.1, 1e-8, 1e-6
# The square of the width falls to so much that the next solution should leave pairs off their smoothed laws by EXPECTED
# of it, in the mean along all pairs, in which none counts for more than FARTHEST widths, and to AIM of itself at least,
# where they are off by no more than CENTRED. Else an iteration with the same width brings them nearer.
AIM, EXPECTED, CENTRED = 0.1, 0.2, 0.15
# A width that is larger than the last one by less than this part of it is the last one.
ROUNDING = 1e-9
# Of the way to a solution the largest of these parts is gone that leaves pairs off by no more than NEAR; with the same
# width, the whole if it leaves BETTER of what they were off, else the part that leaves least.
PARTS = (1.0, 0.95, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2, 0.1, 0.05)
NEAR, BETTER = 0.3, 0.9
# Between iterations pairs that are off by more than so many widths settle in clusters by themselves, unless they are
# more than this part of all.
OFF, MOST_OFF = 1.0, 0.3
# Those that are off by more than LOST widths then, no more than so many, are led back from where they were before, in
# clusters of so many elements.
MOST_LOST, MORE_ELEMENTS = 500, 240
# Pairs that are shorter than the mean have larger widths, by the root of how much shorter they are, up to so much.
MOST_WIDENED = 1e3
# It ends after so many iterations, or one with the last width in which no more than this part of all pairs, or so many,
# change: with the true laws the few blocks that are left settle sooner.
LONGEST, FEW, FEWEST = 40, 1e-2, 10
# Or one with the last width after which pairs are off by no more than this once clusters have settled. In neither case
# as long as ever fewer pairs are astray, off by more than so many widths: the statuses of all around them are no
# better, though in the mean along all pairs of a large model they hardly count.
SETTLED, ASTRAY = 0.01, 100
# The part of the residual that is left, as blocks that are nearly free move by far more than it tells, and later ones,
# in which they are freer, do not move them back; and in the iterations with the true laws that follow.
CLOSELY = 1e-8


@dataclass(frozen=True)
class Width:
    """A width (stress), the last one, and the part of its square that the next iteration aims at."""

    value: float
    last: float
    aim: float = 1.0

    def fall(self, part: float) -> float:
        """The width after a part of the way to what is aimed at. (theory, 132)"""
        value = self.value * float(np.sqrt(1 - part + part * self.aim))
        return self.last if value < self.last * (1 + ROUNDING) else value

    def go_on(self, part: float, off: float, left: float) -> Width:
        """The width of the next iteration, after one that went a part of its way and leaves pairs so much off.

        left: how much it left them off before clusters settled by themselves. (theory, 132)
        """
        value = self.fall(part)
        if off > CENTRED:
            aim = 1.0
        elif self.aim == 1:  # what such a step leaves says nothing of one that aims at less
            aim = AIM
        else:
            aim = min(AIM, (left / EXPECTED * (value / self.value) ** 2) ** 2)
        return replace(self, value=value, aim=max(aim, (self.last / value) ** 2))


@dataclass(frozen=True)
class SmoothCourse:
    """What an iteration with smoothed laws begins with: modes; the state of all pairs that they were read from, but for
    the first one, which begins from the nearest state of the search; one that the equations hold of (None: the same);
    the modes that hold all bodies; and the width. astray: pairs that were off by more than ASTRAY of the last width."""

    modes: ModeState
    state: PairState
    holding: ModeState
    width: Width
    exact: PairState | None = None
    astray: int | None = None


@dataclass(frozen=True)
class Reached:
    """What an iteration has led to: a state of all pairs that the equations hold of, the one before, the width that
    belongs here, and the constraints of its solution."""

    exact: PairState
    former: PairState
    width: float
    constraints: ConstraintMap


class SmoothSearch:
    """Whether the laws are smoothed in a search, once, and the modes that this leads to.

    Decided by counts, modes and violations that all ranks have from the first one. allowed: whether it may be at all;
    alone: whether no groups of neighbouring elements settle by themselves, so that it may be later only.
    smooth (m,): pairs whose laws can be.
    """

    def __init__(self, problem: Problem, memory: Memory, load: Load, allowed: bool, alone: bool = False) -> None:
        laws = problem.laws
        self._problem, self._memory, self._load = problem, memory, load
        self.smooth = find_smooth(laws, memory, load.pressure) if allowed else np.zeros(laws.count, dtype=bool)
        self._alone = alone
        self._able = bool((self.smooth | laws.bonded | laws.parted | laws.follows).all() and self.smooth.any())
        self._allowed = self._able  # once it has begun no longer
        # The state with the least violation of the true laws so far, that violation, and the first largest traction.
        self._nearest: PairState | None = None
        self._violation, self._largest = np.inf, 0.0
        self.taken = 0  # iterations so far
        self.begun = False  # whether `find` is to be asked, or has not ended yet
        self._course: SmoothCourse | None = None
        self._shape = self._shape_widths()
        along = np.where(self.smooth, problem.mesh.pairs.weight, 0.0)
        self._along = along / max(float(along.sum()), np.finfo(float).tiny)

    def _shape_widths(self) -> Real:
        """By what the width of each pair (m,) is multiplied: short ones have the others' product of force and opening
        (theory, 122)."""
        weight = self._problem.mesh.pairs.weight
        if not self._able:
            return np.ones(len(weight))
        mean = float(weight[self.smooth].mean())
        return np.asarray(np.sqrt(mean / np.clip(weight, mean / MOST_WIDENED**2, mean)))

    def make_cluster_search(self) -> ClusterSearch:
        """The search by clusters of the same pairs."""
        # Where they lead nowhere another search begins anew, without; of models without groups there is only one.
        smooth = self.smooth & (self._able and not self._alone)
        return ClusterSearch(self._problem, self._memory, self._load, smooth, self._shape)

    def begins(self, counts: Sequence[int], state: PairState) -> bool:
        """Whether laws are to be smoothed after an iteration, by the numbers of pairs that changed in those so far.

        state: of all pairs in this one; it begins from the one that was nearest to the true laws.
        """
        if self._allowed:
            self._note(state)
        many, fewest = counts[-1] > max(MANY * self._problem.laws.count, LEAST), min(counts[:-1], default=np.inf)
        stalls = len(counts) >= (FIRST_ALONE if self._alone else FIRST) and counts[-1] >= SLOWLY * fewest
        soared = not self._alone and counts[-1] > SOARED * fewest
        if not (self._allowed and many and (stalls or soared)):
            return False
        self._allowed = False
        return True

    def _note(self, state: PairState) -> None:
        violation, largest = self._problem.decide(lambda: (
            self._measure(state),
            float(max(np.abs(state.p_n + self._load.pressure).max(), np.abs(state.p_s).max()))))
        # Later ones have far larger tractions where a pair holds what nothing else does.
        self._largest = self._largest or largest
        if self._nearest is None or violation < self._violation:
            self._nearest, self._violation = state, violation

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
        clusters = None if self._alone else tangent.find_clusters(load)
        if self._course is None:
            self._course = self._start(modes, clusters is None)
        modes, state, holding = self._course.modes, self._course.state, self._course.holding
        exact, width, astray = self._course.exact or state, self._course.width, self._course.astray
        proximal = PROXIMAL * problem.laws.own_stiffness
        for taken in range(self.taken, min(LONGEST, most)):
            self._course = SmoothCourse(modes, state, holding, width, exact, astray)
            pause()
            if not 0 < width.value < np.inf:
                break
            begin = time.perf_counter()
            law = defer_smoothed(
                problem.laws, self.smooth, state, memory, load.pressure, problem.traction_scale,
                width.value * self._shape, proximal, width.aim,
            )
            constraints = hold.release(problem.constrain(law, load), holding)
            try:
                solved = tangent.solve(constraints, load, law, min(forcing.choose(False), CLOSELY))
            except ConvergenceError:
                if not taken:
                    raise
                return modes, state
            forcing.used |= solved.loosely
            whole = evaluate_pairs(problem.mesh, law, solved.unknowns)
            found = take_off_proximal(problem.laws, self.smooth, whole, state, proximal)
            part, off = problem.decide(lambda now=state, new=found, at=width: self._choose_part(now, new, at))  # type: ignore[misc]
            before, former = modes, state
            state, exact, left = state.approach(found, part), exact.approach(whole, part), off
            if clusters is not None:
                now = Reached(exact, former, width.fall(part), constraints)
                state, off = self._settle_clusters(clusters, state, now, off)
                tangent.expect(stack_states(state))
            modes = problem.decide(lambda at=state: (  # type: ignore[misc]
                read_modes(problem.laws, self.smooth, at, memory, load.pressure)))
            changed = (before.mode != modes.mode) | ((modes.mode == SLIP) & (before.sign != modes.sign))
            record.add(solved, modes, changed, begin)
            self.taken += 1
            few = part == 1 and np.count_nonzero(changed) <= max(FEW * len(changed), FEWEST)
            if width.fall(part) <= width.last:
                before_that, astray = astray, 0 if clusters is None else self._count_astray(state, width.last)
                recovers = astray > 0 and (before_that is None or astray < before_that)
                if not recovers and (few or (clusters is not None and off <= SETTLED)):
                    break
            width = width.go_on(part, off, left)
        return modes, state

    def _settle_clusters(
        self, clusters: PairClusters, state: PairState, now: Reached, off: float
    ) -> tuple[PairState, float]:
        """The state, with pairs that are off their smoothed laws settled in clusters; and how much pairs are off then.

        off: how much pairs were off. Blocks that the solution throws far off their seats do not find back from where
        they are: they settle from where they were before, by ever smaller widths, in larger clusters that what is
        beyond follows.
        """
        problem, shape = self._problem, self._shape
        proximal = PROXIMAL * problem.laws.own_stiffness

        def find_far(most: float) -> Bool:
            return problem.decide(lambda: self._find_violation(state, now.width) > most * now.width * shape)

        def take(pairs: Integer, stiffness: Real) -> ClusterContact:
            return take_cluster(problem, self._memory, self._load, self.smooth, now.exact, pairs, stiffness)

        def settle(pairs: Integer, stiffness: Real) -> Real | None:
            found = take(pairs, stiffness).settle_smoothed(
                state.take(pairs), now.width * shape[pairs], proximal[pairs])
            return None if found is None else stack_states(found)

        def lead_back(pairs: Integer, stiffness: Real) -> Real | None:
            found = take(pairs, stiffness).lead_back(
                state.take(pairs), now.former.take(pairs), shape[pairs], now.width, proximal[pairs])
            return None if found is None else stack_states(found)

        far = find_far(OFF)
        if not 0 < np.count_nonzero(far) <= MOST_OFF * len(far):
            return state, off
        values, settled = clusters.solve(far, 4, settle)
        state = state.choose(PairState(*values.T), settled)
        lost = find_far(LOST)
        if 0 < np.count_nonzero(lost) <= MOST_LOST:
            values, settled = clusters.solve(lost, 4, lead_back, now.constraints, MORE_ELEMENTS)
            state = state.choose(PairState(*values.T), settled)
        return state, problem.decide(lambda: self._measure_off(state, now.width))

    def _count_astray(self, state: PairState, width: float) -> int:
        return self._problem.decide(lambda: int(np.count_nonzero(
            self._find_violation(state, width) > ASTRAY * width * self._shape)))

    def _start(self, modes: ModeState, alone: bool) -> SmoothCourse:
        assert self._nearest is not None
        last = (NARROWEST_ALONE if alone else NARROWEST) * self._largest
        begin = max(WIDTH * self._violation, last)
        holding = close_smoothed(self._problem.laws, modes)
        return SmoothCourse(modes, self._nearest, holding, Width(begin, last))

    def _choose_part(self, state: PairState, found: PairState, width: Width) -> tuple[float, float]:
        """The part of the way from a state to a solution that is gone, and by how much pairs are off then."""
        off = [self._measure_off(state.approach(found, part), width.fall(part)) for part in PARTS]
        if width.aim < 1:
            near = [k for k, each in enumerate(off) if each <= NEAR]
            best = near[0] if near else int(np.argmin(off))
        else:
            whole = off[0] <= BETTER * self._measure_off(state, width.value)
            best = 0 if whole else int(np.argmin(off))
        return PARTS[best], off[best]

    def _measure_off(self, state: PairState, width: float) -> float:
        """By how many widths pairs are off their smoothed laws, in the mean along them (see CENTRED)."""
        off = self._find_violation(state, width) / (width * self._shape)
        return float(self._along @ np.minimum(off, FARTHEST))

    def _measure(self, state: PairState) -> float:
        """The mean violation of the true laws along all pairs (stress)."""
        return float(self._along @ self._find_violation(state, 0.0))

    def _find_violation(self, state: PairState, width: float) -> Real:
        return measure_violation(
            self._problem.laws, self.smooth, state, self._memory, self._load.pressure, width * self._shape)
