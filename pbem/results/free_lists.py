"""Memory that HDF5 keeps for objects to come, freed: of a file with thousands of datasets that is much."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from contextlib import AbstractContextManager
from functools import cache
from typing import Any

import h5py


@cache
def _find_collector() -> tuple[Callable[[], int], AbstractContextManager[Any]] | None:
    """H5garbage_collect of the library that h5py uses, and h5py's own lock; None where one of them is not to be had."""
    try:
        # What an extension module depends on is searched with it. PyDLL keeps Python's lock meanwhile.
        collect: Callable[[], int] = ctypes.PyDLL(h5py.h5f.__file__).H5garbage_collect
        return collect, h5py._objects.phil  # no public name: without it nothing is freed
    except (AttributeError, OSError, TypeError):
        return None


def empty_free_lists() -> bool:
    """Free what HDF5 keeps in its lists of freed objects; whether there is a way to.

    They are a few MB, but lie between what else was freed, and hold its pages back: 67 MB after the header of 2 000
    cracks. While a file is open next to nothing of what it keeps is of that kind: there is no use in it later.
    """
    found = _find_collector()
    if found is None:
        return False
    collect, lock = found
    with lock:
        return collect() >= 0
