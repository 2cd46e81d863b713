"""From the curves of a case to chains of legs whose common ends are exactly equal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pbem.arrays import Complex
from pbem.description.case import Case
from pbem.description.schema import CurveTable
from pbem.description.values import MOST_ELEMENTS
from pbem.errors import Fault
from pbem.geometry.arc_ends import MovedEnd, meet_arcs
from pbem.geometry.curve import Curve
from pbem.geometry.junction import format_point
from pbem.geometry.shape import (
    WIDEST_ARC,
    Division,
    draw_circle,
    draw_expression,
    draw_polyline,
    join_ends,
    measure_extent,
    measure_straight,
)
from pbem.geometry.tolerance import Tolerance, make_tolerance
from pbem.model.roles import Roles
from pbem.wording import list_names

# Squares of lengths must not underflow.
SMALLEST = 1e-100
# Ends and curves that are named in one note.
MOST_NAMED = 8
# Straight elements of curves that turn by more (degrees) within them are told.
MOST_STRAIGHT = 15.0


@dataclass(frozen=True)
class Shapes:
    """curves: in the order of the file, without those that have faults; tolerance: which points agree; notes: for the
    user, of ends that were moved and of straight elements on curves that turn."""

    curves: Mapping[str, Curve]
    size: float
    tolerance: Tolerance
    faults: tuple[Fault, ...]
    notes: tuple[str, ...] = ()


def shape_curves(case: Case, roles: Roles) -> Shapes:
    """Build every curve; joined ends are made exactly equal. Elements are counted per leg, nothing is graded yet."""
    faults: list[Fault] = []
    curves: dict[str, Curve] = {}
    for name, table in case.curves.items():
        curve = _draw(name, table)
        if isinstance(curve, Fault):
            faults.append(curve)
        else:
            curves[name] = curve
    straight = _note_straight(case, curves)
    size, largest = measure_extent(curves)
    tolerance = _find_tolerance(curves, roles, largest)
    if curves and not size > SMALLEST:
        found = f"curves with an extent of {size:g}"
        faults.append(Fault.at(("curves",), found, f"a model larger than {SMALLEST:g}"))
        return Shapes({}, size, tolerance, tuple(faults))
    curves, short = join_ends(curves, tolerance)
    for name, number in short:
        loc = ("curves", name, "points", number) if case.curves[name].points else ("curves", name)
        found = "a leg without length (the same point twice)"
        if case.curves[name].expression:
            found = f"element {number} without length (the same point twice)"
        faults.append(Fault.at(loc, found, "points that differ"))
        del curves[name]
    for name, curve in list(curves.items()):
        total = sum(leg.elements for leg in curve.legs)
        if total > MOST_ELEMENTS:
            key = "size" if case.curves[name].size else "elements"
            expected = f"at most {MOST_ELEMENTS} on one curve"
            faults.append(Fault.at(("curves", name, key), f"{total} elements", expected))
            del curves[name]
    curves, moved = meet_arcs({name: table.boundary for name, table in case.regions.items()}, curves)
    return Shapes(curves, size, tolerance, tuple(faults), (*_describe_moved(moved), *straight))


def _describe_moved(moved: Sequence[MovedEnd]) -> list[str]:
    if not moved:
        return []
    said = [f"'{each.curve}' to {format_point(each.point)} by {each.distance:.2g}" for each in moved[:MOST_NAMED]]
    more = len(moved) - len(said)
    return [f"Ends written with few digits were moved to the ends of arcs: {', '.join(said)}"
            f"{f', and {more} more' if more else ''}."]


def _note_straight(case: Case, curves: Mapping[str, Curve]) -> list[str]:
    """Elements of curves by expressions that stay straight where the curve turns: where a crack ends so, it leads in a
    direction that is off by half of what the element should turn by."""
    drawn = {name: table.expression for name, table in case.curves.items() if table.expression and name in curves}
    turns = {name: measure_straight(texts, _read_division(case.curves[name]), curves[name])
             for name, texts in drawn.items()}
    told = {name: turn for name, turn in turns.items() if turn > MOST_STRAIGHT}
    if not told:
        return []
    return [f"Curves by expressions turn by up to {max(told.values()):.3g} degrees within elements that are straight: "
            f"{list_names([repr(name) for name in told], MOST_NAMED)}. Factors, stresses and reactions may be far off, "
            f"which estimates do not tell. Elements that turn by less than {WIDEST_ARC:g} degrees in one sense are "
            "arcs, and corners need ends of elements: give more of them."]


def _find_tolerance(curves: Mapping[str, Curve], roles: Roles, largest: float) -> Tolerance:
    """largest: the largest coordinate of all curves."""
    regions = {name: frozenset((region,)) for name, region in (*roles.outer.items(), *roles.cracks.items())}
    regions |= {name: frozenset(pair) for name, pair in roles.shared.items()}
    contacts = frozenset(frozenset((roles.outer[a], roles.outer[b])) for a, b in roles.contacts.values())
    return make_tolerance(curves, largest, regions, contacts)


def _draw(name: str, table: CurveTable) -> Curve | Fault:
    division = _read_division(table)
    if table.expression is not None:
        return draw_expression(name, table.expression, division)
    if table.center is not None:
        assert table.radius is not None
        return draw_circle(name, complex(*table.center), table.radius, division, table.angles)
    assert table.points is not None
    return draw_polyline(name, [complex(*point) for point in table.points], division)


def _read_division(table: CurveTable) -> Division:
    refine_start, refine_end = (table.grading in (end, "both") for end in ("start", "end"))
    return Division(table.elements, table.size, table.power, refine_start, refine_end)


def find_corners(case: Case) -> Complex:
    """Lower left, lower right and upper left of a rectangle that has the points of all curves."""
    points = [complex(*point) for curve in case.curves.values() for point in curve.points or ()]
    for curve in case.curves.values():
        if curve.center is not None and curve.radius is not None:
            points += [complex(*curve.center) + curve.radius * each for each in (-1 - 1j, 1 + 1j)]
    x, y = [point.real for point in points or [0j]], [point.imag for point in points or [0j]]
    width, height = max(x) - min(x) or max(y) - min(y) or 1.0, max(y) - min(y) or max(x) - min(x) or 1.0
    return complex(min(x), min(y)) + np.array([0, width, 1j * height])
