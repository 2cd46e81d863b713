"""Where points of the plane lie: in which region, or on which element of the boundary."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pbem.arrays import Complex, Integer, Real
from pbem.mesh.mesh import Mesh

# A point lies on an element if it is nearer to it than this part of half its length, or if it is inside and this near
# to one of the element's ends, where the polynomials of neighbours differ: by the shortest element that ends there.
TOUCHING = 1e-8
NEAR_END = 1e-3
CHUNK_BYTES = 32_000_000


@dataclass(frozen=True)
class Location:
    """region (q,): index, -1 outside of all. element (q,): on which the point lies, or -1; s (q,): coordinate there.

    A point on an interface belongs to the first of its regions, on a crack to the first face.
    """

    region: Integer
    element: Integer
    s: Real


def locate_points(mesh: Mesh, infinite: Sequence[int], points: Complex) -> Location:
    """Location of points (q,); infinite: per region, whether it is the outside of its loops, or less than 0: it has no
    inside.

    By winding numbers: the angles that a region's elements subtend add up to a turn about the points inside. They are
    exact for straight elements and arcs, so that no point is on the wrong side of a curved boundary.
    """
    most = max(1, CHUNK_BYTES // (16 * 4 * mesh.elements))
    ends = measure_ends(mesh) if len(points) else np.zeros((mesh.elements, 2))
    parts = [_locate_chunk(mesh, infinite, points[k : k + most], ends) for k in range(0, len(points), most)]
    if not parts:
        none = np.zeros(0, dtype=np.int64)
        return Location(none, none, np.zeros(0))
    return Location(*(np.concatenate(each) for each in zip(*parts, strict=True)))


def measure_ends(mesh: Mesh) -> Real:
    """How near to the start and the end of each element (e, 2) a point is beside that end, in units of half its length.

    A long element and a short one may meet: what is near to the end of the one may be beside the middle of the other.
    """
    ends = np.concatenate([mesh.start, mesh.end])
    lengths = np.tile(mesh.geometry.lengths, 2)
    _, place = np.unique(ends, return_inverse=True)
    shortest = np.full(len(ends), np.inf)
    np.minimum.at(shortest, place.ravel(), lengths)
    return np.asarray((NEAR_END * shortest[place.ravel()] / lengths).reshape(2, -1).T)


def _locate_chunk(mesh: Mesh, infinite: Sequence[int], points: Complex, ends: Real) -> tuple[Integer, Integer, Real]:
    with np.errstate(divide="ignore", invalid="ignore"):
        straight = mesh.geometry.preimage(points).T  # each element from -1 to 1
    off = np.maximum(np.abs(straight.imag), np.abs(straight.real) - 1)
    off = np.where(np.isfinite(off) & (np.array(infinite)[mesh.region] >= 0), off, np.inf)
    nearest = np.argmin(off, axis=1)
    row = np.arange(len(points))
    touches = off[row, nearest] < TOUCHING
    s = np.clip(straight.real[row, nearest], -1, 1)
    turns = _add_angles(mesh, points, len(infinite))
    inside = turns + np.array(infinite) == 1
    region = np.where(inside.any(axis=1), np.argmax(inside, axis=1), -1)
    region = np.where(touches, mesh.region[nearest], region)
    element = np.where(touches, nearest, -1)
    limits = np.where(straight.real < 0, ends[:, 0], ends[:, 1])
    near_end = (np.abs(np.abs(straight.real) - 1 + 1j * straight.imag) < limits) & ~mesh.crack
    near_end &= (np.array(infinite)[mesh.region] >= 0)
    near_end &= (mesh.region == region[:, None]) & ~touches[:, None]
    close = near_end.any(axis=1)
    element[close] = np.argmax(near_end[close], axis=1)
    s[close] = np.clip(straight.real[close, element[close]], -1, 1)
    return region, element, np.where(element >= 0, s, 0.0)


def _add_angles(mesh: Mesh, points: Complex, regions: int) -> Integer:
    """Winding numbers (q, regions) of the regions' loops about the points (theory, 80)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        angle = np.where(mesh.crack, 0.0, mesh.geometry.subtend(points).T)
    # Elements follow each other region by region; a region may have none.
    first = np.searchsorted(mesh.region, np.arange(regions + 1))
    there = np.flatnonzero(np.diff(first))
    turns = np.zeros((len(points), regions))
    turns[:, there] = np.add.reduceat(angle, first[there], axis=1)
    return np.rint(np.nan_to_num(turns) / (2 * np.pi)).astype(np.int64)
