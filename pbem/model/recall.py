"""What was found of the last case, for the next one where that is the same: cases that differ in laws and loads alone.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Any, TypeVar

T = TypeVar("T")


class Recall:
    """The last result of each part of a computation, with what it was found from.

    What it is found from is compared by its values: nothing that can be changed in place may be among it.
    """

    def __init__(self) -> None:
        self._found: dict[Hashable, tuple[Any, Any]] = {}

    def find(self, part: str, given: Any, compute: Callable[[], T]) -> T:
        """The last result of a part if it was found from equal values, else what compute returns."""
        former = self._found.get(part)
        if former is not None and former[0] == given:
            return former[1]  # type: ignore[no-any-return]
        result = compute()
        self._found[part] = (given, result)
        return result
