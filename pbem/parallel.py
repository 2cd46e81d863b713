"""The ranks of the run: who owns which collocation points, how arrays are put together, how all end together."""

from __future__ import annotations

import sys
import traceback
from types import TracebackType
from typing import Any

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

Real = NDArray[np.float64]
Integer = NDArray[np.int64]

world: MPI.Intracomm = MPI.COMM_WORLD


def abort_on_exception(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    """An exception hook: print the traceback once and end all ranks, so that none waits for this one for ever."""
    text = "".join(traceback.format_exception(kind, error, trace))
    sys.stderr.write(f"rank {world.rank} of {world.size} failed:\n{text}")
    sys.stderr.flush()
    if world.size > 1:
        world.Abort(1)


def share_nodes(costs: Real, ranks: int) -> Integer:
    """First nodes (ranks + 1,) of contiguous shares of about equal cost; costs (n,) > 0 per node.

    With at least as many nodes as ranks every rank gets one or more.
    """
    total = np.cumsum(costs)
    targets = total[-1] * np.arange(1, ranks) / ranks
    cuts = np.searchsorted(total, targets * (1 - 1e-12)) + 1
    least = np.arange(1, ranks)
    cuts = np.clip(cuts, least, len(costs) - ranks + least) if len(costs) >= ranks else np.minimum(least, len(costs))
    return np.concatenate([[0], np.maximum.accumulate(cuts), [len(costs)]]).astype(np.int64)


def gather_parts(comm: MPI.Intracomm, part: Real) -> Real:
    """All ranks' parts (k,) one after the other, on every rank."""
    counts = np.array(comm.allgather(len(part)))
    whole = np.empty(int(counts.sum()))
    comm.Allgatherv(np.ascontiguousarray(part), [whole, counts])
    return whole


def norm_of_parts(comm: MPI.Intracomm, part: Real) -> float:
    """Euclidean norm of a vector whose parts lie on the ranks; the same number on all."""
    return float(np.sqrt(comm.allreduce(float(part @ part))))


def broadcast(comm: MPI.Intracomm, value: Any) -> Any:
    """The first rank's value, on every rank."""
    return comm.bcast(value, root=0)
