"""Where contacts end within elements that are too long for the pressure there.

At the end of a contact between rounded bodies the pressure falls like the root of the distance, and beyond it the faces
part like the distance to the power 3/2: theory, (124).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pbem.arrays import Bool, Integer, Real
from pbem.contact.laws import OPEN
from pbem.mesh.mesh import Mesh, sort_pairs
from pbem.model.end_grading import ContactEnd, list_gradable
from pbem.model.model import Model
from pbem.solve.problem.step import ContactState

# Of the largest pressure of the contact: what the root falls by over the element in which contact ends, whose nodes are
# off by at most 0.2 of it. Elements that are made for an end are so long that it falls by TOLERANCE.
COARSE = 0.06
TOLERANCE = 0.05
# By so much of an element's length the ends that were found were off, in pins with 24 to 96 elements a circle: 0.01 in
# the middle, 0.03 at most. Where that is not enough a further pass finds them.
UNCERTAIN = 0.02
# Pressures that lie on the root to FOLLOWED of the largest, wherever the end is within LOOSELY of the element's length,
# need no shorter elements, if that holds at all ends: of 420 pins with 24 to 270 elements a circle these bounds leave
# seven alone, whose pressures are off by 0.90 % at most there. (Of pins with one such end, up to 1.9 % there.)
FOLLOWED, LOOSELY = 0.0065, 0.005
# Of so many closed pairs at least.
LEAST_HELD = 3
# At least so long are elements, by the length in which the end is looked for.
PER_WINDOW = 2.0
# Places of an end within its window, and lengths of elements within a factor of 2, that are told apart.
PLACES, SIZES = 8, 4
# So many nodes tell how the opening bends; by more of an element's length that does not move the end.
LEAST_BENT, MOST_BENT = 3, 0.2
# Curves turn by less where two elements meet smoothly (radians).
SMOOTH = 1e-6


@dataclass(frozen=True)
class _Side:
    """An element of a contact seen from one of its ends: distance (p,) of its pairs from there, their numbers."""

    element: int
    length: float
    pairs: Integer
    distance: Real


def find_contact_ends(model: Model, mesh: Mesh, contact: ContactState) -> tuple[ContactEnd, ...]:
    """The ends of contacts between rounded bodies over whose element the pressure falls by more than COARSE of the
    contact's largest (theory, 124), those that cannot be located among them; of the contacts of `list_gradable`. With
    "auto" they are left out if at all that are located the pressures of the pairs lie on the root as it is: where a
    further pass is made for one of them, shorter elements at the others cost little.

    Elements are looked at on the curve that the pairs belong to.
    """
    gradable = list_gradable(model)
    found: list[tuple[ContactEnd, bool]] = []
    for name, pairs in sort_pairs(mesh).items():
        if name in gradable:
            found += _Pressed(mesh, contact, pairs).find(name, gradable[name])
    spare = model.analysis.grade_contact_ends == "auto" and all(followed for end, followed in found if end.located)
    return tuple(end for end, followed in found if not (spare and followed))


class _Pressed:
    """The elements of one contact with their pairs, and how they are pressed."""

    def __init__(self, mesh: Mesh, contact: ContactState, pairs: Integer) -> None:
        """pairs (m,): of the contact."""
        self._mesh = mesh
        self._pressure = -contact.traction_n
        self._opening = contact.opening
        self._open: Bool = contact.mode == OPEN
        elements = mesh.pairs.slave[pairs] // (mesh.order + 1)
        local = mesh.node_local[mesh.pairs.slave[pairs]]
        fraction = mesh.geometry.select(elements).fractions(local[:, None])[:, 0]
        self._largest = float(self._pressure[pairs].max(initial=0.0))
        self._own = {int(e): (pairs[elements == e], fraction[elements == e]) for e in np.unique(elements)}
        # Ends that meet are one number: pbem.geometry.shape.join_ends.
        self._after = {complex(mesh.start[e]): e for e in self._own}
        self._before = {complex(mesh.end[e]): e for e in self._own}

    def find(self, name: str, curves: tuple[str, ...]) -> Iterator[tuple[ContactEnd, bool]]:
        """Its ends, those on elements that are short enough left out; and whether the pressures of the pairs lie on the
        root as it is."""
        for element, (pairs, _) in self._own.items():
            if self._largest <= 0 or self._open[pairs].all():
                continue
            for forward in (True, False):
                beyond = self._find_beside(element, forward)
                if beyond is not None and self._open[self._own[beyond][0]].all():
                    found = self._locate(name, curves, element, beyond, forward)
                    if found is not None:
                        yield found

    def _find_beside(self, element: int, forward: bool) -> int | None:
        """The element that goes on smoothly from one, with as many pairs as it has nodes; None if there is none."""
        mesh = self._mesh
        point = complex((mesh.end if forward else mesh.start)[element])
        beside = (self._after if forward else self._before).get(point)
        if beside is None or len(self._own[beside][0]) <= mesh.order:
            return None
        leaving, arriving = mesh.geometry.select(np.array([element, beside])).directions()
        turn = leaving[1] / arriving[0] if forward else leaving[0] / arriving[1]
        return beside if abs(np.angle(turn)) < SMOOTH else None

    def _see(self, element: int, at_end: bool) -> _Side:
        """An element from its end or its start."""
        pairs, fraction = self._own[element]
        length = float(self._mesh.geometry.select(np.array([element])).lengths[0])
        return _Side(element, length, pairs, length * (1 - fraction if at_end else fraction))

    def _locate(
        self, name: str, curves: tuple[str, ...], element: int, beyond: int, forward: bool
    ) -> tuple[ContactEnd, bool] | None:
        """The end of contact near the point between a pressed element and an open one beyond, and whether the pressures
        of the pairs lie on the root."""
        mesh, last, free = self._mesh, self._see(element, forward), self._see(beyond, not forward)
        if not self._is_rounded(free):
            return None
        # The opening grows like the distance from the end to the power 3/2.
        at = self._find_root(free, self._find_beside(beyond, forward), not forward)
        if not -last.length <= at <= 0.5 * free.length:
            pressed = float(self._pressure[last.pairs].max()) / self._largest
            between = complex((mesh.end if forward else mesh.start)[element])
            end = ContactEnd(name, between, curves, np.inf, 0.0, pressed, False)
            return (end, False) if pressed > COARSE else None
        over = self._measure_fall(last, at, forward) * np.sqrt(last.length)
        if over <= COARSE * self._largest:
            return None
        followed = self._is_followed(last, free, at, forward)
        # Rounded, so that the mesh of the next pass does not change with the rounding of this one's solution.
        window = UNCERTAIN * max(last.length, free.length)
        at = float(np.rint(PLACES * at / window)) * window / PLACES
        root = TOLERANCE * self._largest / over
        # Where the place is not known well enough for shorter ones, it will be after them.
        shortest = max(last.length * 2.0 ** (np.floor(2 * SIZES * np.log2(root)) / SIZES), window / PER_WINDOW)
        inside, along = (last, 1 + at / last.length) if at <= 0 else (free, at / free.length)
        of = mesh.geometry.select(np.array([inside.element]))
        place = complex(of.place_fractions(np.array([[along if forward else 1 - along]]))[0, 0])
        leaving, arriving = of.directions()
        inward = complex(-arriving[0] if forward else leaving[0])
        end = ContactEnd(name, place, curves, shortest, window, over / self._largest,
                         inward=inward / abs(inward), reach=max(last.length, free.length))
        return end, followed

    def _find_root(self, free: _Side, after: int | None, at_end: bool) -> float:
        """Distance from the start of an open element at which the opening to the power 2/3 vanishes; NaN if nowhere.

        It bends as the faces do, which three nodes tell, or those of two elements.
        """
        distance, grown = free.distance, np.maximum(self._opening[free.pairs], 0.0) ** (2 / 3)
        if len(distance) < LEAST_BENT and after is not None:
            beside = self._see(after, at_end)
            distance = np.concatenate([distance, beside.distance + free.length])
            grown = np.concatenate([grown, np.maximum(self._opening[beside.pairs], 0.0) ** (2 / 3)])
        slope, start = np.polyfit(free.distance, grown[: len(free.distance)], 1)
        if not slope > 0:
            return np.nan
        straight = -start / slope
        if len(distance) >= LEAST_BENT:
            bend, slope, start = np.polyfit(distance, grown, 2)
            left = slope**2 - 4 * bend * start
            found = -2 * start / (slope + np.sqrt(left)) if left >= 0 and slope > 0 else np.nan
            if abs(found - straight) <= MOST_BENT * free.length:
                return float(found)
        return float(straight)

    def _is_rounded(self, side: _Side) -> bool:
        """Whether the faces part as they are rounded: what straight ones do as they bend needs no more than it has."""
        mesh, distance = self._mesh, self._mesh.pairs.distance[side.pairs]
        sides = np.concatenate([mesh.pairs.first[side.pairs], mesh.pairs.second[side.pairs]]) // (mesh.order + 1)
        leaving, arriving = mesh.geometry.select(sides).directions()
        turns = np.abs(np.angle(arriving / leaving))
        return bool(turns.max() > SMOOTH or np.ptp(distance) > SMOOTH * side.length)

    def _measure_fall(self, last: _Side, at: float, forward: bool) -> float:
        """What the pressure falls by per root of the distance to the end at `at`, in closed pairs of the last two
        elements."""
        pairs, distance = self._list_last(last, forward)
        return self._fit_root(pairs, distance + at)[0]

    def _fit_root(self, pairs: Integer, distance: Real) -> tuple[float, int]:
        """What the pressure falls by per root of the distance to the end, in closed pairs, and how many they are."""
        held = ~self._open[pairs] & (distance > 0)
        fall = float(self._pressure[pairs[held]].sum() / np.sqrt(distance[held]).sum()) if held.any() else 0.0
        return fall, int(held.sum())

    def _list_last(self, last: _Side, forward: bool) -> tuple[Integer, Real]:
        """The pairs of the last two elements, and their distances from where the last one ends."""
        inner = self._find_beside(last.element, not forward)
        sides = [(last, 0.0)] if inner is None else [(last, 0.0), (self._see(inner, forward), last.length)]
        return (np.concatenate([side.pairs for side, _ in sides]),
                np.concatenate([side.distance + offset for side, offset in sides]))

    def _is_followed(self, last: _Side, free: _Side, at: float, forward: bool) -> bool:
        """Whether the pressures of the pairs in the last two elements, and those of the open one, lie on the root, also
        where the end is not quite at `at`."""
        pairs, distance = self._list_last(last, forward)
        pairs, distance = np.concatenate([pairs, free.pairs]), np.concatenate([distance, -free.distance])
        for moved in (0.0, -LOOSELY * last.length, LOOSELY * last.length):
            away = distance + at + moved
            fall, held = self._fit_root(pairs, away)
            apart = self._pressure[pairs] - fall * np.sqrt(np.maximum(away, 0.0))
            if held < LEAST_HELD or np.abs(apart).max() > FOLLOWED * self._largest:
                return False
        return True
