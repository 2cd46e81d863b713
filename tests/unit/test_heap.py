"""Freed memory goes back to the system, unless it would have to be asked for again too often."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pbem.arrays import Real
from pbem.heap import Heap

STATUS = Path("/proc/self/status")


def read_resident() -> float:
    """Memory of this process in use, bytes."""
    line = next(line for line in STATUS.read_text().splitlines() if line.startswith("VmRSS"))
    return 1024.0 * int(line.split()[1])


def leave_holes() -> list[Real]:
    """One of ten arrays so small that they lie on the heap; the others, 115 MB, are free."""
    return [np.ones(4000) for _ in range(4000)][::10]


def test_holes_between_arrays_are_given_back() -> None:
    kept = leave_holes()
    before = read_resident()
    assert Heap().give_back()
    assert read_resident() < before - 60e6
    assert sum(float(each.sum()) for each in kept) == 4000.0 * 400


def test_what_was_given_back_is_not_asked_for_more_often_than_a_hundredth_of_the_time_allows() -> None:
    worked = iter((1.0, 1.5, 100.0))
    heap = Heap(lambda: next(worked))
    given, kept = [], []
    for _ in range(3):
        kept += leave_holes()
        given.append(heap.give_back())
    assert given == [True, False, True] and kept
