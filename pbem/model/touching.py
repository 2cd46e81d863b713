"""How near the two faces of an interface or of a contact are before anything is computed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from pbem.arrays import Real
from pbem.geometry.curve import Curve, Leg
from pbem.geometry.intersection import measure_distances, project
from pbem.model.model import Contact, Interface, Model
from pbem.model.varying import Places, evaluate

Opening = Callable[[Places], Real]


def measure_opening(model: Model, joint: Interface | Contact) -> float:
    """The least initial opening anywhere on an interface, or between the curves of a contact (distance and gap)."""

    def evaluate_gap(places: Places) -> Real:
        return evaluate(joint.law.gap, replace(places, point=places.point + model.origin))

    if isinstance(joint, Interface):
        return find_least(model.curves[joint.name], evaluate_gap)[0]
    first, second = model.curves[joint.first], model.curves[joint.second]

    def opening(places: Places) -> Real:
        return measure_distances(second.legs, places.point) + evaluate_gap(places)

    # A corner of the second curve may face the first one between two samples.
    corners = [complex(end) for leg in second.legs for end in (leg.start, leg.end)]
    feet = [find_foot(first, corner) for corner in corners]
    at_feet = opening(Places(*map(np.array, zip(*feet, strict=True))))
    return min(find_least(first, opening)[0], float(at_feet.min()))


def find_least(curve: Curve, evaluate: Opening) -> tuple[float, complex]:
    """The least value of a function along a curve, and its place: from samples, closer and closer around the least."""
    found, passed = [], 0.0
    for leg in curve.legs:
        found.append(_find_least_on_leg(leg, passed, evaluate))
        passed += leg.length
    return min(found, key=lambda pair: pair[0])


def place_on_leg(leg: Leg, passed: float, fractions: Real) -> Places:
    """Places at fractions of a leg that begins after so much of its curve's length."""
    return Places(leg.point(fractions), passed + leg.length * fractions)


def _find_least_on_leg(leg: Leg, passed: float, evaluate: Opening) -> tuple[float, complex]:
    low, high, count = 0.0, 1.0, min(4 * leg.elements, 4000)
    for _ in range(10):
        fractions = np.linspace(low, high, count + 1)
        places = place_on_leg(leg, passed, fractions)
        values = evaluate(places)
        at = int(np.argmin(values))
        low, high, count = fractions[max(at - 1, 0)], fractions[min(at + 1, count)], 16
    return float(values[at]), complex(places.point[at])


def find_foot(curve: Curve, point: complex) -> tuple[complex, float]:
    """The nearest point of a curve, and the length from the curve's first point to it."""
    nearest = min(range(len(curve.legs)), key=lambda number: project(curve.legs[number], point)[1])
    leg = curve.legs[nearest]
    fraction = project(leg, point)[0]
    passed = sum(before.length for before in curve.legs[:nearest])
    return complex(leg.point(np.array(fraction))), passed + fraction * leg.length
