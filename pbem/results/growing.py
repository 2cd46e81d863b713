"""Entries that are added to datasets with each step: dozens of small ones."""

from __future__ import annotations

from typing import Any

import h5py
import numpy as np
from numpy.typing import ArrayLike, NDArray


def append_row(group: h5py.Group, name: str, row: ArrayLike) -> None:
    """Add one entry along the first axis of a dataset; row: of the shape of an entry, or a number for all of it."""
    own = h5py.h5d.open(group.id, name.encode())
    _extend(own, np.broadcast_to(np.asarray(row), own.shape[1:])[None, ...])


def extend(dataset: h5py.Dataset, rows: NDArray[Any]) -> None:
    """Add entries (n, ...) along the first axis. Raises ValueError for those of another shape."""
    _extend(dataset.id, rows)


def _extend(own: h5py.h5d.DatasetID, rows: NDArray[Any]) -> None:
    """As `dataset.resize` and `dataset[count:] = rows` do, of whose time HDF5 takes a third: the rest goes to what else
    a dataset offers, and to all that may stand in the brackets."""
    count, *others = own.shape
    if rows.shape[1:] != tuple(others):
        raise ValueError(f"found entries of the shape {rows.shape[1:]}; expected {tuple(others)}")
    own.set_extent((count + len(rows), *others))
    if rows.size:
        place = own.get_space()
        place.select_hyperslab((count, *(0 for _ in others)), rows.shape)
        own.write(h5py.h5s.create_simple(rows.shape), place, np.ascontiguousarray(rows))
