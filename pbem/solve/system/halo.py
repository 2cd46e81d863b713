"""Values of other ranks' items, sent from neighbour to neighbour by lists that are made once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from mpi4py import MPI

from pbem.arrays import Bool, Integer, Real
from pbem.bem.sharing import Ghosts, Share
from pbem.formed import form_runs
from pbem.parallel import add_up, keep_duplicate

# Of all messages here: on this communicator nothing else sends from rank to rank, and these arrive in their order.
TAG = 7014


@dataclass(frozen=True)
class _Arriving:
    """Values on their way: where they are put, the requests, and the arrays that must live until these are done."""

    values: Real
    order: Integer
    requests: list[MPI.Request]
    sent: Real
    kept: Bool | None = None

    def finish(self) -> Real:
        """The ghosts' values, in the ghosts' order."""
        MPI.Request.Waitall(self.requests)
        values = self.values
        if self.kept is not None:
            values = np.zeros(self.kept.shape)
            values[self.kept] = self.values
        result = np.empty_like(values)
        result[self.order] = values
        return result


class Halo:
    """See pbem.bem.sharing.Ghosts. Only ranks that need something of each other send messages."""

    def __init__(
        self, comm: MPI.Intracomm, numbers: Integer, owner: Integer, own: Integer, kept: Bool | None = None
    ) -> None:
        """Ghosts of numbers (g,), none of them twice, of their owners (g,); own (k,), rising: this rank's items.

        kept (g, w): see pbem.bem.sharing.Ranks; not for values that are added to the owners'.
        """
        self._comm = comm
        self._order = np.argsort(owner, kind="stable")
        taken = np.bincount(owner, minlength=comm.size).astype(np.int64)
        given = np.empty_like(taken)
        comm.Alltoall(taken, given)
        asked = np.empty(int(given.sum()), dtype=np.int64)
        comm.Alltoallv([np.ascontiguousarray(numbers[self._order], dtype=np.int64), taken], [asked, given])
        # Places of what others have asked for, rank after rank.
        self._give = np.searchsorted(own, asked)
        found = own[np.minimum(self._give, len(own) - 1)] if len(own) else np.full(len(asked), -1)
        assert np.array_equal(found, asked), "a rank is asked for what it does not own"
        self._givers, self._takers = _list_ranges(taken), _list_ranges(given)
        self._kept: Bool | None = None
        if kept is not None:
            width = kept.shape[1]
            self._kept, self._asked = kept[self._order], np.empty((len(asked), width), dtype=bool)
            comm.Alltoallv([self._kept.view(np.uint8), width * taken], [self._asked.view(np.uint8), width * given])
            self._sent_to = _count_values(self._takers, self._asked)
            self._sent_by = _count_values(self._givers, self._kept)

    def start(self, values: Real) -> _Arriving:
        """See pbem.bem.sharing.Ghosts."""
        if self._kept is None:
            return self._send(values[self._give], self._takers, self._givers, len(self._order))
        sent, count = values[self._give][self._asked], int(self._kept.sum())
        return replace(self._send(sent, self._sent_to, self._sent_by, count), kept=self._kept)

    def add_to_owners(self, ghosts: Real, values: Real) -> None:
        """See pbem.bem.sharing.Ghosts; in the order of the ranks, so that sums are the same in every run."""
        arriving = self._send(ghosts[self._order], self._givers, self._takers, len(self._give))
        MPI.Request.Waitall(arriving.requests)
        for _, first, last in self._takers:
            values[self._give[first:last]] += arriving.values[first:last]

    def _send(
        self, sent: Real, to: list[tuple[int, int, int]], origin: list[tuple[int, int, int]], count: int
    ) -> _Arriving:
        """Start all messages: rows first .. last - 1 of what is sent to each rank, and of what comes from each."""
        sent, values = np.ascontiguousarray(sent), np.empty((count, *sent.shape[1:]))
        requests = [self._comm.Irecv(values[first:last], rank, TAG) for rank, first, last in origin]
        requests += [self._comm.Isend(sent[first:last], rank, TAG) for rank, first, last in to]
        return _Arriving(values, self._order, requests, sent)


def _list_ranges(counts: Integer) -> list[tuple[int, int, int]]:
    """Of every rank with a count that is not zero: its number, and the first and last of its places."""
    last = np.cumsum(counts)
    return [(int(rank), int(last[rank] - counts[rank]), int(last[rank])) for rank in np.flatnonzero(counts)]


def _count_values(items: list[tuple[int, int, int]], kept: Bool) -> list[tuple[int, int, int]]:
    """Ranges of the values that are kept (k, w) for ranges of items."""
    last = np.concatenate([[0], np.cumsum(kept.sum(axis=1))])
    return [(rank, int(last[begin]), int(last[end])) for rank, begin, end in items]


@dataclass(frozen=True)
class AllRanks:
    """See pbem.bem.sharing.Ranks."""

    comm: MPI.Intracomm

    @property
    def rank(self) -> int:
        """See pbem.bem.sharing.Ranks."""
        return int(self.comm.rank)

    def find_ghosts(self, numbers: Integer, owner: Integer, own: Integer, kept: Bool | None = None) -> Halo:
        """See pbem.bem.sharing.Ranks."""
        return Halo(self.comm, numbers, owner, own, kept)

    def add_up(self, part: Real) -> Real:
        """See pbem.bem.sharing.Ranks."""
        return add_up(self.comm, part)


class NodeGhosts:
    """Values of nodes (two each) on this rank, those of its own nodes first, then of the ghosts that were asked for."""

    def __init__(self, share: Share, own: Integer, per_element: int) -> None:
        """own: this rank's nodes, rising; per_element: nodes of an element."""
        self._share, self._own, self._per_element = share, own, per_element
        self.nodes = np.zeros(0, dtype=np.int64)
        self._ghosts: Ghosts | None = None

    def ask_for(self, nodes: Integer) -> bool:
        """Have the values of at least these nodes; whether the ghosts are others now. All ranks call this together."""
        wanted = np.setdiff1d(nodes, self._own)
        new = float(not np.isin(wanted, self.nodes).all() or self._ghosts is None)
        if not self._share.ranks.add_up(np.array([new]))[0]:
            return False
        self.nodes = np.union1d(self.nodes, wanted)
        owner = self._share.of_element[self.nodes // self._per_element]
        self._ghosts = self._share.ranks.find_ghosts(self.nodes, owner, self._own)
        return True

    def fetch(self, part: Real) -> Real:
        """Own values and ghosts (2 k,) for this rank's part of a vector; all ranks call this together."""
        assert self._ghosts is not None
        return np.concatenate([part, self._ghosts.start(part.reshape(-1, 2)).finish().ravel()])

    def find(self, unknowns: Integer) -> Integer:
        """Places of unknowns in what `fetch` returns."""
        return place_unknowns(self._own, self.nodes, unknowns)


def place_unknowns(own: Integer, ghosts: Integer, unknowns: Integer) -> Integer:
    """Places of unknowns in a vector of two values for each own node, and then for each ghost; nodes are rising.

    Each of the unknowns must be of one of these nodes.
    """
    node, component = np.divmod(unknowns, 2)
    place = np.searchsorted(own, node)
    there = own[np.minimum(place, len(own) - 1)] == node if len(own) else np.zeros(len(node), dtype=bool)
    beyond = node[~there]
    ghost = np.searchsorted(ghosts, beyond)
    found = ghosts[np.minimum(ghost, len(ghosts) - 1)] if len(ghosts) else np.full(len(beyond), -1)
    assert np.array_equal(found, beyond), "a rank looks for a node that it neither owns nor has asked for"
    place[~there] = len(own) + ghost
    return np.asarray(2 * place + component)


def share_elements(comm: MPI.Intracomm, groups: list[Integer], bounds: Sequence[tuple[int, int]]) -> Share:
    """Elements by the groups that ranks own: each those from its first up to its last number (bounds).

    All ranks call this together; their messages pass on a communicator of their own.
    """
    of_element = np.zeros(sum(len(group) for group in groups), dtype=np.int64)
    for rank, (first, last) in enumerate(bounds):
        for group in groups[first:last]:
            of_element[group] = rank
    return Share(AllRanks(keep_duplicate(comm)), form_runs(of_element))
