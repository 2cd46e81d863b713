"""Cracks: inside their region, meeting other curves with their ends only, and which of their ends are tips."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from pbem.description.case import Case
from pbem.errors import Fault
from pbem.geometry.boxes import Boxes
from pbem.geometry.curve import Curve, Leg
from pbem.geometry.intersection import inner_points, project
from pbem.geometry.junction import format_point
from pbem.geometry.loop import Loop, Loops, is_inside, loop_legs

# A tip nearer to another curve than this part of its crack's last leg is taken for a slip of the pen.
NEAR_MISS = 1e-6
# Ends that all but reach another curve, and are listed one by one.
MOST_NOTES = 6


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


def divide_for_tips(
    case: Case, curves: Mapping[str, Curve], tips: Mapping[str, tuple[bool, bool]]
) -> dict[str, Curve]:
    """The curves, with two elements on cracks of one with two tips, where a size is given, which they do not exceed."""
    result = dict(curves)
    for name, ends in tips.items():
        legs, sized = curves[name].legs, case.curves[name].size is not None
        if case.analysis.tips and all(ends) and sized and sum(leg.elements for leg in legs) < 2:
            result[name] = Curve(name, (replace(legs[0], elements=2), *legs[1:]))
    return result


def check_tip_elements(
    case: Case, curves: Mapping[str, Curve], tips: Mapping[str, tuple[bool, bool]]
) -> list[Fault]:
    """A fault for every crack with two tips and one element, which cannot have the shape of both."""
    faults = []
    for name, ends in tips.items():
        if case.analysis.tips and all(ends) and sum(leg.elements for leg in curves[name].legs) < 2:
            key = "elements" if case.curves[name].elements is not None else "size"
            expected = "at least 2, one for each tip; or tips = false in [analysis]"
            faults.append(Fault.at(("curves", name, key), f"1 element on crack '{name}' with two tips", expected))
    return faults


def count_leg_ends(curves: Mapping[str, Curve]) -> Counter[complex]:
    """How many legs end at each point."""
    return Counter(end for curve in curves.values() for leg in curve.legs for end in (leg.start, leg.end))


@dataclass(frozen=True)
class _Miss:
    """A tip of a crack near another curve: its place, the distance, and the crack's leg that ends there."""

    crack: str
    point: complex
    other: str
    distance: float
    leg: Leg


def _find_misses(
    curves: Mapping[str, Curve], tips: Mapping[str, tuple[bool, bool]], reach: Mapping[str, float]
) -> list[_Miss]:
    """The nearest curve of every tip that has one, other than its own crack, within the reach (length) of its crack."""
    legs = [(name, leg) for name, curve in curves.items() for leg in curve.legs]
    boxes = Boxes.around_legs([leg for _, leg in legs], max(reach.values(), default=0.0))
    ends = [
        (name, *end) for name, (at_start, at_end) in tips.items()
        for is_tip, end in (
            (at_start, (curves[name].start, curves[name].legs[0])), (at_end, (curves[name].end, curves[name].legs[-1]))
        ) if is_tip
    ]  # fmt: skip
    found: dict[int, _Miss] = {}
    at, numbers = boxes.find_around(np.array([point for _, point, _ in ends], dtype=complex))
    for which, number in zip(at.tolist(), numbers.tolist(), strict=True):
        (name, point, own), (other, leg) = ends[which], legs[number]
        # The sides of a wedge are near each other all along.
        if other == name or {own.start, own.end} & {leg.start, leg.end}:
            continue
        distance = project(leg, point)[1]
        if distance < reach[name] and (which not in found or distance < found[which].distance):
            found[which] = _Miss(name, point, other, distance, own)
    return [found[which] for which in sorted(found)]


def check_near_misses(curves: Mapping[str, Curve], cracks: Mapping[str, str]) -> list[Fault]:
    """A fault for every tip so near to another curve that it must have been meant to lie on it."""
    reach = {name: NEAR_MISS * max(leg.length for leg in curves[name].legs) for name in cracks}
    expected = "an end on the curve, or clearly away from it"
    return [
        Fault.at(
            ("curves", miss.crack),
            f"crack '{miss.crack}' ending at {format_point(miss.point)}, {miss.distance:.2g} off curve '{miss.other}'",
            expected,
        )
        for miss in _find_misses(curves, find_tips(curves, cracks), reach)
        if miss.distance < NEAR_MISS * miss.leg.length
    ]


def describe_near_misses(case: Case, curves: Mapping[str, Curve], tips: Mapping[str, tuple[bool, bool]]) -> list[str]:
    """Notes for tips that miss another curve by less than an element of their crack, as long as the case asks for."""
    asked = {name: _measure_element(case, curves[name]) for name in tips}
    notes = [
        f"Crack '{miss.crack}' ends at {format_point(miss.point)}, {miss.distance:.3g} short of curve '{miss.other}', "
        f"less than the length of its elements ({asked[miss.crack]:.3g}): it has a tip there, and the ligament "
        "carries load. An end on the curve would join them."
        for miss in _find_misses(curves, tips, asked)
    ]
    more = len(notes) - MOST_NOTES
    if more > 1:
        return [*notes[:MOST_NOTES], f"{more} more ends of cracks miss a curve by less than an element."]
    return notes


def _measure_element(case: Case, curve: Curve) -> float:
    """Mean length of the elements that the case asks for on a curve."""
    table = case.curves[curve.name]
    if table.size is not None:
        return table.size
    count = sum(table.elements) if isinstance(table.elements, tuple) else table.elements
    return curve.length / (count or len(curve.legs))


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
            faults.append(Fault.at(loc, found, "a crack inside its region, which it may touch with its ends"))
    return faults


def _group_by_region(cracks: Mapping[str, str]) -> dict[str, list[str]]:
    groups: dict[str, list[str]] = {}
    for name, region in cracks.items():
        groups.setdefault(region, []).append(name)
    return groups


def describe_closing(curves: Mapping[str, Curve], cracks: Mapping[str, str], loops: Loops) -> list[str]:
    """Notes for cracks that enclose blocks of their region, or cut it in two together with its boundary.

    Nothing but what the cracks carry holds such parts: their own rigid motion makes no traction anywhere.
    """
    notes = []
    for region, names in _group_by_region(cracks).items():
        rings = _count_closing(curves, names, ())
        if sum(rings.values()) > MOST_NOTES:
            notes.append(f"Cracks enclose {sum(rings.values())} blocks of region '{region}', each of them held only by "
                         "what its cracks carry.")  # fmt: skip
        else:
            notes += [
                f"Crack '{name}' closes a ring: the block of region '{region}' within is held only by what its cracks "
                "carry." for name in rings
            ]
        own = [name for name in names if name not in rings]
        cutting = _count_closing(curves, own, loops.get(region, ())) if loops.get(region) else {}
        if len(cutting) > MOST_NOTES:
            notes.append(f"{len(cutting)} cracks cut region '{region}' into parts, which are held together only by "
                         "what the cracks carry.")  # fmt: skip
        else:
            notes += [
                f"Crack '{name}' cuts region '{region}' in two; its parts are held together only by what the crack "
                "carries." for name in cutting
            ]
    return notes


def _count_closing(curves: Mapping[str, Curve], cracks: list[str], loops: tuple[Loop, ...]) -> dict[str, int]:
    """Cracks that close rings of cracks and loops, each with the number of rings that it is the last one of."""
    groups = _Groups()
    for leg in loop_legs(curves, loops):
        groups.join(leg.start, leg.end)
    closing = {name: sum(not groups.join(leg.start, leg.end) for leg in curves[name].legs) for name in cracks}
    return {name: count for name, count in closing.items() if count}
