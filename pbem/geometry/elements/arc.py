"""Circular elements."""

from __future__ import annotations

from typing import Any

import numpy as np

from pbem.geometry.elements.kind import Crossing, Kind, Piece, Shape
from pbem.geometry.elements.straight import Straight

CHORD = Straight()
# An arc that turns by more is seen in halves, as its chord comes near to nothing.
WIDEST = 0.9 * np.pi
# So many complex numbers are more than 64 bytes.
MANY = 8


class Arc(Kind):
    """A point of an arc is at apex (1 + i q s)/(1 - i q s) from the centre, q = tan(sweep/4), the apex being the middle
    of the arc: a map under which the kernels' integrals are closed (theory, 16, 17).

    From the middle of the chord it is at half the chord times (s - i q)/(1 - i q s): `sample`, and inverted `preimage`.
    """

    degree = float("inf")
    crossings = 2

    def owns(self, e: Shape) -> Any:
        return e.sweep != 0

    def place(self, e: Shape, s: Any) -> Any:
        """From the centre (theory, 16)."""
        return e.center + _radius(e, s)

    def sample(self, e: Shape, s: Any) -> Any:
        q = 1j * _tangent(e)
        return 0.5 * (e.end + e.start) + 0.5 * (e.end - e.start) * (s - q) / (1 - q * s)

    def slope(self, e: Shape, s: Any) -> Any:
        """Of the map from the centre (theory, 17)."""
        q = _tangent(e)
        return _apex(e) * 2j * q / (1 - 1j * q * s) ** 2

    def stretch(self, e: Shape, s: Any) -> Any:
        """The modulus of the slope (theory, 17)."""
        return 2 * abs(e.start - e.center) * abs(_tangent(e)) / self.crowding(e, s)

    def crowding(self, e: Shape, s: Any) -> Any:
        """The factor 1 + q^2 s^2 of tractions (theory, 18)."""
        return 1 + (_tangent(e) * s) ** 2

    def normal(self, e: Shape, s: Any) -> Any:
        radius = _radius(e, s)
        return np.sign(e.sweep) * radius / abs(radius)

    def normal_at(self, e: Shape, z: Any) -> Any:
        """Zero at the centre, on which points of tiny arcs far away can round."""
        radius = z - e.center
        size = abs(radius)
        return np.sign(e.sweep) * radius / np.where(size > 0, size, 1.0)

    def directions(self, e: Shape) -> tuple[Any, Any]:
        chord = e.end - e.start
        return _turn(chord, -0.5 * e.sweep), _turn(chord, 0.5 * e.sweep)

    def curvature(self, e: Shape, s: Any) -> Any:
        return np.sign(e.sweep) / abs(e.start - e.center)

    def preimage(self, e: Shape, z: Any) -> Any:
        q, w = 1j * _tangent(e), CHORD.preimage(e, z)
        return (w + q) / (1 + q * w)

    def locate(self, e: Shape, z: Any) -> Any:
        return np.tan(0.5 * np.angle((z - e.center) / _apex(e))) / _tangent(e)

    def length(self, e: Shape) -> Any:
        return abs(e.start - e.center) * abs(e.sweep)

    def fraction(self, e: Shape, s: Any) -> Any:
        return 0.5 + 2 * np.arctan(_tangent(e) * s) / e.sweep

    def carrier(self, e: Shape) -> tuple[Any, Any, Any]:
        return e.center, 0j, abs(e.start - e.center)

    def walk(self, e: Shape, t: Any) -> Any:
        return e.center + _turn(e.start - e.center, e.sweep * t)

    def cut(self, e: Shape, first: Any, last: Any) -> Piece:
        start, end = (self.place_fraction(e, t) for t in (first, last))
        return Piece(start, end, e.center, e.sweep * (last - first))

    def reverse(self, e: Shape) -> Piece:
        return Piece(e.end, e.start, e.center, -e.sweep)

    def move(self, e: Shape, origin: Any, factor: Any) -> Piece:
        start, end, center = ((z - origin) * factor for z in (e.start, e.end, e.center))
        return Piece(start, end, center, e.sweep)

    def tie(self, e: Shape, start: Any, end: Any) -> Piece:
        return Piece(start, end, 0.5 * (start + end) + 0.5j * (end - start) / np.tan(0.5 * e.sweep), e.sweep)

    def restore(self, e: Shape, z: Any, radius: Any) -> Any:
        return e.center + radius * (z - e.center) / abs(z - e.center)

    def project(self, e: Shape, z: Any) -> Any:
        sweep, whole = abs(e.sweep), 2 * np.pi
        angle = np.angle((z - e.center) / (e.start - e.center)) * np.sign(e.sweep) % whole
        # Beyond the arc's end the ray belongs to the nearer of the two ends.
        return np.where((angle > sweep) & (angle - sweep > whole - angle), angle - whole, angle) / sweep

    def distance(self, e: Shape, z: Any) -> Any:
        ends = np.minimum(abs(z - e.start), abs(z - e.end))
        beside = abs(np.angle((z - e.center) / _apex(e))) < 0.5 * abs(e.sweep)
        return np.minimum(np.where(beside, abs(abs(z - e.center) - abs(e.start - e.center)), ends), ends)

    def cross(self, e: Shape, z: Any, direction: Any) -> list[Crossing]:
        apex, from_center, back = _apex(e), z - e.center, np.conj(direction)
        along = (back * from_center).real
        # The product keeps the digits of a point near the circle; its distance off the foot is |from_center x n|.
        radius = abs(apex)
        inside = (radius - abs(from_center)) * (radius + abs(from_center))
        root = np.sqrt(inside + along**2)
        # The root of smaller size without cancellation, from the product of both: -inside.
        far = -along - np.copysign(root, along)
        near = np.where(far == 0, 0.0, -inside / np.where(far == 0, 1.0, far))
        crossings = []
        for distance in (near, far):
            at = from_center + distance * direction
            local = np.tan(0.5 * np.angle(at / apex)) / _tangent(e)
            crossings.append(Crossing(distance, local, (back * np.sign(e.sweep) * at).real < 0))
        return crossings

    def subtend(self, e: Shape, z: Any) -> Any:
        """The chord's angle, and a full turn between the chord and the arc (theory, 80)."""
        if np.any(abs(e.sweep) > WIDEST):
            return sum(self.subtend(self.cut(e, 0.5 * k, 0.5 * k + 0.5), z) for k in (0, 1))
        # Between the chord and the arc the chord passes on the other side of the point: its angle has the other sign,
        # which also tells a point on the chord itself as the angle was rounded.
        in_circle = abs(z - e.center) < abs(e.start - e.center)
        angle = CHORD.subtend(e, z)
        return angle + 2 * np.pi * np.sign(e.sweep) * (in_circle & (angle * e.sweep < 0))

    def extremes(self, e: Shape) -> list[Any]:
        turning = [e.center + abs(e.start - e.center) * direction for direction in (1, 1j, -1, -1j)]
        on_arc = [(t > 0) & (t < 1) for t in (self.project(e, point) for point in turning)]
        return [e.start, e.end, *(np.where(on, z, e.start) for on, z in zip(on_arc, turning, strict=True))]

    def turn(self, e: Shape) -> Any:
        return e.sweep

    def rise(self, e: Shape, parts: int) -> Any:
        return 2 * abs(e.start - e.center) * np.sin(0.25 * e.sweep / parts) ** 2

    def bulge(self, e: Shape) -> Any:
        return 0.5 * abs(e.end - e.start)

    def area(self, e: Shape) -> Any:
        return 0.5 * abs(e.start - e.center) ** 2 * (e.sweep - np.sin(e.sweep))

    def centroid(self, e: Shape) -> Any:
        half = 0.5 * e.sweep
        return e.center + (self.place_fraction(e, 0.5) - e.center) * np.sin(half) / half


def _tangent(e: Shape) -> Any:
    """q of the map."""
    return np.tan(0.25 * e.sweep)


def _radius(e: Shape, s: Any) -> Any:
    """From the centre to the points at s."""
    turn = 1j * _tangent(e) * s
    return _apex(e) * (1 + turn) / (1 - turn)


def _apex(e: Shape) -> Any:
    """The middle of the arc from the centre."""
    return _turn(e.start - e.center, 0.5 * e.sweep)


def _turn(z: Any, angle: Any) -> Any:
    """Vectors turned by an angle (radians).

    NumPy rounds products of complex arrays in one of two ways where operands begin less than 64 bytes apart in memory,
    which those of few numbers may or may not do: two equal runs would differ in their last bits. They are repeated.
    """
    turn = np.exp(1j * angle)
    if np.ndim(z) == np.ndim(turn) == 0 or np.size(z) >= MANY or np.size(turn) >= MANY:
        return z * turn
    z, turn = np.broadcast_arrays(z, turn)
    return (np.resize(z, MANY) * np.resize(turn, MANY))[: z.size].reshape(z.shape)
