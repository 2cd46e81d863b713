"""Thin blocks in open fractures after smoothed laws: the stiffness that lets none of them fly away.

Where the smoothed laws end, blocks lie within their clearance, held by single pairs or by nothing. With the true laws
their systems would be all but singular, or blocks would have to be held by pairs that they do not touch. Instead open
pairs keep a proximal stiffness (theory, 127), which acts on what their jumps change from one iteration to the next:
where these come to rest it bears nothing, and the true laws hold.

A block that nothing holds comes to rest only as far as the forces on it balance. What meshes and products leave over
moves it on and on, and no other stiffness would bear it. Where that is next to nothing the block floats: it is told as
such, and its place is that of the last iteration. Where loads of its own, as its weight, make up a part of it that
counts they have to move the block until it lies. All else, thin needles among it, comes to rest the sooner the less
stiffness there is: it falls once no mode changes, unless systems cannot be solved any more.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pbem.arrays import Bool, Real
from pbem.contact.laws import OPEN, ModeState, PairState
from pbem.contact.loads import Load
from pbem.contact.modes import Linearisation
from pbem.contact.smoothed import stiffen_jumps
from pbem.errors import ConvergenceError
from pbem.solve.nonlinear.blocks import measure_drive, measure_usual
from pbem.solve.problem.problem import Problem

# The stiffness is this part of that of the surroundings of each pair alone, in the mean of its curve, ...
PART = 1e-5
# ... and falls to this part of itself where no mode changes, but around blocks that float.
FALL = 1e-2
# Blocks that nothing holds float where the stiffness bears this part of the mean of all tractions on them, and their
# own loads are this part of what it bears.
FLOATING, OWN = 1e-3, 0.1
# The reasons of errors that more stiffness may prevent.
UNSOLVED = ("linear solver", "singular tangent")


class OpenBlocks:
    """The proximal stiffness of open pairs in iterations after smoothed laws, alike on all ranks (theory, 127).

    smooth (m,): pairs that have one. state: from which the jumps change; None before there were smoothed laws. floats
    (m,): pairs around blocks that float, which keep theirs.
    """

    def __init__(self, problem: Problem, smooth: Bool) -> None:
        self._problem, self._smooth = problem, smooth
        self.state: PairState | None = None
        self.part, self.least = PART, 0.0
        self.floats: Bool = np.zeros(len(smooth), dtype=bool)
        self._own = self._even_out()

    def _even_out(self) -> Real:
        """The stiffness of the surroundings of the pairs (m,), the same along each curve: what drives a block is borne
        by all pairs around it alike, in place of the shortest ones, whose surroundings are the stiffest."""
        pairs, own = self._problem.mesh.pairs, self._problem.laws.own_stiffness
        length, along = (np.bincount(pairs.interface, each) for each in (pairs.weight, pairs.weight * own))
        return np.asarray((along / np.where(length > 0, length, 1.0))[pairs.interface])

    def begin(self, state: PairState) -> None:
        """Keep open pairs near to the jumps of a state from now on."""
        self.state, self.part, self.least = state, PART, 0.0
        self.floats = np.zeros_like(self._smooth)

    def move_on(self, state: PairState, floats: Bool | None) -> None:
        """Take note of the state of an iteration, and if no mode changed in it of the pairs that float; else None."""
        if self.state is None:
            return
        self.state = state
        if floats is not None:
            self.floats = floats
            self.part *= FALL if self.part > self.least else 1.0

    def stiffen_again(self, error: ConvergenceError) -> bool:
        """After an error: whether it is of a system that could not be solved as the stiffness had fallen, which is now
        what it was before."""
        if error.reason not in UNSOLVED or self.state is None or self.part >= PART:
            return False
        self.part /= FALL
        self.least = self.part
        return True

    def stiffen(self, law: Linearisation, modes: ModeState) -> Linearisation:
        """The linearised laws with the stiffness in open pairs. (theory, 127)"""
        if self.state is None:
            return law
        return stiffen_jumps(law, self.state, self._find_stiffness(modes))

    def take_off(self, modes: ModeState, state: PairState) -> tuple[PairState, Real]:
        """A state without the tractions of the stiffness, and the larger one of these at each pair (m,)."""
        if self.state is None:
            return state, np.zeros(len(state.p_n))
        stiffness = self._find_stiffness(modes)[self._problem.laws.leader]
        by_n, by_s = stiffness * (state.g_n - self.state.g_n), stiffness * (state.g_s - self.state.g_s)
        return replace(state, p_n=state.p_n - by_n, p_s=state.p_s - by_s), np.maximum(np.abs(by_n), np.abs(by_s))

    def measure_rest(self, modes: ModeState, state: PairState, borne: Real, load: Load) -> tuple[float, Bool]:
        """What the stiffness bears (m,), as a part of the largest traction of a state without it, but for what is left
        over under a load on blocks that float in these modes; the pairs (m,) around these. On one rank. (theory, 127)
        """
        size = max(np.abs(state.p_n).max(initial=0.0), np.abs(state.p_s).max(initial=0.0))
        floats, weight = np.zeros(len(borne), dtype=bool), self._problem.mesh.pairs.weight
        if not borne.any():
            return 0.0, floats
        usual = measure_usual(self._problem, state)
        moving = {body for motion in self._problem.find_cut_motions(modes) for body in motion.moving}
        for body in sorted(moving):
            if not self._problem.parts.block[body]:
                continue
            own, _ = self._problem.cut.find_around(body)
            mean = weight[own] @ borne[own] / weight[own].sum()
            floats[own] |= mean <= FLOATING * usual and measure_drive(self._problem, body, load) <= OWN * mean
        return float(borne[~floats].max(initial=0.0) / size) if size > 0 else np.inf, floats

    def _find_stiffness(self, modes: ModeState) -> Real:
        is_open = self._smooth & (modes.mode == OPEN)
        return np.where(is_open, np.where(self.floats, PART, self.part) * self._own, 0.0)
