"""Where straight and circular legs lie: nearest points, meeting points, enclosed angle and area."""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pbem.geometry.curve import Leg

# Legs that share an end are not searched for another meeting point nearer to it than this part of the shorter leg:
# the second root of a tangential contact (a fillet) is uncertain by the square root of the rounding.
NEAR_SHARED_END = 1e-4


def extremes(leg: Leg) -> NDArray[np.complex128]:
    """Points of the leg whose bounding box is the leg's: its ends and, of an arc, the turning points in x and y."""
    points = [leg.start, leg.end]
    if leg.center is not None:
        for direction in (1, 1j, -1, -1j):
            point = leg.center + abs(leg.start - leg.center) * direction
            if 0 < fraction_of_arc(leg, point) < 1:
                points.append(point)
    return np.array(points)


def surround(legs: Sequence[Leg]) -> tuple[complex, complex]:
    """Lower left and upper right corner of the box around some legs."""
    points = np.concatenate([extremes(leg) for leg in legs])
    x, y = points.real, points.imag
    return complex(x.min(), y.min()), complex(x.max(), y.max())


def fraction_of_arc(leg: Leg, point: complex) -> float:
    """Fraction of the sweep where the ray from the center to the point cuts the circle; not in [0, 1] off the arc."""
    assert leg.center is not None
    angle = cmath.phase((point - leg.center) / (leg.start - leg.center)) * math.copysign(1.0, leg.sweep)
    sweep = abs(leg.sweep)
    if angle < 0:
        angle += 2 * math.pi
    # Beyond the arc's end the ray belongs to the nearer of the two ends.
    if angle > sweep and angle - sweep > 2 * math.pi - angle:
        angle -= 2 * math.pi
    return angle / sweep


def project(leg: Leg, point: complex) -> tuple[float, float]:
    """Fraction of the leg nearest to the point, and the distance (of the carrying line or circle inside the leg)."""
    if leg.center is None:
        along = leg.end - leg.start
        t = ((point - leg.start) * along.conjugate()).real / abs(along) ** 2
    else:
        t = fraction_of_arc(leg, point) if point != leg.center else 0.0
    t = min(1.0, max(0.0, t))
    return t, abs(complex(leg.point(np.array(t))) - point)


def measure_distances(legs: Sequence[Leg], points: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Distance of each point from the nearest of some legs."""
    nearest = np.full(points.shape, np.inf)
    for leg in legs:
        ends = np.minimum(abs(points - leg.start), abs(points - leg.end))
        if leg.center is None:
            along = leg.end - leg.start
            local = (points - leg.start) / along
            beside = np.where((local.real > 0) & (local.real < 1), abs(local.imag * along), ends)
        else:
            angle = np.angle((points - leg.center) / (leg.start - leg.center)) * math.copysign(1.0, leg.sweep)
            off_circle = abs(abs(points - leg.center) - abs(leg.start - leg.center))
            beside = np.where(angle % (2 * math.pi) < abs(leg.sweep), off_circle, ends)
        nearest = np.minimum(nearest, np.minimum(beside, ends))
    return nearest


def meeting_points(first: Leg, second: Leg, tolerance: float) -> list[complex]:
    """Points in the interior of both legs where they cross or touch; common pieces are not found (see `coincide`)."""
    if first.center is None and second.center is None:
        points = _line_line(first, second)
    elif first.center is None or second.center is None:
        line, arc = (first, second) if first.center is None else (second, first)
        points = _line_circle(line, arc, tolerance)
    else:
        points = _circle_circle(first, second, tolerance)
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
    if leg.center is None:
        along = leg.end - leg.start
        return 0 < ((point - leg.start) * along.conjugate()).real < abs(along) ** 2
    return 0 < fraction_of_arc(leg, point) < 1


def _line_line(first: Leg, second: Leg) -> list[complex]:
    a, b = first.end - first.start, second.end - second.start
    cross = (a.conjugate() * b).imag
    if abs(cross) <= 1e-14 * abs(a) * abs(b):
        return []
    t = ((second.start - first.start).conjugate() * b).imag / cross
    return [first.start + t * a]


def _line_circle(line: Leg, arc: Leg, tolerance: float) -> list[complex]:
    assert arc.center is not None
    radius = abs(arc.start - arc.center)
    direction = (line.end - line.start) / abs(line.end - line.start)
    foot = line.start + ((arc.center - line.start) * direction.conjugate()).real * direction
    distance = abs(foot - arc.center)
    if distance > radius + tolerance:
        return []
    half = math.sqrt(max(0.0, (radius - distance) * (radius + distance)))
    return [foot - half * direction, foot + half * direction]


def _circle_circle(first: Leg, second: Leg, tolerance: float) -> list[complex]:
    assert first.center is not None and second.center is not None
    r, s = abs(first.start - first.center), abs(second.start - second.center)
    between = second.center - first.center
    d = abs(between)
    if d <= tolerance or d > r + s + tolerance or d < abs(r - s) - tolerance:
        return []
    along = (d + (r - s) * (r + s) / d) / 2
    across = math.sqrt(max(0.0, (r - along) * (r + along)))
    return [first.center + between / d * complex(along, sign * across) for sign in (-1, 1)]


def coincide(first: Leg, second: Leg, tolerance: float) -> bool:
    """Legs with the same two ends that also have their middles in common."""
    if {first.start, first.end} != {second.start, second.end}:
        return False
    middles = [complex(leg.point(np.array(0.5))) for leg in (first, second)]
    return abs(middles[0] - middles[1]) <= 10 * tolerance


def enclosed_angle(leg: Leg, points: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Angle by which the ray from each point (off the leg) to the leg turns along it; exact, also close to an arc."""
    if leg.center is not None and abs(leg.sweep) > 0.9 * math.pi:
        first, second = leg.split(0.5, (1, 1))
        return enclosed_angle(first, points) + enclosed_angle(second, points)
    angle = np.angle((leg.end - points) / (leg.start - points))
    if leg.center is None:
        return angle
    # Between the chord and the arc the chord passes on the other side of the point.
    chord = leg.end - leg.start
    in_circle = abs(points - leg.center) < abs(leg.start - leg.center)
    beyond = ((points - leg.start) * np.conj(chord)).imag * leg.sweep < 0
    return angle + 2 * math.pi * math.copysign(1.0, leg.sweep) * (in_circle & beyond)


def winding_number(legs: list[Leg], points: NDArray[np.complex128]) -> NDArray[np.int64]:
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
        if leg.center is not None:
            total += abs(leg.start - leg.center) ** 2 * (leg.sweep - math.sin(leg.sweep)) / 2
    return total


def inner_points(leg: Leg, count: int = 5) -> NDArray[np.complex128]:
    """Points spread over the interior of the leg."""
    return leg.point((np.arange(count) + 0.5) / count)
