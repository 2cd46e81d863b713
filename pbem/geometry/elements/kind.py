"""What a kind of element has to give."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, NamedTuple, Protocol

import numpy as np


class Shape(Protocol):
    """Ends (complex), and of an arc the centre and the signed angle (radians) that it turns through, else 0 (or None).

    One element or leg (numbers), or many (arrays).
    """

    @property
    def start(self) -> Any: ...

    @property
    def end(self) -> Any: ...

    @property
    def center(self) -> Any: ...

    @property
    def sweep(self) -> Any: ...


class Piece(NamedTuple):
    """A shape by itself."""

    start: Any
    end: Any
    center: Any
    sweep: Any


class Crossing(NamedTuple):
    """Distance along a ray, coordinate s on the element, and whether the element's outward normal is against the ray;
    distance or s is infinite or nan where there is none."""

    distance: Any
    local: Any
    facing: Any


class Kind(ABC):
    """The geometry of one kind, of all elements of a shape at once.

    s is the coordinate on an element, from -1 at its start to 1 at its end; t the fraction of its length from the
    start. z are points (complex). A shape's data broadcast against s, t and z: all are numbers or arrays.
    Normals are unit ones to the right of travel, outward of a region on the left.

    degree: of the map from s to the place as a polynomial; infinite if it is none.
    crossings: how often a line crosses the element at most.
    """

    degree: float
    crossings: int

    @abstractmethod
    def owns(self, e: Shape) -> Any:
        """Which elements are of this kind (bool)."""

    @abstractmethod
    def place(self, e: Shape, s: Any) -> Any:
        """Points at s."""

    @abstractmethod
    def sample(self, e: Shape, s: Any) -> Any:
        """The same from the ends and the angle alone: for pictures, and near to an end at 0."""

    @abstractmethod
    def slope(self, e: Shape, s: Any) -> Any:
        """Derivative of the place by s (complex)."""

    def stretch(self, e: Shape, s: Any) -> Any:
        """Length per unit of s: the modulus of the slope."""
        return abs(self.slope(e, s))

    @abstractmethod
    def crowding(self, e: Shape, s: Any) -> Any:
        """Stretch in the middle by that at s: the kernels' tractions are polynomials of s times this (theory, 18)."""

    @abstractmethod
    def normal(self, e: Shape, s: Any) -> Any:
        """At s."""

    @abstractmethod
    def normal_at(self, e: Shape, z: Any) -> Any:
        """At points on the element."""

    @abstractmethod
    def directions(self, e: Shape) -> tuple[Any, Any]:
        """Tangents where each leaves its start and arrives at its end, as long as the chord."""

    @abstractmethod
    def curvature(self, e: Shape, s: Any) -> Any:
        """Angle that the tangent turns through per length, at s."""

    @abstractmethod
    def preimage(self, e: Shape, z: Any) -> Any:
        """The complex s that the map takes to z; its real part is the coordinate of a point on the element."""

    @abstractmethod
    def locate(self, e: Shape, z: Any) -> Any:
        """s at which the normal of the carrier, the line or circle, passes z; beyond an end not in [-1, 1]."""

    @abstractmethod
    def length(self, e: Shape) -> Any:
        """Of each element."""

    @abstractmethod
    def fraction(self, e: Shape, s: Any) -> Any:
        """t at s."""

    @abstractmethod
    def carrier(self, e: Shape) -> tuple[Any, Any, Any]:
        """What it is cut out of: of a line a point, the unit direction and 0, of a circle the centre, 0, the radius."""

    @abstractmethod
    def walk(self, e: Shape, t: Any) -> Any:
        """Points at t, but for rounding at the ends."""

    def place_fraction(self, e: Shape, t: Any) -> Any:
        """Points at t, exactly the ends at 0 and 1."""
        if isinstance(t, float):  # of many legs one at a time, arrays of one number would take most of the time
            return e.start if t == 0.0 else e.end if t == 1.0 else self.walk(e, t)
        return np.where(t == 0.0, e.start, np.where(t == 1.0, e.end, self.walk(e, t)))

    @abstractmethod
    def cut(self, e: Shape, first: Any, last: Any) -> Piece:
        """The piece from one fraction t to another."""

    @abstractmethod
    def reverse(self, e: Shape) -> Piece:
        """The same, travelled backwards."""

    @abstractmethod
    def move(self, e: Shape, origin: Any, factor: Any) -> Piece:
        """In other coordinates, (z - origin) factor: moved, turned, enlarged."""

    @abstractmethod
    def tie(self, e: Shape, start: Any, end: Any) -> Piece:
        """The same with other ends, which are near to its own: an arc keeps its angle, and gets another centre."""

    @abstractmethod
    def restore(self, e: Shape, z: Any, radius: Any) -> Any:
        """Points z on the element put back on a circle of the radius that was written, which rounding took them off."""

    @abstractmethod
    def project(self, e: Shape, z: Any) -> Any:
        """As `locate`, but t; beyond an end of an arc it belongs to the nearer of both ends."""

    @abstractmethod
    def distance(self, e: Shape, z: Any) -> Any:
        """Of z to the nearest point of the element."""

    @abstractmethod
    def cross(self, e: Shape, z: Any, direction: Any) -> list[Crossing]:
        """Where the lines through z along unit directions cross the carrier, `crossings` of them."""

    @abstractmethod
    def subtend(self, e: Shape, z: Any) -> Any:
        """Angle by which the ray from z, off the element, to a point of it turns along the element."""

    @abstractmethod
    def extremes(self, e: Shape) -> list[Any]:
        """Points of the element, the ends among them, whose bounding box is the element's."""

    @abstractmethod
    def turn(self, e: Shape) -> Any:
        """Angle (radians) that the tangent turns through, counter-clockwise positive."""

    @abstractmethod
    def rise(self, e: Shape, parts: int) -> Any:
        """How far the element leaves the chords of so many equal parts of it."""

    @abstractmethod
    def bulge(self, e: Shape) -> Any:
        """0 if a circle around the ends contains it; else the radius about the chord's middle that does."""

    @abstractmethod
    def area(self, e: Shape) -> Any:
        """Between the chord and the element, positive if the element is on the right of the chord."""

    @abstractmethod
    def centroid(self, e: Shape) -> Any:
        """Mean place of its length."""
