"""Whether to go on with old factors or to make new ones: by counted operations, so that equal runs decide alike."""

from __future__ import annotations

from dataclasses import dataclass

# Operations of the small dense system's factors are done by one rank, and in smaller blocks.
SMALL = 2.0


@dataclass(frozen=True)
class Work:
    """What factors have cost and what is done with them costs, in operations of a large LU factorisation.

    factors: to form and factorise the operator; column: one of many columns solved for; iteration: one of GMRES.
    """

    factors: float
    column: float
    iteration: float


class Effort:
    """Adds up what old factors cost beside new ones; when both are the same, new ones are due.

    Never more than twice the best is spent in this way, whatever the modes are going to do.
    """

    def __init__(self, ranks: int) -> None:
        self.ranks = ranks
        self.restart(Work(0.0, 0.0, 0.0), limited=False)

    def restart(self, work: Work, limited: bool) -> None:
        """New factors are there; limited: they may be replaced."""
        self.work, self.limited = work, limited
        self.spent = 0.0

    def allows(self, columns: int, size: int) -> bool:
        """Whether so many columns and a dense system of such a size may be spent; then they are."""
        cost = columns * self.work.column + 2 / 3 * SMALL * self.ranks * size**3
        if self.limited and self.spent + cost > self.work.factors:
            return False
        self.spent += cost
        return True

    def count_columns(self, columns: int) -> None:
        """So many columns are computed whatever they cost."""
        self.spent += columns * self.work.column
