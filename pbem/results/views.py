"""Parts of a result file made at little cost: rows that grow and views of them, arrays that do not, attributes.

A run with thousands of interfaces has tens of thousands of small datasets. Those that grow with the steps are virtual:
each shows its columns of one dataset of all interfaces, so that a step is a few writes whatever their number. All that
is made here goes past h5py's own layer, which takes three to ten times as long: of a run of a few hundred unknowns that
is as much as the integrals.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import h5py
import numpy as np
from h5py import h5a, h5d, h5g, h5i, h5p, h5s, h5t
from numpy.typing import NDArray

# Arrays up to so many bytes stand in the header of their dataset.
COMPACT_BYTES = 2048


def create_group(parent: h5g.GroupID, name: str) -> h5g.GroupID:
    """A group that keeps all its attributes in its header: from the ninth on they would go elsewhere, and HDF5 1.10
    crashes when it copies texts from there."""
    return h5g.create(parent, name.encode(), _choose_link(name.isascii()), _choose_group())


class Columns:
    """A dataset that grows by rows (k, columns, ...), to be shown in parts."""

    def __init__(self, source: h5d.DatasetID) -> None:
        self._columns, *rest = source.shape[1:]
        self._rest = tuple(rest)
        self._name, self._type = h5i.get_name(source), source.get_type()
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
        h5d.create(parent, name.encode(), self._type, _make_rows(shape), properties, _choose_link(name.isascii()))


def create_growing(
    parent: h5g.GroupID, name: str, shape: tuple[int, ...], kind: np.dtype[Any], rows: int
) -> h5d.DatasetID:
    """A dataset without entries, which are of this shape; so many are stored together."""
    return h5d.create(parent, name.encode(), _find_type(kind), _make_rows(shape), _choose_chunks((rows, *shape)),
                      _choose_link(name.isascii()))


def create_array(parent: h5g.GroupID, name: str, values: NDArray[Any]) -> h5d.DatasetID:
    """A dataset that does not change."""
    small = 0 < values.nbytes <= COMPACT_BYTES
    dataset = h5d.create(
        parent, name.encode(), _find_type(values.dtype), _make_space(values.shape),
        _choose_compact() if small else None, _choose_link(name.isascii()),
    )
    if values.size:
        dataset.write(h5s.ALL, h5s.ALL, np.ascontiguousarray(values), _find_memory_type(values.dtype))
    return dataset


def set_attribute(item: h5i.ObjectID, name: str, value: str | bool | int | float | np.generic | NDArray[Any]) -> None:
    """The same attribute that `item.attrs[name] = value` makes, in place of one of that name."""
    array = np.array(value, dtype=TEXT) if isinstance(value, str) else np.asarray(value)
    if h5a.exists(item, name.encode()):
        h5a.delete(item, name.encode())
    space = _make_space(array.shape) if array.shape else _make_scalar()
    attribute = h5a.create(item, name.encode(), _find_type(array.dtype), space)
    if array.size:
        attribute.write(array, _find_memory_type(array.dtype))


def set_texts(item: h5i.ObjectID, name: str, texts: Sequence[str]) -> None:
    """An attribute that is a list of texts."""
    set_attribute(item, name, np.array(list(texts), dtype=TEXT))


TEXT = h5py.string_dtype()


# What many datasets have in common is made once; nothing changes it.


@lru_cache
def _choose_link(ascii_only: bool) -> h5p.PropLCID | None:
    """A name with other characters is said to be UTF-8, which it is: other programs would read it as ASCII."""
    if ascii_only:
        return None
    properties = h5p.create(h5p.LINK_CREATE)
    properties.set_char_encoding(h5t.CSET_UTF8)
    return properties


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
def _choose_chunks(chunk: tuple[int, ...]) -> h5p.PropDCID:
    properties = h5p.create(h5p.DATASET_CREATE)
    properties.set_chunk(chunk)
    properties.set_obj_track_times(False)
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


@lru_cache
def _find_memory_type(kind: np.dtype[Any]) -> h5t.TypeID:
    """The type of arrays in memory, where texts are objects; h5py would make it anew for each that is written."""
    return h5t.py_create(kind)
