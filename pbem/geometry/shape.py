"""The shapes of curves, polylines, circles, arcs and curves by expressions, as chains of legs with equal ends."""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from pbem.arrays import Real
from pbem.errors import Fault
from pbem.geometry.curve import Curve, Leg
from pbem.geometry.elements import Elements
from pbem.geometry.expression import ExpressionError, read_expression
from pbem.geometry.tolerance import TIE, Tolerance, join_points

# Degrees that one circular element may turn by: beyond, its shape functions are far from polynomials of the arc length.
WIDEST_ARC = 45.0
# An element of a curve by expressions is straight if it turns by less (radians), or if the curve leaves the arc by more
# than this part of its rise: the two halves of a corner do by 0.25.
LEAST_BENT, ROUND = 1e-4, 0.15
# Parts of an element at whose ends it is looked whether a curve turns within.
LOOKED_AT = 12
# Squares of coordinates must not overflow.
LARGEST = 1e100


def measure_extent(curves: Mapping[str, Curve]) -> tuple[float, float]:
    """Largest extent of all curves, and their largest coordinate."""
    if not curves:
        return 0.0, 0.0
    points = Elements.collect([leg for curve in curves.values() for leg in curve.legs]).extremes()
    extents = points.real.max() - points.real.min(), points.imag.max() - points.imag.min()
    return float(max(extents)), float(np.abs(points).max())


def share(total: int, lengths: Sequence[float]) -> list[int]:
    """Split a number of elements in proportion to lengths, at least one each (more than the total only for that).

    Of lengths that are equal but for rounding, which the units and the place of a model decide, the first gets more.
    """
    whole = sum(lengths)
    wanted = [total * length / whole for length in lengths]
    counts = [max(1, math.floor(want + 1e-9)) for want in wanted]
    while sum(counts) < total:
        worst = max(range(len(counts)), key=lambda i: (round(wanted[i] - counts[i], 9), -i))
        counts[worst] += 1
    while sum(counts) > max(total, len(counts)):
        several = (i for i in range(len(counts)) if counts[i] > 1)
        worst = max(several, key=lambda i: (round(counts[i] - wanted[i], 9), i))
        counts[worst] -= 1
    return counts


@dataclass(frozen=True)
class Division:
    """How a curve is divided into elements.

    elements: their number, or one for each leg; size: or a length that none exceeds. power: element ends lie at t^power
    from a refined end; refine_start, refine_end: of curves by expressions, whose elements are their legs.
    """

    elements: int | tuple[int, ...] | None = None
    size: float | None = None
    power: float = 3.0
    refine_start: bool = False
    refine_end: bool = False

    def count(self, lengths: Sequence[float]) -> list[int]:
        """Numbers of elements on legs of these lengths."""
        if self.size is not None:
            return [max(1, math.ceil(min(length / self.size, 1e9) - 1e-9)) for length in lengths]
        if isinstance(self.elements, tuple):
            return list(self.elements)
        assert self.elements is not None, "elements or size"
        return share(self.elements, lengths)


def draw_expression(name: str, texts: tuple[str, str], division: Division) -> Curve | Fault:
    """A curve of x and y as functions of t from 0 to 1: one leg for each element, between points of the curve; t is
    uniform unless the division says more. See `_bend`."""
    path = ("curves", name, "expression")
    count = sum(division.count([1.0]))
    ends = _divide_parameter(division, count)
    t = np.append((ends[:-1, None] + np.diff(ends)[:, None] * np.arange(4) / 4).ravel(), ends[-1])
    try:
        x, y = (read_expression(text, t=t) for text in texts)
    except ExpressionError as error:
        return Fault.at(path, error.found, error.expected)
    for axis, values in (("x", x), ("y", y)):
        wrong = ~(np.abs(values) <= LARGEST)
        if wrong.any():
            at = 4 * int(np.argmax(wrong[::4])) if wrong[::4].any() else int(np.argmax(wrong))
            found = f"{axis} = {values[at]:g} at t = {t[at]:g}"
            return Fault.at(path, found, f"a number of at most {LARGEST:g} everywhere")
    points = (np.zeros(len(t)) + x + 1j * y).tolist()
    return Curve(name, tuple(_bend(points[at:at + 5]) for at in range(0, 4 * count, 4)))


def measure_straight(texts: tuple[str, str], division: Division, curve: Curve) -> float:
    """The largest angle (degrees) by which a curve, drawn by `draw_expression`, turns within an element that is
    straight; 0 if none is. Corners at the ends of elements are not within."""
    count = len(curve.legs)
    ends = _divide_parameter(division, count)
    t = ends[:-1, None] + np.diff(ends)[:, None] * np.linspace(0.0, 1.0, LOOKED_AT + 1)
    with np.errstate(all="ignore"):
        try:
            x, y = ((np.zeros(t.size) + read_expression(text, t=t.ravel())).reshape(t.shape) for text in texts)
        except ExpressionError:  # between the points that the curve was drawn through
            return 0.0
        chord = np.diff(x + 1j * y, axis=1)
        turns = np.abs(np.angle(chord[:, 1:] / chord[:, :-1]))
    # Chords leave out what the curve turns by in halves of the first and of the last.
    total = np.degrees(turns.sum(axis=1) + 0.5 * (turns[:, 0] + turns[:, -1]))
    straight = np.array([leg.center is None for leg in curve.legs])
    return float(np.nanmax(np.where(straight & np.isfinite(total), total, 0.0), initial=0.0))


def _divide_parameter(division: Division, count: int) -> Real:
    """t (count + 1,) at the ends of the elements of a curve by expressions."""
    return Leg(0j, 1 + 0j, count, division.refine_start, division.refine_end, division.power).element_fractions()


def _bend(points: Sequence[complex]) -> Leg:
    """A leg of one element through the first, the middle and the last of five points: an arc, as a chord leads away
    from the ends in wrong directions. Straight where the others tell of a corner or of an inflection."""
    start, before, middle, after, end = points
    straight = Leg(start, end, 1)
    if middle in (start, end) or start == end:
        return straight
    sweep = 2 * cmath.phase((end - middle) / (middle - start))
    if not LEAST_BENT <= abs(sweep) <= math.radians(WIDEST_ARC) * (1 + TIE):
        return straight
    center = 0.5 * (start + end) + 0.5j * (end - start) / math.tan(0.5 * sweep)
    rise, radius = abs(middle - 0.5 * (start + end)), abs(start - center)
    if max(abs(abs(each - center) - radius) for each in (before, after)) > ROUND * rise:
        return straight
    return Leg(start, end, 1, center=center, sweep=sweep)


def draw_polyline(name: str, points: Sequence[complex], division: Division) -> Curve:
    """Straight legs from point to point; legs without length are found when curves are joined."""
    lengths = [abs(b - a) for a, b in pairwise(points)]
    if sum(lengths) == 0:
        return Curve(name, tuple(Leg(a, b, 1) for a, b in pairwise(points)))
    counts = division.count(lengths)
    return Curve(name, tuple(
        Leg(a, b, count, power=division.power)
        for a, b, count in zip(points, points[1:], counts, strict=False)
    ))


def draw_circle(
    name: str, center: complex, radius: float, division: Division, angles: tuple[float, float] | None = None
) -> Curve | Fault:
    """A circle, or the arc between two angles (degrees), counter-clockwise if the second is larger.

    An arc is one leg; a full circle four, cut between elements so that these are all equal (if eight or more).
    """
    path = ("curves", name)
    first, last = angles or (0.0, 360.0)
    begin, sweep = math.radians(first), math.radians(last - first)
    count = division.count([radius * abs(sweep)])[0]
    start = _point_on_circle(center, radius, first)
    if abs(abs(start - center) - radius) > 1e-3 * radius:
        found = f"radius = {radius:g}, lost in the rounding of the center"
        return Fault.at(path, found, "a circle that is larger relative to its distance from the origin")
    turn = abs(last - first)
    needed = math.ceil(turn / WIDEST_ARC - 1e-9)
    if division.size is not None:
        count = max(needed, count)
    if count < needed:
        what = "a circle" if turn == 360 else f"an arc of {turn:g} degrees"
        found = f"{count} element{'s' if count > 1 else ''} around {what}"
        return Fault.at(path, found, f"at least {needed}: an element may turn by {WIDEST_ARC:g} degrees")
    if turn < 360:
        end = _point_on_circle(center, radius, last)
        return Curve(name, (Leg(start, end, count, power=division.power, center=center, sweep=sweep),))
    legs, done, here = [], 0, start
    for number in share(count, [1.0] * 4):
        done += number
        there = start if done == count else center + radius * cmath.exp(1j * (begin + sweep * done / count))
        part = sweep * number / count
        legs.append(Leg(here, there, number, power=division.power, center=center, sweep=part))
        here = there
    return Curve(name, tuple(legs))


def _point_on_circle(center: complex, radius: float, degrees: float) -> complex:
    """Exact at multiples of 90 degrees, where users write the same point by hand."""
    quarter, rest = divmod(degrees, 90.0)
    direction = (1, 1j, -1, -1j)[int(quarter) % 4] * cmath.exp(1j * math.radians(rest))
    return center + radius * direction


def join_ends(curves: Mapping[str, Curve], tolerance: Tolerance) -> tuple[dict[str, Curve], list[tuple[str, int]]]:
    """Replace every end by the first point of the file that is the same; also name legs that shrink to a point."""
    points = np.array([point for curve in curves.values() for leg in curve.legs for point in (leg.start, leg.end)])
    owners = [name for name, curve in curves.items() for _ in range(2 * len(curve.legs))]
    joined, number = join_points(points, owners, tolerance) if len(points) else points, 0
    result, short = {}, []
    for name, curve in curves.items():
        legs = []
        for index, leg in enumerate(curve.legs):
            start, end = complex(joined[number]), complex(joined[number + 1])
            number += 2
            if start == end and not abs(leg.turn) > math.pi:
                short.append((name, index + 1))
            # An arc goes through its ends; one that closes upon itself has no chord to be laid over.
            legs.append(replace(leg, start=start, end=end) if start == end else leg.tie(start, end))
        result[name] = Curve(name, tuple(legs))
    return result, list({name: (name, index) for name, index in reversed(short)}.values())


@dataclass(frozen=True)
class Outline:
    """Legs as one curve of a case: the points of a polyline, or a circle, or an arc of it between angles (degrees).

    legs: how many of the chain it stands for.
    """

    points: tuple[complex, ...]
    legs: int
    center: complex = 0j
    radius: float = 0.0
    angles: tuple[float, float] | None = None

    @property
    def straight(self) -> bool:
        """Whether it is a polyline."""
        return self.radius == 0.0


def outline(legs: Sequence[Leg], same: float) -> list[Outline]:
    """Chains of legs as curves that a case can have: straight ones together, and those of one circle together.

    same: length up to which circles' centres and radii are the same.
    """
    outlines = []
    first = 0
    while first < len(legs):
        leg = legs[first]
        last = first + 1
        if leg.sweep == 0:
            while last < len(legs) and legs[last].sweep == 0:
                last += 1
            outlines.append(Outline((leg.start, *(each.end for each in legs[first:last])), last - first))
        else:
            turn = leg.sweep
            while last < len(legs) and legs[last].sweep * leg.sweep > 0 and _share_circle(leg, legs[last], same) and (
                abs(turn + legs[last].sweep) < 2 * math.pi + 1e-9
            ):
                turn += legs[last].sweep
                last += 1
            outlines.append(_outline_circle(leg, legs[last - 1], turn, last - first))
        first = last
    return outlines


def _share_circle(one: Leg, other: Leg, same: float) -> bool:
    assert one.center is not None and other.center is not None
    radii = abs(one.start - one.center), abs(other.start - other.center)
    return abs(one.center - other.center) <= same and abs(radii[0] - radii[1]) <= same


def _outline_circle(first: Leg, last: Leg, turn: float, legs: int) -> Outline:
    assert first.center is not None
    center, radius = first.center, abs(first.start - first.center)
    begin = math.degrees(cmath.phase(first.start - center))
    # A full circle begins at the angle 0 in a case, which splits it where others meet it elsewhere.
    if abs(turn) > 2 * math.pi - 1e-9 and first.start == last.end:
        return Outline((first.start, last.end), legs, center, radius)
    return Outline((first.start, last.end), legs, center, radius, (begin, begin + math.degrees(turn)))
