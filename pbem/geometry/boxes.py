"""Bounding boxes in nearly linear time: which of them meet, and which lie around points."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pbem.arrays import Complex, Integer, Real
from pbem.geometry.curve import Leg
from pbem.geometry.elements import Elements

# Cells are at most so many times finer than the extent of all boxes.
FINEST = 2.0**20


class Boxes:
    """Boxes (n,) from low to high, each (n, 2).

    Boxes of about one size are kept in square cells of that size, each in at most four: those that meet share a cell.
    """

    def __init__(self, low: Real, high: Real) -> None:
        self.low, self.high = low.reshape(-1, 2), high.reshape(-1, 2)
        extent = float((self.high.max(axis=0) - self.low.min(axis=0)).max()) if len(low) else 0.0
        finest = max(extent / FINEST, 1e-300)
        # A little more than enough, for rounding.
        level = np.ceil(np.log2(np.maximum((self.high - self.low).max(axis=1, initial=0.0) / finest, 1.0)) + 1e-9)
        self._sizes = {finest * 2.0**k: np.flatnonzero(level == k) for k in np.unique(level)}

    @classmethod
    def around_legs(cls, legs: Sequence[Leg], tolerance: float) -> Boxes:
        """The boxes of legs, wider by the tolerance on every side."""
        if not legs:
            return cls(np.zeros((0, 2)), np.zeros((0, 2)))
        low, high = Elements.collect(legs).bounds()
        return cls(low - tolerance, high + tolerance)

    @classmethod
    def of_corners(cls, corners: Sequence[tuple[complex, complex]]) -> Boxes:
        """Boxes given by their lower left and upper right corners."""
        both = np.array(corners, dtype=complex).reshape(-1, 2)
        return cls(*(np.stack([side.real, side.imag], axis=1) for side in both.T))

    def find_around(self, points: Complex) -> tuple[Integer, Integer]:
        """Numbers of points (m,) and of the boxes around them, a pair for each, in rising order."""
        at = np.stack([points.real, points.imag], axis=1)
        return self.find_meeting(Boxes(at, at))

    def find_meeting(self, others: Boxes) -> tuple[Integer, Integer]:
        """Numbers of the others and of the boxes that they meet, a pair for each meeting, in rising order."""
        found = [np.zeros((0, 2), dtype=np.int64)]
        for size, numbers in self._sizes.items():
            for other_size, other_numbers in others._sizes.items():
                # In cells of the larger size neither covers more than four.
                found.append(_match(others, other_numbers, self, numbers, max(size, other_size)))
        pairs = np.concatenate(found)
        meet = (others.low[pairs[:, 0]] <= self.high[pairs[:, 1]]).all(axis=1)
        meet &= (others.high[pairs[:, 0]] >= self.low[pairs[:, 1]]).all(axis=1)
        pairs = np.unique(pairs[meet], axis=0)
        return pairs[:, 0], pairs[:, 1]

    def find_pairs(self) -> tuple[Integer, Integer]:
        """Numbers i < j of all boxes that meet, in rising order."""
        i, j = self.find_meeting(self)
        return i[i < j], j[i < j]


def _match(first: Boxes, chosen: Integer, second: Boxes, own: Integer, size: float) -> Integer:
    """Pairs (k, 2) of boxes that share a cell of the given size, which none of them exceeds."""
    origin = second.low.min(axis=0)
    cell, box = _cover(first, chosen, origin, size)
    other_cell, other = _cover(second, own, origin, size)
    order = np.argsort(other_cell, kind="stable")
    other_cell, other = other_cell[order], other[order]
    begin = np.searchsorted(other_cell, cell, side="left")
    count = np.searchsorted(other_cell, cell, side="right") - begin
    within = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    return np.stack([np.repeat(box, count), other[np.repeat(begin, count) + within]], axis=1)


def _cover(boxes: Boxes, chosen: Integer, origin: Real, size: float) -> tuple[Integer, Integer]:
    """The cells, at most four each, that some boxes lie in, and the boxes' numbers."""
    limit = 2.0**30
    low = np.floor(np.clip((boxes.low[chosen] - origin) / size, -limit, limit)).astype(np.int64)
    high = np.floor(np.clip((boxes.high[chosen] - origin) / size, -limit, limit)).astype(np.int64)
    cells, numbers = [], []
    for x, there in ((low[:, 0], None), (high[:, 0], high[:, 0] > low[:, 0])):
        for y, too in ((low[:, 1], None), (high[:, 1], high[:, 1] > low[:, 1])):
            taken = np.ones(len(chosen), dtype=bool)
            for part in (there, too):
                if part is not None:
                    taken &= part
            cells.append((x * 2**32 + y)[taken])
            numbers.append(chosen[taken])
    return np.concatenate(cells), np.concatenate(numbers)
