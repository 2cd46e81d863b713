"""Cracks: inside their region, meeting other curves with their ends only, and which of their ends are tips."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

import numpy as np

from pbem.case import Case
from pbem.errors import Fault
from pbem.model.boxes import Boxes
from pbem.model.curve import Curve
from pbem.model.intersection import inner_points, project
from pbem.model.junction import format_point
from pbem.model.loop import Loops, is_inside, loop_legs
from pbem.model.model import Loop

# A tip nearer to another curve than this part of the model's size is taken for a slip of the pen.
NEAR_MISS = 1e-6


class _Groups:
    """Points joined into groups (disjoint sets)."""

    def __init__(self) -> None:
        self.parent: dict[complex, complex] = {}

    def find(self, point: complex) -> complex:
        self.parent.setdefault(point, point)
        while self.parent[point] != point:
            self.parent[point] = self.parent[self.parent[point]]
            point = self.parent[point]
        return point

    def join(self, first: complex, second: complex) -> bool:
        """False if both were in one group before."""
        first, second = self.find(first), self.find(second)
        self.parent[first] = second
        return first != second


def find_tips(curves: Mapping[str, Curve], cracks: Mapping[str, str]) -> dict[str, tuple[bool, bool]]:
    """Per crack whether its start and its end are tips: points that no other leg reaches."""
    visits = count_leg_ends(curves)
    return {name: (visits[curves[name].start] == 1, visits[curves[name].end] == 1) for name in cracks}


def check_tip_elements(
    case: Case, curves: Mapping[str, Curve], tips: Mapping[str, tuple[bool, bool]]
) -> list[Fault]:
    """A fault for every crack with two tips and one element, which cannot have the shape of both."""
    faults = []
    for name, ends in tips.items():
        if case.analysis.tips and all(ends) and sum(leg.elements for leg in curves[name].legs) < 2:
            key = "elements" if case.curves[name].elements is not None else "size"
            expected = "at least 2, one for each tip; or tips = false in [analysis]"
            faults.append(case.fault(("curves", name, key), f"1 element on crack '{name}' with two tips", expected))
    return faults


def count_leg_ends(curves: Mapping[str, Curve]) -> Counter[complex]:
    """How many legs end at each point."""
    return Counter(end for curve in curves.values() for leg in curve.legs for end in (leg.start, leg.end))


def check_near_misses(
    case: Case, curves: Mapping[str, Curve], cracks: Mapping[str, str], size: float
) -> list[Fault]:
    """A fault for every tip so near to another curve that it must have been meant to lie on it."""
    faults = []
    tips = find_tips(curves, cracks)
    legs = [(name, leg) for name, curve in curves.items() for leg in curve.legs]
    boxes = Boxes.around_legs([leg for _, leg in legs], NEAR_MISS * size)
    points = [
        (name, point) for name, ends in tips.items()
        for is_tip, point in zip(ends, (curves[name].start, curves[name].end), strict=True) if is_tip
    ]
    told = set()
    at, numbers = boxes.find_around(np.array([point for _, point in points], dtype=complex))
    for which, number in zip(at.tolist(), numbers.tolist(), strict=True):
        (name, point), (other, leg) = points[which], legs[number]
        if other == name or which in told:
            continue
        distance = project(leg, point)[1]
        if distance < NEAR_MISS * size:
            told.add(which)
            found = f"crack '{name}' ending at {format_point(point)}, {distance:.2g} off curve '{other}'"
            faults.append(case.fault(("curves", name), found, "an end on the curve, or clearly away from it"))
    return faults


def check_inside(case: Case, curves: Mapping[str, Curve], cracks: Mapping[str, str], loops: Loops) -> list[Fault]:
    """A fault for every crack with a leg outside its region (legs do not cross, so one outside point tells)."""
    faults = []
    for region, names in _group_by_region(cracks).items():
        if region not in loops or not loops[region]:
            continue
        samples = [np.concatenate([inner_points(leg) for leg in curves[name].legs]) for name in names]
        owner = np.repeat(np.arange(len(names)), [len(points) for points in samples])
        points = np.concatenate(samples)
        outside = np.flatnonzero(~is_inside(curves, loops[region], points))
        for number, first in zip(*np.unique(owner[outside], return_index=True), strict=True):
            name, point = names[number], complex(points[outside[first]])
            loc = ("regions", region, "cracks", case.regions[region].cracks.index(name))
            found = f"crack '{name}' outside region '{region}', at {format_point(point)}"
            faults.append(case.fault(loc, found, "a crack inside its region, which it may touch with its ends"))
    return faults


def _group_by_region(cracks: Mapping[str, str]) -> dict[str, list[str]]:
    groups: dict[str, list[str]] = {}
    for name, region in cracks.items():
        groups.setdefault(region, []).append(name)
    return groups


def check_closing(
    case: Case, curves: Mapping[str, Curve], cracks: Mapping[str, str], loops: Loops
) -> tuple[list[Fault], list[str]]:
    """Faults for cracks that enclose a part of their region, notes for those that cut it together with its boundary.

    A part enclosed by cracks alone has no displacement equation of its own, so that its rigid motion would be
    undetermined; a part cut off with a piece of the boundary has.
    """
    faults, notes = [], []
    closing: set[str] = set()
    groups = _Groups()
    for name, region in cracks.items():
        joined = [groups.join(leg.start, leg.end) for leg in curves[name].legs]
        if not all(joined):
            closing.add(name)
            found = f"crack '{name}' closing a ring of cracks, which cuts region '{region}' in two"
            expected = "cracks that enclose nothing: make the enclosed part a region, and the ring its interface"
            faults.append(case.fault(("curves", name), found, expected))
    of_region = _group_by_region(cracks)
    for region in loops:
        own = [name for name in of_region.get(region, []) if name not in closing]
        if not own:
            continue
        cutting = _find_cutting(curves, own, loops[region])
        notes += [
            f"Crack '{name}' cuts region '{region}' in two; its parts are held together only by what the crack carries."
            for name in cutting
        ]
    return faults, notes


def _find_cutting(curves: Mapping[str, Curve], cracks: list[str], loops: tuple[Loop, ...]) -> list[str]:
    groups = _Groups()
    for loop in loops:
        for leg in loop_legs(curves, (loop,)):
            groups.join(leg.start, leg.end)
    return [name for name in cracks if not all([groups.join(leg.start, leg.end) for leg in curves[name].legs])]
