"""Bounding boxes in nearly linear time: which of them meet, and which lie around points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pbem.arrays import Bool, Complex, Integer, Real
from pbem.geometry.curve import Leg
from pbem.geometry.elements import Elements

# Cells are at most so many times finer than the extent of all boxes.
FINEST = 2.0**20
# As many pairs of boxes are compared one by one in the time that it takes to sort a few of them into cells.
FEW = 2**14


class Boxes:
    """Boxes (n,) from low to high, each (n, 2).

    Boxes of about one size are kept in square cells of that size, each in at most four: those that meet share a cell.
    """

    def __init__(self, low: Real, high: Real) -> None:
        self.low, self.high = low.reshape(-1, 2), high.reshape(-1, 2)

    @cached_property
    def _sizes(self) -> dict[float, Integer]:
        """Numbers of the boxes by the size of the cells that they are kept in."""
        extent = float((self.high.max(axis=0) - self.low.min(axis=0)).max()) if len(self.low) else 0.0
        finest = max(extent / FINEST, 1e-300)
        # A little more than enough, for rounding.
        level = np.ceil(np.log2(np.maximum((self.high - self.low).max(axis=1, initial=0.0) / finest, 1.0)) + 1e-9)
        return {finest * 2.0**k: np.flatnonzero(level == k) for k in np.unique(level)}

    @classmethod
    def around_legs(cls, legs: Sequence[Leg], tolerance: float) -> Boxes:
        """The boxes of legs, wider by the tolerance on every side."""
        if not legs:
            return cls(np.zeros((0, 2)), np.zeros((0, 2)))
        low, high = Elements.collect(legs).bounds()
        return cls(low - tolerance, high + tolerance)

    @classmethod
    def around_points(cls, points: Complex, reach: Real) -> Boxes:
        """Squares around points (m,), which reach so far (m,) on every side."""
        low = np.stack([points.real, points.imag], axis=1) - reach[:, None]
        return cls(low, low + 2 * reach[:, None])

    @classmethod
    def of_corners(cls, corners: Sequence[tuple[complex, complex]]) -> Boxes:
        """Boxes given by their lower left and upper right corners."""
        both = np.array(corners, dtype=complex).reshape(-1, 2)
        return cls(*(np.stack([side.real, side.imag], axis=1) for side in both.T))

    def select(self, numbers: Integer) -> Boxes:
        """Some of the boxes."""
        return Boxes(self.low[numbers], self.high[numbers])

    def find_around(self, points: Complex) -> tuple[Integer, Integer]:
        """Numbers of points (m,) and of the boxes around them, a pair for each, in rising order."""
        at = np.stack([points.real, points.imag], axis=1)
        return self.find_meeting(Boxes(at, at))

    def find_meeting(self, others: Boxes) -> tuple[Integer, Integer]:
        """Numbers of the others and of the boxes that they meet, a pair for each meeting, in rising order."""
        if len(self.low) * len(others.low) <= FEW:
            meet = np.ones((len(others.low), len(self.low)), dtype=bool)
            for axis in range(2):
                meet &= others.low[:, None, axis] <= self.high[:, axis]
                meet &= others.high[:, None, axis] >= self.low[:, axis]
            other, own = np.nonzero(meet)
            return other, own
        found = [np.zeros(0, dtype=np.int64)]
        for size, numbers in self._sizes.items():
            for other_size, other_numbers in others._sizes.items():
                # In cells of the larger size neither covers more than four.
                one, own = _match(others, other_numbers, self, numbers, max(size, other_size))
                meet = self._meet(own, others, one)
                found.append(one[meet] * len(self.low) + own[meet])
        first, second = np.divmod(np.sort(np.concatenate(found)), max(len(self.low), 1))
        return first, second

    def _meet(self, own: Integer, others: Boxes, other: Integer) -> Bool:
        """Whether boxes (k,) meet those of the others (k,) with the same place in the lists."""
        meet = np.ones(len(own), dtype=bool)
        for axis in range(2):
            meet &= others.low[other, axis] <= self.high[own, axis]
            meet &= others.high[other, axis] >= self.low[own, axis]
        return meet

    def find_pairs(self) -> tuple[Integer, Integer]:
        """Numbers i < j of all boxes that meet, in rising order."""
        i, j = self.find_meeting(self)
        return i[i < j], j[i < j]


@dataclass(frozen=True)
class Meetings:
    """Pairs (k,) of boxes that meet some others: numbers of the others, in rising order, and of the boxes."""

    boxes: Boxes
    other: Integer
    box: Integer

    def narrow(self, inner: Boxes, within: Integer) -> Meetings:
        """The same for boxes each of which lies in that one of the others whose number (m,) is given."""
        begin = np.searchsorted(self.other, within, side="left")
        count = np.searchsorted(self.other, within, side="right") - begin
        box = self.box[np.arange(count.sum()) + np.repeat(begin - (np.cumsum(count) - count), count)]
        other = np.repeat(np.arange(len(within)), count)
        meet = self.boxes._meet(box, inner, other)
        return Meetings(self.boxes, other[meet], box[meet])

    def select(self, which: Bool) -> Meetings:
        """Some of the pairs."""
        return Meetings(self.boxes, self.other[which], self.box[which])


def take_least_of_each(at: Integer, values: Real, count: int) -> Real:
    """The least of the values (k,) that go with each of the numbers 0 .. count - 1, rising in at (k,); infinite where
    there is none."""
    least = np.full(count, np.inf)
    first = np.flatnonzero(np.diff(at, prepend=-1))
    if len(first):
        least[at[first]] = np.minimum.reduceat(values, first)
    return least


def _match(first: Boxes, chosen: Integer, second: Boxes, own: Integer, size: float) -> tuple[Integer, Integer]:
    """Pairs (k,), each once, of boxes that share a cell of the given size, which none of them exceeds."""
    origin = second.low.min(axis=0)
    cell, box, part = _cover(first, chosen, origin, size)
    other_cell, other, other_part = _cover(second, own, origin, size)
    order = np.argsort(other_cell, kind="stable")
    other_cell, other, other_part = other_cell[order], other[order], other_part[order]
    begin = np.searchsorted(other_cell, cell, side="left")
    count = np.searchsorted(other_cell, cell, side="right") - begin
    found = np.flatnonzero(count)
    begin, count = begin[found], count[found]
    at = np.arange(count.sum()) + np.repeat(begin - (np.cumsum(count) - count), count)
    by = np.repeat(found, count)
    # Of the cells that two boxes share one is the lowest and leftmost: it is such a one of either box.
    once = (part[by] | other_part[at]) == _LEFT | _LOWEST
    return box[by[once]], other[at[once]]


_LEFT, _LOWEST = 1, 2


def _cover(boxes: Boxes, chosen: Integer, origin: Real, size: float) -> tuple[Integer, Integer, NDArray[np.int8]]:
    """The cells, at most four each, that some boxes lie in, the boxes' numbers, and which of its box's cells each is:
    whether one of the leftmost ones and of the lowest ones."""
    limit = 2.0**30
    low = np.floor(np.clip((boxes.low[chosen] - origin) / size, -limit, limit)).astype(np.int64)
    high = np.floor(np.clip((boxes.high[chosen] - origin) / size, -limit, limit)).astype(np.int64)
    cells, numbers, parts = [], [], []
    for x, left in ((low[:, 0], _LEFT), (high[:, 0], 0)):
        for y, lowest in ((low[:, 1], _LOWEST), (high[:, 1], 0)):
            taken = np.ones(len(chosen), dtype=bool)
            if not left:
                taken &= high[:, 0] > low[:, 0]
            if not lowest:
                taken &= high[:, 1] > low[:, 1]
            cells.append((x * 2**32 + y)[taken])
            numbers.append(chosen[taken])
            parts.append(np.full(len(cells[-1]), left | lowest, dtype=np.int8))
    return np.concatenate(cells), np.concatenate(numbers), np.concatenate(parts)
