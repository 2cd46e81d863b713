"""The ranks of the run: who owns which collocation points, how arrays are put together, how all end together."""

from __future__ import annotations

import sys
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from pbem.errors import LaunchError

Real = NDArray[np.float64]
Integer = NDArray[np.int64]

T = TypeVar("T")

world: MPI.Intracomm = MPI.COMM_WORLD


@contextmanager
def abort_if_unexpected(comm: MPI.Intracomm, expected: type[Exception]) -> Iterator[None]:
    """End all ranks at once, with the traceback printed once, when an exception other than `expected` leaves the block.

    Exceptions of the expected kind are those that all ranks raise alike. With one rank nothing is done.
    """
    try:
        yield
    except expected:
        raise
    except BaseException:
        if comm.size == 1:
            raise
        sys.stdout.flush()
        sys.stderr.write(f"pbem: rank {comm.rank} of {comm.size} failed, all ranks end\n{traceback.format_exc()}")
        sys.stderr.flush()
        comm.Abort(1)


def do_on_first(comm: MPI.Intracomm, expected: type[Exception], action: Callable[[], T], share: bool = True) -> T:
    """Call action on the first rank only; all ranks get its value, or raise its exception of the expected kind.

    share=False keeps the value on the first rank (it cannot be sent); the others get None.
    """
    value, error = None, None
    if comm.rank == 0:
        try:
            value = action()
        except expected as caught:
            error = caught
    error = comm.bcast(error, root=0)
    if error is not None:
        raise error
    return comm.bcast(value, root=0) if share else value  # type: ignore[return-value]


def refuse_together(comm: MPI.Intracomm, fault: str | None) -> None:
    """Raise LaunchError on all ranks alike if a rank brings a fault; the first one is said."""
    faults = comm.allgather(fault)
    bad = [rank for rank, text in enumerate(faults) if text]
    if bad:
        where = "" if len(bad) == comm.size else f" (on {len(bad)} of {comm.size} ranks, first on rank {bad[0]})"
        raise LaunchError(f"{faults[bad[0]]}{where}")


def wait_for_all(comm: MPI.Intracomm, fault: str | None, patience: float) -> None:
    """Wait until all ranks are here; a rank with a fault waits so long (s), then says it and ends all ranks, code 2.

    For faults before a collective call in which the other ranks may hang: they would wait for this one for ever.
    """
    arrived = comm.Ibarrier()
    if fault is None:
        arrived.Wait()
        return
    # Not all at once: the first to speak ends the others.
    end = time.monotonic() + patience + 0.2 * min(comm.rank, 50)
    while not arrived.Test():
        if time.monotonic() > end:
            sys.stderr.write(f"pbem: {fault} (on rank {comm.rank} of {comm.size})\n")
            sys.stderr.flush()
            comm.Abort(2)
        time.sleep(0.01)


def gather_by_node(comm: MPI.Intracomm, value: T) -> list[list[T]]:
    """The values of all ranks, those of a node (what shares memory) in a list of their own; the same on every rank."""
    node = comm.Split_type(MPI.COMM_TYPE_SHARED)
    first = node.bcast(comm.rank, root=0)
    node.Free()
    nodes: dict[int, list[T]] = {}
    for key, each in comm.allgather((first, value)):
        nodes.setdefault(key, []).append(each)
    return list(nodes.values())


def describe_library() -> str:
    """Name and version of the MPI library that mpi4py uses."""
    return str(MPI.Get_library_version()).strip("\0 \n").splitlines()[0].split(", package")[0].strip()


def share_nodes(costs: Real, ranks: int) -> Integer:
    """First nodes (ranks + 1,) of contiguous shares of about equal cost; costs (n,) > 0 per node.

    With at least as many nodes as ranks every rank gets one or more.
    """
    total = np.cumsum(costs)
    targets = total[-1] * np.arange(1, ranks) / ranks
    cuts = np.searchsorted(total, targets * (1 - 1e-12)) + 1
    least = np.arange(1, ranks)
    if len(costs) < ranks:
        cuts = np.minimum(least, len(costs))
    else:  # at least one node between two cuts
        cuts = np.maximum.accumulate(np.clip(cuts - least, 0, len(costs) - ranks)) + least
    return np.concatenate([[0], cuts, [len(costs)]]).astype(np.int64)


def gather_parts(comm: MPI.Intracomm, part: Real) -> Real:
    """All ranks' parts (k,) one after the other, on every rank."""
    counts = np.array(comm.allgather(len(part)))
    whole = np.empty(int(counts.sum()))
    comm.Allgatherv(np.ascontiguousarray(part), [whole, counts])
    return whole


def add_up(comm: MPI.Intracomm, part: Real) -> Real:
    """The sum over the ranks of arrays of the same shape, on every rank."""
    if comm.size == 1:
        return part
    whole = np.empty_like(part)
    comm.Allreduce(np.ascontiguousarray(part), whole)
    return whole


def norm_of_parts(comm: MPI.Intracomm, part: Real) -> float:
    """Euclidean norm of a vector whose parts lie on the ranks; the same number on all."""
    return float(np.sqrt(comm.allreduce(float(part @ part))))


def broadcast(comm: MPI.Intracomm, value: Any) -> Any:
    """The first rank's value, on every rank."""
    return comm.bcast(value, root=0)
