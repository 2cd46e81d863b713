"""The two faces of a narrow slot: divided alike, so that no element has to be as short as the slot is wide.

Across a slot there is no material. With elements that lie opposite to each other the two faces act on the body like a
crack, however narrow the slot is; elements that do not are wrong by their ends' offset over the width. Faces across
material, as of a thin body, are another thing: there lengths have to follow the distance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pbem.geometry.curve import Leg
from pbem.geometry.tolerance import TIE

# A slot is narrow if its faces are nearer than this part of the mean length of their elements.
NARROW = 0.5 * (1 + TIE)


@dataclass(frozen=True)
class SlotSide:
    """A curve of a region; forward: travelled in its own direction with the region on the left; None: a crack."""

    curve: str
    forward: bool | None


@dataclass(frozen=True)
class Slot:
    """Numbers of two legs that face each other across a slot; turned: they run in opposite directions."""

    first: int
    second: int
    turned: bool


def find_slots(legs: Sequence[Leg], names: Sequence[str], regions: Sequence[Sequence[SlotSide]]) -> tuple[Slot, ...]:
    """The narrow slots between legs (with the names of their curves) of one region."""
    numbers: dict[str, list[int]] = {}
    for number, name in enumerate(names):
        numbers.setdefault(name, []).append(number)
    slots: dict[tuple[int, int], Slot] = {}
    for sides in regions:
        travelled = [
            (number, side.forward) for side in sides if side.forward is not None for number in numbers[side.curve]
        ]
        starts = _sort_starts(legs, travelled)
        for number, forward in travelled:
            leg = legs[number] if forward else legs[number].reverse()
            for other, other_forward in starts.find(leg.end, NARROW * leg.length / leg.elements):
                if other == number or (min(number, other), max(number, other)) in slots:
                    continue
                opposite = legs[other] if other_forward else legs[other].reverse()
                if _is_slot(leg, opposite):
                    slots[min(number, other), max(number, other)] = Slot(number, other, forward == other_forward)
    return tuple(slots.values())


def divide_alike(legs: list[Leg], slots: Sequence[Slot], kept: frozenset[int]) -> None:
    """Give both faces of every slot the elements of the one that has more; legs of kept numbers stay as they are."""
    for slot in slots:
        one, other = legs[slot.first], legs[slot.second]
        if slot.first in kept or slot.second in kept:
            continue
        more = one if one.elements >= other.elements else other
        ends = more.element_fractions()
        turned = tuple((1.0 - ends[::-1]).tolist()) if slot.turned else tuple(ends.tolist())
        number, less = (slot.second, other) if more is one else (slot.first, one)
        legs[number] = replace(less, elements=more.elements, fractions=turned)


class _Starts:
    """Where the legs of a region begin, as it is travelled, by their x."""

    def __init__(self, points: np.ndarray, which: Sequence[tuple[int, bool]]) -> None:
        order = np.argsort(points.real, kind="stable")
        self._points, self._which = points[order], [which[at] for at in order]

    def find(self, point: complex, distance: float) -> list[tuple[int, bool]]:
        low, high = np.searchsorted(self._points.real, (point.real - distance, point.real + distance))
        return [self._which[at] for at in range(low, high) if abs(self._points[at] - point) <= distance]


def _sort_starts(legs: Sequence[Leg], travelled: Sequence[tuple[int, bool]]) -> _Starts:
    points = [legs[number].start if forward else legs[number].end for number, forward in travelled]
    return _Starts(np.array(points, dtype=complex), travelled)


def _is_slot(leg: Leg, opposite: Leg) -> bool:
    """Whether the second leg runs back beside the first with nothing between them, both with the region on the left."""
    t = np.linspace(0.0, 1.0, 5)
    across = opposite.point(1.0 - t) - leg.point(t)
    near = NARROW * min(leg.length / leg.elements, opposite.length / opposite.elements)
    if not (np.abs(across) <= near).all() or not abs(across[2]) > 0:
        return False
    inner = np.array([0.25, 0.5, 0.75])
    before, after = leg.point(inner - 0.01), leg.point(inner + 0.01)
    outward = -1j * (after - before)
    return bool(((np.conj(outward) * across[1:4]).real > 0).all())
