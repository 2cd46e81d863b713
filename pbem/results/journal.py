"""A file that changes from one committed state to the next, whenever the process is killed, and that knows its damage.

HDF5 writes a file in no fixed order, so that a kill between two writes can leave it unreadable. Here all its writes are
held back in memory until `JournaledFile.commit`, which

1. writes a tail (see `pbem.results.tail`) beyond the committed file and its compact tail, and brings it to the disk:
   all pages that change (the journal), and a checksum for each page of the new state,
2. writes these pages to their places, and the compact tail of the new state behind them,
3. writes the compact tail once more, at the end of the file.

A kill before the tail is complete leaves the former state, of which nothing has been touched; a kill after it leaves
the new one, since whoever opens the file takes the pages from the journal. What lies between the two tails then is room
for the next journal: where the disk or a quota has none for another step, there is some for the reason that the run
ended.
"""

from __future__ import annotations

import errno
import fcntl
import os
import zlib
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

import numpy as np

from pbem.results.tail import (
    BLOCK,
    PAGE,
    Tail,
    check_pages,
    count_pages,
    find_length,
    measure_tail,
    pack_tail,
    read_fully,
    sum_pages,
    write_fully,
)

# Pages that are kept beyond a file, if nothing else is, for the reason that its run ended.
ROOM = 16
# A file that nobody knows yet need not change at once: no more pages of it than this wait in memory.
MOST_WAITING = 4096


def lock(disk: int, wait: bool = False) -> bool:
    """Take the lock of an open file for its only writer; False if another process has it.

    True also where the file system knows no locks.
    """
    try:
        fcntl.flock(disk, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
    except BlockingIOError:
        return False
    except OSError:
        pass
    return True


def is_being_written(path: Path) -> bool:
    """Whether a process has the lock of the file; also if the file system cannot tell."""
    disk = os.open(path, os.O_RDONLY)
    try:
        fcntl.flock(disk, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except OSError:
        return True
    finally:
        os.close(disk)
    return False


class OverlaidFile:
    """The committed state of a file whose journal has not been applied, for h5py to read; it leaves the file alone."""

    def __init__(self, path: Path, tail: Tail) -> None:
        self._disk = open(path, "rb", buffering=0)  # noqa: SIM115
        self._tail = tail
        self._at = 0

    def seek(self, offset: int, whence: int = 0) -> int:
        """As of any file."""
        self._at = offset + (0, self._at, self._tail.length)[whence]
        return self._at

    def tell(self) -> int:
        """As of any file."""
        return self._at

    def readinto(self, buffer: memoryview) -> int:
        """As of any file."""
        view = memoryview(buffer).cast("B")
        wanted = max(0, min(len(view), self._tail.length - self._at))
        data = bytearray(read_fully(self._disk.fileno(), wanted, self._at))
        for number in range(self._at // PAGE, count_pages(self._at + len(data))):
            if number in self._tail.pages:
                _lay_over(data, self._at, self._tail.pages[number], number * PAGE)
        view[: len(data)] = data
        self._at += len(data)
        return len(data)

    def read(self, size: int) -> bytes:
        """As of any file."""
        data = bytearray(size)
        return bytes(data[: self.readinto(memoryview(data))])

    def flush(self) -> None:
        """Nothing: it is only read."""

    def close(self) -> None:
        """Close the file below."""
        self._disk.close()


class JournaledFile:
    """A file, perhaps still empty, for h5py to go on writing, as one process; it holds the lock until it is closed.

    dirty: whether there are writes that were not committed. checked: whether it had checksums, which are right.
    waits: whether all writes wait in memory for `commit`; else they go to the disk now and then, in states that mean
    nothing: of a file under a temporary name.

    Raises BlockingIOError if another process is writing it, DamageError if it is damaged, OSError if it cannot be read
    or written.
    """

    def __init__(self, path: Path, waits: bool = True) -> None:
        self.waits = waits
        self._disk = os.open(path, os.O_RDWR | os.O_CLOEXEC)
        try:
            if not lock(self._disk):
                raise BlockingIOError(errno.EAGAIN, "another process is writing it")
            self._restore()
        except BaseException:
            os.close(self._disk)
            raise

    def _restore(self) -> None:
        """Go to the committed state on the disk; what has not been committed is forgotten."""
        empty = not os.fstat(self._disk).st_size
        tail = Tail(0, np.zeros(0, dtype=np.uint32), {}) if empty else check_pages(self._disk)
        self.checked = not empty and tail is not None
        if empty or tail is None:
            length = find_length(self._disk)
            tail = Tail(length, sum_pages(self._disk, length), {})
            self._tail_size = 0
        else:
            self._tail_size = measure_tail(tail.length)
            if tail.pages:
                self._bring_home(tail)
        self._committed, self._sums = tail.length, tail.sums
        self._length, self._at = self._committed, 0
        self._pages: dict[int, bytearray] = {}

    @property
    def dirty(self) -> bool:
        return bool(self._pages) or self._length != self._committed

    def abandon(self) -> None:
        """Forget what was not committed and go back to the state on the disk. The h5py file must have been closed."""
        self._restore()

    def seek(self, offset: int, whence: int = 0) -> int:
        """As of any file."""
        self._at = offset + (0, self._at, self._length)[whence]
        return self._at

    def tell(self) -> int:
        """As of any file."""
        return self._at

    def readinto(self, buffer: memoryview) -> int:
        """As of any file; what has been written comes from memory."""
        view = memoryview(buffer).cast("B")
        wanted = max(0, min(len(view), self._length - self._at))
        there = max(0, min(wanted, self._committed - self._at))
        data = bytearray(read_fully(self._disk, there, self._at)).ljust(wanted, b"\0")
        for number in range(self._at // PAGE, count_pages(self._at + wanted)):
            if number in self._pages:
                _lay_over(data, self._at, self._pages[number], number * PAGE)
        view[:wanted] = data
        self._at += wanted
        return wanted

    def read(self, size: int) -> bytes:
        """As of any file."""
        data = bytearray(size)
        return bytes(data[: self.readinto(memoryview(data))])

    def write(self, data: memoryview) -> int:
        """As of any file, into memory."""
        view = memoryview(data).cast("B")
        done, size = 0, len(view)
        while done < size:
            number, offset = divmod(self._at, PAGE)
            length = min(size - done, PAGE - offset)
            part = view[done : done + length]
            if length == PAGE:  # of what was there nothing is left
                self._pages[number] = bytearray(part)
            else:
                self._open_page(number)[offset : offset + length] = part
            done, self._at = done + length, self._at + length
        self._length = max(self._length, self._at)
        if len(self._pages) > MOST_WAITING and not self.waits:
            try:
                self.commit()
            except OSError:  # where there is no room all that follows waits, and the last commit says so
                self.waits = True
        return size

    def _open_page(self, number: int) -> bytearray:
        page = self._pages.get(number)
        if page is None:
            there = min(PAGE, self._committed - number * PAGE)
            found = read_fully(self._disk, there, number * PAGE) if there > 0 else b""
            page = self._pages[number] = bytearray(found).ljust(PAGE, b"\0")
        return page

    def truncate(self, size: int | None = None) -> int:
        """As of any file."""
        self._length = self._at if size is None else size
        return self._length

    def flush(self) -> None:
        """Nothing: see `commit`."""

    def commit(self, last: bool = False) -> None:
        """Bring all writes to the disk as one change. last: no further one follows, so that only a compact tail stays.

        Raises OSError; unless it happened after the change was complete, the file is as before.
        """
        tail = self._collect_changes()
        compact = measure_tail(tail.length)
        size = os.fstat(self._disk).st_size
        start = max(self._committed + self._tail_size, tail.length + compact)
        try:
            end = _write_tail(self._disk, tail, start)
            if end < size:
                os.fsync(self._disk)
                os.ftruncate(self._disk, end)
            os.fsync(self._disk)
        except OSError:
            # What the file had already it keeps: there, at least, will be room for the status.
            os.ftruncate(self._disk, size)
            raise
        # The change is complete. If its pages cannot be written to their places, they stay in the journal.
        self._committed, self._sums, self._tail_size = tail.length, tail.sums, compact
        self._bring_home(tail)
        self._pages = {}
        if last:
            os.ftruncate(self._disk, tail.length + compact)
            return
        if size < start:  # none is left of the last journal
            with suppress(OSError):
                write_fully(self._disk, bytes(ROOM * PAGE), end)
        _write_tail(self._disk, Tail(tail.length, tail.sums, {}), os.fstat(self._disk).st_size - compact)

    def _collect_changes(self) -> Tail:
        """The tail of the state to come, with all pages that change."""
        length, before = self._length, self._committed
        if length != before:  # the pages at the old and at the new end may have become longer or shorter
            for number in {max(min(length, before) - 1, 0) // PAGE, (length - 1) // PAGE}:
                self._open_page(number)
        for number in range(count_pages(before), count_pages(length)):
            self._pages.setdefault(number, bytearray(PAGE))  # holes that were never written
        sums = np.resize(self._sums, count_pages(length)).astype(np.uint32)
        changed = {}
        for number, page in sorted(self._pages.items()):
            part = memoryview(page)[: max(0, length - number * PAGE)]
            if not part:
                continue
            own = zlib.crc32(part)
            if length != before or number >= len(self._sums) or own != self._sums[number]:
                changed[number] = part
            sums[number] = own
        return Tail(length, sums, changed)

    def _bring_home(self, tail: Tail) -> None:
        """Write the pages of a journal to their places, and the compact tail behind them."""
        # The superblock, on the first page, goes first: with it all that the others refer to is inside of the file.
        _write_pages(self._disk, tail.pages)
        _write_tail(self._disk, Tail(tail.length, tail.sums, {}), tail.length)
        os.fsync(self._disk)

    def close(self) -> None:
        """Give the lock back; what was not committed is lost."""
        if self._disk >= 0:
            os.close(self._disk)
            self._disk = -1


def _write_tail(disk: int, tail: Tail, start: int) -> int:
    """Write it from there on, in few pieces; its end."""
    waiting: list[bytes] = []
    for part in pack_tail(tail):
        waiting.append(part)
        if sum(map(len, waiting)) > BLOCK:
            start = _write_parts(disk, waiting, start)
    return _write_parts(disk, waiting, start)


def _write_parts(disk: int, parts: list[bytes], start: int) -> int:
    """Write them one after the other, and forget them; where they end."""
    data = b"".join(parts)
    parts.clear()
    write_fully(disk, data, start)
    return start + len(data)


def _write_pages(disk: int, pages: Mapping[int, memoryview | bytes]) -> None:
    """Write pages to their places, neighbours at once."""
    run: list[memoryview | bytes] = []
    first = 0
    for number in [*sorted(pages), -1]:
        if run and (number != first + len(run) or len(run) == 256):
            write_fully(disk, b"".join(run), first * PAGE)
            run = []
        if number >= 0:
            first = number if not run else first
            run.append(pages[number])


def _lay_over(data: bytearray, start: int, page: bytes | bytearray | memoryview, at: int) -> None:
    """Put the part of a page at `at` over that of the data at `start` which lies in it."""
    first, last = max(start, at), min(start + len(data), at + len(page))
    if first < last:
        data[first - start : last - start] = page[first - at : last - at]
