"""How the elements of a model are shared by ranks, and what the operator asks of these; mechanics knows no MPI."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from pbem.arrays import Bool, Integer, Real


class Arrival(Protocol):
    """Values that are on their way from other ranks."""

    def finish(self) -> Real:
        """The values of the ghosts (g, w), in their order."""


class Ghosts(Protocol):
    """Items that other ranks own and this one needs; all ranks call all methods together."""

    def start(self, values: Real) -> Arrival:
        """Send what others need of the own items' values (k, w)."""

    def add_to_owners(self, ghosts: Real, values: Real) -> None:
        """Add this rank's values of its ghosts (g, w) to those of their owners, as others do to the own ones (k, w)."""


class Ranks(Protocol):
    """The ranks that compute together."""

    @property
    def rank(self) -> int:
        """Number of this one."""

    def find_ghosts(self, numbers: Integer, owner: Integer, own: Integer, kept: Bool | None = None) -> Ghosts:
        """Ghosts of numbers (g,) owned by other ranks (g,); own (k,), rising: this rank's. By all ranks together.

        kept (g, w): which values of each ghost are sent; those that are not are zero. None: all of them.
        """

    def add_up(self, part: Real) -> Real:
        """The sum of all ranks' arrays of the same shape; by all ranks together."""


@dataclass(frozen=True)
class Share:
    """Which rank owns each element (elements,) of a model; all ranks have the same."""

    ranks: Ranks
    of_element: Integer

    @property
    def own(self) -> Bool:
        """Whether an element is this rank's (elements,)."""
        return self.of_element == self.ranks.rank


class _Nothing:
    """Values of no ghosts."""

    def __init__(self, width: int) -> None:
        self._width = width

    def finish(self) -> Real:
        return np.zeros((0, self._width))


class _NoGhosts:
    """Of a rank that owns everything."""

    def start(self, values: Real) -> Arrival:
        return _Nothing(values.shape[1])

    def add_to_owners(self, ghosts: Real, values: Real) -> None:
        return


class OneRank:
    """One process computes the whole model."""

    rank = 0

    def find_ghosts(self, numbers: Integer, owner: Integer, own: Integer, kept: Bool | None = None) -> Ghosts:
        """None."""
        assert not len(numbers), "one rank owns everything"
        return _NoGhosts()

    def add_up(self, part: Real) -> Real:
        """Its own."""
        return part


def keep_whole(elements: int) -> Share:
    """All elements on one rank."""
    return Share(OneRank(), np.zeros(elements, dtype=np.int64))
