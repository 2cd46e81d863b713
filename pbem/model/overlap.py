"""Regions that lie in one another: where they must not meet at all, and where contacts let them touch."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise, product

import numpy as np

from pbem.arrays import Complex, Real
from pbem.description.case import Case
from pbem.errors import Fault
from pbem.geometry.boxes import Boxes
from pbem.geometry.curve import Curve, Leg
from pbem.geometry.intersection import (
    inner_points,
    measure_distances,
    meeting_points,
    project,
    surround,
    winding_number,
)
from pbem.geometry.junction import format_point
from pbem.geometry.loop import Loop, Loops, loop_legs
from pbem.geometry.tolerance import Tolerance
from pbem.model.roles import Roles


@dataclass(frozen=True)
class _Body:
    """A region's loops, their legs, which curves they travel forward or backward, and its box (low, high corner)."""

    name: str
    sides: Mapping[str, bool]
    legs: list[Leg]
    infinite: bool
    low: complex
    high: complex

    def find_depth(self, points: Complex) -> Real:
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


def _list_pressed(case: Case, roles: Roles) -> dict[frozenset[str], tuple[float, str]]:
    """Pairs of regions that may be drawn into each other, with the depth that their contacts allow at most, and the
    contact that says so."""
    pressed: dict[frozenset[str], tuple[float, str]] = {}
    for name, curves in roles.contacts.items():
        regions, depth = frozenset(roles.outer[curve] for curve in curves), case.contacts[name].overlap
        if depth > 0 and len(regions) == 2:
            pressed[regions] = max((depth, name), pressed.get(regions, (0.0, "")))
    return pressed


def list_apart(case: Case, roles: Roles) -> set[frozenset[str]]:
    """Pairs of outer curves of bodies that are drawn into each other: they may cross, and do not meet where they do."""
    pairs: set[frozenset[str]] = set()
    for regions in _list_pressed(case, roles):
        first, second = ([curve for curve, region in roles.outer.items() if region == name] for name in regions)
        pairs |= {frozenset(pair) for pair in product(first, second)}
    return pairs


def find_overlaps(
    case: Case, curves: Mapping[str, Curve], loops: Loops, roles: Roles, tolerance: Tolerance
) -> list[Fault]:
    """Regions that lie on the same side of a shared curve, or one inside another that does not have it as a hole.

    Curves that are in contact with one of the other region are left to `check_contacts`; others of the two bodies may
    lie in each other by as much as their contact allows.
    """
    faults, pressed = [], _list_pressed(case, roles)
    bodies = [_make_body(case, curves, name, own) for name, own in loops.items()]
    touching = {curve: other for pair in roles.contacts.values() for curve, other in (pair, pair[::-1])}
    for (i, j), near in _pair_near(bodies, curves, touching).items():
        first, second = bodies[i], bodies[j]
        allowed, _ = pressed.get(frozenset((first.name, second.name)), (0.0, ""))
        found = _overlap(curves, first, second, near, tolerance, allowed)
        if found:
            expected = "regions side by side; the loop of a region inside another belongs in the boundary of both"
            text = f"region '{second.name}' overlapping region '{first.name}' ({found})"
            faults.append(Fault.at(("regions", second.name, "boundary"), text, expected))
    return faults


def _pair_near(
    bodies: list[_Body], curves: Mapping[str, Curve], touching: Mapping[str, str]
) -> dict[tuple[int, int], list[tuple[_Body, str]]]:
    """Pairs of bodies in the order of the file, with the curves of either that may lie in the other: those whose boxes
    meet its own, and which it neither has nor touches. Two infinite regions are a fault of their own."""
    owners: dict[str, list[int]] = {}
    for number, body in enumerate(bodies):
        for curve in body.sides:
            owners.setdefault(curve, []).append(number)
    pairs: dict[tuple[int, int], list[tuple[_Body, str]]] = {
        (own[0], own[1]): [] for own in owners.values() if len(own) == 2
    }
    names = list(owners)
    for number, at in _meet(bodies, [curves[name] for name in names]):
        body, curve = bodies[number], names[at]
        if curve in body.sides or touching.get(curve) in body.sides:
            continue
        for other in owners[curve]:
            pairs.setdefault((min(number, other), max(number, other)), []).append((body, curve))
    return {
        pair: sorted(pairs[pair], key=lambda entry, first=bodies[pair[0]]: entry[0] is not first)  # type: ignore[misc]
        for pair in sorted(pairs) if not all(bodies[number].infinite for number in pair)
    }


def _meet(bodies: list[_Body], curves: list[Curve]) -> Iterator[tuple[int, int]]:
    """Numbers of bodies and of curves whose boxes meet; an infinite body meets all."""
    finite = [number for number, body in enumerate(bodies) if not body.infinite]
    boxes = Boxes.of_corners([surround(curve.legs) for curve in curves])
    at, found = boxes.find_meeting(Boxes.of_corners([(bodies[number].low, bodies[number].high) for number in finite]))
    yield from ((finite[i], j) for i, j in zip(at.tolist(), found.tolist(), strict=True))
    for number, body in enumerate(bodies):
        if body.infinite:
            yield from ((number, j) for j in range(len(curves)))


def _overlap(
    curves: Mapping[str, Curve], first: _Body, second: _Body, near: list[tuple[_Body, str]], tolerance: Tolerance,
    allowed: float,
) -> str:
    """near: curves of one of them that may lie in the other, and that other; allowed: by how much at most."""
    fewer, more = sorted((first.sides, second.sides), key=len)
    for curve, forward in fewer.items():
        if more.get(curve) == forward:
            return f"both lie on the same side of '{curve}'"
    for body, curve in near:
        if allowed:
            depth = _find_deepest(curves[curve], body)[0]
            if depth > max(tolerance.of(curve), allowed * (1 + ROUNDED)):
                return f"'{curve}' lies inside, {depth:.3g} deep, by more than the overlap of their contact"
            continue
        points = np.concatenate([inner_points(leg, 1) for leg in curves[curve].legs])
        if (body.find_depth(points) > tolerance.of(curve)).any():
            return f"'{curve}' lies inside"
    return ""


def check_contacts(
    case: Case, curves: Mapping[str, Curve], loops: Loops, roles: Roles, tolerance: Tolerance
) -> tuple[dict[str, float], list[str], list[Fault]]:
    """By name the overlap that is allowed of contacts whose bodies lie in each other as they are drawn, with a sentence
    for each; a fault for every one in which they do by more, with the deepest place found."""
    faults, overlaps, notes = [], {}, {}
    pressed = _list_pressed(case, roles)
    for name, (first, second) in roles.contacts.items():
        for curve, other in ((first, second), (second, first)):
            region = roles.outer[other]
            if region not in loops or region == roles.outer[curve] or curve not in curves:
                continue
            depth, point = _find_deepest(curves[curve], _make_body(case, curves, region, loops[region]))
            # Where a contact says nothing, its bodies are as deep in each other as another of their contacts says.
            own = case.contacts[name].overlap
            allowed, saying = (own, name) if own else pressed.get(frozenset((region, roles.outer[curve])), (0.0, name))
            if depth > max(tolerance.of(curve), allowed * (1 + ROUNDED)):
                found = f"curve '{curve}' inside region '{region}', {depth:.3g} deep at {format_point(point)}"
                expected = ("bodies that at most touch before they are loaded; or, for a press fit, "
                            f"overlap = {_round_up(depth):g} in [contacts.{name}], the depth that is meant, at most")
                if allowed:
                    expected = f"at most overlap = {allowed:g} deep, as [contacts.{saying}] says, or a larger overlap"
                faults.append(Fault.at(("contacts", name), found, expected))
                break
            if depth > tolerance.of(curve):
                overlaps[name] = allowed
                notes[name] = (f"The bodies of contact '{name}' are drawn {depth:.4g} deep into each other, at "
                               f"{format_point(point)}; the first step drives them apart.")
    return overlaps, [*notes.values()], faults


# Depths are known to this part of them.
ROUNDED = 1e-6


def _round_up(depth: float) -> float:
    """The next number of two digits."""
    unit = 10.0 ** (math.floor(math.log10(depth)) - 1)
    return math.ceil(depth * (1 - ROUNDED) / unit) * unit


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
