"""Curves as chains of straight or circular legs, with the number and grading of the elements on each leg."""

from __future__ import annotations

import cmath
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from pbem.arrays import Complex, Real
from pbem.geometry.elements import Kind, choose_kind

# Divisions of legs that are kept: most legs of a model are divided alike.
DIVISIONS = 1024


@dataclass(frozen=True, slots=True)
class Leg:
    """A straight or circular piece of a curve from `start` to `end` (complex points) with its elements.

    A circular leg has its `center` and the signed angle `sweep` (radians, counter-clockwise positive) it runs
    through. Element ends lie at t^power from every refined end (t uniform); with no refined end they are uniform.
    Where `fractions` (elements + 1, rising from 0 to 1) is given, the element ends lie at these fractions of the
    length instead. At a `singular` end stress may be infinite or jump, whether or not it is refined.
    """

    start: complex
    end: complex
    elements: int
    refine_start: bool = False
    refine_end: bool = False
    power: float = 3.0
    center: complex | None = None
    sweep: float = 0.0
    fractions: tuple[float, ...] | None = None
    singular_start: bool = False
    singular_end: bool = False

    @property
    def length(self) -> float:
        return float(self.kind.length(self))

    @property
    def kind(self) -> Kind:
        """Its geometry: what pbem.geometry.elements knows of straight or circular ones."""
        return choose_kind(self)

    @property
    def turn(self) -> float:
        """Signed angle (radians) that it turns through."""
        return float(self.kind.turn(self))

    def point(self, t: Real) -> Complex:
        """Points at the fractions t (any shape) of the leg's length, as complex numbers."""
        return np.asarray(self.kind.place_fraction(self, t))

    def tangent(self, at_end: bool) -> complex:
        """Unit tangent in the direction of travel at the start or the end."""
        return complex(1j * self.kind.normal_at(self, self.end if at_end else self.start))

    def normals(self, points: Complex) -> Complex:
        """Unit normals to the right of travel, outward of a region on the left, at points of the leg."""
        return np.broadcast_to(self.kind.normal_at(self, points), points.shape)

    def project(self, point: complex) -> float:
        """Fraction of the length at which the normal passes the point; not in [0, 1] beyond the ends."""
        return float(self.kind.project(self, point))

    def reverse(self) -> Leg:
        return replace(
            self, **self.kind.reverse(self)._asdict(),
            refine_start=self.refine_end, refine_end=self.refine_start,
            singular_start=self.singular_end, singular_end=self.singular_start,
            fractions=None if self.fractions is None else tuple(1.0 - t for t in reversed(self.fractions)),
        )

    def split(self, t: float, elements: tuple[int, int]) -> tuple[Leg, Leg]:
        """Two legs that meet smoothly at the fraction t, with the given numbers of elements, not refined there."""
        whole = replace(self, fractions=None)
        middle = complex(self.point(np.array(t)))
        first = replace(whole.cut(0.0, t, self.start, middle, elements[0]), refine_end=False, singular_end=False)
        second = replace(whole.cut(t, 1.0, middle, self.end, elements[1]), refine_start=False, singular_start=False)
        return first, second

    def cut(self, first: float, last: float, start: complex, end: complex, elements: int) -> Leg:
        """The piece between two fractions, from start to end, which are its ends but for rounding."""
        piece = self.kind.cut(self, first, last)
        return replace(self, **piece._replace(start=start, end=end)._asdict(), elements=elements)

    def tie(self, start: complex, end: complex) -> Leg:
        """The leg with other ends, near to its own: itself if they are the same."""
        if start == self.start and end == self.end:
            return self
        return replace(self, **self.kind.tie(self, start, end)._asdict())

    def element_fractions(self) -> Real:
        """The elements + 1 ends of the elements as fractions of the leg's length."""
        if self.fractions is not None:
            return np.array(self.fractions)
        return self.divide(self.elements, self.refine_start, self.refine_end)

    def divide(self, elements: int, refine_start: bool, refine_end: bool) -> Real:
        """Fractions (elements + 1,) at t^power from every refined end, whatever elements the leg has (theory, 79)."""
        return _divide_unit(elements, refine_start, refine_end, self.power).copy()

    def element_ends(self) -> Complex:
        """The elements + 1 ends of the elements along the leg."""
        return self.point(self.element_fractions())


@lru_cache(DIVISIONS)
def _divide_unit(elements: int, refine_start: bool, refine_end: bool, power: float) -> Real:
    """See Leg.divide. Asked for ten times by what fits lengths, the mesh and the estimates."""
    t = np.linspace(0.0, 1.0, elements + 1)
    if refine_start and refine_end:
        t = np.where(t <= 0.5, 0.5 * (2 * t) ** power, 1 - 0.5 * (2 * (1 - t)) ** power)
    elif refine_start:
        t = t**power
    elif refine_end:
        t = 1 - (1 - t) ** power
    return t


@dataclass(frozen=True, slots=True)
class Curve:
    """A named chain of legs, each starting where the one before ends; `closed` if it ends where it starts."""

    name: str
    legs: tuple[Leg, ...]

    @property
    def start(self) -> complex:
        return self.legs[0].start

    @property
    def end(self) -> complex:
        return self.legs[-1].end

    @property
    def closed(self) -> bool:
        return self.start == self.end

    @property
    def length(self) -> float:
        return sum(leg.length for leg in self.legs)

    def reverse(self) -> Curve:
        return Curve(self.name, tuple(leg.reverse() for leg in reversed(self.legs)))


def turning_angle(incoming: complex, outgoing: complex) -> float:
    """Angle in (-pi, pi] from one unit tangent to the next."""
    return cmath.phase(outgoing / incoming)


def find_middle(curves: Mapping[str, Curve]) -> complex:
    """The mean place of all curves, as of their legs."""
    return find_middle_of_legs([leg for curve in curves.values() for leg in curve.legs])


def find_middle_of_legs(legs: Sequence[Leg]) -> complex:
    """Their mean place, by their lengths: it moves and turns with the model, whatever its mesh."""
    first = legs[0].start
    lengths = [leg.length for leg in legs]
    return first + sum(length * (_find_centroid(leg) - first) for leg, length in zip(legs, lengths, strict=True)) / sum(
        lengths
    )


def measure_spread(curves: Mapping[str, Curve], names: Iterable[str]) -> float:
    """Twice the largest distance of the ends of some curves' elements from their mean."""
    ends = [leg.element_ends() for name in names for leg in curves[name].legs]
    points = np.concatenate([each[part] for part in (slice(None, -1), slice(1, None)) for each in ends])
    return float(2 * np.abs(points - points.mean()).max())


def _find_centroid(leg: Leg) -> complex:
    return complex(leg.kind.centroid(leg))
