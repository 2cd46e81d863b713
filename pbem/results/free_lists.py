"""Memory that HDF5 keeps for objects to come, freed: of a file with thousands of datasets that is much."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cache

import h5py
from h5py._objects import phil


@cache
def _find_collector() -> Callable[[], int] | None:
    """H5garbage_collect of the library that h5py uses; None where it cannot be asked."""
    try:
        # What an extension module depends on is searched with it. PyDLL keeps Python's lock meanwhile.
        found: Callable[[], int] = ctypes.PyDLL(h5py.h5f.__file__).H5garbage_collect
    except (AttributeError, OSError, TypeError):
        return None
    return found


def empty_free_lists() -> bool:
    """Free what HDF5 keeps in its lists of freed objects; whether there is a way to.

    They are a few MB, but lie between what else was freed, and hold its pages back: 67 MB after the header of 2 000
    cracks.
    """
    collect = _find_collector()
    if collect is None:
        return False
    with phil:  # h5py's own lock
        return collect() >= 0
