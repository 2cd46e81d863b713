"""Pairs that part and meet again without end, as their strength is lost where they part and back where they meet.

Faces with cohesion, and without tensile strength or with little, can have no admissible modes: closed they pull, and
open, without the shear that they bore, they lie in each other. Along the whole of such a place pairs then go on to part
and to meet, whatever is done with those next to them. A search is not at its end only as pairs do so now and then: the
end of an opening moves to and fro, before it settles.
"""

from __future__ import annotations

import numpy as np

from pbem.contact.laws import OPEN, ModeState
from pbem.solve.nonlinear.search import Search
from pbem.solve.nonlinear.unsettled import find_losing
from pbem.solve.problem.problem import Problem

# Pairs have come together again so often after they had parted, ...
OFTEN = 3
# ... and are this part of those that change in so many iterations in turn, not before one of this number, ...
MOST, IN_TURN, LATE = 2 / 3, 4, 16
# ... in which no fewer pairs change than at best before.


class TornPairs:
    """How often the pairs of a search have met again, and in how many iterations in turn most that change are such; the
    same on all ranks, from the same proposals."""

    def __init__(self, problem: Problem) -> None:
        self._losing = find_losing(problem.laws) & ~problem.laws.follows
        self._restart()

    def _restart(self) -> None:
        self.open, self.parted = np.zeros((2, len(self._losing)), dtype=bool)
        self.met = np.zeros(len(self._losing), dtype=np.int64)
        self.turns = 0

    def note(self, search: Search, modes: ModeState) -> None:
        """Take note of an iteration, after the search has: of what a solution in these modes asks for."""
        proposal = search.proposal
        if len(search.counts) <= 1:
            self._restart()
        # What pairs ask for is not what they get, where caution or pivoting chooses.
        was_open, self.open = self.open, modes.mode == OPEN
        self.met[was_open & ~self.open & self.parted] += 1
        self.parted |= self.open & ~was_open & (len(search.counts) > 1)
        changed = proposal.changed & self._losing
        torn = np.count_nonzero(changed & (self.met >= OFTEN))
        self.turns = self.turns + 1 if torn and torn >= MOST * np.count_nonzero(proposal.changed) else 0

    def are_all_that_is_left(self, search: Search) -> bool:
        """Whether the search goes on with such pairs alone, and comes no nearer to an end."""
        if self.turns < IN_TURN or search.taken < LATE:
            return False
        before, lately = search.counts[search.entered : -IN_TURN], search.counts[-IN_TURN:]
        return bool(before) and min(lately) >= min(before)
