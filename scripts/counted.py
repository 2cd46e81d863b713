"""A communicator that counts what a rank sends and receives, by kind of call: bytes, messages, the largest array."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from mpi4py import MPI


@dataclass
class Traffic:
    """Of one kind of call on one rank: calls, messages and bytes sent and received, bytes of the largest array."""

    calls: int = 0
    messages: int = 0
    sent: int = 0
    received: int = 0
    largest: int = 0


@dataclass
class Ledger:
    """What was counted so far, by the name of the call."""

    kinds: dict[str, Traffic] = field(default_factory=dict)

    def add(self, kind: str, messages: int, sent: int, received: int) -> None:
        """Count a call."""
        traffic = self.kinds.setdefault(kind, Traffic())
        traffic.calls += 1
        traffic.messages += messages
        traffic.sent += sent
        traffic.received += received
        traffic.largest = max(traffic.largest, sent, received)

    def sum_up(self) -> Traffic:
        """All kinds together; `largest` is that of the largest."""
        whole = Traffic()
        for each in self.kinds.values():
            for name in ("calls", "messages", "sent", "received"):
                setattr(whole, name, getattr(whole, name) + getattr(each, name))
            whole.largest = max(whole.largest, each.largest)
        return whole

    def clear(self) -> None:
        """Begin anew."""
        self.kinds.clear()


# What a communicator may be asked for without a count: nothing of a model is sent. All that is neither here nor counted
# below is refused, as nobody would see what it sends.
SILENT = frozenset((
    "Abort", "Barrier", "Create_keyval", "Delete_attr", "Free", "Get_attr", "Get_rank", "Get_size", "Ibarrier",
    "Set_attr", "barrier", "py2f", "rank", "size",
))  # fmt: skip


def count_bytes(buffer: Any) -> int:
    """Bytes of a buffer as mpi4py takes it: an array, or [array, counts]."""
    return int(np.asarray(buffer[0] if isinstance(buffer, list | tuple) else buffer).nbytes)


def count_object(item: Any) -> int:
    """Bytes of numbers, and of other objects what they take as they are sent."""
    return int(np.asarray(item).nbytes if isinstance(item, float | int | np.ndarray) else len(MPI.pickle.dumps(item)))


class CountedComm(MPI.Intracomm):
    """The same ranks; collective calls count what an algorithm without a tree has to send to and take from a rank.

    A duplicate, and its own duplicates count with it: nothing that others keep with the communicator is used. What
    libraries as PETSc and MUMPS send on theirs is not seen. Ways to send that are not counted raise
    NotImplementedError.
    An all-reduce is counted once each way, as its array: of P ranks each sends and receives at least 2 (P - 1)/P of it.
    """

    # By which petsc4py knows a communicator of mpi4py's.
    __module__ = "mpi4py.MPI"
    ledger: Ledger

    def __new__(cls, comm: MPI.Intracomm) -> CountedComm:
        """All ranks together; with an empty ledger."""
        made = super().__new__(cls, MPI.Intracomm(comm).Dup())
        made.ledger = Ledger()
        return made

    def __getattribute__(self, name: str) -> Any:
        """As usual, but for what would send without being counted."""
        if hasattr(MPI.Intracomm, name) and not (name.startswith("_") or name in SILENT or name in vars(CountedComm)):
            raise NotImplementedError(f"{name} is not counted")
        return super().__getattribute__(name)

    def Dup(self, info: MPI.Info | None = None) -> CountedComm:  # noqa: N802
        """A duplicate that counts in the same ledger."""
        made = CountedComm(self)
        made.ledger = self.ledger
        return made

    def Allreduce(self, sendbuf: Any, recvbuf: Any, op: MPI.Op = MPI.SUM) -> None:  # noqa: N802
        """Counted."""
        size = count_bytes(recvbuf)
        self.ledger.add("Allreduce", 1, size, size)
        super().Allreduce(sendbuf, recvbuf, op)

    def Allgather(self, sendbuf: Any, recvbuf: Any) -> None:  # noqa: N802
        """Counted."""
        self.ledger.add("Allgather", 1, count_bytes(sendbuf), count_bytes(recvbuf))
        super().Allgather(sendbuf, recvbuf)

    def Allgatherv(self, sendbuf: Any, recvbuf: Any) -> None:  # noqa: N802
        """Counted."""
        self.ledger.add("Allgatherv", 1, count_bytes(sendbuf), count_bytes(recvbuf))
        super().Allgatherv(sendbuf, recvbuf)

    def Alltoallv(self, sendbuf: Any, recvbuf: Any) -> None:  # noqa: N802
        """Counted."""
        self.ledger.add("Alltoallv", 1, count_bytes(sendbuf), count_bytes(recvbuf))
        super().Alltoallv(sendbuf, recvbuf)

    def Alltoall(self, sendbuf: Any, recvbuf: Any) -> None:  # noqa: N802
        """Counted."""
        self.ledger.add("Alltoall", 1, count_bytes(sendbuf), count_bytes(recvbuf))
        super().Alltoall(sendbuf, recvbuf)

    def Isend(self, buf: Any, dest: int, tag: int = 0) -> MPI.Request:  # noqa: N802
        """Counted."""
        self.ledger.add("Isend", 1, count_bytes(buf), 0)
        return super().Isend(buf, dest, tag)

    def Irecv(self, buf: Any, source: int = MPI.ANY_SOURCE, tag: int = MPI.ANY_TAG) -> MPI.Request:  # noqa: N802
        """Counted."""
        self.ledger.add("Irecv", 1, 0, count_bytes(buf))
        return super().Irecv(buf, source, tag)

    def allreduce(self, sendobj: Any, op: Any = MPI.SUM) -> Any:
        """Counted as the numbers that are sent, and of other objects their bytes."""
        size = count_object(sendobj)
        self.ledger.add("allreduce", 1, size, size)
        return super().allreduce(sendobj, op)

    def allgather(self, sendobj: Any) -> list[Any]:
        """Counted likewise."""
        found = super().allgather(sendobj)
        self.ledger.add("allgather", 1, count_object(sendobj), sum(count_object(each) for each in found))
        return found

    def bcast(self, obj: Any, root: int = 0) -> Any:
        """Counted likewise."""
        found = super().bcast(obj, root)
        size, first = count_object(found), self.rank == root
        self.ledger.add("bcast", 1, size * first, size * (not first))
        return found

    def gather(self, sendobj: Any, root: int = 0) -> list[Any] | None:
        """Counted likewise."""
        found = super().gather(sendobj, root)
        self.ledger.add("gather", 1, count_object(sendobj), sum(count_object(each) for each in found or ()))
        return found
