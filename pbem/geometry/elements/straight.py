"""Straight elements."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from pbem.geometry.elements.kind import Crossing, Kind, Piece, Shape


class Straight(Kind):
    """The place is (start + end)/2 + s (end - start)/2."""

    degree = 1.0
    crossings = 1

    def owns(self, e: Shape) -> Any:
        return e.sweep == 0

    def place(self, e: Shape, s: Any) -> Any:
        """From the middle along the half chord (theory, 16)."""
        return 0.5 * (e.end + e.start) + 0.5 * (e.end - e.start) * s

    def sample(self, e: Shape, s: Any) -> Any:
        return self.place(e, s)

    def slope(self, e: Shape, s: Any) -> Any:
        return 0.5 * (e.end - e.start)

    def crowding(self, e: Shape, s: Any) -> Any:
        return 1.0

    def normal(self, e: Shape, s: Any) -> Any:
        return -1j * ((e.end - e.start) / abs(e.end - e.start))

    def normal_at(self, e: Shape, z: Any) -> Any:
        return self.normal(e, 0.0)

    def directions(self, e: Shape) -> tuple[Any, Any]:
        return e.end - e.start, e.end - e.start

    def curvature(self, e: Shape, s: Any) -> Any:
        return 0.0 * abs(e.end - e.start)

    def preimage(self, e: Shape, z: Any) -> Any:
        return (z - 0.5 * (e.end + e.start)) / (0.5 * (e.end - e.start))

    def locate(self, e: Shape, z: Any) -> Any:
        return self.preimage(e, z).real

    def length(self, e: Shape) -> Any:
        return abs(e.end - e.start)

    def fraction(self, e: Shape, s: Any) -> Any:
        return 0.5 * (1 + s)

    def carrier(self, e: Shape) -> tuple[Any, Any, Any]:
        return e.start, (e.end - e.start) / abs(e.end - e.start), 0.0

    def walk(self, e: Shape, t: Any) -> Any:
        return e.start + (e.end - e.start) * t

    def cut(self, e: Shape, first: Any, last: Any) -> Piece:
        return Piece(self.place_fraction(e, first), self.place_fraction(e, last), e.center, e.sweep)

    def reverse(self, e: Shape) -> Piece:
        return Piece(e.end, e.start, e.center, e.sweep)

    def move(self, e: Shape, origin: Any, factor: Any) -> Piece:
        return Piece((e.start - origin) * factor, (e.end - origin) * factor, e.center, e.sweep)

    def tie(self, e: Shape, start: Any, end: Any) -> Piece:
        return Piece(start, end, e.center, e.sweep)

    def restore(self, e: Shape, z: Any, radius: Any) -> Any:
        return z

    def project(self, e: Shape, z: Any) -> Any:
        along = e.end - e.start
        square = abs(along) ** 2
        if isinstance(square, float) and not square:  # numbers of Python are not divided by zero
            return math.nan
        return ((z - e.start) * along.conjugate()).real / square

    def distance(self, e: Shape, z: Any) -> Any:
        along = e.end - e.start
        local = (z - e.start) / along
        ends = np.minimum(abs(z - e.start), abs(z - e.end))
        beside = (local.real > 0) & (local.real < 1)
        return np.minimum(np.where(beside, abs(local.imag * along), ends), ends)

    def cross(self, e: Shape, z: Any, direction: Any) -> list[Crossing]:
        half, middle, back = 0.5 * (e.end - e.start), 0.5 * (e.end + e.start), np.conj(direction)
        local = (back * (z - middle)).imag / (back * half).imag
        return [Crossing((back * (middle + local * half - z)).real, local, (back * -1j * half).real < 0)]

    def subtend(self, e: Shape, z: Any) -> Any:
        return np.angle((e.end - z) * np.conj(e.start - z))

    def extremes(self, e: Shape) -> list[Any]:
        return [e.start, e.end]

    def turn(self, e: Shape) -> Any:
        return 0.0 * abs(e.end - e.start)

    def rise(self, e: Shape, parts: int) -> Any:
        return 0.0 * abs(e.end - e.start)

    def bulge(self, e: Shape) -> Any:
        return 0.0 * abs(e.end - e.start)

    def area(self, e: Shape) -> Any:
        return 0.0 * abs(e.end - e.start)

    def centroid(self, e: Shape) -> Any:
        return e.start + 0.5 * (e.end - e.start)
