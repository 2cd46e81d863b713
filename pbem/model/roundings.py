"""Rounded corners, and what they allow beside them: from the rounding on, lengths grow with the distance from it.

Where a boundary turns within an arc that is short beside the elements next to it, as at the round end of a slot or at
a fillet, it goes on smoothly; but seen from a few radii away it is a corner, and displacements follow the power of a
corner down to a distance of about one radius. So the neighbours of the arc are about as long as its radius at most,
and lengths grow geometrically from there, across the ends of curves too.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np

from pbem.arrays import Complex, Integer, Real
from pbem.geometry.boxes import Boxes
from pbem.geometry.curve import Leg
from pbem.geometry.tolerance import TIE

# Arcs of a curve, one after another, that turn by so much (radians) together are a rounded corner to elements longer
# than their radii. A curve by expressions has an arc for each element.
TURNS = math.radians(10.0) * (1 - TIE)
# Growth of lengths per distance from the ends of the arc, by the order of the polynomials. The displacement beside a
# slot with a round end of 5e-4 of its length was 1.5 % off at order 2, 1.8 % at order 3 and 6.6 % at order 1 without;
# with these it is 3e-4, 1e-4 and 8e-3 off, with 1.0 in place of them 1e-3, 7e-4 and 2e-2.
STEEPEST = (0.33, 0.33, 0.5, 0.5)
# Elements next to the arc whose grading is the user's are borne up to so many radii: displacements were 3e-4 off at 6,
# 1 % at 60.
BEARABLE = 8.0


@dataclass(frozen=True)
class Roundings:
    """Ends (k,) of rounded corners, their radii, and the number of the joined set of legs that each belongs to.

    joined (legs,): number of the set of legs that hang together at their ends, of each leg; slope: growth of lengths.
    """

    point: Complex
    radius: Real
    set_of: Integer
    joined: Integer
    slope: float

    def measure(self, legs: Integer, points: Complex, wanted: Real) -> Real:
        """The longest elements (m,) that roundings allow at points on legs with these numbers, infinite where they
        allow the wanted length and more."""
        allowed = np.full(len(points), np.inf)
        if len(self.point):
            near = Boxes.around_points(self.point, np.zeros(len(self.point)))
            which, end = near.find_meeting(Boxes.around_points(points, wanted / self.slope))
            own = self.joined[legs[which]] == self.set_of[end]
            which, end = which[own], end[own]
            lengths = self.radius[end] + self.slope * np.abs(points[which] - self.point[end])
            np.minimum.at(allowed, which, lengths)
        return allowed


def find_roundings(legs: Sequence[Leg], names: Sequence[str], longest: Real, order: int) -> Roundings:
    """Arcs that are short beside elements of the legs that they hang together with.

    names: of the curves of the legs; longest: the longest element (legs,) of each leg; order: of the polynomials."""
    joined, turns = join_legs(legs), _sum_turns(legs, names)
    most = np.zeros(len(legs))
    np.maximum.at(most, joined, longest)
    point, radius, set_of = [], [], []
    for number, leg in enumerate(legs):
        if turns[number] >= TURNS and leg.length < abs(leg.turn) * most[joined[number]]:
            point += [leg.start, leg.end]
            radius += 2 * [leg.length / abs(leg.turn)]
            set_of += 2 * [joined[number]]
    return Roundings(
        np.array(point, dtype=complex), np.array(radius), np.array(set_of, dtype=np.int64), joined, STEEPEST[order]
    )


def _sum_turns(legs: Sequence[Leg], names: Sequence[str]) -> list[float]:
    """Of each leg the angle (radians) by which the arcs of its curve around it turn one after another to its side."""
    turns: list[float] = []
    sides = zip(names, (math.copysign(1.0, leg.turn) if leg.turn else 0.0 for leg in legs), strict=True)
    for _, group in groupby(sides):
        count = len(list(group))
        turns += count * [sum(abs(leg.turn) for leg in legs[len(turns):len(turns) + count])]
    return turns


def join_legs(legs: Sequence[Leg]) -> Integer:
    """Per leg the number of the set of legs that hang together at their ends, each from 0 to one less than the legs."""
    parent: dict[complex, complex] = {}

    def find(point: complex) -> complex:
        parent.setdefault(point, point)
        while parent[point] != point:
            parent[point] = parent[parent[point]]
            point = parent[point]
        return point

    for leg in legs:
        parent[find(leg.start)] = find(leg.end)
    numbers: dict[complex, int] = {}
    return np.array([numbers.setdefault(find(leg.start), len(numbers)) for leg in legs], dtype=np.int64)
