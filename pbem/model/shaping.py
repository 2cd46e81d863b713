"""From the curves of a case to chains of legs whose common ends are exactly equal."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pbem.description.case import Case
from pbem.description.values import MOST_ELEMENTS
from pbem.errors import Fault
from pbem.geometry.curve import Curve
from pbem.geometry.shape import join_ends, measure_extent, shape_legs
from pbem.geometry.tolerance import ROUNDINGS, Tolerance
from pbem.model.roles import Roles

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
        legs = shape_legs(table)
        if isinstance(legs, Fault):
            wrong = ("curves", name, *(["expression"] if table.expression else []))
            faults.append(case.fault(wrong, legs.found, legs.expected))
            continue
        curves[name] = Curve(name, legs)
    size, largest = measure_extent(curves)
    tolerance = make_tolerance(curves, roles, largest)
    if curves and not size > SMALLEST:
        found = f"curves with an extent of {size:g}"
        faults.append(case.fault(("curves",), found, f"a model larger than {SMALLEST:g}"))
        return Shapes({}, size, tolerance, tuple(faults))
    curves, short = join_ends(curves, tolerance)
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


def make_tolerance(curves: Mapping[str, Curve], roles: Roles, largest: float) -> Tolerance:
    """largest: the largest coordinate of all curves."""
    regions = {name: frozenset((region,)) for name, region in (*roles.outer.items(), *roles.cracks.items())}
    regions |= {name: frozenset(pair) for name, pair in roles.shared.items()}
    contacts = frozenset(frozenset((roles.outer[a], roles.outer[b])) for a, b in roles.contacts.values())
    rounding = ROUNDINGS * float(np.finfo(float).eps) * largest
    return Tolerance({name: curve.length for name, curve in curves.items()}, rounding, regions, contacts)
