"""How well Newton's linear systems are solved while modes change: as well as the change of the iteration is worth.

With the last solution carried over into the present unknowns, what is left of the equations is what the pairs that
changed make of it. While modes change this has to become smaller by a factor only, which takes a few products
however much there is left (theory, 88). Once no mode changes, the same system is gone on with
to the full accuracy, by which the modes are judged again: what is stored is never less exact than without this.
"""

from __future__ import annotations

from pbem.solve.petsc.session import find_number

# The part of the residual that a loose solution leaves. Option newton_forcing; 0 solves every system in full.
FORCING = 0.03
# Where no more than this part of all pairs has changed in the last iteration, this may be the last but one: it leaves
# so much less, as full accuracy at once takes many iterations of GMRES (kb11 26 in the last system, 19 with this).
FEW, NEARLY = 1e-3, 0.03
# After a full solution that changed modes which a loose one had not, solutions are so much less loose.
TIGHTER = 0.1
# So often in a step; then every system is solved in full.
MOST_TIGHTENED = 3


class Forcing:
    """The forcing term through one search; the same on all ranks, as it follows from what the first one decides.

    used: whether any system was solved loosely.
    """

    def __init__(self, on: bool) -> None:
        self._part = find_number("newton_forcing", FORCING) if on else 0.0
        self._tightened = 0
        self.used = False

    def choose(self, exactly: bool, changed: float = 1.0) -> float:
        """The part of its residual that the next system may leave; 0 for a solution in full. exactly: asked for.

        changed: part of all pairs that the last iteration has changed.
        """
        return 0.0 if exactly else self._part * (NEARLY if changed <= FEW else 1.0)

    def tighten(self) -> None:
        """Take note of modes that changed in a full solution, but not in the loose one of the same system."""
        self._tightened += 1
        self._part *= TIGHTER
        if self._tightened >= MOST_TIGHTENED:
            self.end()

    def end(self) -> bool:
        """Solve every system in full from now on; whether that is a change."""
        changed, self._part = self._part > 0, 0.0
        return changed
