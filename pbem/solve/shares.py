"""Shares of rows among the ranks: those of ScaLAPACK, and vectors that change from one kind to another."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

Real = NDArray[np.float64]
Integer = NDArray[np.int64]

# Rows and columns of the blocks in which PETSc's ScaLAPACK matrices are dealt to the ranks.
BLOCK = 64


def change_shares(comm: MPI.Intracomm, part: Real, old: Integer, new: Integer) -> Real:
    """This rank's rows (old[rank], ...) in other shares (new[rank], ...); rows keep their order over the ranks."""
    if np.array_equal(old, new):
        return part
    width = int(np.prod(part.shape[1:], dtype=int))
    ends = [np.concatenate([[0], np.cumsum(counts)]) for counts in (old, new)]

    def overlap(mine: Integer, others: Integer) -> Integer:
        begin, end = mine[comm.rank], mine[comm.rank + 1]
        return np.maximum(np.minimum(others[1:], end) - np.maximum(others[:-1], begin), 0) * width

    result = np.empty((int(new[comm.rank]), *part.shape[1:]))
    given, taken = overlap(ends[0], ends[1]), overlap(ends[1], ends[0])
    comm.Alltoallv([np.ascontiguousarray(part), given], [result, taken])
    return result


def share_equally(count: int, ranks: int) -> list[int]:
    """Shares as ScaLAPACK wants them: all the same, but for the last, which may be smaller, and empty ones after it."""
    share = -(-count // ranks)
    return [max(0, min(share, count - share * rank)) for rank in range(ranks)]


def find_own_blocks(count: int, comm: MPI.Intracomm, across: bool = False) -> Integer:
    """The rows (across: the columns) of which this rank has blocks, on PETSc's grid of ranks.

    A guess that costs time only if it is wrong: PETSc sends values to where they belong.
    """
    down = next(rows for rows in range(int(comm.size**0.5 + 1e-3), 0, -1) if comm.size % rows == 0)
    wide = comm.size // down
    ranks, own = (wide, comm.rank % wide) if across else (down, comm.rank // wide)
    return np.flatnonzero(np.arange(count) // BLOCK % ranks == own)
