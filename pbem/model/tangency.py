"""Elements that get shorter towards the places where rounded faces touch, or will touch first.

Two faces that part like kappa s^2/2 from where they are nearest touch over a short stretch, however long the elements
are: what presses on them by less than kappa h^2/2 is not seen by elements of the length h at all.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from pbem.arrays import Real
from pbem.geometry.curve import Curve, Leg
from pbem.geometry.intersection import measure_distances
from pbem.geometry.tolerance import TIE
from pbem.model.halving import halve_towards

# The approach of two bodies that is to be seen, as a part of the smaller of both curves' lengths and the radius
# 1/kappa: a strain of this size.
SEEN = 1e-6
# Elements grow by so much per distance from the place.
GROWTH = 1.5
# At least so long are elements, by the distance over which a body may come to touch elsewhere.
PER_WINDOW = 4.0
# Faces farther apart than this part of the same length are not expected to touch.
FAR = 0.05 * (1 + TIE)
# Parts of half an element over which rounded faces part by their squares, up to so much of what they would at a corner.
SCALES = np.array([0.125, 0.5, 1.0])
NOT_ROUND = 0.25
# Faces that part by less than this, by the half element's length, are flush.
FLUSH = 1e-9
# Samples an element in which a least distance is looked for, and of a leg at most.
SAMPLES = 4
MOST_SAMPLES = 4000


@dataclass(frozen=True)
class Tangency:
    """Where two rounded faces are nearest: place (complex) on one of the curves; shortest: length of elements there,
    and within `window` of it, as bodies that move until they touch may do so beside it."""

    place: complex
    shortest: float
    window: float


def find_tangencies(first: Curve, second: Curve) -> Iterator[Tangency]:
    """Of the two curves of a contact; faces that are flush, that meet with a corner or that are far apart have none.

    They are looked for along the curve with the shorter elements, whichever comes first.
    """
    first, second = sorted((first, second), key=_measure_elements)
    passed: list[complex] = []
    for leg in first.legs:
        half = 0.5 * leg.length / leg.elements
        for fraction, least in _find_minima(leg, second):
            place = complex(leg.point(np.array(fraction)))
            curvature = _measure_curvature(leg, second, fraction, least, half)
            if curvature is None or any(abs(place - other) < half for other in passed):
                continue
            passed.append(place)
            size = min(first.length, second.length, 1.0 / curvature)
            if least <= FAR * size:
                shortest = max(float(np.sqrt(2 * SEEN * size / curvature)), least / PER_WINDOW)
                yield Tangency(place, shortest, least)


def grade_tangencies(curves: Mapping[str, Curve], found: Mapping[str, list[Tangency]]) -> dict[str, Curve]:
    """The curves with elements near their tangencies halved until they are short enough."""
    return {name: halve_towards(curve, found[name], GROWTH) if found.get(name) else curve
            for name, curve in curves.items()}


def _measure_elements(curve: Curve) -> float:
    """Their mean length."""
    return curve.length / sum(leg.elements for leg in curve.legs)


def _measure(leg: Leg, second: Curve, fractions: Real) -> Real:
    return measure_distances(second.legs, leg.point(fractions))


def _find_minima(leg: Leg, second: Curve) -> Iterator[tuple[float, float]]:
    """Fractions along a leg where the other curve is nearest around, and the distances."""
    count = min(SAMPLES * leg.elements, MOST_SAMPLES)
    fractions = np.linspace(0.0, 1.0, count + 1)
    values = np.concatenate([[np.inf], _measure(leg, second, fractions), [np.inf]])
    lowest = np.flatnonzero((values[1:-1] <= values[:-2]) & (values[1:-1] < values[2:]))
    for at in lowest.tolist():
        low, high = fractions[max(at - 1, 0)], fractions[min(at + 1, count)]
        for _ in range(8):
            finer = np.linspace(low, high, 17)
            near = _measure(leg, second, finer)
            best = int(np.argmin(near))
            low, high = finer[max(best - 1, 0)], finer[min(best + 1, 16)]
        yield float(finer[best]), float(near[best])


def _measure_curvature(leg: Leg, second: Curve, fraction: float, least: float, half: float) -> float | None:
    """Half of it times the distance squared is what the faces part by; None if they are flush or meet with a corner."""
    step = half / leg.length
    found = []
    for sign in (-1.0, 1.0):
        if 0.0 <= fraction + sign * step <= 1.0:
            parted = _measure(leg, second, fraction + sign * step * SCALES) - least
            if parted[-1] <= FLUSH * half or (np.abs(parted / parted[-1] - SCALES**2) > NOT_ROUND * SCALES).any():
                return None
            found.append(float(2 * parted[-1] / half**2))
    return max(found, default=None)
