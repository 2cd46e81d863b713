"""Where the time of a run goes: seconds, calls and bytes of its pieces, every moment in one piece.

Pieces are nested: a piece has the time in which no piece within it runs, so that all pieces together, with the rest,
are the whole. There is one clock in a process; `pbem.solve.petsc.log` tells PETSc of the same pieces.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, TypeVar

T = TypeVar("T")

# What no piece has.
OTHER = "other"
# The pieces of a run, in this order; those within are told below theirs.
PIECES = ("start", "reading", "assembly", "steps", "estimate", "evaluation", "writing", OTHER)
WITHIN = "/"


@dataclass
class Share:
    """What a piece has had: seconds, those of them of the processor, calls, and bytes that it has stored or moved."""

    seconds: float = 0.0
    processor: float = 0.0
    calls: int = 0
    bytes: float = 0.0


class Listener(Protocol):
    """Who is told where a piece begins and ends; path: the names from outside in."""

    def enter(self, path: tuple[str, ...]) -> None:
        """A piece begins, within the pieces before the last name."""

    def leave(self, path: tuple[str, ...]) -> None:
        """The same piece ends."""


class Clock:
    """Shares by path, such as "steps/product". Its time starts when it is made, or set back."""

    def __init__(
        self, now: Callable[[], float] = time.perf_counter, worked: Callable[[], float] = time.process_time
    ) -> None:
        """now, worked: seconds that have passed, and that the processor has worked, since any moment."""
        self._now, self._worked = now, worked
        self.listener: Listener | None = None
        self.restart()

    def restart(self) -> None:
        """Forget everything; time starts now, with no piece running."""
        self.begun = self._last = self._now()
        self._last_worked = self._first_worked = self._worked()
        self._path: tuple[str, ...] = ()
        self.shares: dict[str, Share] = {}

    def add(self, name: str, seconds: float, processor: float = 0.0) -> None:
        """Count time before the start of the clock to a piece, and to the whole."""
        share = self._find((name,))
        share.seconds += seconds
        share.processor += processor
        share.calls += 1
        self.begun -= seconds
        self._first_worked -= processor

    @contextmanager
    def piece(self, name: str, size: float = 0.0) -> Iterator[None]:
        """The block is a piece of that name, within the piece that runs; size: bytes that it stores or moves."""
        path = (*self._path, name)
        self._pass()
        share = self._find(path)
        share.calls += 1
        share.bytes += size
        self._path = path
        if self.listener is not None:
            self.listener.enter(path)
        try:
            yield
        finally:
            # A clock that was set back meanwhile has nothing of this piece.
            if self._path == path:
                self._pass()
                self._path = path[:-1]
            if self.listener is not None:
                self.listener.leave(path)

    def each(self, name: str, items: Iterable[T]) -> Iterator[T]:
        """The items, of which each is made within a piece; what is done with them is none of it."""
        iterator = iter(items)
        while True:
            with self.piece(name):
                try:
                    item = next(iterator)
                except StopIteration:
                    return
            yield item

    def read(self) -> tuple[float, dict[str, Share]]:
        """Seconds since the start, and the shares until now, OTHER among them: their seconds add up to the whole."""
        self._pass()
        rest = Share(calls=1)
        shares = {OTHER: rest} | {path: Share(**vars(share)) for path, share in self.shares.items()}
        whole = self._last - self.begun
        rest.seconds = whole - sum(share.seconds for share in self.shares.values())
        worked = self._last_worked - self._first_worked
        rest.processor = worked - sum(share.processor for share in self.shares.values())
        order = [*PIECES, *shares]
        return whole, dict(sorted(shares.items(), key=lambda item: order.index(item[0].split(WITHIN)[0])))

    def _pass(self) -> None:
        """Give the time since the last change to the piece that runs."""
        now, worked = self._now(), self._worked()
        if self._path:
            share = self._find(self._path)
            share.seconds += now - self._last
            share.processor += worked - self._last_worked
        self._last, self._last_worked = now, worked

    def _find(self, path: tuple[str, ...]) -> Share:
        return self.shares.setdefault(WITHIN.join(path), Share())


def find_age() -> float:
    """Seconds since this process was started; 0 where the system does not tell."""
    try:
        begun = int(Path("/proc/self/stat").read_text().rpartition(")")[2].split()[19]) / os.sysconf("SC_CLK_TCK")
        return max(time.clock_gettime(time.CLOCK_BOOTTIME) - begun, 0.0)
    except (OSError, ValueError, IndexError, AttributeError):
        return 0.0


def sum_up(shares: dict[str, Share]) -> dict[str, float]:
    """Seconds of the outer pieces, each with all within it."""
    sums = dict.fromkeys(PIECES, 0.0)
    for path, share in shares.items():
        name = path.split(WITHIN)[0]
        sums[name] = sums.get(name, 0.0) + share.seconds
    return sums


clock = Clock()
