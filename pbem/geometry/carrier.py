"""The lines and circles that legs lie on, and distances between them that rounding does not tear apart.

Places are rounded, each by itself: distances from place to place along two faces that nearly touch would have a noise
of the last digit of the coordinates, and the pressure of a contact feels this noise by the modulus over an element's
length. Between two lines or circles there is one distance, rounded once for all points of both, and what the faces
leave of it from point to point follows from small numbers, which are rounded as such (theory, 131).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pbem.arrays import Complex, Integer, Real
from pbem.geometry.curve import Curve, Leg

# Points that are off a line or a circle by so many roundings of their coordinates lie on it.
ROUNDINGS = 8


@dataclass(frozen=True)
class Carriers:
    """Of legs or elements (m,): a point of the line and its unit direction, or the circle's centre, 0 and its radius
    (0 of lines); the same numbers for all that lie on the same line of one curve, or on the same circle."""

    point: Complex
    direction: Complex
    radius: Real

    def select(self, numbers: Integer) -> Carriers:
        """Some of them, by an index."""
        return Carriers(self.point[numbers], self.direction[numbers], self.radius[numbers])


NO_CARRIERS = Carriers(np.zeros(0, dtype=complex), np.zeros(0, dtype=complex), np.zeros(0))


def find_carriers(curves: Mapping[str, Curve]) -> dict[str, Carriers]:
    """Those of the legs of all curves."""
    radii: dict[complex, list[float]] = {}
    return {name: _join(_find_of_curve(curve.legs, radii)) for name, curve in curves.items()}


def measure_distances(
    point: Complex, normal: Complex, own: Carriers, other: Carriers, found: Real, rounding: float
) -> Real:
    """From points (k,) of carriers along unit normals of these to other carriers, where they were found at `found` but
    for rounding. own, other: of each point.

    Lines and circles that touch, or are the same, but for `rounding` do so exactly. (theory, 131)
    """
    straight = other.radius == 0
    off, facing = _measure_off_lines(point, normal, own, other, rounding)
    inside = _measure_in_circles(point, own, other, rounding)
    along = (np.conj(normal) * (point - other.point)).real
    with np.errstate(invalid="ignore", divide="ignore"):
        # Of both crossings with a circle the smaller one follows from their product, without cancellation.
        far = -along - np.copysign(np.sqrt(inside + along**2), along)
        near = -inside / far
        crossed = np.where(np.abs(near - found) <= np.abs(far - found), near, far)
        distance = np.where(straight, off / facing, crossed)
    return np.where(np.isfinite(distance), distance, found)


def _measure_off_lines(
    point: Complex, normal: Complex, own: Carriers, other: Carriers, rounding: float
) -> tuple[Real, Real]:
    """How far lines are off the points along their own normals, and the cosine of these with the points' normals."""
    across = 1j * other.direction
    # Off a circle: first from its point that is nearest to the line, or farthest from it.
    outward = _direct(point - own.point)
    across = np.where((np.conj(across) * outward).real < 0, -across, across)
    between = (np.conj(across) * (other.point - own.point)).real
    of_circle = _snap(between - own.radius, rounding) + 0.5 * own.radius * np.abs(outward - across) ** 2
    walked = (np.conj(own.direction) * (point - own.point)).real
    of_line = _snap(between - walked * (np.conj(across) * own.direction).real, rounding)
    return np.where(own.radius > 0, of_circle, of_line), (np.conj(across) * normal).real


def _measure_in_circles(point: Complex, own: Carriers, other: Carriers, rounding: float) -> Real:
    """Radius squared less the distance from the centre squared, of points in other circles."""
    apart = own.point - other.point
    away = _snap(np.abs(apart), rounding)
    outward, towards = _direct(point - own.point), _direct(apart)
    side = np.where((np.conj(towards) * outward).real < 0, -1.0, 1.0)
    # Of the radii's sum and difference the one that belongs to this side, first: one of both brackets may be small.
    less, more = other.radius - side * own.radius, other.radius + side * own.radius
    of_circle = _snap(less - away, rounding) * _snap(more + away, rounding) + (
        side * own.radius * away * np.abs(outward - side * towards) ** 2
    )
    height = np.abs((np.conj(1j * own.direction) * apart).real)
    walked = (np.conj(own.direction) * (point - other.point)).real
    of_line = _snap(other.radius - height, rounding) * (other.radius + height) - walked**2
    return np.where(own.radius > 0, of_circle, of_line)


def _snap(length: Real, rounding: float) -> Real:
    return np.where(np.abs(length) <= rounding, 0.0, length)


def _direct(vectors: Complex) -> Complex:
    """Unit vectors; 1 for zeros."""
    length = np.abs(vectors)
    return np.where(length > 0, vectors, 1.0) / np.where(length > 0, length, 1.0)


def _find_of_curve(legs: Sequence[Leg], radii: dict[complex, list[float]]) -> Iterable[Carriers]:
    """Those of the legs of a curve, a run of legs at a time. radii: of all circles so far, by their centres."""
    ends = np.array([leg.start for leg in legs] + [legs[-1].end])
    arcs = np.flatnonzero([leg.turn != 0 for leg in legs])
    begin = 0
    while begin < len(legs):
        leg = legs[begin]
        end = begin + 1
        point, direction, radius = leg.kind.carrier(leg)
        if radius:
            radius = _find_radius(point, radius, radii)
        else:
            arc = np.searchsorted(arcs, begin)
            end += _count_on_line(ends[begin : arcs[arc] + 1 if arc < len(arcs) else None])
            chord = legs[end - 1].end - leg.start
            direction = chord / abs(chord)
        yield _spread(point, direction, radius, end - begin)
        begin = end


def _count_on_line(ends: Complex) -> int:
    """How many straight legs go on along the line of the first. ends: of all until the next arc.

    In steps that double as long as they succeed and are halved after: to ask for each leg would be quadratic.
    """
    count, step, growing = 0, 1, True
    while step:
        if count + step + 1 < len(ends) and _lie_on_line(ends[: count + step + 2]):
            count += step
        else:
            growing = False
        step = 2 * step if growing else step // 2
    return count


def _find_radius(center: complex, radius: float, radii: dict[complex, list[float]]) -> float:
    """That of a circle which was there before, if it is the same one."""
    known = radii.setdefault(center, [])
    same = ROUNDINGS * np.finfo(float).eps * (radius + abs(center))
    for each in known:
        if abs(each - radius) <= same:
            return each
    known.append(radius)
    return radius


def _lie_on_line(ends: Complex) -> bool:
    """Whether straight legs between successive ends go on along one line, but for the rounding of their ends."""
    chord = ends[-1] - ends[0]
    if chord == 0:
        return False
    relative = (ends - ends[0]) * np.conj(chord) / abs(chord)
    off, size = np.abs(relative.imag).max(), np.abs(ends).max()
    return bool(off <= ROUNDINGS * np.finfo(float).eps * size and (np.diff(relative.real) > 0).all())


def _spread(point: complex, direction: complex, radius: float, count: int) -> Carriers:
    return Carriers(np.full(count, point), np.full(count, direction), np.full(count, radius))


def _join(parts: Iterable[Carriers]) -> Carriers:
    columns = zip(*((part.point, part.direction, part.radius) for part in parts), strict=True)
    point, direction, radius = (np.concatenate(column) for column in columns)
    return Carriers(point, direction, radius)
