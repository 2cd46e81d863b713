"""Memory that was freed, given back to the system: arrays come and go by the thousand, and leave holes."""

from __future__ import annotations

import ctypes
import time
from collections.abc import Callable
from pathlib import Path

# What a page that was given back costs when it is needed again, in seconds (measured: 0.7e-6 to 1.6e-6), and the part
# of the processor's time that may go that way: small runs would have to ask for all of their memory again and again.
FAULT, MOST_SPENT = 1e-6, 0.01
STATM = Path("/proc/self/statm")


class Heap:
    """The heap of this process."""

    def __init__(self, worked: Callable[[], float] = time.process_time) -> None:
        """worked: seconds that the processor has worked for the process."""
        self._worked = worked
        self._spent = 0.0
        self._trim = _find_trim()

    def give_back(self) -> bool:
        """Give the pages of the heap that nothing lies on back to the system; whether that was done.

        It is not where there is no way to, nor before the process has worked enough for what it gave back last.
        """
        if self._trim is None or self._spent > MOST_SPENT * self._worked():
            return False
        before = _count_resident()
        self._trim(0)
        self._spent += FAULT * max(before - _count_resident(), 0)
        return True


def _find_trim() -> Callable[[int], int] | None:
    """malloc_trim of the GNU library; None where the library has none."""
    try:
        found: Callable[[int], int] = ctypes.CDLL(None).malloc_trim
    except (AttributeError, OSError, TypeError):
        return None
    return found


def _count_resident() -> int:
    """Pages in memory; 0 where the system does not tell."""
    try:
        return int(STATM.read_text().split()[1])
    except (OSError, ValueError, IndexError):
        return 0


heap = Heap()
