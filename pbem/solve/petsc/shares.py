"""Shares of rows among the ranks: those of ScaLAPACK, and vectors that change from one kind to another."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from pbem.arrays import Integer, Real

# Rows and columns of the blocks in which PETSc's ScaLAPACK matrices are dealt to the ranks.
BLOCK = 64


def cut_equally(numbers: Integer, comm: MPI.Intracomm) -> Integer:
    """This rank's part of numbers (k,), all parts of the same size but for one."""
    cuts = np.linspace(0, len(numbers), comm.size + 1).astype(int)
    return numbers[cuts[comm.rank] : cuts[comm.rank + 1]]


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


def refuse_shares(nodes: int, ranks: int, lu: bool) -> str | None:
    """What to say when the dense operator of so many nodes cannot be shared; None if it can. lu: by ScaLAPACK."""
    if fits_ranks(nodes, ranks, lu):
        return None
    most = next(fewer for fewer in range(ranks, 0, -1) if fits_ranks(nodes, fewer, lu))
    if nodes < ranks:
        found = f"the model has {nodes} nodes, fewer than the {ranks} ranks"
    else:
        found = f"ScaLAPACK cannot share the {2 * nodes} rows of the dense matrix equally among {ranks} ranks"
    other = ", or solver.linear = \"mumps\"" if nodes >= ranks else ""
    return f"{found}; start at most {most}{other}, or solver.operator = \"hierarchical\""


def fits_ranks(nodes: int, ranks: int, lu: bool) -> bool:
    """Whether every rank gets a node, and ScaLAPACK's blocks of rows are the same on all ranks but the last.

    PETSc's ScaLAPACK matrices must have a block of ceil(rows / ranks) rows on each rank, the last one what is left.
    """
    block = -(-2 * nodes // ranks)
    return ranks == 1 or (nodes >= ranks and (not lu or (ranks - 1) * block <= 2 * nodes))
