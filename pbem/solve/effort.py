"""Whether to go on with old factors or to make new ones: by measured seconds, the same on all ranks."""

from __future__ import annotations

import time
from collections.abc import Callable

from mpi4py import MPI

# Of a small dense factorisation on one rank, operations in a second: a low estimate.
DENSE_RATE = 1e10


class Effort:
    """Adds up what old factors cost beside new ones; when both are the same, new ones are due.

    Never more than twice the best is spent in this way, whatever the modes are going to do.
    """

    def __init__(self, comm: MPI.Intracomm) -> None:
        self.comm = comm
        self.restart(0.0, 1, limited=False)

    def restart(self, factorisation: float, unknowns: int, limited: bool) -> None:
        """New factors are there, in so many seconds; limited: they may be replaced."""
        self.factorisation, self.limited = factorisation, limited
        self.column_seconds = 3.0 * factorisation / unknowns  # 2 n^2 operations beside 2/3 n^3
        self.spent = 0.0

    def allows(self, columns: int, size: int) -> bool:
        """Whether so many columns and a dense system of such a size may be spent; then they are."""
        cost = columns * self.column_seconds + 2 / 3 * size**3 / DENSE_RATE
        if self.limited and self.spent + cost > self.factorisation:
            return False
        self.spent += cost
        return True

    def measure(self, columns: int, compute: Callable[[], None]) -> None:
        """Compute columns, and remember their time for the next ones."""
        begin = time.perf_counter()
        compute()
        seconds = self.comm.allreduce(time.perf_counter() - begin, op=MPI.MAX)
        self.spent += seconds - columns * self.column_seconds
        if columns >= 32:  # fewer tell more of the call than of the columns
            self.column_seconds = seconds / columns
