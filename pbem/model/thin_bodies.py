"""Long faces of thin bodies, which elements of low order do not bend."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pbem.geometry.curve import Curve, Leg, turning_angle
from pbem.geometry.intersection import measure_distances, project
from pbem.geometry.loop import Loop
from pbem.geometry.tolerance import TIE
from pbem.model.model import Interface, Region, Stage

# Faces of a body this much longer than it is thick are found. Of bodies with more faces it is not asked.
THIN, MOST_FACES = 8.0, 200
# Straight legs are one face while they keep within this angle (radians) of its first one: what rounded coordinates
# leave of a line.
STRAIGHT = 1e-2


@dataclass(frozen=True)
class _Face:
    """leg: straight legs that go on along a line as one, with the region on its left, or an arc; curves: their names;
    bonded: to another region."""

    leg: Leg
    curves: tuple[str, ...]
    bonded: bool


def list_bonded(interfaces: Mapping[str, Interface], stages: Sequence[Stage]) -> frozenset[str]:
    """Names of the interfaces that hold two regions together in all stages, without elastic joints."""
    return frozenset(
        name for name, interface in interfaces.items()
        if interface.second is not None and interface.law.kind == "bonded"
        and interface.law.normal_stiffness is interface.law.tangential_stiffness is None
        and all(stage.construction.joints.get(name) != "open" for stage in stages)
    )


def find_thin_bodies(curves: Mapping[str, Curve], regions: Sequence[Region], bonded: Collection[str]) -> list[str]:
    """Curves along bodies that are THIN times as long as thick, or more. bonded: those that hold two regions together.

    A layer that is bonded to others on both of its faces is none: it bends as much as they do.
    """
    found: dict[str, None] = {}
    for region in regions:
        faces = [face for loop in region.loops for face in _list_faces(loop, curves, bonded)]
        if not region.rigid and len(faces) <= MOST_FACES:
            found |= dict.fromkeys(name for face in _choose_thin(faces) for name in face.curves)
    return list(found)


def _choose_thin(faces: Sequence[_Face]) -> Iterator[_Face]:
    for number, face in enumerate(faces):
        others = [other for k, other in enumerate(faces) if k != number]
        points = np.asarray(face.leg.point(np.array([0.25, 0.5, 0.75])))
        distance = measure_distances([other.leg for other in others], points).max()
        if THIN * (1 + TIE) * distance < face.leg.length:
            middle = complex(points[1])
            feet = [complex(other.leg.point(np.array(project(other.leg, middle)[0]))) for other in others]
            nearest = min(range(len(feet)), key=lambda k: abs(feet[k] - middle))
            inside = ((feet[nearest] - middle) / (points[2] - points[0])).imag > 0
            if inside and not (face.bonded and others[nearest].bonded):
                yield face


def _list_faces(loop: Loop, curves: Mapping[str, Curve], bonded: Collection[str]) -> list[_Face]:
    """Those of a loop, from a corner on if it has any."""
    faces = [_Face(leg, (side.curve,), side.curve in bonded)
             for side in loop.sides
             for leg in (curves[side.curve] if side.forward else curves[side.curve].reverse()).legs]
    corner = next((k for k in range(len(faces)) if not _go_on(faces[k - 1], faces[k])), 0)
    joined: list[list[_Face]] = []
    for face in (*faces[corner:], *faces[:corner]):
        if joined and _go_on(joined[-1][0], face):
            joined[-1].append(face)
        else:
            joined.append([face])
    return [_join(parts) for parts in joined]


def _go_on(first: _Face, next_one: _Face) -> bool:
    """Whether both are straight and of the same direction, and are bonded or not."""
    if first.leg.turn or next_one.leg.turn or first.bonded != next_one.bonded:
        return False
    return abs(turning_angle(first.leg.tangent(True), next_one.leg.tangent(False))) <= STRAIGHT


def _join(parts: Sequence[_Face]) -> _Face:
    if len(parts) == 1:
        return parts[0]
    names = dict.fromkeys(name for part in parts for name in part.curves)
    return _Face(Leg(parts[0].leg.start, parts[-1].leg.end, 1), tuple(names), parts[0].bonded)
