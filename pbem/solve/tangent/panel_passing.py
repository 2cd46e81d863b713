"""Arrays that one rank has and all need, on their way while other things are computed."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from mpi4py import MPI


@dataclass(frozen=True)
class Coming:
    """Arrays on their way; they have their values after `wait`."""

    arrays: tuple[np.ndarray[Any, Any], ...]
    requests: list[MPI.Request]

    def wait(self) -> tuple[np.ndarray[Any, Any], ...]:
        """The arrays, when they are here."""
        MPI.Request.Waitall(self.requests)
        return self.arrays


class Passing:
    """Sends arrays to all ranks, one set of them after the other; all ranks call its methods together.

    Who sends does not wait until the others have them, but for those that it sent before.
    """

    def __init__(self, comm: MPI.Intracomm) -> None:
        self._comm = comm
        self._sent: list[MPI.Request] = []

    def send(self, arrays: tuple[np.ndarray[Any, Any], ...], root: int) -> Coming:
        """The rank `root` gives the values, which must stay as they are; the others the arrays for them."""
        requests = [self._comm.Ibcast(each, root=root) for each in arrays]
        if root != self._comm.rank:
            return Coming(arrays, requests)
        self.finish()
        self._sent = requests
        return Coming(arrays, [])

    def finish(self) -> None:
        """Wait until all ranks have what this one sent."""
        MPI.Request.Waitall(self._sent)
        self._sent = []


def receive_ahead(coming: Iterable[Coming]) -> Iterator[tuple[np.ndarray[Any, Any], ...]]:
    """Sets of arrays, each of them on its way while the one before is worked with."""
    before: Coming | None = None
    for each in coming:
        if before is not None:
            yield before.wait()
        before = each
    if before is not None:
        yield before.wait()
