"""A file that changes from one committed state to the next, whenever the process is killed, and that knows its damage.

HDF5 writes a file in no fixed order, so that a kill between two writes can leave it unreadable. Here all its writes are
held back in memory until `JournaledFile.commit`, which

1. writes what lies beyond the committed end of the file; nothing refers to it yet,
2. writes a tail after it and brings it to the disk: the pages that change within the committed part (the journal), and
   a checksum for each page of the new state,
3. writes these pages to their places.

A kill before the tail is complete leaves the former state; a kill after it leaves the new one, since whoever opens the
file takes the pages from the journal. HDF5 itself ignores what follows its own end of the file. Programs that change
the file without this module cut the tail off; it is then read without checksums.

The tail: checksums (4 bytes a page), numbers of the pages in the journal (8 bytes each), these pages; then the footer:
magic, length of the HDF5 file, number of pages in the journal, checksum of all before it in the tail, and of itself.
"""

from __future__ import annotations

import errno
import fcntl
import os
import struct
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

PAGE = 4096
MAGIC = b"pbemtail"
FOOTER = struct.Struct("<8sQQI")
CHECK = struct.Struct("<I")
FOOTER_SIZE = FOOTER.size + CHECK.size
SIGNATURE = b"\x89HDF\r\n\x1a\n"
BLOCK = 256 * PAGE


class DamageError(OSError):
    """The contents of a file are not those that were written."""


@dataclass(frozen=True)
class Tail:
    """length: of the HDF5 file (bytes); sums: checksum of each of its pages; pages: the journal, by page number."""

    length: int
    sums: NDArray[np.uint32]
    pages: Mapping[int, bytes]


def count_pages(length: int) -> int:
    """Pages of a file of so many bytes; the last may be shorter."""
    return -(-length // PAGE)


def pack_tail(tail: Tail) -> bytes:
    """The bytes of a tail, footer included."""
    numbers = np.array(list(tail.pages), dtype="<u8").tobytes()
    body = b"".join([tail.sums.astype("<u4").tobytes(), numbers, *(page.ljust(PAGE, b"\0") for page in
                                                                   tail.pages.values())])
    footer = FOOTER.pack(MAGIC, tail.length, len(tail.pages), zlib.crc32(body))
    return body + footer + CHECK.pack(zlib.crc32(footer))


def read_tail(disk: int) -> Tail | None:
    """The tail of an open file (descriptor); None if there is none, or it is not complete."""
    size = os.fstat(disk).st_size
    if size < FOOTER_SIZE:
        return None
    end = os.pread(disk, FOOTER_SIZE, size - FOOTER_SIZE)
    if len(end) < FOOTER_SIZE or not end.startswith(MAGIC):
        return None
    _, length, count, body_sum = FOOTER.unpack(end[: FOOTER.size])
    if zlib.crc32(end[: FOOTER.size]) != CHECK.unpack(end[FOOTER.size :])[0]:
        return None
    pages = count_pages(length)
    needed = 4 * pages + count * (8 + PAGE)
    start = size - FOOTER_SIZE - needed
    if start < length:
        return None
    body = _read_fully(disk, needed, start)
    if len(body) < needed or zlib.crc32(body) != body_sum:
        return None
    sums = np.frombuffer(body, "<u4", pages).astype(np.uint32)
    numbers = np.frombuffer(body, "<u8", count, offset=4 * pages)
    first = 4 * pages + 8 * count
    journal = {
        int(number): body[first + PAGE * i : first + PAGE * (i + 1)][: length - PAGE * int(number)]
        for i, number in enumerate(numbers)
    }
    return Tail(length, sums, journal)


def sum_pages(disk: int, length: int, instead: Mapping[int, bytes] | None = None) -> NDArray[np.uint32]:
    """Checksums of the pages of the first `length` bytes of a file; `instead`: pages that take the place of its own."""
    sums = np.zeros(count_pages(length), dtype=np.uint32)
    for start in range(0, length, BLOCK):
        block = memoryview(_read_fully(disk, min(BLOCK, length - start), start))
        for at in range(0, len(block), PAGE):
            sums[(start + at) // PAGE] = zlib.crc32(block[at : at + PAGE])
    for number, page in (instead or {}).items():
        sums[number] = zlib.crc32(page)
    return sums


def find_length(disk: int) -> int:
    """The length (bytes) of the HDF5 file by its own superblock, at most that of the file."""
    size = os.fstat(disk).st_size
    head = os.pread(disk, 48, 0)
    if len(head) < 48 or not head.startswith(SIGNATURE) or head[8] not in (2, 3) or head[9] != 8:
        return size
    return int(min(size, struct.unpack("<Q", head[28:36])[0]))


def check_pages(disk: int) -> Tail | None:
    """The tail, if all pages are what was written, in their places or in the journal; None of a file without a tail.

    Raises DamageError, with the place of the first that is not.
    """
    tail = read_tail(disk)
    if tail is not None:
        wrong = np.flatnonzero(sum_pages(disk, tail.length, tail.pages) != tail.sums)
        if len(wrong):
            raise DamageError(errno.EIO, f"it was damaged: the checksum of bytes {wrong[0] * PAGE} to "
                                         f"{min((wrong[0] + 1) * PAGE, tail.length) - 1} is wrong")
    return tail


def find_unapplied(disk: int) -> Tail | None:
    """The tail if pages of its journal differ from those in their places: the process was killed in between."""
    tail = read_tail(disk)
    if tail is None:
        return None
    for number, page in tail.pages.items():
        if os.pread(disk, len(page), number * PAGE) != page:
            return tail
    return None


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
        data = bytearray(_read_fully(self._disk.fileno(), max(0, min(len(view), self._tail.length - self._at)),
                                     self._at))
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
    """A file for h5py to go on writing, as one process; it holds the lock until it is closed.

    dirty: whether there are writes that were not committed. Raises BlockingIOError if another process is writing it,
    DamageError if it is damaged, OSError if it cannot be read or written.
    """

    def __init__(self, path: Path) -> None:
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
        tail = check_pages(self._disk)
        self._room = os.fstat(self._disk).st_size
        if tail is not None:
            for number, page in tail.pages.items():
                _write_fully(self._disk, page, number * PAGE)
            os.fsync(self._disk)
        self._committed = find_length(self._disk) if tail is None else tail.length
        self._sums = sum_pages(self._disk, self._committed) if tail is None else tail.sums
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
        data = bytearray(_read_fully(self._disk, there, self._at)).ljust(wanted, b"\0")
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
        done = 0
        while done < len(view):
            number, offset = divmod(self._at, PAGE)
            part = view[done : done + PAGE - offset]
            self._open_page(number)[offset : offset + len(part)] = part
            done, self._at = done + len(part), self._at + len(part)
        self._length = max(self._length, self._at)
        return len(view)

    def _open_page(self, number: int) -> bytearray:
        if number not in self._pages:
            there = max(0, min(PAGE, self._committed - number * PAGE))
            self._pages[number] = bytearray(_read_fully(self._disk, there, number * PAGE)).ljust(PAGE, b"\0")
        return self._pages[number]

    def truncate(self, size: int | None = None) -> int:
        """As of any file."""
        self._length = self._at if size is None else size
        return self._length

    def flush(self) -> None:
        """Nothing: see `commit`."""

    def commit(self, last: bool = False) -> None:
        """Bring all writes to the disk as one change. last: no further one follows, so that no journal stays behind.

        Raises OSError; unless it happened after the change was complete, the file is as before.
        """
        length, before = self._length, self._committed
        pages = {number: page for number, page in sorted(self._pages.items()) if number * PAGE < length}
        sums = np.resize(self._sums, count_pages(length)).astype(np.uint32)
        if length != before:  # the pages at the old and at the new end may have become longer or shorter
            for number in {(min(length, before) - 1) // PAGE, (length - 1) // PAGE}:
                pages[number] = self._open_page(number)
        for number in range(count_pages(before), count_pages(length)):
            pages.setdefault(number, bytearray(PAGE))  # holes that were never written
        for number, page in pages.items():
            sums[number] = zlib.crc32(memoryview(page)[: length - number * PAGE])
        inside = {number: bytes(page[: length - number * PAGE]) for number, page in sorted(pages.items())
                  if number * PAGE < before and (sums[number] != self._sums[number] or length != before)}
        try:
            _write_pages(self._disk, {n: page for n, page in pages.items() if n * PAGE >= before}, length)
            self._write_tail(Tail(length, sums, inside), max(length, before))
        except OSError:
            # The blocks of the former tail are kept: the status, at least, will have room.
            os.ftruncate(self._disk, max(before, min(self._room, os.fstat(self._disk).st_size)))
            raise
        # The change is complete. If its pages cannot be written to their places, they stay in the journal.
        self._committed, self._sums = length, sums
        # The superblock, on the first page, goes first: with it all that the others refer to is inside of the file.
        _write_pages(self._disk, inside, length)
        os.fsync(self._disk)
        self._pages = {}
        if last:
            self._write_tail(Tail(length, sums, {}), length)

    def _write_tail(self, tail: Tail, start: int) -> None:
        packed = pack_tail(tail)
        _write_fully(self._disk, packed, start)
        os.ftruncate(self._disk, start + len(packed))
        os.fsync(self._disk)
        self._room = start + len(packed)

    def close(self) -> None:
        """Give the lock back; what was not committed is lost."""
        if self._disk >= 0:
            os.close(self._disk)
            self._disk = -1


def _lay_over(data: bytearray, start: int, page: bytes | bytearray, at: int) -> None:
    """Put the part of a page at `at` over that of the data at `start` which lies in it."""
    first, last = max(start, at), min(start + len(data), at + len(page))
    if first < last:
        data[first - start : last - start] = page[first - at : last - at]


def _write_pages(disk: int, pages: Mapping[int, bytes | bytearray], length: int) -> None:
    """Write pages to their places, neighbours at once, nothing beyond the length."""
    run: list[bytes | bytearray] = []
    first = 0
    for number in [*sorted(pages), -1]:
        if run and number != first + len(run):
            _write_fully(disk, b"".join(run)[: length - first * PAGE], first * PAGE)
            run = []
        if number >= 0:
            first = number if not run else first
            run.append(pages[number])


def _write_fully(disk: int, data: bytes, at: int) -> None:
    view = memoryview(data)
    while view:
        done = os.pwrite(disk, view, at)
        view, at = view[done:], at + done


def _read_fully(disk: int, count: int, at: int) -> bytes:
    """So many bytes from a place on, or those until the end of the file."""
    parts = []
    while count > 0:
        part = os.pread(disk, count, at)
        if not part:
            break
        parts.append(part)
        count, at = count - len(part), at + len(part)
    return b"".join(parts)
