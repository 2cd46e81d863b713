"""Regions that lie in one another: where they must not meet at all, and where contacts let them touch."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from pbem.case import Case
from pbem.errors import Fault
from pbem.model.curve import Curve, Leg
from pbem.model.intersection import (
    inner_points,
    measure_distances,
    meeting_points,
    project,
    surround,
    winding_number,
)
from pbem.model.junction import format_point
from pbem.model.loop import Loops, loop_legs
from pbem.model.model import Loop
from pbem.model.roles import Roles

Complex = NDArray[np.complex128]


@dataclass(frozen=True)
class _Body:
    """A region's loops, their legs, which curves they travel forward or backward, and its box (low, high corner)."""

    name: str
    sides: Mapping[str, bool]
    legs: list[Leg]
    infinite: bool
    low: complex
    high: complex

    def find_depth(self, points: Complex) -> NDArray[np.float64]:
        """How deep points lie inside; zero on the boundary and outside."""
        depths = measure_distances(self.legs, points)
        off = depths > 0
        depths[off] *= winding_number(self.legs, points[off]) == (0 if self.infinite else 1)
        return depths


def _make_body(case: Case, curves: Mapping[str, Curve], name: str, loops: tuple[Loop, ...]) -> _Body:
    legs = loop_legs(curves, loops)
    infinite = case.regions[name].infinite
    low, high = (complex(-np.inf, -np.inf), complex(np.inf, np.inf)) if infinite else surround(legs)
    return _Body(name, {side.curve: side.forward for loop in loops for side in loop.sides}, legs, infinite, low, high)


def find_overlaps(case: Case, curves: Mapping[str, Curve], loops: Loops, roles: Roles, tolerance: float) -> list[Fault]:
    """Regions that lie on the same side of a shared curve, or one inside another that does not have it as a hole.

    Curves that are in contact with one of the other region are left to `check_contacts`.
    """
    faults = []
    bodies = [_make_body(case, curves, name, own) for name, own in loops.items()]
    boxes = {name: surround(curve.legs) for name, curve in curves.items()}
    touching = {curve: other for pair in roles.contacts.values() for curve, other in (pair, pair[::-1])}
    for first, second in _pair_near(bodies):
        found = _overlap(curves, boxes, first, second, touching, tolerance)
        if found:
            expected = "regions side by side; the loop of a region inside another belongs in the boundary of both"
            text = f"region '{second.name}' overlapping region '{first.name}' ({found})"
            faults.append(case.fault(("regions", second.name, "boundary"), text, expected))
    return faults


def _pair_near(bodies: list[_Body]) -> Iterator[tuple[_Body, _Body]]:
    """Pairs whose boxes meet, each in the order of the file; two infinite regions are a fault of their own."""
    low = np.array([body.low for body in bodies])
    high = np.array([body.high for body in bodies])
    for i, body in enumerate(bodies):
        near = (low.real <= body.high.real) & (low.imag <= body.high.imag)
        near &= (high.real >= body.low.real) & (high.imag >= body.low.imag)
        for j in np.flatnonzero(near[i + 1:]):
            other = bodies[i + 1 + int(j)]
            if not (body.infinite and other.infinite):
                yield body, other


def _overlap(
    curves: Mapping[str, Curve],
    boxes: Mapping[str, tuple[complex, complex]],
    first: _Body,
    second: _Body,
    touching: Mapping[str, str],
    tolerance: float,
) -> str:
    for curve, forward in first.sides.items():
        if second.sides.get(curve) == forward:
            return f"both lie on the same side of '{curve}'"
    for body, other in ((first, second), (second, first)):
        for curve in other.sides:
            low, high = boxes[curve]
            beside = high.real < body.low.real or low.real > body.high.real
            apart = beside or high.imag < body.low.imag or low.imag > body.high.imag
            if apart or curve in body.sides or touching.get(curve) in body.sides:
                continue
            points = np.concatenate([inner_points(leg, 1) for leg in curves[curve].legs])
            if (body.find_depth(points) > tolerance).any():
                return f"'{curve}' lies inside"
    return ""


def check_contacts(
    case: Case, curves: Mapping[str, Curve], loops: Loops, roles: Roles, tolerance: float
) -> list[Fault]:
    """A fault for every contact one of whose curves begins inside the other's region, with the deepest place found."""
    faults = []
    for name, (first, second) in roles.contacts.items():
        for curve, other in ((first, second), (second, first)):
            region = roles.outer[other]
            if region not in loops or region == roles.outer[curve] or curve not in curves:
                continue
            depth, point = _find_deepest(curves[curve], _make_body(case, curves, region, loops[region]))
            if depth > tolerance:
                found = f"curve '{curve}' inside region '{region}', {depth:.3g} deep at {format_point(point)}"
                expected = "bodies that at most touch before they are loaded"
                faults.append(case.fault(("contacts", name), found, expected))
                break
    return faults


def _find_deepest(curve: Curve, body: _Body) -> tuple[float, complex]:
    """Deepest of some points of the curve, of which one at least lies on every piece between two meeting points."""
    points = np.concatenate([
        np.concatenate([[leg.start, leg.end], inner_points(leg), _separate(leg, body.legs)]) for leg in curve.legs
    ])
    depths = body.find_depth(points)
    at = int(np.argmax(depths))
    return float(depths[at]), complex(points[at])


def _separate(leg: Leg, others: Sequence[Leg]) -> Complex:
    """The middles of the pieces into which other legs divide a leg, where they cross it or come nearest with an end."""
    cuts = {0.0, 1.0}
    for other in others:
        meetings = [*meeting_points(leg, other, 0.0), other.start]
        cuts |= {project(leg, point)[0] for point in meetings}
    ends = sorted(cuts)
    return leg.point(np.array([(a + b) / 2 for a, b in pairwise(ends)]))
