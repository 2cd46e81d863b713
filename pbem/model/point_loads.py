"""Forces and moments at single points: where they act, in which region, and by which field."""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, replace

import numpy as np

from pbem.arrays import Bool
from pbem.description.case import Case
from pbem.description.field_tables import PointForceTable
from pbem.errors import Fault, KeyPath
from pbem.geometry.curve import Curve, Leg, turning_angle
from pbem.geometry.intersection import measure_distances, meeting_points, project
from pbem.geometry.junction import format_point, split_leg
from pbem.geometry.loop import Loop, Loops, is_inside, loop_legs
from pbem.geometry.tolerance import TIE, Tolerance
from pbem.model.roles import Roles, unknown_name
from pbem.wording import list_names

# A point lies on a curve that is nearer than this part of the curve's length.
ON_CURVE = 1e-6
# A load inside has to be further from curves than this part of their elements, and is told of if nearer than an
# element: the stress that it brings to a curve changes within its distance. Only where the user keeps the elements.
TOO_NEAR, NEAR = 0.05 * (1 - TIE), 1.0 - TIE
# Straight legs that a load on the boundary sees along their line, but for an angle with this sine, get next to none of
# its tractions: those of a polygon of four dozen sides that is loaded at its corners are right to 5e-4 without
# more elements, and would have twice as many.
GRAZING = 0.15
# An angle of a corner below this (radians) is no wedge.
SHARPEST = math.radians(1.0)
# Points at which the end of a cut is tried.
TRIED = 32

Force = tuple[float, float, float]


@dataclass(frozen=True)
class PointLoad:
    """place: of the load (complex), in or on the boundary of the region (its name).

    On a boundary, inward: unit vector along the middle of the wedge that the boundary makes there, half_angle: half of
    its angle (pi/2 where it is smooth); both 0 inside. beyond: where the cut of the displacement ends outside of the
    body; None if it meets the body nowhere.
    """

    name: str
    region: str
    place: complex
    inward: complex = 0j
    half_angle: float = 0.0
    beyond: complex | None = None

    @property
    def on_boundary(self) -> bool:
        return bool(self.inward)

    def move(self, shift: complex) -> PointLoad:
        """The same about another origin: the places of the model have become less by the shift."""
        beyond = None if self.beyond is None else self.beyond - shift
        return replace(self, place=self.place - shift, beyond=beyond)


def split_at_points(
    curves: Mapping[str, Curve], tolerance: Tolerance, points: Sequence[complex]
) -> tuple[dict[str, Curve], dict[complex, complex]]:
    """The curves with an end of a leg at each of the points that lies on them, and the points as they lie there."""
    result, places = dict(curves), {}
    for point in points:
        near = [(project(leg, point), name, index, leg) for name, curve in result.items()
                for index, leg in enumerate(curve.legs)]
        near = [each for each in near if each[0][1] <= max(tolerance.of(each[1]), ON_CURVE * result[each[1]].length)]
        if not near:
            continue
        ends = {end for _, name, _, leg in near for end in (leg.start, leg.end)
                if abs(end - point) <= max(tolerance.of(name), ON_CURVE * result[name].length)}
        if ends:
            places[point] = min(ends, key=lambda end: abs(end - point))
            continue
        (t, _), name, index, leg = min(near, key=lambda each: each[0][1])
        if not 0 < t < 1:
            continue
        places[point] = complex(leg.point(np.array(t)))
        legs = result[name].legs
        result[name] = Curve(name, (*legs[:index], *split_leg(leg, {places[point]: t}), *legs[index + 1 :]))
    return result, places


@dataclass(frozen=True)
class PointLoads:
    """loads: by their names; stages: force along x and y and moment of each at the end of every stage."""

    loads: Mapping[str, PointLoad]
    notes: tuple[str, ...]
    faults: tuple[Fault, ...]


def read_point_forces(case: Case) -> tuple[tuple[Mapping[str, Force], ...], list[Fault]]:
    """Complete values for every stage; what a stage leaves out keeps the value reached before."""
    values = {name: (table.fx, table.fy, table.moment) for name, table in case.point_loads.items()}
    faults: list[Fault] = []
    stages = []
    for number, stage in enumerate(case.stages):
        for name, table in stage.point_loads.items():
            if name not in values:
                loc = ("stages", number, "point_loads", name)
                faults.append(unknown_name(loc, name, "point load", case.point_loads))
                continue
            values[name] = _update(values[name], table)
        stages.append(dict(values))
    return tuple(stages or [values]), faults


def _update(before: Force, table: PointForceTable) -> Force:
    given = [getattr(table, key) if key in table.model_fields_set else value
             for key, value in zip(("fx", "fy", "moment"), before, strict=True)]
    return given[0], given[1], given[2]


def place_point_loads(
    case: Case, roles: Roles, curves: Mapping[str, Curve], loops: Loops, places: Mapping[complex, complex],
    held: Mapping[str, tuple[str, ...]],
) -> PointLoads:
    """The regions and the fields of all point loads, with faults for those that have none.

    places: of points on curves, as in `split_at_points`; held: curves on which displacements are prescribed, with the
    keys that do.
    """
    loads: dict[str, PointLoad] = {}
    notes: list[str] = []
    faults: list[Fault] = []
    kept = {name for name, table in case.curves.items() if table.grading != "auto"}
    for name, table in case.point_loads.items():
        point, loc = complex(*table.at), ("point_loads", name)
        moments = any(tables[name].moment for tables in (case.point_loads, *(
            {name: stage.point_loads[name]} for stage in case.stages if name in stage.point_loads)))
        found: PointLoad | Fault | None
        if point in places:
            found = _place_on_boundary(loc, name, places[point], roles, curves, loops, held)
            if isinstance(found, PointLoad) and moments:
                found = Fault.at((*loc, "moment"), "a moment at a point of a boundary",
                                 "moments inside regions; on a boundary two forces, or tractions along a curve")
        else:
            found = _place_inside(loc, name, point, curves, loops)
        if isinstance(found, PointLoad):
            wrong, note = _check_distance((*loc, "at"), found, curves, kept)
            faults += wrong
            notes += note
        if isinstance(found, Fault):
            faults.append(found)
        elif found is not None:
            loads[name] = found
    faults += _check_apart(case, loads)
    return PointLoads(loads, tuple(notes), tuple(faults))


def _check_apart(case: Case, loads: Mapping[str, PointLoad]) -> Iterator[Fault]:
    seen: dict[complex, str] = {}
    for name, load in loads.items():
        if load.place in seen:
            found = f"the place {format_point(load.place)} of point load '{seen[load.place]}' again"
            yield Fault.at(("point_loads", name, "at"), found, "a place of its own: forces at one point add up")
        seen.setdefault(load.place, name)


def _place_inside(
    loc: KeyPath, name: str, point: complex, curves: Mapping[str, Curve], loops: Loops
) -> PointLoad | Fault:
    within = [region for region, around in loops.items() if is_inside(curves, around, np.array([point]))[0]]
    if len(within) == 1:
        return PointLoad(name, within[0], point)
    return Fault.at((*loc, "at"), f"{format_point(point)}, outside of all regions",
                    "a point inside a region or on its boundary")


def _check_distance(
    loc: KeyPath, load: PointLoad, curves: Mapping[str, Curve], kept: Set[str]
) -> tuple[list[Fault], list[str]]:
    """Loads inside that are too near to a curve, or so near that its elements should be shorter; of those on a boundary
    the latter, by curves to which they bring tractions.

    kept: curves whose grading is the user's; others get elements later that are as short as the loads want them.
    """
    near: list[tuple[float, str, float]] = []
    for curve in (curves[name] for name in curves if name in kept):
        for leg in curve.legs:
            if load.on_boundary and not find_acted_on([leg], load.place)[0]:
                continue
            t, distance = project(leg, load.place)
            ends = leg.element_fractions()
            at = min(max(int(np.searchsorted(ends, t)), 1), len(ends) - 1)
            near.append((distance / (leg.length * float(ends[at] - ends[at - 1])), curve.name, distance))
    if not near:
        return [], []
    part, curve_name, distance = min(near)
    where = f"{distance:.3g} from curve '{curve_name}', {part:.2g} times the length of its elements"
    if part < TOO_NEAR and not load.on_boundary:
        expected = ("a point on the curve, or further away from it, or shorter elements there, "
                    "as grading = \"auto\" makes")
        return [Fault.at(loc, f"a point {where}", expected)], []
    if part >= NEAR:
        return [], []
    return [], [f"The point load '{load.name}' lies {where}: shorter ones there are more accurate."]


def find_acted_on(legs: Sequence[Leg], place: complex) -> Bool:
    """The legs (k,) to which the field of a force at the end of some of them brings tractions. It is radial (Flamant;
    of a wedge, Michell): straight legs that lead through the place are free of any, what is left on curved ones that
    end there changes with the curvature alone, and next to nothing is left on legs that lead past it (GRAZING).
    """
    ends = np.array([(leg.start, leg.end) for leg in legs], dtype=complex).reshape(-1, 2)
    tangents = np.array([leg.tangent(at_end=False) for leg in legs], dtype=complex)[:, None]
    away = ends - place
    along, across = (np.conj(tangents) * away).real, (np.conj(tangents) * away).imag
    seen = (np.abs(across) > GRAZING * np.abs(away)).any(axis=1)
    # From the ends alone of a long leg a place beside its middle is at a small angle, too.
    beside = (along.prod(axis=1) < 0) & (np.abs(across[:, 0]) > TIE * np.abs(away).max(axis=1))
    turning = np.array([abs(leg.turn) > GRAZING for leg in legs], dtype=bool)
    return np.asarray((seen | beside | turning) & away.all(axis=1))


def _place_on_boundary(
    loc: KeyPath, name: str, place: complex, roles: Roles, curves: Mapping[str, Curve], loops: Loops,
    held: Mapping[str, tuple[str, ...]],
) -> PointLoad | Fault | None:
    """None where the boundary of the region is at fault, which is told elsewhere."""
    at = format_point(place)
    touching = [each.name for each in curves.values() for leg in each.legs if place in (leg.start, leg.end)]
    own = list(dict.fromkeys(touching))
    for one in own:
        if one not in roles.outer or one in roles.in_contact:
            kind = "a crack" if one in roles.cracks else "a contact" if one in roles.in_contact else "an interface"
            return Fault.at((*loc, "at"), f"{at}, on '{one}', {kind}",
                            "a point inside a region, or on a curve that bounds one region and touches nothing")
        if one in held:
            return Fault.at((*loc, "at"), f"{at}, on '{one}', where {list_names(held[one])} is prescribed",
                            "a point at which no displacement is prescribed: it would carry the load at once")
    region = roles.outer[own[0]]
    if region not in loops:
        return None
    legs = loop_legs(curves, loops[region])
    arriving = [leg for leg in legs if leg.end == place]
    leaving = [leg for leg in legs if leg.start == place]
    if len(touching) != 2 or len(arriving) != 1 or len(leaving) != 1:
        return Fault.at((*loc, "at"), f"{at}, where {list_names(own)} meet", "a point of the boundary of one region")
    before, after = arriving[0].tangent(at_end=True), leaving[0].tangent(at_end=False)
    half_angle = 0.5 * (math.pi - turning_angle(before, after))
    if min(half_angle, math.pi - half_angle) < 0.5 * SHARPEST:
        return Fault.at((*loc, "at"), f"{at}, the end of a spike or a slit", "a corner that is a wedge")
    inward = 1j * cmath.exp(1j * cmath.phase(before)) * cmath.exp(0.5j * turning_angle(before, after))
    return PointLoad(name, region, place, inward, half_angle, _find_beyond(place, -inward, legs, loops[region]))


def _find_beyond(place: complex, outward: complex, legs: Sequence[Leg], loops: Sequence[Loop]) -> complex | None:
    """Where a cut from a point of the boundary ends before it comes to the region again: as far from it as can be."""
    far = 4 * max(abs(leg.start - place) + leg.length for leg in legs)
    ray = Leg(place, place + far * outward, 1)
    met = [abs(point - place) for leg in legs for point in meeting_points(ray, leg, 0.0)]
    least = 1e-6 * min(leg.length for leg in legs)
    # A corner may lie exactly in the way.
    seen = [(leg.start - place) * np.conj(outward) for leg in legs]
    met += [each.real for each in seen if abs(each.imag) < 1e-9 * far and each.real > 0]
    reach = min((distance for distance in met if distance > least), default=None)
    if reach is None:
        return None
    tried = place + outward * reach * np.arange(1, TRIED) / TRIED
    return complex(tried[np.argmax(measure_distances(legs, tried))])
