"""Opens result files, also damaged ones and those of runs that go on, and reads small things from them."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from h5py import h5d, h5s
from numpy.typing import NDArray

from pbem.errors import ResultFileError
from pbem.results.journal import OverlaidFile
from pbem.results.tail import DamageError, find_unapplied

# What h5py and NumPy raise when a file holds other kinds of things than it should.
DAMAGE = (KeyError, ValueError, RuntimeError, TypeError, AttributeError, IndexError, MemoryError, OverflowError)

# What HDF5 says of a file that this process has open already, with other locks than are asked for now.
OTHER_LOCKS = "flag values don't match"


@contextmanager
def open_quietly(path: Path) -> Iterator[h5py.File]:
    """A file to be read, without locks: a run that is going on may be looked at, and goes on writing.

    Raises ResultFileError where the file is damaged.
    """
    with refuse_damage(path), _open(path) as file:
        yield file


def has_journal(path: Path) -> bool:
    """Whether pages of the file are still on their way to their places: its run was killed while it wrote them."""
    disk = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    try:
        return find_unapplied(disk) is not None
    finally:
        os.close(disk)


def open_unlocked(path: Path) -> h5py.File:
    """A file to be read, without locks, unless this process has it open with them: HDF5 then asks for the same again.

    Raises OSError where it cannot be read.
    """
    for locking in (False, None, True):
        try:
            return h5py.File(path, "r", locking=locking)
        except OSError as error:
            if OTHER_LOCKS not in str(error):
                raise
    return h5py.File(path, "r", locking="best-effort")


@contextmanager
def _open(path: Path) -> Iterator[h5py.File]:
    disk = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    try:
        tail = find_unapplied(disk)
    finally:
        os.close(disk)
    if tail is None:
        with open_unlocked(path) as file:
            yield file
        return
    # Its run was killed while it wrote the pages of its journal to their places.
    with closing(OverlaidFile(path, tail)) as committed, h5py.File(committed, "r") as file:
        yield file


@contextmanager
def refuse_damage(path: Path) -> Iterator[None]:
    """Raise ResultFileError for what h5py raises in the block when a file is none of HDF5's, cut off or damaged."""
    try:
        yield
    except DamageError as error:
        raise ResultFileError(str(path), str(error.strerror)) from error
    except OSError as error:
        raise ResultFileError(str(path), f"is not an HDF5 file, or is cut off ({_shorten(error)})") from error
    except DAMAGE as error:
        raise ResultFileError(str(path), f"is not a complete result file ({_shorten(error)})") from error


def _shorten(error: Exception) -> str:
    return " ".join(str(error).split())[:200]


def read_names(item: h5py.HLObject) -> tuple[str, ...]:
    """Its attribute `names`."""
    return tuple(str(name) for name in item.attrs["names"])


def read_array(group: h5py.Group, name: str) -> NDArray[Any]:
    """A whole dataset of numbers, past h5py's own layer, which takes three times as long for a small one.

    Raises KeyError if there is no such dataset.
    """
    dataset = h5d.open(group.id, name.encode())
    values = np.empty(dataset.shape, dtype=dataset.dtype)
    if values.size:
        dataset.read(h5s.ALL, h5s.ALL, values)
    return values


def freeze(array: NDArray[Any]) -> NDArray[Any]:
    """The same array, read-only."""
    array.setflags(write=False)
    return array
