"""Where the conservation integrals about a crack tip run: the crack from the tip on, and the circle that cuts it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from pbem.arrays import Bool, Complex, Integer, Real
from pbem.geometry.elements import Elements
from pbem.mesh.mesh import Mesh

# The circle has this part of the distance to whatever else is there as its radius, and this part of the distance to
# the crack's other tip, at most; and so many elements in it.
REACH = 0.5
REACH_ALONG = 0.6
MOST_INSIDE = 12
# A crack that turns by more between two elements (radians) has a corner, where the field is not smooth.
KINK = np.radians(10.0)
# Elements of the crack up to so many radii are taken together.
NEAR = 3.0


@dataclass(frozen=True)
class TipPaths:
    """Of tips (k,), numbers among those asked for, from each of which equally many elements lead on.

    elements (k, m): of the crack, from the tip on, across the ends of curves that go on; outward (k, m): whether they
    run away from the tip. whole (k,): they are the entire crack, which ends at a second tip. near (k,): how many of
    them lie near to the circle or within it.
    cut (k,): which of them the circle cuts (its place in the list), at the coordinate cut_at in [-1, 1] as seen when
    going away from the tip.
    """

    tip: Integer
    elements: Integer
    outward: Bool
    whole: Bool
    near: Integer
    cut: Integer
    cut_at: Real


@dataclass(frozen=True)
class _Chain:
    elements: list[int]
    outward: list[bool]
    ends_in_tip: bool


def trace_paths(
    mesh: Mesh, element: Integer, end: Integer, most_whole: int, loads: Complex | None = None
) -> list[TipPaths]:
    """Paths of tips at the given ends (0 start, 1 end) of crack elements (k,).

    A crack of more than most_whole elements is not followed to its other tip. loads: places of point loads, which the
    circles keep away from as from anything else.
    """
    chains = _follow(mesh, element, end, most_whole)
    point = np.where(end == 0, mesh.start[element], mesh.end[element])
    count = np.array([len(chain.elements) for chain in chains])
    loads = np.zeros(0, dtype=complex) if loads is None else loads
    places = sort_by_length(mesh)
    return [_trace_alike(mesh, tips, point[tips], [chains[tip] for tip in tips], loads, places)
            for tips in (np.flatnonzero(count == length) for length in np.unique(count))]


def view_outward(mesh: Mesh, elements: Integer, outward: Bool) -> Elements:
    """Elements (any shape) as they are met when leaving a tip."""
    return mesh.geometry.select(elements).turn_back(~outward)


def _trace_alike(
    mesh: Mesh, tip: Integer, point: Complex, chains: list[_Chain], loads: Complex, places: list[Places]
) -> TipPaths:
    elements = np.array([chain.elements for chain in chains])
    outward = np.array([chain.outward for chain in chains])
    whole = np.array([chain.ends_in_tip for chain in chains])
    seen = view_outward(mesh, elements, outward)
    start, end = seen.start - point[:, None], seen.end - point[:, None]
    inside, along = _reach_along(start, end, seen.directions(), whole)
    own = np.repeat(np.arange(len(tip)), inside), elements[np.arange(elements.shape[1]) < inside[:, None]]
    clearance = measure_clearance(mesh, point, along, *own, places)
    if len(loads):
        clearance = np.minimum(clearance, np.abs(point[:, None] - loads).min(axis=1))
    middle = np.abs(seen.move(point[:, None], np.array(1.0)).sample(np.zeros(1))[..., 0])
    limit = np.minimum(along, REACH * clearance)
    fits = middle <= limit[:, None] * (1 + 1e-9)
    fits &= np.arange(elements.shape[1]) < np.minimum(inside, MOST_INSIDE)[:, None]
    cut = np.where(fits.any(axis=1), elements.shape[1] - 1 - np.argmax(fits[:, ::-1], axis=1), 0)
    # Within the first element in steps, so that paths look alike.
    share = np.maximum(limit / middle[:, 0], 0.02)
    cut_at = np.where(fits.any(axis=1), 0.0, 2.0 ** (0.5 * np.floor(2 * np.log2(np.minimum(share, 1.0)))) - 1.0)
    beyond = np.abs(end) > NEAR * middle[np.arange(len(tip)), cut][:, None]
    near = np.where(beyond.any(axis=1), np.argmax(beyond, axis=1) + 1, elements.shape[1])
    return TipPaths(tip, elements, outward, whole, near, cut, cut_at)


def _follow(mesh: Mesh, element: Integer, end: Integer, most: int) -> list[_Chain]:
    """The elements from each tip on, as far as exactly two elements of cracks meet."""
    _, meeting = np.unique(np.concatenate([mesh.start, mesh.end]), return_inverse=True)
    counts = np.bincount(meeting)
    # Lists: numbers are looked up one by one.
    order, vertex, count = np.argsort(meeting, kind="stable").tolist(), meeting.tolist(), counts.tolist()
    first, total, crack = (np.cumsum(counts) - counts).tolist(), mesh.elements, mesh.crack.tolist()
    chains = []
    for begin, side in zip(element.tolist(), end.tolist(), strict=True):
        elements, outward = [begin], [side == 0]
        ends_in_tip = False
        while len(elements) <= most:
            last = elements[-1]
            point = vertex[last + total * outward[-1]]
            if count[point] != 2:
                ends_in_tip = count[point] == 1
                break
            one, two = order[first[point] : first[point] + 2]
            other = one if one % total != last else two
            following = other % total
            if not crack[following] or following == begin:
                break
            elements.append(following)
            outward.append(other < total)
        chains.append(_Chain(elements, outward, ends_in_tip))
    return chains


def _reach_along(
    start: Complex, end: Complex, directions: tuple[Complex, Complex], whole: Bool
) -> tuple[Integer, Real]:
    """How many elements (k, m), seen from the tip, lead away from it without a corner, and the largest radius that they
    allow; directions: in which they leave their start and arrive at their end."""
    leaves, arrives = directions
    away = (np.conj(start) * leaves).real >= 0
    away &= (np.conj(end) * arrives).real > 0
    away[:, 1:] &= np.abs(np.angle(leaves[:, 1:] / arrives[:, :-1])) < KINK
    every = away.all(axis=1)
    inside = np.where(every, away.shape[1], np.maximum(np.argmin(away, axis=1), 1))
    farthest = np.abs(end[np.arange(len(end)), inside - 1])
    return inside, np.where(every & whole, REACH_ALONG, REACH) * farthest


@dataclass(frozen=True)
class Places:
    """Elements (k,) of a mesh that are about as long as the longest of them, and a tree of their middles."""

    elements: Integer
    longest: float
    tree: cKDTree


def sort_by_length(mesh: Mesh) -> list[Places]:
    """All elements, those together whose lengths are between the same powers of two times the shortest."""
    lengths = mesh.geometry.lengths
    middle = 0.5 * (mesh.start + mesh.end)
    classes = np.floor(np.log2(lengths / lengths.min())).astype(int)
    found = []
    for number in np.unique(classes):
        members = np.flatnonzero(classes == number)
        tree = cKDTree(np.column_stack([middle[members].real, middle[members].imag]))
        found.append(Places(members, float(lengths[members].max()), tree))
    return found


def measure_clearance(
    mesh: Mesh, points: Complex, radius: Real, owner: Integer, own: Integer, places: list[Places] | None = None
) -> Real:
    """Distance of each point to the nearest element that is not its own; infinite beyond twice the radius.

    owner, own (l,): points, and elements that are theirs. places: of `sort_by_length`, if they are known.
    """
    clearance = np.full(len(points), np.inf)
    left_out = owner * mesh.elements + own
    for each in sort_by_length(mesh) if places is None else places:
        members, tree = each.elements, each.tree
        around = radius / REACH + each.longest
        found = tree.query_ball_point(np.column_stack([points.real, points.imag]), around)
        of = np.repeat(np.arange(len(points)), [len(numbers) for numbers in found])
        if not len(of):
            continue
        near = members[np.concatenate([np.asarray(numbers, dtype=np.int64) for numbers in found])]
        others = ~np.isin(of * mesh.elements + near, left_out)
        of, near = of[others], near[others]
        np.minimum.at(clearance, of, mesh.geometry.select(near).distances(points[of, None])[:, 0])
    return clearance
