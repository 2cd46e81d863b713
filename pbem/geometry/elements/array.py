"""Many elements of any kinds, by arrays: each function is evaluated once for each kind that is among them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from pbem.arrays import Bool, Complex, Real
from pbem.geometry.elements.arc import Arc
from pbem.geometry.elements.kind import Crossing, Kind, Piece, Shape
from pbem.geometry.elements.straight import Straight
from pbem.uniform import fold_uniform

STRAIGHT, ARC = Straight(), Arc()
KINDS: tuple[Kind, ...] = (STRAIGHT, ARC)


def choose_kind(shape: Shape) -> Kind:
    """The kind of a single element or leg."""
    return next(kind for kind in KINDS if kind.owns(shape))


@dataclass(frozen=True)
class Elements:
    """Elements (m,), or (k, m), in the order of travel: ends (complex), and of arcs the centre and the signed angle
    (radians), else 0.

    Coordinates s, fractions t of the length and points are (p,), the same for all elements, or (m, p), for each its
    own; what is found there is (m, p). See `kind.Kind` for what is not said here.
    """

    start: Complex
    end: Complex
    center: Complex
    sweep: Real

    @classmethod
    def collect(cls, shapes: Sequence[Shape]) -> Elements:
        """Of single shapes, such as legs."""
        start, end, center = (
            np.array([getattr(shape, name) or 0j for shape in shapes], dtype=complex)
            for name in ("start", "end", "center")
        )
        return cls(start, end, center, np.array([shape.sweep for shape in shapes], dtype=float))

    @classmethod
    def by_ends(cls, start: Complex, end: Complex, sweep: Real) -> Elements:
        """Without centres, which follow from the rest."""
        half, curved = 0.5 * (end - start), sweep != 0
        across = np.divide(1j * half, np.tan(0.5 * sweep), out=np.zeros_like(half), where=curved)
        return cls(start, end, np.where(curved, 0.5 * (start + end) + across, 0), sweep)

    @classmethod
    def complete(cls, start: Complex, end: Complex, center: Complex | None, sweep: Real | None) -> Elements:
        """Straight ones if their centres and angles are not given."""
        none = np.zeros(len(start))
        return cls(start, end, none.astype(complex) if center is None else center, none if sweep is None else sweep)

    @classmethod
    def join(cls, parts: Sequence[Elements]) -> Elements:
        return cls(*(np.concatenate([getattr(part, name) for part in parts]) for name in cls.__dataclass_fields__))

    def fold(self) -> Elements:
        """The same; of straight ones alone the zeros for centres and angles take no room and cannot be written to."""
        return Elements(self.start, self.end, fold_uniform(self.center), fold_uniform(self.sweep))

    @property
    def count(self) -> int:
        return len(self.start)

    def select(self, numbers: Any) -> Elements:
        """Some of them, by an index of arrays."""
        return Elements(self.start[numbers], self.end[numbers], self.center[numbers], self.sweep[numbers])

    def reverse(self) -> Elements:
        """All travelled backwards, the last one first."""
        return self.turn_back().select(slice(None, None, -1))

    def turn_back(self, which: Bool | None = None) -> Elements:
        """All, or some of them (m,), travelled backwards where they are."""
        back = self._transform("reverse")
        if which is None:
            return back
        return Elements(*(np.where(which, getattr(back, name), getattr(self, name)) for name in self._names))

    def cut(self, first: Real, last: Real) -> Elements:
        """Of each (m,) the piece from one fraction t of its length to another."""
        return self._transform("cut", first, last)

    def move(self, origin: Complex, factor: Complex) -> Elements:
        """In the coordinates (z - origin) factor: moved, turned, enlarged; both broadcast against the elements."""
        of_each = (np.broadcast_to(value, self.start.shape) for value in (origin, factor))
        return self._transform("move", *of_each)

    @property
    def lengths(self) -> Real:
        return self._each("length")

    @property
    def turns(self) -> Real:
        """Angle (m,) that each turns through (radians), counter-clockwise positive."""
        return self._each("turn")

    @property
    def bulges(self) -> Real:
        """Radius (m,) about the middle of the chord that contains each; 0 if a circle around its ends does."""
        return self._each("bulge")

    @property
    def areas(self) -> Real:
        """Area (m,) between the chord and each, positive if it is on the right of the chord."""
        return self._each("area")

    @property
    def degree(self) -> float:
        """Of the maps from s to the places: the largest."""
        return max(kind.degree for kind, _ in self._groups)

    @property
    def extent(self) -> float:
        """The largest modulus of the numbers that they are given by: they are rounded as these are."""
        return float(max(np.abs(each).max(initial=0.0) for each in (self.start, self.end, self.center)))

    def rises(self, parts: int = 1) -> Real:
        """How far (m,) each leaves the chords of so many equal parts of it."""
        return self._each("rise", parts)

    def extremes(self) -> Complex:
        """Points (m, c) on them whose bounding boxes are theirs; some may be named more than once."""
        found = [(own, kind.extremes(self.select(own))) for kind, own in self._groups]
        points = np.repeat(self.start[:, None], max(len(own_points) for _, own_points in found), axis=1)
        for own, own_points in found:
            for number, point in enumerate(own_points):
                points[own, number] = point
        return points

    def bounds(self) -> tuple[Real, Real]:
        """Lower left and upper right corners, x and y (m, 2), of the boxes around them."""
        points = self.extremes()
        low, high = ([of(part, axis=1) for part in (points.real, points.imag)] for of in (np.min, np.max))
        return np.stack(low, axis=1), np.stack(high, axis=1)

    def place(self, local: Real) -> Complex:
        """Points at s (theory, 16)."""
        return self._at("place", local)

    def sample(self, local: Real) -> Complex:
        """Points at s for pictures."""
        return self._at("sample", local)

    def slope(self, local: Real) -> Complex:
        """Derivatives of the points by s (theory, 17)."""
        return self._at("slope", local)

    def stretch(self, local: Real) -> Real:
        """Length of the element per unit of s (theory, 17)."""
        return self._at("stretch", local)

    def crowding(self, local: Real) -> Real:
        """Stretch in the middle of each by that at s (theory, 18)."""
        return self._at("crowding", local)

    def normals(self, local: Real) -> Complex:
        """Unit outward normals: to the right of travel."""
        return self._at("normal", local)

    def normals_at(self, points: Complex) -> Complex:
        """Unit outward normals at points on the elements."""
        return self._at("normal_at", points)

    def curvature(self, local: Real) -> Real:
        """Angle that the tangent turns through per length."""
        return self._at("curvature", local)

    def directions(self) -> tuple[Complex, Complex]:
        """Tangents (m,) where each leaves its start and arrives at its end, as long as the chord."""
        leaves, arrives = np.empty_like(self.start), np.empty_like(self.start)
        for kind, own in self._groups:
            leaves[own], arrives[own] = kind.directions(self.select(own))
        return leaves, arrives

    def preimage(self, points: Complex) -> Complex:
        """The complex s that the map of each takes to the points; of points on the element it is real."""
        return self._at("preimage", points)

    def locate(self, points: Complex) -> Real:
        """s at which the normal of each passes the points."""
        return self._at("locate", points)

    def fractions(self, local: Real) -> Real:
        """Fraction of each element's length that lies before s."""
        return self._at("fraction", local)

    def place_fractions(self, t: Real) -> Complex:
        """Points at t."""
        return self._at("place_fraction", t)

    def distances(self, points: Complex) -> Real:
        """Of points to the nearest points of the elements."""
        return self._at("distance", points)

    def subtend(self, points: Complex) -> Real:
        """Angles by which the ray from the points turns along the elements."""
        return self._at("subtend", points)

    def arc_lengths(self, local: Real) -> Real:
        """Length (m, p) from the first element's start to the points at s."""
        lengths = self.lengths
        return (np.cumsum(lengths) - lengths)[:, None] + lengths[:, None] * self.fractions(local)

    def cross(self, points: Complex, directions: Complex) -> Crossing:
        """Distance, s and facing (m, p, c) of the crossings of rays (p,), unit directions, with elements (m,).

        c is that of the kind that is crossed most often; distance and s are infinite where there is no crossing.
        """
        size = (self.count, len(points), max(kind.crossings for kind, _ in self._groups))
        found = Crossing(np.full(size, np.inf), np.full(size, np.inf), np.zeros(size, dtype=bool))
        with np.errstate(divide="ignore", invalid="ignore"):
            for kind, own in self._groups:
                for number, crossing in enumerate(kind.cross(self.select(own)._columns, points, directions)):
                    met = np.isfinite(crossing.distance) & np.isfinite(crossing.local)
                    found.distance[own, :, number] = np.where(met, crossing.distance, np.inf)
                    found.local[own, :, number] = np.where(met, crossing.local, np.inf)
                    found.facing[own, :, number] = crossing.facing & met
        return found

    @property
    def _names(self) -> tuple[str, ...]:
        return tuple(self.__dataclass_fields__)

    @cached_property
    def _groups(self) -> tuple[tuple[Kind, Any], ...]:
        """The kinds that are there, and which elements are theirs, as an index."""
        owned = [(kind, kind.owns(self)) for kind in KINDS]
        found = [(kind, own) for kind, own in owned if own.any()]
        return tuple(found) if len(found) > 1 else ((found[0][0] if found else STRAIGHT, ...),)

    @cached_property
    def _columns(self) -> Elements:
        """With an axis for the points."""
        return self.select((..., None))

    def _each(self, name: str, *values: Any) -> Any:
        """A value for each element."""
        parts = [(own, getattr(kind, name)(self.select(own), *values)) for kind, own in self._groups]
        return self._put_together(parts, self.start.shape)

    def _at(self, name: str, values: Any) -> Any:
        """A value for each element and point."""
        values = np.asarray(values)
        columns, shape = self._columns, np.broadcast_shapes((*self.start.shape, 1), values.shape)
        parts = []
        for kind, own in self._groups:
            chosen = values if own is ... or values.ndim < 2 else np.broadcast_to(values, shape)[own]
            parts.append((own, getattr(kind, name)(columns.select(own), chosen)))
        return self._put_together(parts, shape)

    def _transform(self, name: str, *values: Any) -> Elements:
        made = Elements(*(np.empty_like(getattr(self, each)) for each in self._names))
        for kind, own in self._groups:
            piece: Piece = getattr(kind, name)(self.select(own), *(value[own] for value in values))
            for each in self._names:
                getattr(made, each)[own] = getattr(piece, each)
        return made

    @staticmethod
    def _put_together(parts: Sequence[tuple[Any, Any]], shape: tuple[int, ...]) -> Any:
        own, first = parts[0]
        if own is ... and np.shape(first) == shape:
            return first
        result = np.empty(shape, dtype=np.result_type(first))
        for own, part in parts:
            result[own] = part
        return result
