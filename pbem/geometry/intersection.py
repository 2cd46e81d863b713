"""Where legs lie: nearest points, meeting points, enclosed angle and area."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from pbem.arrays import Complex, Integer, Real
from pbem.geometry.curve import Leg
from pbem.geometry.elements import Elements, cross_carriers

# Legs that share an end are not searched for another meeting point nearer to it than this part of the shorter leg:
# the second root of a tangential contact (a fillet) is uncertain by the square root of the rounding.
NEAR_SHARED_END = 1e-4


def surround(legs: Sequence[Leg]) -> tuple[complex, complex]:
    """Lower left and upper right corner of the box around some legs."""
    low, high = Elements.collect(legs).bounds()
    return complex(*low.min(axis=0)), complex(*high.max(axis=0))


def project(leg: Leg, point: complex) -> tuple[float, float]:
    """Fraction of the leg nearest to the point, and the distance (of the carrying line or circle inside the leg)."""
    t = min(1.0, max(0.0, leg.project(point)))
    return t, abs(complex(leg.kind.place_fraction(leg, t)) - point)


def measure_distances(legs: Sequence[Leg], points: Complex) -> Real:
    """Distance of each point from the nearest of some legs."""
    nearest = np.full(points.shape, np.inf)
    for leg in legs:
        nearest = np.minimum(nearest, leg.kind.distance(leg, points))
    return nearest


def meeting_points(first: Leg, second: Leg, tolerance: float) -> list[complex]:
    """Points in the interior of both legs where they cross or touch; common pieces are not found (see `coincide`)."""
    points = cross_carriers(first, second, tolerance)
    shared = {first.start, first.end} & {second.start, second.end}
    margin = NEAR_SHARED_END * min(first.length, second.length)
    return [
        point for point in points
        if _inside(first, point, tolerance) and _inside(second, point, tolerance)
        and all(abs(point - end) > margin for end in shared)
    ]


def _inside(leg: Leg, point: complex, tolerance: float) -> bool:
    if min(abs(point - leg.start), abs(point - leg.end)) <= tolerance:
        return False
    return 0 < leg.project(point) < 1


def coincide(first: Leg, second: Leg, tolerance: float) -> bool:
    """Legs with the same two ends that also have their middles in common."""
    if {first.start, first.end} != {second.start, second.end}:
        return False
    middles = [complex(leg.point(np.array(0.5))) for leg in (first, second)]
    return abs(middles[0] - middles[1]) <= 10 * tolerance


def enclosed_angle(leg: Leg, points: Complex) -> Real:
    """Angle by which the ray from each point (off the leg) to the leg turns along it; exact, also close to an arc."""
    return np.asarray(leg.kind.subtend(leg, points))


def winding_number(legs: list[Leg], points: Complex) -> Integer:
    """How often closed chains of legs run counter-clockwise around each point."""
    total = np.zeros(points.shape)
    for leg in legs:
        total += enclosed_angle(leg, points)
    return np.rint(total / (2 * math.pi)).astype(np.int64)


def enclosed_area(legs: list[Leg]) -> float:
    """Area of a closed chain of legs, positive if counter-clockwise."""
    origin = legs[0].start
    total = 0.0
    for leg in legs:
        total += ((leg.start - origin).conjugate() * (leg.end - origin)).imag / 2
        total += float(leg.kind.area(leg))
    return total


def inner_points(leg: Leg, count: int = 5) -> Complex:
    """Points spread over the interior of the leg."""
    return leg.point((np.arange(count) + 0.5) / count)
