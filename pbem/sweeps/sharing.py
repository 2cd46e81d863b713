"""Which ranks compute which cases of a sweep: each rank cases of its own, or all of them every case together."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from pbem.errors import PbemError
from pbem.forecast.forecast import make_forecast
from pbem.mesh.mesh import Mesh
from pbem.model.model import Model
from pbem.parallel import Comm, alone, read_available_memory
from pbem.sweeps.table import Row
from pbem.sweeps.values import write_cell

# Cases of fewer unknowns gain nothing from several ranks.
SMALL = 4000
# With so many cases for each rank it pays that each assembles the operator for itself.
CASES_EACH = 8
# The operators of all ranks of a node take up to this part of its memory.
PART_OF_MEMORY = 0.4
# Keys of these tables change the operator; of [[generate]] all but those of laws.
OF_GEOMETRY = ("materials", "curves", "regions", "contacts", "analysis", "generate")
TAG = 1


def changes_operator(key: str) -> bool:
    """Whether cases that differ in a key have operators of their own, as far as its name tells."""
    root, *rest = key.replace(" ", "").split(".")
    if root == "contacts":
        return rest[-1:] == ["between"]
    return root in OF_GEOMETRY and not (root == "generate" and rest[-1:] in (["friction"], ["cohesion"], ["gap"]))


def sort_cases(cases: Sequence[dict[str, Any]], several: Mapping[str, Sequence[Any]]) -> list[dict[str, Any]]:
    """The cases with the same operator one after the other, and each beside one that differs by one value only."""
    # The key with the most values changes fastest: its neighbours are the most alike.
    keys = sorted(several, key=lambda key: (not changes_operator(key), len(several[key])))
    written = {key: {write_cell(each): place for place, each in enumerate(several[key])} for key in keys}

    def place(case: dict[str, Any]) -> list[int]:
        """To and fro: every other time a key goes through its values it does so backwards."""
        found, turned = [], 0
        for key in keys:
            at = written[key][write_cell(case[key])]
            found.append(len(several[key]) - 1 - at if turned % 2 else at)
            turned += at
        return found

    return sorted(cases, key=place)


@dataclass(frozen=True)
class Share:
    """How cases are shared: single: each rank computes cases of its own; blocks: those that are neighbours."""

    single: bool
    blocks: bool

    @contextmanager
    def open(self, comm: Comm) -> Iterator[RankGroup]:
        """The group of ranks in which this rank computes cases."""
        if comm.size == 1 or not self.single:
            yield RankGroup(comm, comm, self.blocks)
            return
        own: Comm = comm.Dup()  # type: ignore[assignment]
        try:
            yield RankGroup(alone, own, self.blocks)
        finally:
            own.Free()


def choose_share(model: Model, mesh: Mesh, comm: Comm, count: int, several: Mapping[str, Sequence[Any]]) -> Share:
    """Cases of their own if there are enough for all ranks, and memory for as many operators; asked on one rank."""
    blocks = any(changes_operator(key) for key in several)
    if comm.size == 1:
        return Share(False, blocks)
    least = comm.size * (1 if 2 * mesh.nodes <= SMALL or blocks else CASES_EACH)
    needed = make_forecast(model, mesh, 1, timed=False).rank_memory
    return Share(count >= least and comm.size * needed <= PART_OF_MEMORY * read_available_memory(), blocks)


@dataclass(frozen=True)
class RankGroup:
    """comm: of the ranks that compute a case together; all: of those that share the cases."""

    comm: Comm
    all: Comm
    blocks: bool
    _ended: list[int] = field(default_factory=lambda: [0])  # ranks that have sent all their rows

    def share_out(
        self, cases: Sequence[dict[str, Any]], compute: Callable[[dict[str, Any]], Row],
        add: Callable[[dict[str, Any], Row], None],
    ) -> None:
        """Compute all cases; the first rank of all adds their rows. Errors of one rank are raised on all."""
        if self.comm is self.all:
            for case in cases:
                row = compute(case)
                self._add_together(case, row, add)
            return
        size, rank = self.all.size, self.all.rank
        if self.blocks:
            ends = [len(cases) * k // size for k in range(size + 1)]
            own: Sequence[int] = range(ends[rank], ends[rank + 1])
        else:
            own = range(rank, len(cases), size)
        error: PbemError | None = None
        try:
            for number in own:
                row = compute(cases[number])
                if rank == 0:
                    add(cases[number], row)
                    self._receive(cases, add)
                else:
                    self.all.send((number, row), dest=0, tag=TAG)
        except PbemError as caught:
            error = caught
        if rank > 0:
            self.all.send(None, dest=0, tag=TAG)
        else:
            error = self._receive_rest(cases, add, error)
        errors = [each for each in self.all.allgather(error) if each is not None]
        if errors:
            raise errors[0]

    def _add_together(self, case: dict[str, Any], row: Row, add: Callable[[dict[str, Any], Row], None]) -> None:
        error: PbemError | None = None
        if self.all.rank == 0:
            try:
                add(case, row)
            except PbemError as caught:
                error = caught
        error = self.all.bcast(error, root=0)
        if error is not None:
            raise error

    def _receive(self, cases: Sequence[dict[str, Any]], add: Callable[[dict[str, Any], Row], None]) -> int:
        """Add the rows that have come from other ranks; how many ranks have come to their end."""
        ended = 0
        while self.all.iprobe(tag=TAG):
            found = self.all.recv(tag=TAG)
            if found is None:
                ended += 1
            else:
                add(cases[found[0]], found[1])
        self._ended[0] += ended
        return self._ended[0]

    def _receive_rest(
        self, cases: Sequence[dict[str, Any]], add: Callable[[dict[str, Any], Row], None], error: PbemError | None
    ) -> PbemError | None:
        """Wait for the rows of all other ranks."""
        def add_if_right(case: dict[str, Any], row: Row) -> None:
            nonlocal error
            try:
                add(case, row)
            except PbemError as caught:
                error = error or caught

        while self._receive(cases, add_if_right) < self.all.size - 1:
            time.sleep(0.005)
        return error
