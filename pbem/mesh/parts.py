"""The parts into which cracks cut the regions: faces of the plane graph of boundary elements and both crack faces.

Every boundary element is travelled once and every crack element twice, always with material on the left; at its end the
way goes on along the element that is the first one clockwise of where it came from. What closes counter-clockwise
bounds a part, what closes clockwise is a hole or a group of cracks in one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from pbem.arrays import Bool, Complex, Integer, Real
from pbem.geometry.elements import Elements
from pbem.mesh.mesh import Mesh

# End points nearer to each other than this part of the shorter of their curves are one, as in the case file; and so are
# those that differ by the rounding of the coordinates.
COINCIDENT = 1e-9
ROUNDINGS = 16
# But not those that are further apart than this part of an element that ends there.
WITHIN = 1e-3
# What encloses less than this part of its own length squared encloses nothing.
FLAT = 1e-9
# Directions that differ by less (radians) are one.
SAME_WAY = 1e-9
# Of so many points and elements the angles are found at once: all of a large model would take gigabytes.
SEEN = 100_000


@dataclass(frozen=True)
class Parts:
    """first, second (e,): the part on the left of every element, and that of a crack's second face (first elsewhere).

    region (p,): of every part; the last one of an infinite region is that without a boundary. cut (p,): parts that
    share their region with others. block (p,): those of them that cracks alone bound.
    """

    first: Integer
    second: Integer
    region: Integer
    cut: Bool
    block: Bool


def find_parts(mesh: Mesh) -> Parts:
    """The parts of all regions, which rigid motions move one by one; one for each that no cracks cut (theory, 83).

    The mesh keeps them.
    """
    return mesh.keep("parts", _find_parts)


def _find_parts(mesh: Mesh) -> Parts:
    first = mesh.region.astype(np.int64).copy()
    second, region, unbounded = first.copy(), list(range(len(mesh.region_names))), set[int]()
    for number in np.unique(mesh.region[mesh.crack]):
        own = np.flatnonzero(mesh.region == number)
        label, count, infinite = _divide_region(mesh, own)
        if count < 2:
            continue
        numbers = np.array([number, *range(len(region), len(region) + count - 1)])
        region += [int(number)] * (count - 1)
        first[own] = numbers[label[: len(own)]]
        second[own] = first[own]
        crack = mesh.crack[own]
        second[own[crack]] = numbers[label[len(own) :]]
        if infinite:
            unbounded.add(int(numbers[-1]))
    owner = np.array(region, dtype=np.int64)
    cut = np.bincount(owner)[owner] > 1
    block = cut.copy()
    block[first[~mesh.crack]] = block[list(unbounded)] = False
    return Parts(first, second, owner, cut, block)


def _divide_region(mesh: Mesh, own: Integer) -> tuple[Integer, int, bool]:
    """Part of every way along the elements of a region, cracks' second faces last, the number of parts, and whether the
    last one has no boundary around it."""
    cracks = own[mesh.crack[own]]
    back = mesh.geometry.select(cracks).turn_back()
    ways = Elements.join([mesh.geometry.select(own), back])
    start, end = ways.start, ways.end
    (leave, arrive), count = ways.directions(), ways.count
    vertex = _number_vertices(np.concatenate([start, end]), np.tile(_measure_reach(mesh, own, cracks), 2))
    follower = _follow(vertex[:count], vertex[count:], np.angle(leave), np.angle(-arrive))
    loops, label = connected_components(
        sparse.csr_matrix((np.ones(count), (np.arange(count), follower)), shape=(count, count)), directed=False
    )
    # Twice the area, with what lies beyond the chords; about a point of each loop, as it may be small.
    _, at = np.unique(label, return_index=True)
    origin = start[at][label]
    area = np.asarray((np.conj(start - origin) * (end - origin)).imag, dtype=float)
    area = np.asarray(np.bincount(label, area + 2 * ways.areas, loops), dtype=float)
    around = np.asarray(np.bincount(label, np.abs(end - start), loops), dtype=float)
    outer = np.flatnonzero(area > FLAT * around**2)
    outer = outer[np.argsort(area[outer], kind="stable")]
    if not len(outer):
        return np.zeros(count, dtype=np.int64), 1, False
    # Both sides of closed cracks cancel: what is left is the material's area, or that of the holes in a plane.
    bounded = float(area.sum()) > FLAT * np.abs(start - start.mean()).max() ** 2
    part = np.full(loops, 0 if bounded else len(outer), dtype=np.int64)
    part[outer] = np.arange(len(outer))
    inner = np.setdiff1d(np.arange(loops), outer)
    ways_of = np.split(np.argsort(label, kind="stable"), np.cumsum(np.bincount(label, minlength=loops))[:-1])
    # What hangs together with an outline is around it or beside it, but not within.
    graph = sparse.csr_matrix((np.ones(count), (vertex[:count], vertex[count:])), shape=(2 * count, 2 * count))
    network = connected_components(graph, directed=False)[1][vertex[at]]
    for number in reversed(range(len(outer))):
        others = inner[network[inner] != network[outer[number]]]
        part[others[_is_inside(start[at[others]], ways.select(ways_of[outer[number]]))]] = number
    return part[label], len(outer) + (not bounded), not bounded


def _measure_reach(mesh: Mesh, own: Integer, cracks: Integer) -> Real:
    """Of every way along the elements of a region: how near its ends are to points that are the same."""
    length = np.abs(mesh.end - mesh.start)
    of_curve = np.bincount(mesh.curve[own], length[own], len(mesh.curve_names))
    points = np.concatenate([mesh.start[own], mesh.end[own]])
    rounding = ROUNDINGS * float(np.finfo(float).eps) * float(np.abs(points).max())
    ways = np.concatenate([own, cracks])
    # Elements may be shorter than that by far, where they are graded or a curve is divided by others.
    reach = np.minimum(COINCIDENT * of_curve[mesh.curve[ways]], WITHIN * length[ways])
    return np.maximum(reach, rounding)


def _number_vertices(points: Complex, reach: Real) -> Integer:
    """Numbers (n,) of points, the same for those that are nearer to each other than both of their reaches."""
    places = np.stack([points.real, points.imag], axis=1)
    near = cKDTree(places).query_pairs(float(reach.max()), output_type="ndarray")
    apart = np.abs(points[near[:, 0]] - points[near[:, 1]])
    near = near[apart <= np.minimum(reach[near[:, 0]], reach[near[:, 1]])]
    count = len(points)
    links = sparse.csr_matrix((np.ones(len(near)), (near[:, 0], near[:, 1])), shape=(count, count))
    return np.asarray(connected_components(links, directed=False)[1])


def _follow(leaves: Integer, reaches: Integer, leaving: Real, coming: Real) -> Integer:
    """The way (k,) that follows each: at its end the first clockwise of where it comes from (angles, radians)."""
    order = np.argsort(leaves, kind="stable")
    bounds = np.searchsorted(leaves[order], np.arange(max(leaves.max(), reaches.max()) + 2))
    first, count = bounds[reaches], bounds[reaches + 1] - bounds[reaches]
    follower, least = np.arange(len(leaves)), np.full(len(leaves), np.inf)
    for number in range(int(count.max())):
        ways = np.flatnonzero(count > number)
        others = order[first[ways] + number]
        clockwise = (coming[ways] - leaving[others]) % (2 * np.pi)
        clockwise[clockwise < SAME_WAY] = 2 * np.pi  # the way back comes last
        nearer = clockwise < least[ways]
        follower[ways[nearer]], least[ways[nearer]] = others[nearer], clockwise[nearer]
    return follower


def _is_inside(points: Complex, outline: Elements) -> Bool:
    """Whether points lie inside of a closed outline: by the angles under which they see its elements."""
    corners, (low, high) = np.stack([points.real, points.imag], axis=1), outline.bounds()
    inside = ((corners >= low.min(axis=0)) & (corners <= high.max(axis=0))).all(axis=1)
    near, step = np.flatnonzero(inside), max(1, SEEN // outline.count)
    for begin in range(0, len(near), step):
        some = near[begin : begin + step]
        inside[some] = np.rint(outline.subtend(points[some]).sum(axis=0) / (2 * np.pi)) != 0
    return inside
