"""Where the carriers of two legs, lines or circles, meet."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

from pbem.geometry.elements.array import ARC, STRAIGHT, choose_kind
from pbem.geometry.elements.kind import Kind, Shape


def cross_carriers(first: Shape, second: Shape, tolerance: float) -> list[complex]:
    """Points where the carriers cross or touch, circles within the tolerance."""
    kinds = choose_kind(first), choose_kind(second)
    if kinds in MEETINGS:
        return MEETINGS[kinds](first, second, tolerance)
    return MEETINGS[kinds[::-1]](second, first, tolerance)


def _line_line(first: Shape, second: Shape, tolerance: float) -> list[complex]:
    a, b = first.end - first.start, second.end - second.start
    cross = (a.conjugate() * b).imag
    if abs(cross) <= 1e-14 * abs(a) * abs(b):
        return []
    t = ((second.start - first.start).conjugate() * b).imag / cross
    return [first.start + t * a]


def _line_circle(line: Shape, arc: Shape, tolerance: float) -> list[complex]:
    radius = abs(arc.start - arc.center)
    direction = (line.end - line.start) / abs(line.end - line.start)
    foot = line.start + ((arc.center - line.start) * direction.conjugate()).real * direction
    distance = abs(foot - arc.center)
    if distance > radius + tolerance:
        return []
    half = math.sqrt(max(0.0, (radius - distance) * (radius + distance)))
    return [foot - half * direction, foot + half * direction]


def _circle_circle(first: Shape, second: Shape, tolerance: float) -> list[complex]:
    r, s = abs(first.start - first.center), abs(second.start - second.center)
    between = second.center - first.center
    d = abs(between)
    if d <= tolerance or d > r + s + tolerance or d < abs(r - s) - tolerance:
        return []
    along = (d + (r - s) * (r + s) / d) / 2
    across = math.sqrt(max(0.0, (r - along) * (r + along)))
    return [first.center + between / d * complex(along, sign * across) for sign in (-1, 1)]


MEETINGS: Mapping[tuple[Kind, Kind], Callable[[Shape, Shape, float], list[complex]]] = {
    (STRAIGHT, STRAIGHT): _line_line,
    (STRAIGHT, ARC): _line_circle,
    (ARC, ARC): _circle_circle,
}
