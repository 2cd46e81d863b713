"""Legs that meet: ends on other legs split them, and every other meeting is a fault."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Set
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pbem.arrays import Integer
from pbem.errors import Fault
from pbem.geometry.boxes import Boxes
from pbem.geometry.curve import Curve, Leg
from pbem.geometry.intersection import coincide, meeting_points, project
from pbem.geometry.shape import share
from pbem.geometry.tolerance import Tolerance

Places = Mapping[str, tuple[complex, ...]]


@dataclass(frozen=True)
class SplitCurves:
    """curves: with legs that end at every junction; breaks: the points per curve at which legs were split."""

    curves: Mapping[str, Curve]
    breaks: Places
    notes: tuple[str, ...]


def format_point(point: complex) -> str:
    """A point for a message."""
    # Coordinates of maps have six digits before the point.
    return f"({', '.join(f'{each:.{10 if 1e4 <= abs(each) < 1e10 else 6}g}' for each in (point.real, point.imag))})"


def format_vector(vector: complex) -> str:
    """A force or another vector for a message."""
    return f"({vector.real:.6g}, {vector.imag:.6g})"


def _pair(found: tuple[Integer, Integer]) -> Iterator[tuple[int, int]]:
    return zip(found[0].tolist(), found[1].tolist(), strict=True)


def split_at_junctions(
    curves: Mapping[str, Curve], tolerance: Tolerance, apart: Set[frozenset[str]] = frozenset()
) -> SplitCurves:
    """Split every leg in whose interior an end of another curve lies; the break is exactly that end.

    apart: pairs of curves of bodies that are drawn into each other, which do not meet in the end.
    """
    legs = [(name, index, leg) for name, curve in curves.items() for index, leg in enumerate(curve.legs)]
    boxes = Boxes.around_legs([leg for _, _, leg in legs], tolerance.largest)
    breaks: dict[tuple[str, int], dict[complex, float]] = defaultdict(dict)
    notes = []
    ends = [(name, end) for name, curve in curves.items() if not curve.closed for end in (curve.start, curve.end)]
    for at, number in _pair(boxes.find_around(np.array([end for _, end in ends], dtype=complex))):
        (name, end), (other, index, leg) = ends[at], legs[number]
        if other == name or end in (leg.start, leg.end) or {other, name} in apart:
            continue
        t, distance = project(leg, end)
        if distance > tolerance.between(name, other) or not 0 < t < 1:
            continue
        if end not in breaks[other, index]:
            notes.append(f"'{other}' is split at {format_point(end)}, where '{name}' ends.")
        breaks[other, index][end] = t
    result = {}
    for name, curve in curves.items():
        pieces = [piece for i, leg in enumerate(curve.legs) for piece in split_leg(leg, breaks.get((name, i), {}))]
        result[name] = Curve(name, tuple(pieces))
    places = {
        name: tuple(point for i in range(len(curve.legs)) for point in breaks.get((name, i), {}))
        for name, curve in curves.items()
    }
    return SplitCurves(result, places, tuple(notes))


def split_leg(leg: Leg, points: Mapping[complex, float]) -> list[Leg]:
    """Pieces between the points (with their fractions); elements in proportion to length, at least one each."""
    cuts = sorted(points.items(), key=lambda item: item[1])
    fractions = [0.0, *(t for _, t in cuts), 1.0]
    ends = [leg.start, *(point for point, _ in cuts), leg.end]
    parts = [b - a for a, b in pairwise(fractions)]
    counts = share(leg.elements, parts)
    return [
        leg.cut(fractions[i], fractions[i + 1], ends[i], ends[i + 1], counts[i])
        for i in range(len(parts))
    ]


def find_crossings(
    curves: Mapping[str, Curve],
    cracks: Mapping[str, str],
    tolerance: Tolerance,
    touching: Set[frozenset[str]] = frozenset(),
) -> list[Fault]:
    """Every place where legs cross, touch or coincide other than at points where curves may meet.

    touching: pairs of curves that are left out, as they may touch anywhere.
    """
    legs = [(name, leg) for name, curve in curves.items() for leg in curve.legs]
    found: dict[tuple[str, str], Fault] = {}
    boxes = Boxes.around_legs([leg for _, leg in legs], tolerance.largest)
    for i, j in _pair(boxes.find_pairs()):
        (name, leg), (other, other_leg) = legs[i], legs[j]
        if (name, other) in found or {name, other} in touching:
            continue
        same = tolerance.between(name, other)
        if coincide(leg, other_leg, same):
            found[name, other] = _overlap(name, other, leg)
            continue
        points = meeting_points(leg, other_leg, same) or _touching_ends(leg, other_leg, same)
        if points:
            found[name, other] = _crossing(name, other, points[0], cracks)
    for pair, point in _meeting_vertices(curves, cracks).items():
        if frozenset(pair) in touching:
            continue
        found.setdefault(pair, _crossing(*pair, point, cracks))
    return list(found.values())


def find_crossing_cracks(cracks: Mapping[str, Curve], tolerance: Tolerance) -> set[str]:
    """Names of the cracks that cross or touch another one, or themselves, elsewhere than with their ends."""
    legs = [(name, leg) for name, curve in cracks.items() for leg in curve.legs]
    if not legs:
        return set()
    found: set[str] = set()
    boxes = Boxes.around_legs([leg for _, leg in legs], tolerance.largest)
    for i, j in _pair(boxes.find_pairs()):
        (name, leg), (other, other_leg) = legs[i], legs[j]
        same = tolerance.between(name, other)
        if {name, other} <= found:
            continue
        touching = {*_touching_ends(leg, other_leg, same)} - {
            end for curve in (cracks[name], cracks[other]) if not curve.closed for end in (curve.start, curve.end)
        }
        if touching or meeting_points(leg, other_leg, same):
            found |= {name, other}
    region = dict.fromkeys(cracks, "")
    return found.union(*_meeting_vertices(cracks, region))


def _touching_ends(first: Leg, second: Leg, tolerance: float) -> list[complex]:
    """Ends of one leg in the interior of the other."""
    points = []
    for leg, other in ((first, second), (second, first)):
        for end in (other.start, other.end):
            if end not in (leg.start, leg.end):
                t, distance = project(leg, end)
                if distance <= tolerance and 0 < t < 1:
                    points.append(end)
    return points


def _meeting_vertices(curves: Mapping[str, Curve], cracks: Mapping[str, str]) -> dict[tuple[str, str], complex]:
    """Pairs of curves that meet in a vertex where neither ends (a crack must end where it meets a boundary)."""
    at: dict[complex, list[tuple[str, bool]]] = defaultdict(list)
    for name, curve in curves.items():
        # A closed crack, as a piece of one that crosses itself, ends where it begins.
        ends = set() if curve.closed and name not in cracks else {curve.start, curve.end}
        for leg in curve.legs:
            at[leg.start].append((name, leg.start in ends))
        if not curve.closed:
            at[curve.end].append((name, True))
    pairs: dict[tuple[str, str], complex] = {}
    for point, visits in at.items():
        for i, (name, ends_here) in enumerate(visits):
            for other, other_ends in visits[i + 1:]:
                crack, other_crack = name in cracks, other in cracks
                if name == other:
                    allowed = False
                elif crack != other_crack:
                    allowed = ends_here if crack else other_ends
                else:
                    allowed = ends_here or other_ends
                if not allowed:
                    pairs.setdefault((name, other), point)
    return pairs


def _overlap(name: str, other: str, leg: Leg) -> Fault:
    found = f"curve '{other}' running over curve '{name}' from {format_point(leg.start)} to {format_point(leg.end)}"
    if name == other:
        found = f"a curve that runs over itself from {format_point(leg.start)} to {format_point(leg.end)}"
    expected = "each piece once: a piece shared by two regions is one curve, named in the boundary of both"
    return Fault.at(("curves", other), found, expected)


def _crossing(name: str, other: str, point: complex, cracks: Mapping[str, str]) -> Fault:
    if name == other:
        found = f"a curve that crosses or touches itself at {format_point(point)}"
        expected = "a curve without crossings: split it into curves that meet at a point"
        return Fault.at(("curves", name), found, expected)
    kinds = ["crack" if one in cracks else "curve" for one in (name, other)]
    found = f"{kinds[1]} '{other}' crossing or touching {kinds[0]} '{name}' at {format_point(point)}"
    if any(one in cracks for one in (name, other)):
        expected = "cracks that meet others only with their ends: split into curves that meet at a point"
    else:
        expected = "boundaries that meet only at ends: split into curves that meet at a point, or move them apart"
    return Fault.at(("curves", other), found, expected)
