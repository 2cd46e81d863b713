"""Memory that was freed, given back to the system: arrays come and go by the thousand, and leave holes."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cache


@cache
def _find_trim() -> Callable[[int], int] | None:
    """malloc_trim of the GNU library; None where the library has none."""
    try:
        found: Callable[[int], int] = ctypes.CDLL(None).malloc_trim
    except (AttributeError, OSError, TypeError):
        return None
    return found


def give_back() -> bool:
    """Give the pages of the heap that nothing lies on back to the system; whether there is a way to."""
    trim = _find_trim()
    if trim is None:
        return False
    trim(0)
    return True
