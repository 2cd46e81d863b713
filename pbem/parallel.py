"""The ranks of the run: who owns which collocation points, how arrays are put together, how all end together."""

from __future__ import annotations

import os
import re
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from pbem.arrays import Integer, Real
from pbem.errors import LaunchError, StopError, printable

T = TypeVar("T")
Scalar = TypeVar("Scalar", bound=np.generic)

PETSC_ERR_MEM, PETSC_ERR_LIB = 55, 76
# How PETSc tells that MUMPS could not allocate what it needs to solve.
MUMPS_LACKS_MEMORY = re.compile(r"\bMUMPS\b.*INFOG\(1\) ?= ?-(5|7|13|19|22|29)\b")
# SIGUSR1 is what batch systems send some time before the end, where they are asked to.
STOP_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGUSR1, signal.SIGXCPU)

# Signals within so many seconds after the first are the same request: a batch system signals the launcher and the
# ranks, and the launcher passes it on about a second later.
REPEATED = 3.0
# After so many seconds a run that is to stop does not wait for the end of its iteration. Launchers kill ranks that have
# not ended a second or two after SIGTERM.
PATIENCE = 0.3

Comm = MPI.Intracomm

world: Comm = MPI.COMM_WORLD
alone: Comm = MPI.COMM_SELF


def check_communicator(comm: Comm | None) -> Comm:
    """The communicator, by default that of all ranks. Raises TypeError if it is none that ranks can compute with."""
    if comm is None:
        return world
    if not isinstance(comm, MPI.Intracomm) or comm == MPI.COMM_NULL:
        raise TypeError(f"comm is {type(comm).__name__} {comm!r}; expected an intra-communicator of mpi4py")
    return comm


def _free_duplicate(comm: MPI.Comm, _: int, own: MPI.Comm) -> None:
    """What MPI calls when a communicator is freed, or at its own end, when nothing can be freed any more."""
    if comm not in (MPI.COMM_WORLD, MPI.COMM_SELF):
        own.Free()


_DUPLICATE = MPI.Comm.Create_keyval(delete_fn=_free_duplicate)


def keep_duplicate(comm: Comm) -> Comm:
    """A duplicate for messages from rank to rank, which a host program that receives from any rank cannot take.

    All ranks call this together. It is made once, kept with the communicator, and freed with it: MPI has few of them.
    """
    if comm.size == 1:
        return comm
    own: Comm | None = comm.Get_attr(_DUPLICATE)  # type: ignore[assignment]
    if own is None:
        own = comm.Dup()  # type: ignore[assignment]
        comm.Set_attr(_DUPLICATE, own)
    assert own is not None
    return own


@contextmanager
def abort_if_unexpected(comm: MPI.Intracomm, expected: type[Exception]) -> Iterator[None]:
    """End all ranks at once, with the traceback printed once, when an exception other than `expected` leaves the block.

    Exceptions of the expected kind are those that all ranks raise alike. With one rank nothing is done.
    """
    try:
        yield
    except expected:
        raise
    except BaseException as error:
        if comm.size == 1:
            raise
        where = f"pbem: rank {comm.rank} of {comm.size}"
        if lacks_memory(error):
            # Ranks of a node run out of memory together; whichever speaks first ends the others, on busy nodes later.
            time.sleep(0.8 * min(comm.rank, 1) + 0.2 * min(comm.rank, 50))
            text = f"{where}: {describe_lack(error)}; all ranks end\n"
        else:
            text = f"{where} failed, all ranks end\n{traceback.format_exc()}"
        with suppress(OSError):
            sys.stdout.flush()
            sys.stderr.write(printable(text, keep="\n"))
            sys.stderr.flush()
        comm.Abort(1)


def lacks_memory(error: BaseException) -> bool:
    """Whether it is Python's error of too little memory, PETSc's, or that of a library below PETSc."""
    code = getattr(error, "ierr", None)
    below = code == PETSC_ERR_LIB and MUMPS_LACKS_MEMORY.search(str(error)) is not None
    return isinstance(error, MemoryError) or code == PETSC_ERR_MEM or below


def describe_lack(error: BaseException) -> str:
    """That there is not enough memory, in one line."""
    text = " ".join(str(error).split())
    return f"out of memory{f' ({text})' if text else ''}; use more nodes, or fewer ranks per node"


class StopSignals:
    """Notes the signals by which users and batch systems stop a run, so that all ranks can stop together.

    Used as a context, in the main thread; elsewhere, and for signals that are ignored (nohup), it does nothing. The
    first signal is noted only, and those that follow at once, as launchers pass on what batch systems send to all
    processes; a later one does what it does without this. asked: reason, detail and exit code, as of StopError; None as
    long as the run may go on. With `at_once` the first signal raises StopError itself: for what one rank does between
    two occasions to ask.
    """

    def __init__(self) -> None:
        self.asked: tuple[str, str, int] | None = None
        self.at_once = False
        self._former: dict[int, Any] = {}
        self._since = 0.0

    @property
    def overdue(self) -> bool:
        """Whether it was asked so long ago that the end of an iteration should not be waited for."""
        return self.asked is not None and time.monotonic() > self._since + PATIENCE

    def ask(self, reason: str, detail: str, code: int) -> None:
        """Let the run stop at the next occasion; the first reason counts."""
        if self.asked is None:
            self.asked, self._since = (reason, detail, code), time.monotonic()

    def _note(self, number: int, _: object) -> None:
        name = signal.Signals(number).name
        if self.asked is not None and time.monotonic() > self._since + REPEATED:
            self._restore()
            os.kill(os.getpid(), number)
            return
        again = self.asked is not None
        self.ask(name, f"stopped by {name}", 128 + number)
        if self.at_once and not again and self.asked is not None:
            raise StopError(*self.asked)

    def __enter__(self) -> StopSignals:
        if threading.current_thread() is threading.main_thread():
            for number in STOP_SIGNALS:
                if signal.getsignal(number) not in (signal.SIG_IGN, None):
                    self._former[number] = signal.signal(number, self._note)
        return self

    def __exit__(self, *_: object) -> None:
        self._restore()

    def _restore(self) -> None:
        while self._former:
            number, former = self._former.popitem()
            signal.signal(number, former)


def do_on_first(comm: MPI.Intracomm, expected: type[Exception], action: Callable[[], T], share: bool = True) -> T:
    """Call action on the first rank only; all ranks get its value, or raise its exception of the expected kind.

    share=False keeps the value on the first rank (it cannot be sent); the others get None.
    """
    if comm.size == 1:  # what is sent is packed, though to oneself
        return action()
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


def read_available_memory() -> float:
    """Bytes of memory of this node that are free for programs; without bound where the system does not tell."""
    with suppress(OSError, ValueError):
        for line in Path("/proc/meminfo").read_text().splitlines():
            name, _, value = line.partition(":")
            if name == "MemAvailable":
                return 1024.0 * float(value.split()[0])
    return float("inf")


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
    if comm.size == 1:
        return np.array(part, dtype=float)
    counts = np.array(comm.allgather(len(part)))
    whole = np.empty(int(counts.sum()))
    comm.Allgatherv(np.ascontiguousarray(part), [whole, counts])
    return whole


def gather_rows(comm: MPI.Intracomm, part: Real) -> Real:
    """All ranks' rows (k, c) one after the other, on every rank."""
    return gather_parts(comm, part.ravel()).reshape(-1, part.shape[1])


def add_up(comm: MPI.Intracomm, part: Real) -> Real:
    """The sum over the ranks of arrays of the same shape, on every rank."""
    if comm.size == 1:
        return part
    whole = np.empty(part.shape, part.dtype)  # in C's order, as what is sent
    comm.Allreduce(np.ascontiguousarray(part), whole)
    return whole


def add_up_there(comm: MPI.Intracomm, part: NDArray[Scalar]) -> NDArray[Scalar]:
    """The same in the array of each rank, which is in C's order: large ones are not held twice."""
    if comm.size > 1:
        comm.Allreduce(MPI.IN_PLACE, part)
    return part


def norm_of_parts(comm: MPI.Intracomm, part: Real) -> float:
    """Euclidean norm of a vector whose parts lie on the ranks; the same number on all."""
    return float(np.sqrt(comm.allreduce(float(part @ part))))


def largest_of_parts(comm: MPI.Intracomm, part: Real) -> float:
    """Largest size of an entry of a vector whose parts lie on the ranks; the same number on all."""
    return float(comm.allreduce(float(np.abs(part).max(initial=0.0)), op=MPI.MAX))


def broadcast(comm: MPI.Intracomm, value: Any) -> Any:
    """The first rank's value, on every rank."""
    return value if comm.size == 1 else comm.bcast(value, root=0)
