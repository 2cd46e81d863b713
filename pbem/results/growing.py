"""Entries that are added to datasets with each step: dozens of small ones."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import h5py
import numpy as np
from h5py import h5d, h5p, h5s
from numpy.typing import ArrayLike, NDArray

# Bytes of a dataset's chunks that HDF5 keeps, all of them full but the last one; larger ones it writes at once.
CACHED = 1 << 16
# Where it looks for them: a prime number of places.
PLACES = 31


class GrowingRows:
    """Adds entries to the datasets of an open file.

    These are opened at their first entry and stay so for as long as the file is open: to open one takes longer than to
    write to it, and what its last chunk holds would be read again for the next entry.
    """

    def __init__(self, file: h5py.File) -> None:
        self._file = file
        self._opened: dict[str, _Rows] = {}
        self._names: dict[str, tuple[str, ...]] = {}

    def append(self, path: str, row: ArrayLike) -> None:
        """Add one entry along the first axis of a dataset; row: of the shape of an entry, or a number for all of it.

        Raises KeyError if there is no such dataset, ValueError for a row of another shape.
        """
        self._open(path).append(row)

    def extend(self, path: str, entries: NDArray[Any]) -> None:
        """Add entries (n,) with names for their columns, of which those are taken that the dataset has: files of
        earlier versions that are gone on with have fewer.

        Raises KeyError if there is no such dataset, ValueError for a column of it that the entries lack.
        """
        rows = self._open(path)
        values = np.empty(len(entries), dtype=rows.kind)
        for name in rows.kind.names:
            values[name] = entries[name]
        rows.extend(values)

    def list_names(self, group: str) -> tuple[str, ...]:
        """Names of what a group holds, which stay the same; none if there is no such group."""
        if group not in self._names:
            self._names[group] = tuple(self._file[group]) if group in self._file else ()
        return self._names[group]

    def _open(self, path: str) -> _Rows:
        rows = self._opened.get(path)
        if rows is None:
            rows = self._opened[path] = _Rows(self._file, path)
        return rows


@lru_cache
def _choose_access() -> h5p.PropDAID:
    """How the datasets are opened; nothing changes it."""
    access = h5p.create(h5p.DATASET_ACCESS)
    access.set_chunk_cache(PLACES, CACHED, 1.0)
    return access


class _Rows:
    """An open dataset that grows."""

    def __init__(self, file: h5py.File, path: str) -> None:
        self._own = h5d.open(file.id, path.encode(), _choose_access())
        self._count, *rest = self._own.shape
        self._row, self.kind, self._type = tuple(rest), self._own.dtype, self._own.get_type()
        self._entry = h5s.create_simple((1, *rest))
        self._first = (0,) * len(rest)

    def append(self, row: ArrayLike) -> None:
        values = np.empty((1, *self._row), dtype=self.kind)
        values[0] = row
        self.extend(values)

    def extend(self, values: NDArray[Any]) -> None:
        self._own.set_extent((self._count + len(values), *self._row))
        if values.size:
            place = self._own.get_space()
            place.select_hyperslab((self._count, *self._first), values.shape)
            entries = self._entry if len(values) == 1 else h5s.create_simple(values.shape)
            self._own.write(entries, place, values, self._type)
        self._count += len(values)
