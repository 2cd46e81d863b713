"""Elements of contacts at or opposite blunt corners: displacements have a kink there, however small the corner is."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise

import numpy as np

from pbem.arrays import Bool, Complex, Real
from pbem.geometry.curve import Curve, Leg, turning_angle
from pbem.geometry.intersection import measure_distances
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
                at = _find_beside(curve, np.array(points))
                found[name] = found.get(name, np.zeros(len(at), dtype=bool)) | at
    return found


def _list_corners(curve: Curve) -> list[complex]:
    joints = [*pairwise(curve.legs), *([(curve.legs[-1], curve.legs[0])] if curve.closed else [])]
    turns = [abs(turning_angle(before.tangent(at_end=True), after.tangent(at_end=False))) for before, after in joints]
    return [before.end for (before, _), turn in zip(joints, turns, strict=True) if STRAIGHT < turn <= CORNER]


def _find_beside(curve: Curve, points: Complex) -> Bool:
    """Whether each element of a curve is next to one of some points (k,), across whatever gap."""
    # Twice over the legs: of curves of many legs the distances of all points from each would be too much to keep.
    nearest, beside = measure_distances(curve.legs, points), []
    for leg in curve.legs:
        t, distance = _project(leg, points)
        t = t[distance <= nearest * (1 + 1e-9) + 1e-9 * curve.length]
        ends = leg.element_fractions()
        spare = NEAR * np.diff(ends)  # of the element opposite: those beside it may be much longer
        low, high = ends[:-1] - np.append(0.0, spare[:-1]), ends[1:] + np.append(spare[1:], 0.0)
        beside.append((low[:, None] <= t) & (t <= high[:, None]))
    return np.concatenate([each.any(axis=1) for each in beside])


def _project(leg: Leg, points: Complex) -> tuple[Real, Real]:
    """Of points (k,) the fraction of the leg nearest to each, and the distance."""
    t = np.clip(leg.kind.project(leg, points), 0.0, 1.0)
    return t, np.abs(leg.kind.place_fraction(leg, t) - points)
