"""Small parts of a result file made at little cost: views of rows that grow, arrays that do not, attributes.

A run with thousands of interfaces has tens of thousands of small datasets. Those that grow with the steps are virtual:
each shows its columns of one dataset of all interfaces, so that a step is a few writes whatever their number. All that
is made here goes past h5py's own layer, which takes ten times as long.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import h5py
import numpy as np
from h5py import h5a, h5d, h5g, h5p, h5s, h5t
from numpy.typing import NDArray

# Arrays up to so many bytes stand in the header of their dataset.
COMPACT_BYTES = 2048


def create_group(parent: h5g.GroupID, name: str) -> h5g.GroupID:
    """A group that keeps all its attributes in its header: from the ninth on they would go elsewhere, and HDF5 1.10
    crashes when it copies texts from there."""
    return h5g.create(parent, name.encode(), gcpl=_choose_group())


class Columns:
    """A dataset that grows by rows (k, columns, ...), to be shown in parts."""

    def __init__(self, source: h5py.Dataset) -> None:
        self._columns, self._rest = source.shape[1], source.shape[2:]
        self._name, self._type = source.name.encode(), source.id.get_type()
        most = (h5s.UNLIMITED, self._columns, *self._rest)
        self._taken = h5s.create_simple((1, *most[1:]), most)

    def create_view(self, parent: h5g.GroupID, name: str, first: int, count: int | None = None) -> None:
        """A dataset of the columns from `first` on and of all rows, also those to come.

        count: how many columns; None: one, whose axis is left out.
        """
        rest = self._rest
        shape = rest if count is None else (count, *rest)
        self._taken.select_hyperslab(
            (0, first, *(0,) * len(rest)), (h5s.UNLIMITED, 1, *(1,) * len(rest)), block=(1, count or 1, *rest)
        )
        properties = h5p.create(h5p.DATASET_CREATE)
        properties.set_virtual(_select_rows(shape), b".", self._name, self._taken)
        h5d.create(parent, name.encode(), self._type, _make_rows(shape), properties)


def create_array(parent: h5g.GroupID, name: str, values: NDArray[Any]) -> None:
    """A dataset that does not change."""
    small = 0 < values.nbytes <= COMPACT_BYTES
    dataset = h5d.create(
        parent, name.encode(), _find_type(values.dtype), _make_space(values.shape), _choose_compact() if small else None
    )
    dataset.write(h5s.ALL, h5s.ALL, np.ascontiguousarray(values))


def set_attribute(group: h5g.GroupID, name: str, value: str | bool | int | float) -> None:
    """The same attribute that `group.attrs[name] = value` makes."""
    array = np.array(value, dtype=TEXT) if isinstance(value, str) else np.array(value)
    attribute = h5a.create(group, name.encode(), _find_type(array.dtype), _make_scalar())
    attribute.write(array)


TEXT = h5py.string_dtype()


# What many datasets have in common is made once; nothing changes it.


@lru_cache
def _choose_group() -> h5p.PropGCID:
    properties = h5p.create(h5p.GROUP_CREATE)
    properties.set_attr_phase_change(64, 32)
    return properties


@lru_cache
def _choose_compact() -> h5p.PropDCID:
    properties = h5p.create(h5p.DATASET_CREATE)
    properties.set_layout(h5d.COMPACT)
    return properties


@lru_cache
def _make_rows(shape: tuple[int, ...]) -> h5s.SpaceID:
    return h5s.create_simple((0, *shape), (h5s.UNLIMITED, *shape))


@lru_cache
def _select_rows(shape: tuple[int, ...]) -> h5s.SpaceID:
    space = h5s.create_simple((0, *shape), (h5s.UNLIMITED, *shape))
    zeros, ones = (0,) * len(shape), (1,) * len(shape)
    space.select_hyperslab((0, *zeros), (h5s.UNLIMITED, *ones), block=(1, *shape))
    return space


@lru_cache
def _make_space(shape: tuple[int, ...]) -> h5s.SpaceID:
    return h5s.create_simple(shape)


@lru_cache
def _make_scalar() -> h5s.SpaceID:
    return h5s.create(h5s.SCALAR)


@lru_cache
def _find_type(kind: np.dtype[Any]) -> h5t.TypeID:
    return h5t.py_create(kind, logical=True)
