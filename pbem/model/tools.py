"""Rigid tools: which of their sides faces the bodies, and the regions that stand for them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from pbem.description.case import Case
from pbem.errors import Fault
from pbem.geometry.curve import Curve
from pbem.geometry.intersection import project
from pbem.geometry.loop import Loop, Loops, Side, side_legs
from pbem.model.material import Material, RigidSupport
from pbem.model.model import Region
from pbem.model.rigid_body import RigidBody, find_reference
from pbem.model.roles import Roles

# Points on a leg of a tool from which the body is looked at; near ones count most.
_FRACTIONS = (np.arange(9) + 0.5) / 9
_NEAR = 0.02


def check_tools(case: Case, roles: Roles) -> list[Fault]:
    """Faults of tools that touch nothing."""
    faults = []
    touching = {curve for contact in case.contacts.values() for curve in contact.between}
    for name, table in case.tools.items():
        for curve in (name, *table.curves):
            if curve in roles.outer and curve not in touching:
                found = f"curve '{curve}' of a tool in no contact"
                faults.append(Fault.at(("tools", name), found, f"a table [contacts.NAME] between '{curve}' and a body"))
    return faults


# Elements of a tool at least, at order 0 and above: its nodes have to tell a rotation from a translation, also those
# of the coarser mesh beside, whose elements are merged in pairs or have an order less.
LEAST_ELEMENTS = (4, 2)


def divide_tools(case: Case, curves: Mapping[str, Curve]) -> dict[str, Curve]:
    """The curves, with more elements on the longest leg of tools that have too few of them."""
    result = dict(curves)
    for name, table in case.tools.items():
        legs = [(leg.length, curve, number) for curve in (name, *table.curves) if curve in result
                for number, leg in enumerate(result[curve].legs)]
        lacking = LEAST_ELEMENTS[min(case.analysis.order, 1)] - sum(
            result[curve].legs[number].elements for _, curve, number in legs)
        if lacking > 0 and legs:
            _, curve, number = max(legs, key=lambda each: each[0])
            own = list(result[curve].legs)
            own[number] = replace(own[number], elements=own[number].elements + lacking)
            result[curve] = Curve(curve, tuple(own))
    return result


def orient_tools(case: Case, curves: Mapping[str, Curve], loops: Loops, roles: Roles) -> Loops:
    """The curves of every tool as loops by themselves, open or closed, travelled so that their normals face the bodies.
    """
    partners = {curve: other for pair in roles.contacts.values() for curve, other in (pair, pair[::-1])}
    sides = {side.curve: side for own in loops.values() for loop in own for side in loop.sides}
    made: Loops = {}
    for name, table in case.tools.items():
        own = [curve for curve in (name, *table.curves) if partners.get(curve) in sides and curve in curves]
        made[name] = tuple(
            Loop((Side(curve, _faces(curves, curve, sides[partners[curve]])),), True) for curve in own
        )
    return made


def _faces(curves: Mapping[str, Curve], tool: str, body: Side) -> bool:
    """Whether the normals of a tool's curve, as it is written, face the outward normals of a body's side."""
    legs, size = side_legs(curves, body), curves[tool].length
    total = 0.0
    for leg in curves[tool].legs:
        points = leg.point(_FRACTIONS)
        for point, normal in zip(points, leg.normals(points), strict=True):
            nearest = min(legs, key=lambda each: project(each, complex(point))[1])
            fraction, distance = project(nearest, complex(point))
            outward = nearest.normals(nearest.point(np.array([fraction])))[0]
            total += leg.length * float((np.conj(outward) * normal).real) / (distance / size + _NEAR) ** 2
    return total <= 0


def make_tool_regions(
    case: Case, curves: Mapping[str, Curve], bodies: Mapping[str, RigidBody], loops: Loops
) -> tuple[Region, ...]:
    """A region for every tool. Its moduli, those of the stiffest material, only set the size of numbers."""
    used = [case.materials[table.material] for table in case.regions.values()]
    stiffest = max(used, key=lambda table: table.young)
    made = []
    for name in case.tools:
        body = bodies[name]
        forced = tuple(kind == "force" for kind in body.known)
        support = RigidSupport((forced[0], forced[1], forced[2]), find_reference(body, curves, 0j))
        material = Material(f"{name} (rigid)", stiffest.young, stiffest.poisson, stiffest.plane, rigid=support)
        made.append(Region(name, material, loops[name]))
    return tuple(made)


def move_tool(region: Region, origin: complex) -> Region:
    """The region in coordinates about another point."""
    support = region.material.rigid
    if support is None:
        return region
    moved = replace(support, about=support.about - origin)
    return replace(region, material=replace(region.material, rigid=moved))
