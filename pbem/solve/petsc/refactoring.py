"""Whether to go on with old factors or to make new ones: by counted operations, so that equal runs decide alike."""

from __future__ import annotations

from dataclasses import dataclass, replace

# Operations of the small dense system's factors are done by one rank, and in smaller blocks.
SMALL = 2.0


@dataclass(frozen=True)
class FactorWork:
    """What factors have cost and what is done with them costs, in operations of a large LU factorisation.

    factors: to form and factorise the operator; call: of columns, however many, and column: each of them; iteration:
    one of GMRES.
    """

    factors: float
    call: float
    column: float
    iteration: float


@dataclass(frozen=True)
class Effort:
    """Adds up what old factors cost beside new ones; when both are the same, new ones are due.

    Never more than twice the best is spent in this way, whatever the modes are going to do.
    limited: they may be replaced. spent: operations with the present factors so far.
    """

    ranks: int
    work: FactorWork
    limited: bool
    spent: float = 0.0

    def allows(self, columns: int, size: int) -> bool:
        """Whether so many columns and a dense system of such a size may be spent."""
        return not self.limited or self.spend(columns, size).spent <= self.work.factors

    def spend(self, columns: int, size: int = 0) -> Effort:
        """With so many columns and a dense system of such a size more."""
        solved = self.work.call + columns * self.work.column if columns else 0.0
        cost = solved + 2 / 3 * SMALL * self.ranks * size**3
        return replace(self, spent=self.spent + cost)
