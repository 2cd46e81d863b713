"""Curves that touch each other without an angle, or meet at a very small one: no elements resolve what is between."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from pbem.geometry.curve import Leg
from pbem.geometry.intersection import project
from pbem.geometry.junction import format_point

# Angles (radians) of wedges that may need more elements than there can be, and what counts as none.
NARROW, NONE = math.radians(2.0), math.radians(1e-4)
EXPECTED = "curves that cross or meet at a wider angle, or that are clearly apart"


def describe_cusp(names: tuple[str, str], first: Sequence[Leg], second: Sequence[Leg], near: complex) -> str | None:
    """What is found where the legs of two curves meet at a small angle near a point; None if they do not there.

    near: no further from the corner than a hundredth of the shorter leg.
    """
    for one in first:
        for other in second:
            for at_end in (False, True) if one is not other else ():
                point = one.end if at_end else one.start
                if point not in (other.start, other.end):
                    continue
                if abs(near - point) > 1e-2 * min(one.length, other.length):
                    continue
                angle = abs(float(np.angle(_enter(one, at_end) / _enter(other, point == other.end))))
                if angle < NARROW:
                    how = (f"touching each other at {format_point(point)} without an angle between them" if angle < NONE
                           else f"meeting at {format_point(point)} at an angle of {math.degrees(angle):.2g} degrees")
                    what = f"curves '{names[0]}' and '{names[1]}'" if names[0] != names[1] else f"legs of '{names[0]}'"
                    return f"{what} {how}"
    return None


def touch_only(first: Sequence[Leg], second: Sequence[Leg], place: complex) -> bool:
    """Whether two curves that all but coincide from a place on bend otherwise there, so that they only touch."""
    one, other = (min(legs, key=lambda leg: project(leg, place)[1]) for legs in (first, second))
    return abs(_bend(one, place) - _bend(other, place)) * min(one.length, other.length) > NONE


def _enter(leg: Leg, at_end: bool) -> complex:
    """Unit vector from an end of the leg into it."""
    return -leg.tangent(True) if at_end else leg.tangent(False)


def _bend(leg: Leg, place: complex) -> complex:
    """Curvature (1/length) of a leg at a place on it, in the direction that it bends to."""
    return complex(-leg.normals(np.array([place]))[0]) * leg.turn / leg.length
