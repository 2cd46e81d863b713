"""Thin blocks in open fractures after smoothed laws: the stiffness that lets none of them fly away, until it is gone.

Where the smoothed laws end, blocks lie within their clearance, held by single pairs or by nothing. With the true laws
their systems would be all but singular, or blocks would have to be held by pairs that they do not touch. Instead open
pairs keep a proximal stiffness (theory, 127), which acts on what their jumps change from one iteration to the next. It
falls to nothing once no mode changes; what it bears then is below the tolerance, and the true laws hold.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pbem.arrays import Bool, Real
from pbem.contact.laws import OPEN, ModeState, PairState
from pbem.contact.modes import P_N, P_S, Linearisation
from pbem.solve.problem.problem import Problem

# The stiffness is this part of that of the surroundings of each pair alone, ...
PART = 1e-7
# ... and falls to this part of itself after an iteration in which no mode changes.
FALL = 1e-2


class OpenBlocks:
    """The proximal stiffness of open pairs in iterations after smoothed laws, alike on all ranks (theory, 127).

    smooth (m,): pairs that have one. state: from which the jumps change; None before there were smoothed laws.
    """

    def __init__(self, problem: Problem, smooth: Bool) -> None:
        self._problem, self._smooth = problem, smooth
        self.state: PairState | None = None
        self.part = PART

    def begin(self, state: PairState) -> None:
        """Keep open pairs near to the jumps of a state from now on."""
        self.state, self.part = state, PART

    def move_on(self, state: PairState, settled: bool) -> None:
        """Take note of the state of an iteration, and whether no mode changed in it."""
        if self.state is not None:
            self.state = state
            self.part *= FALL if settled else 1.0

    def stiffen(self, law: Linearisation, modes: ModeState) -> Linearisation:
        """The linearised laws with the stiffness in open pairs. (theory, 127)"""
        if self.state is None:
            return law
        stiffness = self._find_stiffness(modes)
        at = np.flatnonzero(stiffness)
        tangent, offset = law.tangent.copy(), law.offset.copy()
        for unknown, traction, jump in ((0, P_N, self.state.g_n), (1, P_S, self.state.g_s)):
            tangent[at, traction, unknown] = stiffness[at]
            offset[at, traction] -= stiffness[at] * jump[at]
        return replace(law, tangent=tangent, offset=offset)

    def take_off(self, modes: ModeState, state: PairState) -> tuple[PairState, float]:
        """A state without the tractions of the stiffness, and their largest as a part of the largest of the others."""
        if self.state is None:
            return state, 0.0
        stiffness = self._find_stiffness(modes)[self._problem.laws.leader]
        by_n, by_s = stiffness * (state.g_n - self.state.g_n), stiffness * (state.g_s - self.state.g_s)
        left = replace(state, p_n=state.p_n - by_n, p_s=state.p_s - by_s)
        size = max(np.abs(left.p_n).max(), np.abs(left.p_s).max())
        most = max(np.abs(by_n).max(), np.abs(by_s).max())
        return left, float(most / size) if size > 0 else float(most > 0)

    def _find_stiffness(self, modes: ModeState) -> Real:
        is_open = self._smooth & (modes.mode == OPEN)
        return np.where(is_open, self.part * self._problem.laws.own_stiffness, 0.0)
