"""Where many points lie among many elements: in which region, or on which face; only what is near is looked at.

As `pbem.bem.location`, which compares every point with every element.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from pbem.arrays import Bool, Complex, Integer, Real
from pbem.bem.location import TOUCHING, measure_ends
from pbem.geometry.elements import Elements
from pbem.mesh.mesh import Mesh
from pbem.mesh.resampling import find_neighbours

# Circles around elements are taken larger by this part.
MARGIN = 0.02
# Angles of loops about points are evaluated for so many pairs of both at once.
CHUNK = 2_000_000
# Coordinates are rounded by so many units of their last digit.
ROUNDINGS = 8
# Points nearer to a face than this part of the mean (geometric) of the model's extent and the length of the curve are
# on it: over the square of the distance, the rounding of places would be a stress, beside the joints of elements. But
# not if they are further than the part BESIDE of the element, or of what is left up to a corner, a tip or a junction.
CLOSE, BESIDE = 5e-7, 1e-2


@dataclass(frozen=True)
class Whereabouts:
    """region (q,): index, -1 outside of all. face (q,): the element, or second face of a crack, on which a point lies,
    or -1; s (q,): coordinate there. beside (q,): it is one that lies beside the element or its end, not on it.
    """

    region: Integer
    face: Integer
    s: Real
    beside: Bool


def find_points(
    mesh: Mesh, faces: Elements, infinite: Integer, points: Complex, reach: Real, second: bool
) -> Whereabouts:
    """Where points (q,) lie; infinite (r,): 1 of a region that is the outside of its loops, less than 0 of one without
    an inside, else 0; reach (q,): the largest number in their coordinates, which rounds them.

    second: a point on a crack or interface belongs to the second of its sides, else to the first.
    """
    region = _count_turns(mesh, faces, infinite, points)
    point, face = _list_near(faces, points)
    s = faces.select(face).preimage(points[point, None])[:, 0] if len(face) else np.zeros(0, dtype=complex)
    off = np.maximum(np.abs(s.imag), np.abs(s.real) - 1)
    half = 0.5 * faces.lengths[face]
    tolerance = np.maximum(TOUCHING, ROUNDINGS * np.finfo(float).eps * reach[point] / half)
    on = np.full(len(points), -1)
    where = np.zeros(len(points))
    # Sides of the same place: regions by their numbers, of a crack the first face before the second.
    first_faces = np.concatenate([np.arange(mesh.elements), np.flatnonzero(mesh.crack)])
    side = 2 * mesh.region[first_faces] + (np.arange(faces.count) >= mesh.elements)
    off[infinite[mesh.region[first_faces[face]]] < 0] = np.inf
    touching = np.flatnonzero(off < tolerance)
    rank = (-1 if second else 1) * side[face[touching]]
    order = touching[np.lexsort((off[touching], rank, point[touching]))]
    touched, chosen = np.unique(point[order], return_index=True)
    _take(on, where, touched, order[chosen], face, s)
    region[touched] = mesh.region[first_faces[on[touched]]]
    # Beside an end of an element inside of its region: there the polynomials of neighbours differ.
    inner = face < mesh.elements
    limits = measure_ends(mesh)[np.where(inner, face, 0), (s.real > 0).astype(int)]
    ending = np.abs(np.abs(s.real) - 1 + 1j * s.imag) < limits
    ending &= inner & ~mesh.crack[np.where(inner, face, 0)] & (on[point] < 0)
    ending &= (mesh.region[first_faces[face]] == region[point]) & np.isfinite(off)
    close, chosen = np.unique(point[ending], return_index=True)
    _take(on, where, close, np.flatnonzero(ending)[chosen], face, s)
    beside = np.zeros(len(points), dtype=bool)
    beside[close] = True
    # Beside a face, on its own side of a crack or interface.
    left = (on[point] < 0) & (mesh.region[first_faces[face]] == region[point]) & np.isfinite(off)
    left &= (np.abs(s.real) <= 1) & (s.imag > 0) & (s.imag < 2 * BESIDE)
    left = np.flatnonzero(left)
    if len(left):
        left = left[s.imag[left] * half[left] < _find_limits(mesh, faces, first_faces, face[left], s.real[left])]
    left = left[np.lexsort((s.imag[left] * half[left], point[left]))]
    close, chosen = np.unique(point[left], return_index=True)
    _take(on, where, close, left[chosen], face, s)
    beside[close] = True
    return Whereabouts(region, on, where, beside)


def _find_limits(mesh: Mesh, faces: Elements, first_faces: Integer, face: Integer, s: Real) -> Real:
    """The distance (k,) from places s on faces, within which points are on these."""
    lengths = mesh.geometry.lengths
    curves = np.bincount(mesh.curve, lengths)[mesh.curve[first_faces[face]]]
    following, smooth = find_neighbours(mesh)
    loose = np.ones((mesh.elements, 2), dtype=bool)
    goes_on = np.flatnonzero((following >= 0) & smooth)
    loose[goes_on, 1] = loose[following[goes_on], 0] = False
    ends = loose[first_faces[face]]
    # Second faces of cracks run the other way.
    ends = np.where((face >= mesh.elements)[:, None], ends[:, ::-1], ends)
    length = faces.lengths[face]
    up_to = np.where(ends, 0.5 * length[:, None] * np.stack([1 + s, 1 - s], axis=1), np.inf).min(axis=1)
    return np.asarray(np.minimum(CLOSE * np.sqrt(faces.extent * curves), BESIDE * np.minimum(length, up_to)))


def _take(on: Integer, where: Real, points: Integer, chosen: Integer, face: Integer, s: Complex) -> None:
    on[points] = face[chosen]
    where[points] = np.clip(s.real[chosen], -1, 1)


def _list_near(faces: Elements, points: Complex) -> tuple[Integer, Integer]:
    """Pairs of points and faces that are near each other, by the points."""
    middle = 0.5 * (faces.start + faces.end)
    radius = (1 + MARGIN) * np.maximum(0.5 * np.abs(faces.end - faces.start), faces.bulges)
    if not len(points):
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    tree = cKDTree(np.column_stack([points.real, points.imag]))
    found = tree.query_ball_point(np.column_stack([middle.real, middle.imag]), radius)
    counts = np.array([len(each) for each in found], dtype=np.int64)
    point = np.concatenate([np.zeros(0, dtype=np.int64), *(np.array(each, dtype=np.int64) for each in found if each)])
    face = np.repeat(np.arange(faces.count), counts)
    order = np.argsort(point, kind="stable")
    return point[order], face[order]


def _count_turns(mesh: Mesh, faces: Elements, infinite: Integer, points: Complex) -> Integer:
    """The region (q,) that each point is in, by the turns of the regions' boundaries about it; -1 outside of all.

    A loop turns only about points in the box around it: of thousands of small ones each point meets few. (theory, 80)
    """
    turns: dict[int, Real] = {}
    for loop in _part_loops(mesh):
        edges = faces.select(loop)
        region = int(mesh.region[loop[0]])
        inside = np.arange(len(points))
        if (np.roll(edges.start, -1) == edges.end).all():
            low, high = edges.bounds()
            (left, below), (right, above) = low.min(axis=0), high.max(axis=0)
            inside = np.flatnonzero((points.real >= left) & (points.real <= right)
                                    & (points.imag >= below) & (points.imag <= above))  # fmt: skip
        total = turns.setdefault(region, np.zeros(len(points)))
        most = max(1, CHUNK // len(loop))
        for begin in range(0, len(inside), most):
            chosen = inside[begin : begin + most]
            with np.errstate(divide="ignore", invalid="ignore"):
                total[chosen] += np.nan_to_num(edges.subtend(points[chosen])).sum(axis=0)
    found = np.full(len(points), -1)
    for region in range(len(infinite) - 1, -1, -1):
        count = np.rint(turns.get(region, np.zeros(len(points))) / (2 * np.pi))
        found[count + infinite[region] == 1] = region
    return found


def _part_loops(mesh: Mesh) -> list[Integer]:
    """The elements of every boundary, in pieces that are closed where their ends are told exactly."""
    bounding = np.flatnonzero(~mesh.crack)
    if not len(bounding):
        return []
    before, after = bounding[:-1], bounding[1:]
    breaks = (mesh.region[after] != mesh.region[before]) | (mesh.start[after] != mesh.end[before])
    return np.split(bounding, np.flatnonzero(breaks) + 1)
