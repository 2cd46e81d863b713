"""What faces see along their outward normals: curves of a contact each other, a region itself across a slot."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pbem.arrays import Complex, Integer, Real
from pbem.errors import Fault
from pbem.geometry.boxes import Boxes
from pbem.geometry.curve import Curve, Leg, turning_angle
from pbem.geometry.elements import Elements
from pbem.geometry.intersection import inner_points, measure_distances, project, surround
from pbem.geometry.junction import format_point, split_leg
from pbem.geometry.loop import Loops, Side, side_legs
from pbem.geometry.tolerance import TIE
from pbem.model.model import Contact, Model, Region

# Points on a leg from which its surroundings are looked at.
SAMPLES = 9
# Faces look at each other if their normals are opposite within 60 degrees.
OPPOSITE = -0.5 * (1 - TIE)
# A strip between two faces is narrow if its width is less than this part of their lengths.
NARROW = 0.25 * (1 - TIE)
# Faces that touch may lie in one another by this part of the shorter curve (rounding, chords of curved sides).
OVERLAP = 1e-3
# Normals of bodies that lie in each other meet the other face farther behind than these are deep, by this factor.
REACH = 2.0
# A leg is not split nearer to its ends than this part of its mean element.
LEAST_PIECE = 0.25 * (1 - TIE)
# Faces farther away than this piece have to be opposite within 20 degrees: a disc on a block does not face its top's
# ends. How far away they are does not matter, as the parts that fall on each other are the same across any gap.
OPPOSITE_FAR = -0.94
# A face ends at a corner of its curve, too, that turns away from the other one by more than this (radians).
CORNER = math.radians(45.0) * (1 + TIE)


@dataclass(frozen=True)
class Sight:
    """What each of some points (k,) meets first along its normal: number of the leg (-1: none), distance, and the
    product of its own normal with that of the leg there (-1: face to face)."""

    leg: Integer
    distance: Real
    product: Real


@dataclass(frozen=True)
class Seats:
    """curves: with legs that end opposite the ends of curves in contact; opposite: per curve the points where they do,
    each with the curve that ends there and the point at which it ends; notes: a sentence for each."""

    curves: Mapping[str, Curve]
    opposite: Mapping[str, Mapping[complex, tuple[str, complex]]]
    notes: tuple[str, ...]


@dataclass(frozen=True)
class Strip:
    """Two legs of one region's boundary, each (curve, number of the leg), with a narrow strip in between.

    inside: it is a thin part of the region, else a slot.
    """

    first: tuple[str, int]
    second: tuple[str, int]
    width: float
    inside: bool


class Obstacles:
    """Legs, travelled with their region on the left, that rays may meet."""

    def __init__(self, legs: Sequence[Leg]) -> None:
        self._shapes = Elements.collect(legs)

    def look_along(self, points: Complex, normals: Complex, nearest: float) -> Sight:
        """What rays (k,) from the points along the unit normals meet first, from the distance `nearest` on."""
        crossing = self._shapes.cross(points, normals)
        on_leg = (np.abs(crossing.local) <= 1) & (crossing.distance >= nearest)
        distance = np.where(on_leg, crossing.distance, np.inf).min(axis=2)
        at, rays = np.argmin(distance, axis=0), np.arange(len(points))
        distance = distance[at, rays]
        met = np.isfinite(distance)
        seen, product = self._shapes.select(at[met]), np.zeros(len(points))
        outward = seen.normals_at((points[met] + distance[met] * normals[met])[:, None])[:, 0]
        product[met] = (np.conj(normals[met]) * outward).real
        return Sight(np.where(met, at, -1), distance, product)


def check_facing(model: Model) -> list[Fault]:
    """A fault for every contact whose curves never face each other, with what is known of their distance."""
    sides = {side.curve: side for region in model.regions for loop in region.loops for side in loop.sides}
    faults = []
    for name, contact in model.contacts.items():
        if _face(model, sides, contact):
            continue
        first, second = model.curves[contact.first], model.curves[contact.second]
        points = np.concatenate([np.array([leg.start, *inner_points(leg), leg.end]) for leg in first.legs])
        distances = measure_distances(second.legs, points)
        at = int(np.argmin(distances))
        found = (
            f"curves '{contact.first}' and '{contact.second}', which never face each other "
            f"(nearest at {format_point(complex(points[at]))}, {distances[at]:.3g} apart)"
        )
        expected = "two curves that the outward normals of one of them meet, with nothing in between"
        faults.append(Fault.at(("contacts", name), found, expected))
    return faults


def _face(model: Model, sides: Mapping[str, Side], contact: Contact) -> bool:
    """Whether a normal of either curve meets the other one from outside, before any other part of the two bodies."""
    shorter = min(model.curves[contact.first].length, model.curves[contact.second].length)
    for curve, other in ((contact.first, contact.second), (contact.second, contact.first)):
        facing = Obstacles(side_legs(model.curves, sides[other]))
        for leg in side_legs(model.curves, sides[curve]):
            points = inner_points(leg, max(SAMPLES, 4 * leg.elements))
            seen = facing.look_along(points, leg.normals(points), -max(OVERLAP * shorter, REACH * contact.overlap))
            if ((seen.leg >= 0) & (seen.product < 0)).any():
                return True
    return False


def split_opposite_ends(
    curves: Mapping[str, Curve], loops: Loops, contacts: Mapping[str, tuple[str, str]],
    kept: Set[str] = frozenset(),
) -> Seats:
    """Split the curves of contacts where their normals pass ends and corners of the curve that they face; say where.

    Contact ends there, so that no element has a part that faces nothing; faces that touch are split there as well.
    kept: curves that are not split, the corners of which end no faces. Ends near those of a leg are left.
    """
    sides = {side.curve: side for own in loops.values() for loop in own for side in loop.sides}
    result, notes = dict(curves), []
    opposite: dict[str, dict[complex, tuple[str, complex]]] = {}
    for pair in contacts.values():
        for name, other in (pair, pair[::-1]):
            if name in kept or name not in sides or other not in sides:
                continue
            shorter = min(curves[name].length, curves[other].length)
            cuts: dict[int, dict[float, complex]] = {}
            for end, normal in _outward_ends(curves[other], sides[other], other not in kept):
                found = _find_opposite(curves[name], sides[name].forward, end, normal, -OVERLAP * shorter)
                if found is not None:
                    cuts.setdefault(found[0], {})[found[1]] = end
            legs = []
            for number, leg in enumerate(result[name].legs):
                points = {complex(leg.point(np.array(t))): t for t in cuts.get(number, ())}
                legs += split_leg(leg, points)
                for at, t in points.items():
                    opposite.setdefault(name, {})[at] = (other, cuts[number][t])
                    what = "an end" if cuts[number][t] in (curves[other].start, curves[other].end) else "a corner"
                    notes.append(f"'{name}' is split at {format_point(at)}, opposite {what} of '{other}'.")
            result[name] = Curve(name, tuple(legs))
    return Seats(result, opposite, tuple(notes))


def _outward_ends(curve: Curve, side: Side, with_corners: bool) -> list[tuple[complex, complex]]:
    """Ends of a curve, and its corners on either side, where it turns away from what it faces, with outward normals."""
    sign, legs = 1 if side.forward else -1, curve.legs
    ends = [] if curve.closed else [(legs[0], curve.start), (legs[-1], curve.end)]
    joints = [*pairwise(legs)] + ([(legs[-1], legs[0])] if curve.closed else [])
    for before, after in joints if with_corners else ():
        if sign * turning_angle(before.tangent(at_end=True), after.tangent(at_end=False)) > CORNER:
            ends += [(before, before.end), (after, after.start)]
    return [(point, sign * complex(leg.normals(np.array([point]))[0])) for leg, point in ends]


def _find_opposite(
    curve: Curve, forward: bool, end: complex, normal: complex, least: float
) -> tuple[int, float] | None:
    """Number of the nearest leg that an end of another curve faces, at least so far ahead, and the fraction there."""
    feet = [(*project(leg, end)[::-1], number) for number, leg in enumerate(curve.legs)]
    for distance, t, number in sorted(feet):
        leg = curve.legs[number]
        foot = leg.point(np.array([t]))
        outward = complex(leg.normals(foot)[0]) * (1 if forward else -1)
        piece = LEAST_PIECE * leg.length / leg.elements
        facing = (normal * outward.conjugate()).real <= (OPPOSITE if distance <= piece else OPPOSITE_FAR)
        # The normal of a foot at the end of a leg, which is but the nearest point, passes by the other curve's end.
        if facing and 0 < t < 1 and ((end - complex(foot[0])) * outward.conjugate()).real >= least:
            return (number, t) if min(t, 1 - t) * leg.length >= piece else None
    return None


def find_strips(model: Model, region: Region, chosen: Sequence[tuple[str, int]]) -> list[Strip]:
    """Pairs of chosen legs (curve, number of the leg) of a region with a narrow slot or a thin part in between.

    The first of each is that which comes first in the file: the way round the region is another in a mirrored model.
    """
    legs: list[Leg] = []
    names: list[tuple[str, int]] = []
    for side in (side for loop in region.loops for side in loop.sides):
        own = side_legs(model.curves, side)
        numbers = range(len(own)) if side.forward else range(len(own) - 1, -1, -1)
        legs += own
        names += [(side.curve, number) for number in numbers]
    wanted = set(chosen)
    strips: dict[frozenset[tuple[str, int]], Strip] = {}
    place, nearby = {curve: at for at, curve in enumerate(model.curves)}, _find_near(legs)
    for at in sorted(range(len(legs)), key=lambda at: (place[names[at][0]], names[at][1])):
        name, leg, near = names[at], legs[at], nearby[at]
        if name not in wanted:
            continue
        around = Obstacles([legs[number] for number in near])
        points = inner_points(leg, SAMPLES)
        for inside, normals in ((False, leg.normals(points)), (True, -leg.normals(points))):
            seen = around.look_along(points, normals, 1e-12 * model.size)
            facing = (seen.leg >= 0) & ((-seen.product if inside else seen.product) < OPPOSITE)
            for number in np.unique(seen.leg[facing]):
                other = names[near[number]]
                width = float(seen.distance[facing & (seen.leg == number)].min())
                length = min(leg.length, legs[near[number]].length)
                if other in wanted and other != name and width < NARROW * length:
                    strips.setdefault(frozenset((name, other)), Strip(name, other, width, inside))
    return list(strips.values())


def _find_near(legs: Sequence[Leg]) -> list[list[int]]:
    """Of every leg the numbers of those, itself among them, that a narrow strip may lie between it and."""
    reach = NARROW * np.array([leg.length for leg in legs])
    corners = [surround([leg]) for leg in legs]
    wide = [(low - (1 + 1j) * r, high + (1 + 1j) * r) for (low, high), r in zip(corners, reach, strict=True)]
    near: list[list[int]] = [[] for _ in legs]
    at, found = Boxes.of_corners(corners).find_meeting(Boxes.of_corners(wide))
    for number, other in zip(at.tolist(), found.tolist(), strict=True):
        near[number].append(other)
    return near
