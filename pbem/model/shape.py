"""From the curves of the case file to chains of legs whose common ends are exactly equal."""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from pbem.case import Case
from pbem.case.schema import CurveTable
from pbem.case.values import LARGEST, MOST_ELEMENTS
from pbem.errors import Fault
from pbem.model.curve import Curve, Leg
from pbem.model.expression import ExpressionError, evaluate_expression
from pbem.model.intersection import extremes
from pbem.model.roles import Roles
from pbem.model.tolerance import Tolerance, join_points, make_tolerance

# Degrees that one circular element may turn by: beyond, its shape functions are far from polynomials of the arc length.
WIDEST_ARC = 45.0
# Squares of lengths must not underflow.
SMALLEST = 1e-100


@dataclass(frozen=True)
class Shapes:
    """curves: in the order of the file, without those that have faults; tolerance: which points agree."""

    curves: Mapping[str, Curve]
    size: float
    tolerance: Tolerance
    faults: tuple[Fault, ...]


def shape_curves(case: Case, roles: Roles) -> Shapes:
    """Build every curve; joined ends are made exactly equal. Elements are counted per leg, nothing is graded yet."""
    faults: list[Fault] = []
    curves: dict[str, Curve] = {}
    for name, table in case.curves.items():
        legs = _shape_legs(table)
        if isinstance(legs, Fault):
            wrong = ("curves", name, *(["expression"] if table.expression else []))
            faults.append(case.fault(wrong, legs.found, legs.expected))
            continue
        curves[name] = Curve(name, legs)
    size, largest = _measure(curves)
    tolerance = make_tolerance(curves, roles, largest)
    if curves and not size > SMALLEST:
        found = f"curves with an extent of {size:g}"
        faults.append(case.fault(("curves",), found, f"a model larger than {SMALLEST:g}"))
        return Shapes({}, size, tolerance, tuple(faults))
    curves, short = _join(curves, tolerance)
    for name, number in short:
        loc = ("curves", name, "points", number) if case.curves[name].points else ("curves", name)
        found = "a leg without length (the same point twice)"
        if case.curves[name].expression:
            found = f"element {number} without length (the same point twice)"
        faults.append(case.fault(loc, found, "points that differ"))
        del curves[name]
    for name, curve in list(curves.items()):
        total = sum(leg.elements for leg in curve.legs)
        if total > MOST_ELEMENTS:
            key = "size" if case.curves[name].size else "elements"
            expected = f"at most {MOST_ELEMENTS} on one curve"
            faults.append(case.fault(("curves", name, key), f"{total} elements", expected))
            del curves[name]
    return Shapes(curves, size, tolerance, tuple(faults))


def _measure(curves: Mapping[str, Curve]) -> tuple[float, float]:
    """Largest extent of all curves, and their largest coordinate."""
    if not curves:
        return 0.0, 0.0
    points = np.concatenate([extremes(leg) for curve in curves.values() for leg in curve.legs])
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


def _count_elements(table: CurveTable, lengths: Sequence[float]) -> list[int]:
    if table.size is not None:
        return [max(1, math.ceil(min(length / table.size, 1e9) - 1e-9)) for length in lengths]
    if isinstance(table.elements, tuple):
        return list(table.elements)
    assert table.elements is not None
    return share(table.elements, lengths)


def _shape_legs(table: CurveTable) -> tuple[Leg, ...] | Fault:
    if table.expression is not None:
        return _expression_legs(table)
    return _circular_legs(table) if table.center is not None else _straight_legs(table)


def _expression_legs(table: CurveTable) -> tuple[Leg, ...] | Fault:
    """One straight leg for each element, between points of the curve; t is uniform unless the grading says more."""
    assert table.expression is not None
    count = table.elements[0] if isinstance(table.elements, tuple) else table.elements
    assert count is not None
    refine_start, refine_end = (table.grading in (end, "both") for end in ("start", "end"))
    t = Leg(0j, 1 + 0j, count, refine_start, refine_end, table.power).element_fractions()
    try:
        x, y = (evaluate_expression(text, t=t) for text in table.expression)
    except ExpressionError as error:
        return Fault("", error.found, error.expected)
    for axis, values in (("x", x), ("y", y)):
        wrong = ~(np.abs(values) <= LARGEST)
        if wrong.any():
            at = int(np.argmax(wrong))
            return Fault("", f"{axis} = {values[at]:g} at t = {t[at]:g}", f"a number of at most {LARGEST:g} everywhere")
    points = (x + 1j * y).tolist()
    return tuple(Leg(a, b, 1) for a, b in pairwise(points))


def _straight_legs(table: CurveTable) -> tuple[Leg, ...]:
    assert table.points is not None
    points = [complex(*point) for point in table.points]
    lengths = [abs(b - a) for a, b in pairwise(points)]
    if sum(lengths) == 0:
        return tuple(Leg(a, b, 1) for a, b in pairwise(points))
    counts = _count_elements(table, lengths)
    return tuple(
        Leg(a, b, count, power=table.power)
        for a, b, count in zip(points, points[1:], counts, strict=False)
    )


def _circular_legs(table: CurveTable) -> tuple[Leg, ...] | Fault:
    """An arc is one leg; a full circle four, cut between elements so that these are all equal (if eight or more)."""
    assert table.center is not None and table.radius is not None
    angles = table.angles or (0.0, 360.0)
    center, begin, sweep = complex(*table.center), math.radians(angles[0]), math.radians(angles[1] - angles[0])
    count = _count_elements(table, [table.radius * abs(sweep)])[0]
    start = _point_on_circle(center, table.radius, angles[0])
    if abs(abs(start - center) - table.radius) > 1e-3 * table.radius:
        found = f"radius = {table.radius:g}, lost in the rounding of the center"
        return Fault("", found, "a circle that is not so small against its distance from the origin")
    turn = abs(angles[1] - angles[0])
    needed = math.ceil(turn / WIDEST_ARC - 1e-9)
    if table.size is not None:
        count = max(needed, count)
    if count < needed:
        what = "a circle" if turn == 360 else f"an arc of {turn:g} degrees"
        found = f"{count} element{'s' if count > 1 else ''} around {what}"
        return Fault("", found, f"at least {needed}: an element may turn by {WIDEST_ARC:g} degrees")
    if turn < 360:
        end = _point_on_circle(center, table.radius, angles[1])
        return (Leg(start, end, count, power=table.power, center=center, sweep=sweep),)
    legs, done, here = [], 0, start
    for number in share(count, [1.0] * 4):
        done += number
        there = start if done == count else center + table.radius * cmath.exp(1j * (begin + sweep * done / count))
        part = sweep * number / count
        legs.append(Leg(here, there, number, power=table.power, center=center, sweep=part))
        here = there
    return tuple(legs)


def _point_on_circle(center: complex, radius: float, degrees: float) -> complex:
    """Exact at multiples of 90 degrees, where users write the same point by hand."""
    quarter, rest = divmod(degrees, 90.0)
    direction = (1, 1j, -1, -1j)[int(quarter) % 4] * cmath.exp(1j * math.radians(rest))
    return center + radius * direction


def _join(curves: Mapping[str, Curve], tolerance: Tolerance) -> tuple[dict[str, Curve], list[tuple[str, int]]]:
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
            whole = leg.center is not None and abs(leg.sweep) > math.pi
            if start == end and not whole:
                short.append((name, index + 1))
            legs.append(replace(leg, start=start, end=end))
        result[name] = Curve(name, tuple(legs))
    return result, list({name: (name, index) for name, index in reversed(short)}.values())
