"""Narrow wedges between faces: graded alike on both sides down to a last bit, which follows the pairs next to it.

In the corner of a wedge of angle a, lengths proportional to the distance r from the corner keep the ratio of length
and distance of the sides, down to the element in the corner itself, which no mesh resolves: there pairs open when
they are pressed. Up to TIED that bit must not choose its own contact status. It takes that of the pair next to it
(stick, slip with its sign, open); its jump stays free, so that rigid motions of the sides pass through the corner.
Faces tied to zero jump there would pin cracks that cross: 30 % of the slip, falling with the logarithm of the length.

Further legs that end in the corner are graded in the same way, though no wedge lies beside them: where a branch leaves
a crack, jumps that elements of a tenfold length cannot follow turn the needle between the two (30 % of the slip).

Where a crack branches off another its slip ends in the corner or opens the crack, at whatever angle: jumps vary with
a small power of the distance, and what the element in the corner cannot follow spoils the slip far around it (2 to 4 %
of the largest at 70 to 45 degrees with lengths at t^3). There lengths fall geometrically as well, unless the elements
that are asked for are too few for it to matter.

Nor do powers suffice where a crack turns sharply: the outer side of the corner is all but a crack's tip, whose square
root the elements on both legs must follow, the less of it the shorter a leg (K of wings a tenth as long: 1 to 10 % at
120 degrees with lengths at t^3). There lengths fall geometrically, too, and more slowly; where the grading is the
user's, at corners that turn less as well, since nothing else is known of it.

Where a crack ends on an interface with a softer material jumps vary with a still smaller power, and lengths fall
geometrically to a last bit that follows from it (see pbem.model.interface_ends).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pbem.arrays import Real
from pbem.geometry.curve import Leg
from pbem.geometry.nearness import Corner, Surroundings
from pbem.geometry.tolerance import TIE

# Length of the last bit, as a part of the shortest leg of the wedges at a corner: at 8 degrees, from where it changes
# with the power of the angle, and its bounds. What it spoils grows in proportion to it, and as slender bodies bend.
LAST_BIT, AT_ANGLE, POWER = 2e-4, 8.0, 2.5
LEAST_BIT, MOST_BIT = 5e-5, 1e-2
# Most of it where a crack branches off another, in a wedge or in none, and the least number of elements from there to
# the other end, or to the middle of a leg that is refined at both ends, in the mean of the three legs.
BRANCH_BIT, LEAST_ASKED = 6e-5, 5
# The same number where a crack ends on an interface with a softer material: K is off by more there.
LEAST_AT_INTERFACE = 3
# The least turn (radians) of a crack in a corner towards which lengths fall geometrically, where the grading is chosen
# (less: powers do); the least number of elements of a leg, in the mean of both, from the corner on.
SHARP, LEAST_AT_TURN = math.radians(60.0) * (1 - TIE), 4
# The same of constant and linear elements where one leg is shorter than this part of the other: K of wings of a
# hundredth was off by 0.9 to 3.3 % at 15 to 50 degrees with powers.
SHARP_BESIDE_WING, WING = math.radians(10.0) * (1 - TIE), 0.2 * (1 - TIE)
# The angle between its legs (radians) below which lengths fall more slowly, and to a shorter last bit: K of a wing that
# the other leg shields was off by 0.3 % at order 3 and 34 to 45 degrees with that of other corners (0.1 % with this).
SHARPER, SHARPER_BIT = math.radians(80.0) * (1 - TIE), 0.2
# Constant and linear elements fall with this power of the angle there, in place of 1: K was off by 0.5 to 1 % on any
# number of elements elsewhere. LEAST_GROWTH bounds their number.
LINEAR_FOLD, LEAST_GROWTH = 4, 0.06
# Degrees, by the order of the elements, the last one for all higher ones: below, the last bit follows its neighbour. In
# wedges of up to 48, 31 and less than 20 degrees the compliance of pairs there had the wrong sign. Where a crack turns
# the last one holds for all orders: K of a wing of linear elements at 34 degrees was 0.57 % off (0.5 at most without).
TIED = (50.0 * (1 - TIE), 35.0 * (1 - TIE), 25.0 * (1 - TIE))
# Elements that are asked for from the corner on, in the mean of the legs, up to which the last bit is as it is. With
# more it is shorter where it is not tied, by the power of legs that are graded by powers: else slips would not converge
# with the elements.
ENOUGH = 4
# Most growth of lengths per distance from the corner, for wedges that are not very narrow.
MOST_GROWTH = 1.0


@dataclass(frozen=True)
class Reach:
    """Longest element, as a multiple of the distance to the next face: usual; bending: between a crack and a face that
    bounds the region, where what lies between bends; linear: elements are of order 1 or 0."""

    usual: float
    bending: float
    linear: bool = False


@dataclass(frozen=True)
class Tie:
    """The bit of a curve from arc length `start` to `end` that follows the pair next to it; corner, angle (degrees)
    and the other side of the wedge are for messages."""

    curve: str
    start: float
    end: float
    corner: complex
    angle: float
    other: str


@dataclass(frozen=True)
class Wedges:
    """All corners of narrow wedges, with the length of the last bit at each; at: number of the corner at an end of a
    leg (its number, and whether it is the leg's end)."""

    corners: tuple[Corner, ...]
    bits: tuple[float, ...]
    ties: tuple[Tie, ...]
    at: Mapping[tuple[int, bool], int]

    def list_turning(self) -> frozenset[tuple[int, bool]]:
        """The ends of legs (number, whether it is the leg's end) where a crack turns sharply."""
        return frozenset(end for end, number in self.at.items() if self.corners[number].turning)

    def tabulate(self, legs: int, reach: Reach) -> tuple[Real, Real]:
        """Per end of a leg (legs, 2): length of the last bit, and growth of lengths; zeros where no wedge is."""
        floor, growth = np.zeros((legs, 2)), np.zeros((legs, 2))
        for corner, bit in zip(self.corners, self.bits, strict=True):
            for number, at_end in corner.ends + corner.beside:
                floor[number, int(at_end)] = bit
                growth[number, int(at_end)] = _measure_growth_of_leg(corner, (number, at_end), reach)
        return floor, growth

    def grade(
        self, leg: int, at_end: bool, length: float, places: Real, limits: Real, reach: Reach
    ) -> Sequence[float]:
        """Ends of elements, as fractions of the leg from a corner on: in geometric progression, equal on all legs of
        the corner, up to where they would be longer than a limit (fractions), given from the places (fractions) on;
        [0] where no wedge is."""
        number = self.at.get((leg, at_end))
        if number is None:
            return [0.0]
        growth, bit = _measure_growth_of_leg(self.corners[number], (leg, at_end), reach), self.bits[number]
        if bit > 0.5 * length:
            return [0.0]
        if at_end:
            places, limits = (1.0 - np.append(places[1:], 1.0))[::-1], limits[::-1]
        ends = [0.0, bit / length]
        while True:
            following = ends[-1] * (1 + growth)
            first, last = np.searchsorted(places, (ends[-1], following))
            # The part in which the element begins reaches back to where less is allowed.
            allowed = limits[first:last].min(initial=limits[first - 1] * (1 + growth))
            if following > 0.5 or following - ends[-1] > allowed * (1 + 1e-9):
                return ends
            ends.append(following)


def measure_growth(angle: float, reach: float) -> float:
    """Length of an element over its distance from the corner of a wedge (radians)."""
    return min(MOST_GROWTH, reach * math.sin(angle))


def _measure_growth_of_leg(corner: Corner, end: tuple[int, bool], reach: Reach) -> float:
    if corner.turning:
        fold = min(1.0, corner.angle / SHARPER)
        return 0.5 * reach.usual * (max(fold**LINEAR_FOLD, 2 * LEAST_GROWTH) if reach.linear else fold)
    if end in corner.beside:
        return MOST_GROWTH if corner.ends else reach.usual
    growth = measure_growth(corner.angle, reach.usual)
    return growth if math.isinf(corner.bending) else min(growth, measure_growth(corner.bending, reach.bending))


def measure_last_bit(angle: float, singular: bool = False) -> float:
    """Length of the last bit in the corner of a wedge (radians), as a part of its shortest leg.

    singular: jumps vary with a small power of the distance there, as a crack branches or turns."""
    most = BRANCH_BIT if singular else MOST_BIT
    return min(max(LAST_BIT * (math.degrees(angle) / AT_ANGLE) ** POWER, LEAST_BIT), most)


def _count_asked(leg: Leg) -> float:
    """Elements from an end of a leg on that is refined, up to where those of the other end begin."""
    return leg.elements / (2 if leg.refine_start and leg.refine_end else 1)


def find_wedges(
    surroundings: Surroundings, kept: frozenset[str], order: int
) -> Wedges:
    """The wedges of a model and what is tied in their corners. kept: curves whose grading is the user's; order: of the
    elements."""
    legs, names = surroundings.legs, surroundings.curve
    before = [0.0]
    for number in range(1, len(legs)):
        same = names[number - 1] == names[number]
        before.append(before[-1] + legs[number - 1].length if same else 0.0)
    bits, ties = [], []
    corners = []
    for corner in surroundings.corners:
        ends = corner.ends or corner.beside
        numbers = [number for number, _ in corner.ends + corner.beside]
        given = any(names[number] in kept for number in numbers)
        asked = float(np.mean([legs[number].elements if given else _count_asked(legs[number]) for number in numbers]))
        branching = corner.branching and asked >= LEAST_ASKED
        narrow = math.degrees(corner.angle) < TIED[-1]
        turning = corner.turning and not narrow and asked >= LEAST_AT_TURN
        lengths = [legs[number].length for number in numbers]
        sharp = SHARP_BESIDE_WING if order < 2 and min(lengths) < WING * max(lengths) else SHARP
        turning = turning and (given or math.pi - corner.angle >= sharp)
        ending = math.isfinite(corner.last_bit) and asked >= LEAST_AT_INTERFACE
        if not (branching or turning or ending or corner.ends):
            continue
        corners.append(replace(corner, branching=branching, turning=turning))
        shortest = min(legs[number].length for number, _ in ends)
        bit = measure_last_bit(corner.angle, branching or turning) * shortest
        tied = math.degrees(corner.angle) < (TIED[-1] if turning else TIED[min(order, 2)])
        if not (branching or turning or tied):
            bit *= min(1.0, (ENOUGH / asked) ** 3)
        if turning and corner.angle < SHARPER:
            bit *= SHARPER_BIT
        if ending:
            bit = min(bit, corner.last_bit * min(lengths))
        bits.append(bit)
        if not tied:
            continue
        for number, at_end in corner.ends:
            first = before[number] + (legs[number].length - bit if at_end else 0.0)
            other = names[corner.sides[corner.sides[0] == number]]
            ties.append(Tie(names[number], first, first + bit, corner.point, math.degrees(corner.angle), other))
    at = {end: number for number, corner in enumerate(corners) for end in corner.ends + corner.beside}
    return Wedges(tuple(corners), tuple(bits), tuple(ties), at)
