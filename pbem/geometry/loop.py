"""Closed loops around the regions: chained from curves in any order and direction, oriented, and nested."""

from __future__ import annotations

import cmath
import math
from collections import defaultdict
from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pbem.arrays import Bool, Complex, Integer
from pbem.errors import Fault
from pbem.geometry.boxes import Boxes
from pbem.geometry.curve import Curve, Leg
from pbem.geometry.intersection import enclosed_area, inner_points, meeting_points, project, surround, winding_number
from pbem.geometry.junction import format_point
from pbem.geometry.tolerance import Tolerance
from pbem.wording import list_names

HalfEdge = tuple[str, bool]
# Ends that are nearer to each other than this part of the shorter curve are thought to be meant as one.
ROUNDED = 1e-2


@dataclass(frozen=True)
class Side:
    """A curve as part of a loop; `forward` if the loop runs in the direction in which the curve was written."""

    curve: str
    forward: bool


@dataclass(frozen=True)
class Loop:
    """A closed chain of sides, travelled with the region on the left. `outer`: counter-clockwise, around the region."""

    sides: tuple[Side, ...]
    outer: bool


Loops = dict[str, tuple[Loop, ...]]


@dataclass(frozen=True)
class _Chain:
    sides: tuple[Side, ...]
    legs: list[Leg]

    def reverse(self) -> _Chain:
        sides = tuple(Side(side.curve, not side.forward) for side in reversed(self.sides))
        return _Chain(sides, [leg.reverse() for leg in reversed(self.legs)])


def side_legs(curves: Mapping[str, Curve], side: Side) -> tuple[Leg, ...]:
    """The legs of a side in its direction of travel (region on the left)."""
    return curves[side.curve].legs if side.forward else curves[side.curve].reverse().legs


def loop_legs(curves: Mapping[str, Curve], loops: tuple[Loop, ...]) -> list[Leg]:
    """All legs of some loops in their direction of travel."""
    return [leg for loop in loops for side in loop.sides for leg in side_legs(curves, side)]


def is_inside(
    curves: Mapping[str, Curve], loops: tuple[Loop, ...], points: Complex
) -> Bool:
    """Which points (off the loops) lie in the region of these loops, which is infinite if none of them is outer."""
    around = 1 if any(loop.outer for loop in loops) else 0
    legs = [loop_legs(curves, (loop,)) for loop in loops]
    return wind_around(legs, points) == around


def wind_around(loops: Sequence[list[Leg]], points: Complex) -> Integer:
    """How often all of some loops run counter-clockwise around each point (n,); none does that lies beside it."""
    total = np.zeros(len(points), dtype=np.int64)
    at, number = Boxes.of_corners([surround(legs) for legs in loops]).find_around(points)
    order = np.argsort(number, kind="stable")
    at, begin = at[order], np.searchsorted(number[order], np.arange(len(loops) + 1))
    for which, legs in enumerate(loops):
        near = at[begin[which]:begin[which + 1]]
        if len(near):
            total[near] += winding_number(legs, points[near])
    return total


def find_loops(
    boundaries: Mapping[str, Sequence[str]], infinite: Container[str], curves: Mapping[str, Curve],
    tolerance: Tolerance, check_nesting: bool = True,
) -> tuple[Loops, list[Fault]]:
    """Loops of every region all of whose curves are known; regions with faults are left out, the whole plane has none.

    boundaries: names of the curves around each region, in any order and direction; infinite: the regions that are the
    outside of theirs. check_nesting: False if curves cross, when it is not settled which loop lies in which.
    """
    result: Loops = {}
    faults: list[Fault] = []
    for region, boundary in boundaries.items():
        names = list(dict.fromkeys(boundary))
        if not names and region in infinite:
            result[region] = ()
        if not names or any(name not in curves for name in names):
            continue
        chains, wrong = _chain(region, {name: curves[name] for name in names}, tolerance)
        if not wrong:
            loops, wrong = _nest(region, chains, region in infinite)
            wrong = wrong if check_nesting else []
        if wrong:
            faults += wrong
        else:
            result[region] = loops
    return result, faults


def _chain(
    region: str, curves: Mapping[str, Curve], tolerance: Tolerance
) -> tuple[list[_Chain], list[Fault]]:
    """Walk from end to end; where more than two ends meet, take the turn that keeps one sector of the region."""
    leaving: dict[complex, list[HalfEdge]] = defaultdict(list)
    for name, curve in curves.items():
        if not curve.closed:
            leaving[curve.start].append((name, True))
            leaving[curve.end].append((name, False))
    faults = [
        _open_end(region, point, edges, curves, tolerance)
        for point, edges in leaving.items() if len(edges) % 2
    ]
    if faults:
        return [], faults
    following: dict[HalfEdge, HalfEdge] = {}
    legs = [leg for curve in curves.values() for leg in curve.legs]
    for point, edges in leaving.items():
        pairs = [(edges[0], edges[1])] if len(edges) == 2 else _pair_sectors(point, edges, curves, legs)
        if pairs is None:
            found = f"{len(edges)} curve ends that touch at {format_point(point)}, and which go together is unclear"
            expected = "loops that touch at most at single points, under angles that differ"
            faults.append(Fault.at(("regions", region, "boundary"), found, expected))
            continue
        for one, two in pairs:  # arriving against `one` one leaves along `two`, and the other way round
            following[one[0], not one[1]] = two
            following[two[0], not two[1]] = one
    if faults:
        return [], faults
    chains = []
    used: set[str] = set()
    for name in curves:
        if name in used:
            continue
        sides, edge = [], (name, True)
        while edge[0] not in used:
            used.add(edge[0])
            sides.append(Side(*edge))
            edge = edge if curves[edge[0]].closed else following[edge]
        chains.append(_Chain(tuple(sides), [leg for side in sides for leg in side_legs(curves, side)]))
    return chains, []


def _open_end(
    region: str, point: complex, edges: list[HalfEdge], curves: Mapping[str, Curve], tolerance: Tolerance
) -> Fault:
    """Name the curve, the end without a partner, and what is nearest to it."""
    names = list(dict.fromkeys(name for name, _ in edges))
    where = "starts" if edges[0][1] else "ends"
    found = f"an open loop: curve '{names[0]}' {where} at {format_point(point)}, where no other curve goes on"
    if len(edges) > 1:
        found = f"an open loop: an odd number of curve ends ({list_names(names)}) at {format_point(point)}"
    expected = "curves that close into loops"
    near = _nearest_end(point, names, curves)
    touched = [
        name for name, curve in curves.items() if name not in names
        for leg in curve.legs if project(leg, point)[1] <= tolerance.between(names[0], name)
    ]
    if touched:
        expected += f" (the point lies on curve '{touched[0]}': split that one there)"
    elif near:
        expected += f" (the nearest end is that of '{near[1]}' at {format_point(near[2])}, {near[0]:.3g} away)"
        # The end of an arc follows from its centre, radius and angle: users write it with the digits that they have.
        arc = next((end for end, leg in ((point, _leg_at(curves[names[0]], edges[0][1])), (near[2], near[3]))
                    if leg.sweep), None)
        if arc is not None and near[0] <= ROUNDED * min(curves[names[0]].length, curves[near[1]].length):
            expected += f": the arc's end, with all its digits, is [{arc.real!r}, {arc.imag!r}]"
    return Fault.at(("regions", region, "boundary"), found, expected)


def _leg_at(curve: Curve, start: bool) -> Leg:
    return curve.legs[0 if start else -1]


def _nearest_end(
    point: complex, own: list[str], curves: Mapping[str, Curve]
) -> tuple[float, str, complex, Leg] | None:
    ends = [
        (abs(end - point), name, end, _leg_at(curve, start))
        for name, curve in curves.items() if not curve.closed
        for start, end in ((True, curve.start), (False, curve.end))
        if end != point and not (name in own and len(curves) > 1)
    ]
    return min(ends, key=lambda entry: entry[0], default=None)


def _ray(curve: Curve, forward: bool) -> complex:
    return curve.legs[0].tangent(at_end=False) if forward else -curve.legs[-1].tangent(at_end=True)


def _pair_sectors(
    point: complex, edges: list[HalfEdge], curves: Mapping[str, Curve], legs: list[Leg]
) -> list[tuple[HalfEdge, HalfEdge]] | None:
    """Pairs of ends that bound one sector of the region (sectors alternate between in and out); None if unclear."""
    rays = sorted((cmath.phase(_ray(curves[name], forward)), (name, forward)) for name, forward in edges)
    phases = [phase for phase, _ in rays] + [rays[0][0] + 2 * math.pi]
    if min(b - a for a, b in pairwise(phases)) < 1e-6:
        return None
    reach = 1e-4 * min(curves[name].legs[0 if forward else -1].length for name, forward in edges)
    middles = np.array([
        point + reach * cmath.exp(0.5j * (a + b)) for a, b in pairwise(phases)
    ])
    inside = _is_enclosed_oddly(legs, middles)
    if any(inside[i] == inside[i - 1] for i in range(len(inside))):
        return None
    ends = [edge for _, edge in rays]
    return [(ends[i], ends[(i + 1) % len(ends)]) for i in range(len(ends)) if inside[i]]


def _is_enclosed_oddly(legs: list[Leg], points: Complex) -> list[bool]:
    """Even-odd rule for legs whose directions are not yet sorted out: count the cuts with a ray to the left."""
    far = 10 * max(abs(leg.start - points[0]) + leg.length for leg in legs)
    # An odd direction, so that the ray passes no vertex.
    direction = cmath.exp(2.39996j)
    rays = [Leg(complex(p), complex(p) + far * direction, 1) for p in points]
    return [sum(len(meeting_points(ray, leg, 0.0)) for leg in legs) % 2 == 1 for ray in rays]


def _nest(
    region: str, chains: list[_Chain], infinite: bool
) -> tuple[tuple[Loop, ...], list[Fault]]:
    """The loop of the largest area is outer, counter-clockwise; all others lie in it side by side, clockwise.

    An infinite region has no outer loop.
    """
    areas = [enclosed_area(chain.legs) for chain in chains]
    outer = -1 if infinite else max(range(len(chains)), key=lambda i: abs(areas[i]))
    turned = [
        chain if (area > 0) == (i == outer) else chain.reverse()
        for i, (chain, area) in enumerate(zip(chains, areas, strict=True))
    ]
    faults = []
    loc = ("regions", region, "boundary")
    boxes = Boxes.of_corners([surround(chain.legs) for chain in chains])
    near: dict[int, list[int]] = {i: [] for i in range(len(chains))}
    meeting = boxes.find_meeting(boxes) if len(chains) > 1 else ()
    for i, j in zip(*(numbers.tolist() for numbers in meeting), strict=True):
        if j != outer:
            near[i].append(j)
    for i, chain in enumerate(turned):
        if i == outer:
            continue
        points = np.concatenate([inner_points(leg, 3) for leg in chain.legs])
        for j in sorted([*near[i], *([outer] if outer >= 0 else [])]):
            if i == j:
                continue
            inside = winding_number(turned[j].legs, points) != 0
            names, around = (list_names([side.curve for side in turned[k].sides], 4) for k in (i, j))
            if j == outer and not inside.all():
                found = f"the loop of {names} outside the loop of {around}"
                expected = "one connected region inside one outer loop: make separate parts separate regions"
                faults.append(Fault.at(loc, found, expected))
            elif j != outer and inside.any():
                found = f"the loop of {names} inside the inner loop of {around}"
                expected = "inner loops side by side: what lies inside a hole is another region"
                faults.append(Fault.at(loc, found, expected))
    return tuple(Loop(chain.sides, i == outer) for i, chain in enumerate(turned)), faults
