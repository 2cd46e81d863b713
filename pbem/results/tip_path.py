"""Where the conservation integrals about a crack tip run: the crack from the tip on, and the circle that cuts it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from pbem.mesh.elements import Elements
from pbem.mesh.mesh import Mesh

Bool = NDArray[np.bool_]
Complex = NDArray[np.complex128]
Integer = NDArray[np.int64]
Real = NDArray[np.float64]

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
class TipPath:
    """elements (m,): of the crack, from the tip on, across the ends of curves that go on; outward (m,): whether they
    run away from the tip. whole: they are the entire crack, which ends at a second tip. near: how many of them lie
    near to the circle or within it.

    cut: which of them the circle cuts (its place in the list), at the coordinate cut_at in [-1, 1] as seen when going
    away from the tip.
    """

    elements: Integer
    outward: Bool
    whole: bool
    near: int
    cut: int
    cut_at: float


@dataclass(frozen=True)
class _Chain:
    elements: list[int]
    outward: list[bool]
    ends_in_tip: bool


def trace_paths(mesh: Mesh, element: Integer, end: Integer, most_whole: int) -> list[TipPath]:
    """Paths of tips at the given ends (0 start, 1 end) of crack elements (k,).

    A crack of more than most_whole elements is not followed to its other tip.
    """
    chains = _follow(mesh, element, end, most_whole)
    tips = np.where(end == 0, mesh.start[element], mesh.end[element])
    reach = [_reach_along(mesh, tip, chain) for tip, chain in zip(tips, chains, strict=True)]
    inside = [chain.elements[:count] for chain, (count, _) in zip(chains, reach, strict=True)]
    free = measure_clearance(mesh, tips, np.array([distance for _, distance in reach]), inside)
    return [
        _cut(mesh, tip, chain, count, distance, clearance)
        for tip, chain, (count, distance), clearance in zip(tips, chains, reach, free, strict=True)
    ]


def _follow(mesh: Mesh, element: Integer, end: Integer, most: int) -> list[_Chain]:
    """The elements from each tip on, as far as exactly two elements of cracks meet."""
    ends = np.concatenate([mesh.start, mesh.end])
    _, vertex = np.unique(ends, return_inverse=True)
    count = np.bincount(vertex)
    order = np.argsort(vertex, kind="stable")
    first = np.concatenate([[0], np.cumsum(count)])
    chains = []
    for begin, side in zip(element.tolist(), end.tolist(), strict=True):
        elements, outward = [begin], [side == 0]
        ends_in_tip = False
        while len(elements) <= most:
            last = elements[-1]
            point = int(vertex[last + mesh.elements * outward[-1]])
            if count[point] != 2:
                ends_in_tip = bool(count[point] == 1)
                break
            here = order[first[point] : first[point + 1]]
            other = int(here[0] if here[0] % mesh.elements != last else here[1])
            following = other % mesh.elements
            if not mesh.crack[following] or following == begin:
                break
            elements.append(following)
            outward.append(other < mesh.elements)
        chains.append(_Chain(elements, outward, ends_in_tip))
    return chains


def _reach_along(mesh: Mesh, tip: complex, chain: _Chain) -> tuple[int, float]:
    """How many elements lead away from the tip without a corner, and the largest radius that they allow."""
    numbers = np.array(chain.elements)
    outward = np.array(chain.outward)
    start = np.where(outward, mesh.start[numbers], mesh.end[numbers]) - tip
    end = np.where(outward, mesh.end[numbers], mesh.start[numbers]) - tip
    half = 0.5 * np.where(outward, 1.0, -1.0) * mesh.sweep[numbers]
    leaves, arrives = (end - start) * np.exp(-1j * half), (end - start) * np.exp(1j * half)
    away = (np.conj(start) * leaves).real >= 0
    away &= (np.conj(end) * arrives).real > 0
    away[1:] &= np.abs(np.angle(leaves[1:] / arrives[:-1])) < KINK
    inside = len(away) if away.all() else int(np.argmin(away))
    if inside == 0:
        return 1, float(np.abs(end[0]))
    if inside < len(away):
        return inside, float(REACH * np.abs(end[inside - 1]))
    farthest = float(np.abs(end[-1]))
    return inside, (REACH_ALONG if chain.ends_in_tip else REACH) * farthest


def measure_clearance(mesh: Mesh, tips: Complex, radius: Real, own: list[list[int]]) -> Real:
    """Distance of each tip to the nearest element that is not its own; infinite beyond twice the radius."""
    lengths = Elements(mesh.start, mesh.end, mesh.center, mesh.sweep).lengths
    middle = 0.5 * (mesh.start + mesh.end)
    clearance = np.full(len(tips), np.inf)
    classes = np.floor(np.log2(lengths / lengths.min())).astype(int)
    for number in np.unique(classes):
        members = np.flatnonzero(classes == number)
        tree = cKDTree(np.column_stack([middle[members].real, middle[members].imag]))
        around = radius / REACH + lengths[members].max()
        found = tree.query_ball_point(np.column_stack([tips.real, tips.imag]), around)
        counts = np.array([len(each) for each in found])
        if not counts.sum():
            continue
        near = members[np.concatenate([np.asarray(each, dtype=np.int64) for each in found])]
        of = np.repeat(np.arange(len(tips)), counts)
        distance = _measure_distance(mesh, near, tips[of])
        for tip, (low, high) in enumerate(zip(np.cumsum(counts) - counts, np.cumsum(counts), strict=True)):
            others = ~np.isin(near[low:high], own[tip])
            clearance[tip] = min(clearance[tip], distance[low:high][others].min(initial=np.inf))
    return clearance


def _measure_distance(mesh: Mesh, elements: Integer, points: Complex) -> Real:
    """Distance of points (k,) to straight or circular elements (k,)."""
    start, end, center, sweep = (a[elements] for a in (mesh.start, mesh.end, mesh.center, mesh.sweep))
    at_ends = np.minimum(np.abs(points - start), np.abs(points - end))
    along = ((points - start) / (end - start)).real
    straight = np.where((along > 0) & (along < 1), np.abs(points - start - along * (end - start)), at_ends)
    arc = sweep != 0
    apex = (start - center) * np.exp(0.5j * sweep)
    off = np.abs(np.angle((points - center) / np.where(arc, apex, 1)))
    around = np.where(off < 0.5 * np.abs(sweep), np.abs(np.abs(points - center) - np.abs(start - center)), at_ends)
    return np.where(arc, around, straight)


def _cut(mesh: Mesh, tip: complex, chain: _Chain, inside: int, along: float, clearance: float) -> TipPath:
    """The largest circle that cuts an element in its middle; if there is none, the first element nearer to the tip."""
    numbers, outward = np.array(chain.elements), np.array(chain.outward)
    own = numbers[: min(inside, MOST_INSIDE)]
    elements = Elements(mesh.start[own], mesh.end[own], mesh.center[own], mesh.sweep[own])
    radius = np.abs(elements.place(np.zeros(1))[:, 0] - tip)
    limit = min(along, REACH * clearance)
    fits = np.flatnonzero(radius <= limit * (1 + 1e-9))
    cut = int(fits[-1]) if len(fits) else 0
    cut_at = 0.0 if len(fits) else max(limit / radius[0], 0.02) - 1.0
    reached = np.abs(np.where(outward, mesh.end[numbers], mesh.start[numbers]) - tip)
    beyond = np.flatnonzero(reached > NEAR * radius[cut])
    near = int(beyond[0]) + 1 if len(beyond) else len(numbers)
    return TipPath(numbers, outward, chain.ends_in_tip, near, cut, cut_at)
