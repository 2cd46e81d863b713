"""Thin blocks in open fractures after smoothed laws: the stiffness that lets none of them fly away.

Where the smoothed laws end, blocks lie within their clearance, held by single pairs or by nothing. With the true laws
their systems would be all but singular, or blocks would have to be held by pairs that they do not touch. Instead open
pairs keep a proximal stiffness (theory, 127), which acts on what their jumps change: where these come to rest it bears
nothing, and the true laws hold.

A block that nothing holds comes to rest only as far as the forces on it balance. What meshes and products leave over
would move it on and on, with the statuses of all around it. So it is anchored where the smoothed laws left it. Where
what the anchor bears is next to nothing the block floats: it is told as such, and its place is that of the anchor. What
is more than that, or loads of its own, as its weight, has to move the block until it lies: it is driven, and from one
iteration to the next a soft stiffness alone resists that. All else, thin needles among it, comes to rest the sooner the
less stiffness there is, as long as systems can be solved.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pbem.arrays import Bool, Real
from pbem.contact.deferred_laws import defer_stiffness
from pbem.contact.laws import OPEN, ModeState, PairState
from pbem.contact.loads import Load
from pbem.contact.modes import Linearisation
from pbem.errors import ConvergenceError
from pbem.solve.nonlinear.blocks import measure_drive, measure_usual
from pbem.solve.problem.problem import Problem

# The stiffness is this part of that of the surroundings of each pair alone, in the mean of its curve: around blocks
# that are anchored, that are driven, and elsewhere, ...
ANCHORED, DRIVEN, ELSEWHERE = 1e-2, 1e-5, 1e-9
# ... and falls to this part of itself where no mode changes, but for the first.
FALL = 1e-2
# Blocks that nothing holds float where the stiffness bears this part of the mean of all tractions on them, and their
# own loads are this part of what it bears.
FLOATING, OWN = 1e-3, 0.1
# The reasons of errors that more stiffness may prevent.
UNSOLVED = ("linear solver", "singular tangent")


@dataclass(frozen=True)
class _Stiffness:
    """The stiffness of pairs (m,) in some modes, stress/length; the blocks that can move in these, and those of the
    pairs (m,) around the ones that are anchored."""

    values: Real
    moving: tuple[int, ...]
    anchored: Bool


class OpenBlocks:
    """The proximal stiffness of open pairs in iterations after smoothed laws, alike on all ranks (theory, 127).

    smooth (m,): pairs that have one. state: from which the jumps change; None before there were smoothed laws. driven:
    blocks that are not anchored though nothing holds them. fallen: what FALL makes of the stiffness by now. renewed:
    whether anchors act from the state of the last iteration, as no mode changed in it: then they bear what is left over
    on their blocks, and not what has opened around these since they were anchored.
    """

    def __init__(self, problem: Problem, smooth: Bool) -> None:
        self._problem, self._smooth = problem, smooth
        self.state: PairState | None = None
        self.fallen, self.least, self.renewed = 1.0, 0.0, False
        self.driven: frozenset[int] = frozenset()
        self._own = self._even_out()
        none = np.zeros(len(smooth))
        self._stiffness = _Stiffness(none, (), none > 0)

    def _even_out(self) -> Real:
        """The stiffness of the surroundings of the pairs (m,), the same along each curve: what drives a block is borne
        by all pairs around it alike, in place of the shortest ones, whose surroundings are the stiffest."""
        pairs, own = self._problem.mesh.pairs, self._problem.laws.own_stiffness
        length, along = (np.bincount(pairs.interface, each) for each in (pairs.weight, pairs.weight * own))
        return np.asarray((along / np.where(length > 0, length, 1.0))[pairs.interface])

    def begin(self, state: PairState) -> None:
        """Keep open pairs near to the jumps of a state from now on."""
        self.state, self.fallen, self.least, self.driven, self.renewed = state, 1.0, 0.0, frozenset(), False

    def move_on(self, state: PairState, driven: frozenset[int], calm: bool) -> None:
        """Take note of the state of an iteration, of the blocks that were driven in it, and of whether no mode changed.
        """
        if self.state is None:
            return
        self.state = self.state.choose(state, ~self._stiffness.anchored | calm)
        self.renewed = calm
        self.driven = driven if calm else self.driven | driven
        self.fallen *= FALL if calm and self.fallen > self.least else 1.0

    def settle(self, state: PairState, settled: Bool) -> None:
        """Take note of a state in which clusters of pairs (m,) settled by themselves: these are anchored there anew."""
        if self.state is not None:
            self.state = self.state.choose(state, ~self._stiffness.anchored | settled)

    def stiffen_again(self, error: ConvergenceError) -> bool:
        """After an error: whether it is of a system that could not be solved with so little stiffness, of which there
        is more now."""
        if error.reason not in UNSOLVED or self.state is None or self.fallen >= DRIVEN / ELSEWHERE:
            return False
        self.fallen /= FALL
        self.least = self.fallen
        return True

    def stiffen(self, law: Linearisation, modes: ModeState) -> Linearisation:
        """The linearised laws with the stiffness in open pairs. All ranks together. (theory, 127)"""
        if self.state is None:
            return law
        self._stiffness = self._problem.decide(lambda: self._choose_stiffness(modes))
        return defer_stiffness(law, self.state, self._stiffness.values)

    def _choose_stiffness(self, modes: ModeState) -> _Stiffness:
        moving = {body for motion in self._problem.find_cut_motions(modes) for body in motion.moving}
        blocks = tuple(body for body in sorted(moving) if self._problem.parts.block[body])
        part, anchored = np.full(len(self._smooth), ELSEWHERE * self.fallen), np.zeros(len(self._smooth), dtype=bool)
        for body in blocks:
            own, _ = self._problem.cut.find_around(body)
            if body in self.driven:
                part[own] = np.maximum(part[own], DRIVEN * min(self.fallen, 1.0))
            else:
                part[own], anchored[own] = ANCHORED, True
        is_open = self._smooth & (modes.mode == OPEN)
        return _Stiffness(np.where(is_open, part * self._own, 0.0), blocks, anchored)

    def take_off(self, state: PairState) -> tuple[PairState, Real]:
        """A state without the tractions of the stiffness, and the larger one of these at each pair (m,)."""
        if self.state is None:
            return state, np.zeros(len(state.p_n))
        stiffness = self._stiffness.values[self._problem.laws.leader]
        by_n, by_s = stiffness * (state.g_n - self.state.g_n), stiffness * (state.g_s - self.state.g_s)
        return replace(state, p_n=state.p_n - by_n, p_s=state.p_s - by_s), np.maximum(np.abs(by_n), np.abs(by_s))

    def measure_rest(self, state: PairState, borne: Real, load: Load) -> tuple[float, frozenset[int]]:
        """What the stiffness bears (m,), as a part of the largest traction of a state without it, but for what is left
        over under a load on blocks that float; the other blocks that can move. On one rank. (theory, 127)
        """
        if not borne.any():
            return 0.0, frozenset()
        size = max(np.abs(state.p_n).max(initial=0.0), np.abs(state.p_s).max(initial=0.0))
        floats, weight = np.zeros(len(borne), dtype=bool), self._problem.mesh.pairs.weight
        usual, driven = measure_usual(self._problem, state), set()
        for body in self._stiffness.moving:
            own, _ = self._problem.cut.find_around(body)
            mean = weight[own] @ borne[own] / weight[own].sum()
            if mean <= FLOATING * usual and measure_drive(self._problem, body, load) <= OWN * mean:
                floats[own] = self.renewed
            else:
                driven.add(body)
        return float(borne[~floats].max(initial=0.0) / size) if size > 0 else np.inf, frozenset(driven)
