"""Curves drawn beside each other at a distance that nobody means: bodies that were to be joined, edges drawn twice."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pbem.errors import Fault
from pbem.geometry.boxes import Boxes
from pbem.geometry.curve import Curve, Leg
from pbem.geometry.intersection import project
from pbem.geometry.junction import format_point
from pbem.geometry.loop import Loops
from pbem.model.roles import Roles

# Faces nearer to each other than this part of the shorter of their legs are meant to be one.
COINCIDENT = 1e-5
# They run beside each other on this part of the shorter leg at least.
BESIDE = 1e-2
_FRACTIONS = np.linspace(0.0, 1.0, 9)


def find_coincidences(curves: Mapping[str, Curve], loops: Loops, roles: Roles) -> list[Fault]:
    """A fault for every two curves that all but coincide on a part of their length, with their distance.

    Left alone are faces of bodies that have a contact with each other, whose clearance may be as small as is liked, and
    the opposite sides of one body.
    """
    regions = _list_regions(loops, roles)
    contacts = {frozenset((roles.outer[one], roles.outer[other])) for one, other in roles.contacts.values()}
    legs = [(name, leg) for name, curve in curves.items() for leg in curve.legs]
    longest = max((leg.length for _, leg in legs), default=0.0)
    faults: dict[tuple[str, str], Fault] = {}
    at, other_at = Boxes.around_legs([leg for _, leg in legs], 0.5 * COINCIDENT * longest).find_pairs()
    for i, j in zip(at.tolist(), other_at.tolist(), strict=True):
        (one, leg), (other, second) = legs[i], legs[j]
        if one == other or (one, other) in faults or not _may_not_coincide(one, other, regions, contacts, roles):
            continue
        distance, point = _measure_beside(leg, second)
        if distance is not None:
            found = f"curve '{other}' beside curve '{one}', at most {distance:.3g} apart near {format_point(point)}"
            expected = (
                "one curve in both lists where they are joined or pressed, a contact between bodies that have a "
                f"clearance, or at least {COINCIDENT * min(leg.length, second.length):.1g} between them"
            )
            faults[one, other] = Fault.at(("curves", other), found, expected)
    return list(faults.values())


def _list_regions(loops: Loops, roles: Roles) -> dict[str, set[str]]:
    regions: dict[str, set[str]] = {name: {region} for name, region in roles.cracks.items()}
    for region, own in loops.items():
        for side in (side for loop in own for side in loop.sides):
            regions.setdefault(side.curve, set()).add(region)
    return regions


def _may_not_coincide(
    one: str, other: str, regions: Mapping[str, set[str]], contacts: set[frozenset[str]], roles: Roles
) -> bool:
    first, second = regions.get(one, set()), regions.get(other, set())
    if one in roles.cracks or other in roles.cracks:
        return bool(first & second)
    apart = not first & second
    return apart and not any(frozenset((a, b)) in contacts for a in first for b in second)


def _measure_beside(first: Leg, second: Leg) -> tuple[float | None, complex]:
    """Largest distance of two legs where they run beside each other, and the middle of that stretch; None if they do
    not, or are not near enough all along it."""
    shorter, other = sorted((first, second), key=lambda leg: leg.length)
    ends = sorted(project(shorter, end)[0] for end in (other.start, other.end))
    low, high = (0.0, 1.0) if _covers(other, shorter) else ends
    if high - low < BESIDE:
        return None, 0j
    points = shorter.point(low + (high - low) * _FRACTIONS)
    distance = max(project(other, complex(point))[1] for point in points)
    return (distance if distance < COINCIDENT * shorter.length else None), complex(points[len(points) // 2])


def _covers(other: Leg, shorter: Leg) -> bool:
    """Whether both ends of the shorter leg lie beside the inside of the other, where this one's ends say nothing."""
    return all(0.0 < project(other, end)[0] < 1.0 for end in (shorter.start, shorter.end))
