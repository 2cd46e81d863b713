"""Elements of contacts at or opposite blunt corners: displacements have a kink there, however small the corner is."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise

import numpy as np

from pbem.arrays import Bool
from pbem.geometry.curve import Curve, turning_angle
from pbem.geometry.intersection import project
from pbem.model.model import Model
from pbem.model.sight import CORNER

# Corners that turn by less (radians) are rounding: strains are larger. At those that turn by more than CORNER the curve
# opposite is split.
STRAIGHT = 1e-7
# A corner opposite an element this part of it from its end is as near to the next one.
NEAR = 0.25
# Corners on a curve at most, of its elements: a curve drawn as a polygon has them everywhere.
MOST = 0.5


def find_elements_at_kinks(model: Model) -> Mapping[str, Bool]:
    """Per curve of a contact that has any, whether each of its elements lies at a blunt corner of it, or opposite one.

    Where faces touch, the corner is in their displacement as a kink, even one of a thousandth of a radian: it is as
    large as the strain.
    """
    found: dict[str, Bool] = {}
    for contact in model.contacts.values():
        for name, other in ((contact.first, contact.second), (contact.second, contact.first)):
            curve = model.curves[name]
            points = [*_list_corners(curve), *_list_corners(model.curves[other])]
            if points and len(points) <= MOST * sum(leg.elements for leg in curve.legs):
                at = np.any([_find_beside(curve, point) for point in points], axis=0)
                found[name] = found.get(name, np.zeros(len(at), dtype=bool)) | at
    return found


def _list_corners(curve: Curve) -> list[complex]:
    joints = [*pairwise(curve.legs), *([(curve.legs[-1], curve.legs[0])] if curve.closed else [])]
    turns = [abs(turning_angle(before.tangent(at_end=True), after.tangent(at_end=False))) for before, after in joints]
    return [before.end for (before, _), turn in zip(joints, turns, strict=True) if STRAIGHT < turn <= CORNER]


def _find_beside(curve: Curve, point: complex) -> Bool:
    """Whether each element of a curve is next to a point, across whatever gap."""
    feet = [project(leg, point) for leg in curve.legs]
    nearest = min(range(len(feet)), key=lambda number: feet[number][1])
    beside = []
    for number, (leg, (t, _)) in enumerate(zip(curve.legs, feet, strict=True)):
        ends = np.array(leg.element_fractions())
        spare = NEAR * np.diff(ends)
        touches = feet[number][1] <= feet[nearest][1] * (1 + 1e-9) + 1e-9 * curve.length
        beside.append((ends[:-1] - spare <= t) & (t <= ends[1:] + spare) & touches)
    return np.concatenate(beside)
