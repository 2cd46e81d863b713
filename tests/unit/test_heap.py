"""Freed memory goes back to the system."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pbem.heap import give_back

STATUS = Path("/proc/self/status")


def read_resident() -> float:
    """Memory of this process in use, bytes."""
    line = next(line for line in STATUS.read_text().splitlines() if line.startswith("VmRSS"))
    return 1024.0 * int(line.split()[1])


def test_holes_between_arrays_are_given_back() -> None:
    # So small that they lie on the heap, one of ten of which stays.
    arrays = [np.ones(4000) for _ in range(4000)]
    kept = arrays[::10]
    before = read_resident()
    del arrays
    assert give_back()
    assert read_resident() < before - 60e6
    assert sum(float(each.sum()) for each in kept) == 4000.0 * 400
