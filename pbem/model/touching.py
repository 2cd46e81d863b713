"""How near the two faces of an interface or of a contact are before anything is computed."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pbem.arrays import Complex, Real
from pbem.geometry.curve import Curve, Leg
from pbem.geometry.expression import evaluate_expression
from pbem.geometry.intersection import measure_distances, project
from pbem.model.model import Contact, Interface, Law, Model

Opening = Callable[[Complex], Real]


def sample_gap(law: Law, points: Complex) -> Real:
    """The law's own gap at points of the user's coordinates (any shape). Raises ExpressionError if its expression is
    none."""
    if isinstance(law.gap, str):
        return evaluate_expression(law.gap, x=points.real, y=points.imag)
    return np.full(points.shape, law.gap)


def measure_opening(model: Model, joint: Interface | Contact) -> float:
    """The least initial opening anywhere on an interface, or between the curves of a contact (distance and gap)."""
    if isinstance(joint, Interface):
        return find_least(model.curves[joint.name], lambda points: sample_gap(joint.law, points + model.origin))[0]
    first, second = model.curves[joint.first], model.curves[joint.second]

    def opening(points: Complex) -> Real:
        return measure_distances(second.legs, points) + sample_gap(joint.law, points + model.origin)

    # A corner of the second curve may face the first one between two samples.
    corners = [complex(end) for leg in second.legs for end in (leg.start, leg.end)]
    feet = np.array([_find_foot(first, corner) for corner in corners])
    return min(find_least(first, opening)[0], float(opening(feet).min()))


def find_least(curve: Curve, evaluate: Opening) -> tuple[float, complex]:
    """The least value of a function along a curve, and its place: from samples, closer and closer around the least."""
    found = [_find_least_on_leg(leg, evaluate) for leg in curve.legs]
    return min(found, key=lambda pair: pair[0])


def _find_least_on_leg(leg: Leg, evaluate: Opening) -> tuple[float, complex]:
    low, high, count = 0.0, 1.0, min(4 * leg.elements, 4000)
    for _ in range(10):
        fractions = np.linspace(low, high, count + 1)
        points = leg.point(fractions)
        values = evaluate(points)
        at = int(np.argmin(values))
        low, high, count = fractions[max(at - 1, 0)], fractions[min(at + 1, count)], 16
    return float(values[at]), complex(points[at])


def _find_foot(curve: Curve, point: complex) -> complex:
    nearest = min(curve.legs, key=lambda leg: project(leg, point)[1])
    return complex(nearest.point(np.array(project(nearest, point)[0])))
