"""The tail of a result file: checksums of its pages, and the journal of the pages on their way to their places.

A file that is written by `pbem.results.journal` is that of HDF5, which ignores what follows its own end, and behind
that end one or two tails. One is at the end of the file. One without a journal, the *compact* one, begins at the end of
the HDF5 file: it counts where the other is not whole, since it is being written or was cut off. What has neither and
does not end where its HDF5 file ends was cut off. Programs that change the file without this module cut the tails off;
it then ends with its HDF5 file, and is read without checksums (see `pbem.results.trial`).

The tail: checksums (4 bytes a page), numbers of the pages in the journal (8 bytes each), these pages; then the footer:
magic, length of the HDF5 file, number of pages in the journal, checksum of all before it in the tail, and of itself.
"""

from __future__ import annotations

import errno
import os
import struct
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

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
    pages: Mapping[int, memoryview | bytes]


def count_pages(length: int) -> int:
    """Pages of a file of so many bytes; the last may be shorter."""
    return -(-length // PAGE)


def measure_tail(length: int, journal: int = 0) -> int:
    """Bytes of the tail of an HDF5 file of so many, with so many pages in the journal."""
    return 4 * count_pages(length) + journal * (8 + PAGE) + FOOTER_SIZE


def pack_tail(tail: Tail) -> Iterator[bytes]:
    """The bytes of a tail, part by part, footer included."""
    numbers = sorted(tail.pages)
    body_sum = 0
    yield (part := tail.sums.astype("<u4").tobytes() + np.array(numbers, dtype="<u8").tobytes())
    body_sum = zlib.crc32(part)
    for first in range(0, len(numbers), BLOCK // PAGE):
        pages = [tail.pages[number] for number in numbers[first : first + BLOCK // PAGE]]
        yield (part := b"".join(bytes(page).ljust(PAGE, b"\0") for page in pages))
        body_sum = zlib.crc32(part, body_sum)
    footer = FOOTER.pack(MAGIC, tail.length, len(numbers), body_sum)
    yield footer + CHECK.pack(zlib.crc32(footer))


def read_tail(disk: int) -> Tail | None:
    """The tail of an open file (descriptor) that counts; None if there is none that is whole."""
    size = os.fstat(disk).st_size
    length = find_length(disk)
    return _read_tail_before(disk, size) or _read_tail_before(disk, min(size, length + measure_tail(length)))


def _read_tail_before(disk: int, end: int) -> Tail | None:
    """The tail that ends there; None if there is none, or it is not whole."""
    footer = read_fully(disk, FOOTER_SIZE, end - FOOTER_SIZE) if end >= FOOTER_SIZE else b""
    if len(footer) < FOOTER_SIZE or not footer.startswith(MAGIC):
        return None
    _, length, count, body_sum = FOOTER.unpack(footer[: FOOTER.size])
    start = end - measure_tail(length, count)
    if zlib.crc32(footer[: FOOTER.size]) != CHECK.unpack(footer[FOOTER.size :])[0] or start < length:
        return None
    body = memoryview(read_fully(disk, end - FOOTER_SIZE - start, start))
    if zlib.crc32(body) != body_sum:
        return None
    pages = count_pages(length)
    numbers = np.frombuffer(body, "<u8", count, offset=4 * pages).tolist()
    first = 4 * pages + 8 * count
    journal = {
        number: body[first + PAGE * i : first + PAGE * (i + 1)][: length - PAGE * number]
        for i, number in enumerate(numbers)
    }
    return Tail(length, np.frombuffer(body, "<u4", pages).astype(np.uint32), journal)


def sum_pages(disk: int, length: int, instead: Mapping[int, memoryview | bytes] | None = None) -> NDArray[np.uint32]:
    """Checksums of the pages of the first `length` bytes of a file; `instead`: pages that take the place of its own."""
    sums = np.zeros(count_pages(length), dtype=np.uint32)
    for start in range(0, length, BLOCK):
        block = memoryview(read_fully(disk, min(BLOCK, length - start), start))
        for at in range(0, len(block), PAGE):
            sums[(start + at) // PAGE] = zlib.crc32(block[at : at + PAGE])
    for number, page in (instead or {}).items():
        sums[number] = zlib.crc32(page)
    return sums


def find_length(disk: int) -> int:
    """The length (bytes) of the HDF5 file by its own superblock; that of the file if it is of another version."""
    head = os.pread(disk, 48, 0)
    if len(head) < 48 or not head.startswith(SIGNATURE) or head[8] not in (2, 3) or head[9] != 8:
        return os.fstat(disk).st_size
    return int(struct.unpack("<Q", head[28:36])[0])


def check_pages(disk: int) -> Tail | None:
    """The tail, if all pages are what was written, in their places or in the journal; None of a file without checksums.

    Raises DamageError, with the place of the first that is not, or if it was cut off.
    """
    tail = read_tail(disk)
    if tail is None:
        _refuse_cut(disk)
        return None
    wrong = np.flatnonzero(sum_pages(disk, tail.length, tail.pages) != tail.sums)
    if len(wrong):
        raise DamageError(errno.EIO, f"it was damaged: the checksum of bytes {wrong[0] * PAGE} to "
                                     f"{min((wrong[0] + 1) * PAGE, tail.length) - 1} is wrong")
    return tail


def _refuse_cut(disk: int) -> None:
    """Raise DamageError if a file without checksums has lost them by damage, not by a program that goes on with it."""
    size, length = os.fstat(disk).st_size, find_length(disk)
    if not os.pread(disk, len(SIGNATURE), 0).startswith(SIGNATURE):
        raise DamageError(errno.EIO, "is not an HDF5 file, or its first bytes are damaged")
    if size < length:
        raise DamageError(errno.EIO, f"it was cut off, or damaged: it has {size} of {length} bytes")
    if size > length:
        raise DamageError(errno.EIO, "it was cut off, or damaged: its checksums are incomplete")


def find_unapplied(disk: int) -> Tail | None:
    """The tail if pages of its journal differ from those in their places: the process was killed in between."""
    tail = read_tail(disk)
    if tail is None:
        return None
    for number, page in tail.pages.items():
        if os.pread(disk, len(page), number * PAGE) != page:
            return tail
    return None


def write_fully(disk: int, data: bytes | bytearray | memoryview, at: int) -> None:
    """All bytes to a place. Raises OSError."""
    view = memoryview(data)
    while view:
        done = os.pwrite(disk, view, at)
        view, at = view[done:], at + done


def read_fully(disk: int, count: int, at: int) -> bytes:
    """So many bytes from a place on, or those until the end of the file."""
    parts = []
    while count > 0:
        part = os.pread(disk, count, at)
        if not part:
            break
        parts.append(part)
        count, at = count - len(part), at + len(part)
    return b"".join(parts)
