"""Elements that are halved near places of a curve, and how the elements of its legs are divided anew."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np

from pbem.arrays import Real
from pbem.geometry.curve import Curve, Leg


class Place(Protocol):
    """A point (complex) on a curve; elements are no longer than `shortest` within the window of it."""

    @property
    def place(self) -> complex: ...
    @property
    def shortest(self) -> float: ...
    @property
    def window(self) -> float: ...


def halve_towards(curve: Curve, places: Sequence[Place], growth: float) -> Curve:
    """The curve with elements halved until none is longer than `shortest` within the window of a place, and beyond
    than `growth` times the distance more."""
    at = np.array([find_arc_length(curve, each.place) for each in places])[:, None]
    shortest = np.array([each.shortest for each in places])[:, None]
    window = np.array([each.window for each in places])[:, None]
    turns = (-curve.length, 0.0, curve.length) if curve.closed else (0.0,)

    def divide(leg: Leg, begin: float) -> Real:
        fractions = leg.element_fractions()
        while True:
            first, last = begin + fractions[:-1] * leg.length, begin + fractions[1:] * leg.length
            apart = np.min([np.maximum(first - at - turn, at + turn - last) for turn in turns], axis=0)
            allowed = (shortest + growth * np.maximum(apart - window, 0.0)).min(axis=0)
            long = np.flatnonzero(last - first > allowed * (1 + 1e-9))
            if not len(long):
                return fractions
            fractions = np.insert(fractions, long + 1, 0.5 * (fractions[long] + fractions[long + 1]))

    return divide_legs(curve, divide)


def divide_legs(curve: Curve, divide: Callable[[Leg, float], Real]) -> Curve:
    """The curve with other elements on those legs that get more of them.

    divide: fractions of a leg at the ends of its elements, rising from 0 to 1, from the leg and the arc length where it
    begins.
    """
    legs, begin = [], 0.0
    for leg in curve.legs:
        found = divide(leg, begin)
        if len(found) > leg.elements + 1:
            leg = replace(leg, elements=len(found) - 1, fractions=tuple(float(t) for t in found))
        legs.append(leg)
        begin += leg.length
    return Curve(curve.name, tuple(legs))


def find_arc_length(curve: Curve, place: complex) -> float:
    """Distance along the curve of its point that is nearest to a place."""
    found, begin = [], 0.0
    for leg in curve.legs:
        fraction = min(max(leg.project(place), 0.0), 1.0)
        found.append((abs(complex(leg.point(np.array(fraction))) - place), begin + fraction * leg.length))
        begin += leg.length
    return min(found)[1]
