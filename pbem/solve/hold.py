"""Bodies that the present contact would leave free: pairs that hold them in the meantime, or the refusal."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pbem.contact.laws import SLIP, STICK, ModeState
from pbem.contact.support import close_nearest_pairs, find_ties, stick_calmest_pairs
from pbem.errors import ConvergenceError
from pbem.solve.problem import Problem

Real = NDArray[np.float64]
Integer = NDArray[np.int64]

# A body that slips on all its contacts is held by single pairs at most so often in one step.
MOST_HELD = 12


class Hold:
    """Modes that hold all bodies, through the iterations of one step.

    A body whose pairs are all open has no equilibrium until it touches something: its nearest pairs are closed. One
    whose closed pairs all slip can still be in balance, by friction that acts in both senses: then there is a place
    between where slip changes its sense, and a pair there that sticks holds the body and carries what is left of the
    balance. If that is more than its bound, the place is further on against the sense of what it carries.
    """

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.pairs: Integer = np.zeros(0, dtype=np.int64)
        self.count = 0

    def apply(self, modes: ModeState, opening: Real, slip: Real, before: ModeState | None = None) -> ModeState:
        """The modes, with pairs closed or sticking where a body would be free to move.

        opening, slip (m,): as they are, the slip of this step alone; before: the modes that led to them.
        """
        if not _find_free(self.problem, modes):
            return modes
        mesh, laws = self.problem.mesh, self.problem.laws
        closed = close_nearest_pairs(mesh, laws, modes, opening)
        if before is None or self.count >= MOST_HELD or not _find_free(self.problem, closed):
            return closed
        # Pairs that stuck until now and are overloaded say in which sense the body goes on to move.
        overloaded = np.flatnonzero((before.mode == STICK) & (modes.mode == SLIP))
        overloaded = np.intersect1d(overloaded, self.pairs)
        held, pairs = stick_calmest_pairs(
            mesh, laws, closed, slip, overloaded, lambda trial: not _find_free(self.problem, trial)
        )
        self.count += 1
        self.pairs = np.union1d(self.pairs, pairs)
        return held

    def describe(self, modes: ModeState) -> tuple[str, ...]:
        """What the user should know of pairs that hold a body in the end."""
        held = self.pairs[modes.mode[self.pairs] == STICK]
        if not len(held):
            return ()
        released = ModeState(modes.mode.copy(), modes.sign)
        released.mode[held] = SLIP
        free = _find_free(self.problem, released)
        if not free:
            return ()
        mesh = self.problem.mesh
        names = ", ".join(sorted({repr(mesh.interface_names[k]) for k in mesh.pairs.interface[held]}))
        return (
            f"All of {names} slips and friction is in balance; a {free} is held by {len(held)} sticking "
            f"{'pair' if len(held) == 1 else 'pairs'} where the slip changes its sense, and known only to the distance "
            "of its neighbours.",
        )


def _find_free(problem: Problem, modes: ModeState) -> str | None:
    return problem.free_motions(tuple(find_ties(problem.model, problem.mesh, modes).items()))


def describe_free_motion(problem: Problem, modes: ModeState) -> ConvergenceError | None:
    """The error that names what can move freely in the present contact; None if nothing can."""
    free = _find_free(problem, modes)
    if not free:
        return None
    detail = f"nothing in the present contact prevents a {free}; hold it by a condition"
    return ConvergenceError("free motion", detail)


def refuse_free_motion(problem: Problem, modes: ModeState) -> None:
    """Raise ConvergenceError if a body can move freely in the present contact, where any position would do."""
    error = describe_free_motion(problem, modes)
    if error:
        raise error
