"""The contact of a cluster of pairs whose tractions follow from their jumps by a stiffness, by smoothed laws.

Newton's method with smoothed laws (pbem.contact.smoothed), for a given width or for ever smaller ones, and at last with
the true laws. Thin blocks hang in small clusters as in large networks, and settle in the same way.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import lapack

from pbem.arrays import Bool, Real
from pbem.contact.complementarity import Subset
from pbem.contact.laws import OPEN, ModeState, PairState, plastic_slip
from pbem.contact.modes import G_N, G_S, P_N, P_S, Linearisation, Proposal, linearise
from pbem.contact.smoothed import (
    linearise_smoothly,
    measure_violation,
    read_modes,
    stiffen_jumps,
    take_off_proximal,
)

# Newton's steps of each width, and with the true laws, at most.
MOST_STEPS, MOST_AT_END = 20, 30
# Widths on the way to the last one, at most, those that were too narrow too.
MOST_WIDTHS = 48
# Of the way to a solution the whole is gone if that leaves BETTER of what pairs were off, in the mean, in which none
# counts for more than FARTHEST widths; else the part that leaves least.
PARTS = (1.0, 0.9, 0.75, 0.5, 0.3, 0.15, 0.05)
BETTER, FARTHEST = 0.9, 10.0
# It ends where no pair is off its smoothed laws by more widths than this; on the way to smaller ones.
NEAR, NEAR_ON_WAY = 0.1, 1.0
# The first width, as a part of the largest violation of the true laws; the next ones, as a part of the one before.
FIRST, NEXT = 0.1, 0.1
# Where that leaves a pair off by more widths than LOST, the next one is wider: the root of that part, unless that is
# SLOWEST already; after those that leave none so far off, parts are smaller again, by the power SOONER.
LOST, SLOWEST, SOONER = 10.0, 0.8, 1.5
# The proximal stiffness is this part of that of the surroundings of each pair alone: enough for systems to be regular
# where tangents cancel these, and so little that blocks hardly feel it (theory, 127). In clusters, whose systems are
# small and solved in double precision, blocks that hardly anything drives come to rest with less.
PROXIMAL, PROXIMAL_ALONE = 1e-5, 1e-8

# The modes that states of the pairs in some modes ask for.
Judge = Callable[[ModeState, PairState], Proposal]


@dataclass(frozen=True)
class ClusterContact:
    """The k pairs of a cluster: their subset, those that can be smoothed (k,), and the stiffness (2 k, 2 k) that gives
    tractions, in units of `scale` (stress), from jumps, n and s of pair after pair; exact: a state to which it adds.
    """

    subset: Subset
    smooth: Bool
    stiffness: Real
    exact: PairState
    scale: float

    def settle_smoothed(self, state: PairState, width: Real, proximal: Real) -> PairState | None:
        """The state near to the smoothed laws of widths (k,) that Newton's method leads to from one; None if its
        systems have no solution or it leads no nearer.

        proximal (k,): stiffness against the change of the jumps in a step (stress/length).
        """
        found = self._approach(state, width, proximal, NEAR)
        # Not one that is no number either.
        if found is None or not self._measure_off(found[0], width)[0] <= self._measure_off(state, width)[0]:
            return None
        return found[0]

    def _approach(
        self, state: PairState, width: Real, proximal: Real, near: float
    ) -> tuple[PairState, PairState] | None:
        """The state that Newton's method leads to, and one on which the stiffness acts; None if there is none.

        It ends where no pair is off its laws by more than `near` widths.
        """
        last = self._measure_off(state, width)
        exact, laws = self.exact, self.subset.laws
        for _ in range(MOST_STEPS):
            law = linearise_smoothly(laws, self.smooth, state, self.subset.memory, self.subset.pressure, self.scale,
                                     width, proximal)
            found = self._solve(law, exact)
            if found is None:
                return None
            exact = found
            found = take_off_proximal(laws, self.smooth, found, state, proximal)
            off = [self._measure_off(state.approach(found, part), width) for part in PARTS]
            best = 0 if off[0][0] <= BETTER * last[0] else int(np.argmin([mean for mean, _ in off]))
            state, last = state.approach(found, PARTS[best]), off[best]
            if best == 0 and last[1] <= near:
                break
        return state, exact

    def narrow(self, state: PairState, shape: Real, last: float) -> PairState | None:
        """The state near to the smoothed laws of the width `last` > 0, by way of larger ones, each times shape (k,);
        None if there is none, or it is too far."""
        contact, proximal = self, PROXIMAL_ALONE * self.subset.laws.own_stiffness
        width = max(FIRST * float(self._find_violation(state, 0.0).max(initial=0.0)), last)
        fall, reached = NEXT, np.inf
        for _ in range(MOST_WIDTHS):
            found = contact._approach(state, width * shape, proximal, NEAR_ON_WAY)
            if found is None:
                return None
            if fall < SLOWEST and contact._measure_off(found[0], width * shape)[1] > LOST:
                # What is too narrow for the first one is so by itself, later ones for the step that led to them.
                fall = float(np.sqrt(fall))
                width = fall * reached if reached < np.inf else width / NEXT
                continue
            state, reached = found[0], width
            if width <= last:
                return state
            contact = ClusterContact(self.subset, self.smooth, self.stiffness, found[1], self.scale)
            fall = max(fall**SOONER, NEXT)
            width = max(fall * width, last)
        return None

    def lead_back(
        self, state: PairState, former: PairState, shape: Real, width: float, proximal: Real
    ) -> PairState | None:
        """The state near to the smoothed laws of a width > 0, times shape (k,), that ever smaller ones lead to from a
        former state; None if there is none, or it is further off them than the state that there is.

        proximal: see settle_smoothed.
        """
        near = self.narrow(former, shape, width)
        found = None if near is None else self.settle_smoothed(near, width * shape, proximal)
        if found is None or not self._measure_off(found, width * shape)[0] < self._measure_off(state, width * shape)[0]:
            return None
        return found

    def end(self, state: PairState, judge: Judge) -> tuple[ModeState, PairState] | None:
        """The modes that the judge leaves as they are, and their state, by Newton's steps with the true laws from those
        of a state near to smoothed ones; None if they do not come to that."""
        laws, memory, pressure = self.subset.laws, self.subset.memory, self.subset.pressure
        modes, exact = read_modes(laws, self.smooth, state, memory, pressure), self.exact
        for _ in range(MOST_AT_END):
            law = linearise(laws, modes, state.p_n, plastic_slip(laws, state), memory, pressure, self.scale)
            stiffness = np.where(modes.mode == OPEN, PROXIMAL_ALONE * laws.own_stiffness, 0.0)
            found = self._solve(stiffen_jumps(law, state, stiffness), exact)
            if found is None:
                return None
            exact = found
            by_n, by_s = stiffness * (found.g_n - state.g_n), stiffness * (found.g_s - state.g_s)
            state = PairState(found.p_n - by_n, found.p_s - by_s, found.g_n, found.g_s)
            proposal = judge(modes, state)
            if not proposal.changed.any():
                return modes, state
            modes = proposal.modes
        return None

    def _measure_off(self, state: PairState, width: Real) -> tuple[float, float]:
        """By how many widths pairs are off their smoothed laws, in the mean (see FARTHEST) and at most."""
        off = self._find_violation(state, width) / width
        return float(np.minimum(off, FARTHEST).mean()), float(off.max())

    def _find_violation(self, state: PairState, width: Real | float) -> Real:
        return measure_violation(
            self.subset.laws, self.smooth, state, self.subset.memory, self.subset.pressure, width)

    def _solve(self, law: Linearisation, exact: PairState) -> PairState | None:
        """The state that fulfils linearised laws, p = p_0 + stiffness (g - g_0) from an exact one; None if there is
        none. In double precision: at the smallest widths single is less than these."""
        count, scale = len(law.tangent), self.scale
        tangent, offset = law.tangent.copy(), law.offset.copy()
        tangent[:, :G_N] /= scale
        offset[:, :G_N] /= scale
        traction = np.stack([exact.p_n, exact.p_s], axis=1) / scale
        jump = np.stack([exact.g_n, exact.g_s], axis=1)
        right = (traction - offset[:, :G_N]).ravel() + self.stiffness @ (offset[:, G_N:] - jump).ravel()
        blocks, matrix = self.stiffness.reshape(2 * count, count, 2), np.empty((2 * count, count, 2))
        for j in range(2):
            matrix[:, :, j] = -(blocks[:, :, 0] * tangent[:, G_N, j] + blocks[:, :, 1] * tangent[:, G_S, j])
        at = np.arange(count)
        for i in (P_N, P_S):
            matrix[2 * at + i, at] += tangent[:, i]
        _, _, x, zero_pivot = lapack.dgesv(matrix.reshape(2 * count, 2 * count), right, overwrite_a=True)
        if zero_pivot or not np.isfinite(x).all():
            return None
        values = offset + (tangent @ x.reshape(count, 2, 1))[..., 0]
        return PairState(values[:, P_N] * scale, values[:, P_S] * scale, values[:, G_N], values[:, G_S])
