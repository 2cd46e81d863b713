"""Triangles that fill the regions of a model up to their outlines, for pictures of fields.

No triangle lies across a boundary, an interface or a crack; what they have on either side are vertices of their own,
so that a field may jump there. The triangulation is Delaunay's of points on the boundary and inside; where a piece of
the boundary is not among its edges, it is halved until it is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components
from scipy.spatial import Delaunay, cKDTree

from pbem.arrays import Bool, Complex, Integer, Real
from pbem.results.contents import Elements
from pbem.results.region_points import View, fill_points

# The pieces of a curved element turn by no more than this (radians); of one too small to be seen, by more.
TURN, COARSE_TURN = 0.07, 0.5
# An element is divided into so many pieces if there is room for them in the picture.
PIECES = 3
# Points that differ by less than this part of a region's size are one.
SAME = 1e-10
MOST_ROUNDS = 14
# Edges shorter than this part of the least spacing of points cannot be seen.
UNSEEN = 0.01
# An infinite region is shown beyond everything else by this part of the size.
MARGIN = 0.02


@dataclass(frozen=True)
class Triangles:
    """Vertices (v,) and triangles (t, 3) of their numbers, counter-clockwise.

    position (v,): complex. region (v,). face, s (v, 2): of vertices on the boundary the faces of elements that they are
    on, and the coordinates there: where two elements meet, both, else twice the same; -1 inside.
    """

    position: Complex
    region: Integer
    face: Integer
    s: Real
    corners: Integer

    @property
    def areas(self) -> Real:
        """Of the triangles (t,)."""
        a, b, c = self.position[self.corners].T
        return np.asarray(0.5 * ((b - a).conj() * (c - a)).imag)

    @property
    def weights(self) -> Real:
        """The area (v,) that each vertex stands for."""
        shares = np.repeat(self.areas / 3, 3)
        return np.asarray(np.bincount(self.corners.ravel(), shares, len(self.position)), dtype=float)

    def select(self, which: Bool) -> Triangles:
        """Some of the triangles (t,), and the vertices that they have."""
        kept, numbers = np.unique(self.corners[which], return_inverse=True)
        return Triangles(
            self.position[kept], self.region[kept], self.face[kept], self.s[kept], numbers.reshape(-1, 3)
        )

    def find_tips(self, elements: Elements) -> Bool:
        """Which vertices (v,) are where a crack ends inside a region: on both faces of its last element."""
        opposite = np.full(len(elements.crack) + 1, -2)
        first, second = np.flatnonzero(elements.crack).reshape(2, -1)
        opposite[first], opposite[second] = second, first
        return np.asarray(opposite[self.face[:, 0]] == self.face[:, 1])


@dataclass(frozen=True)
class _Edges:
    """Pieces of the boundary (p,), each with its region on the left: numbers of both ends, the face, s at both ends."""

    start: Integer
    end: Integer
    face: Integer
    first: Real
    last: Real

    def key(self, count: int) -> Integer:
        """A number of each piece, whichever way it runs."""
        return np.minimum(self.start, self.end) * count + np.maximum(self.start, self.end)

    def select(self, which: Integer | Bool) -> _Edges:
        return _Edges(*(getattr(self, name)[which] for name in self.__dataclass_fields__))


def triangulate(
    elements: Elements, infinite: Bool, view: View, empty: frozenset[int] = frozenset()
) -> Triangles:
    """Triangles of all regions that have a part in the view; infinite (r,): regions that go on beyond everything;
    empty: those without an inside."""
    parts = []
    low, high = elements.geometry.bounds()
    box = np.minimum(low.min(axis=0), view.low), np.maximum(high.max(axis=0), view.high)
    order = np.argsort(elements.region, kind="stable")
    ends = np.searchsorted(elements.region[order], np.arange(len(infinite) + 1))
    for region, endless in enumerate(infinite):
        own = order[ends[region] : ends[region + 1]]
        if region in empty or (not len(own) and not endless):
            continue
        if not endless and not view.meets(low[own].min(axis=0)[None], high[own].max(axis=0)[None])[0]:
            continue
        found = _triangulate_region(elements, own, view, box if endless else None)
        parts.append((region, found))
    return _join(parts)


def _triangulate_region(
    elements: Elements, own: Integer, view: View, box: tuple[Real, Real] | None
) -> Triangles:
    """Of the region that the elements `own` are of; box: of an infinite one, its corners."""
    points, edges = _divide_elements(elements, own, view)
    if box is not None:
        points, edges = _add_frame(points, edges, box, view)
    middle = 0.5 * (points.real.min() + points.real.max()) + 0.5j * (points.imag.min() + points.imag.max())
    size = float(np.abs(points - middle).max())
    points, edges = _merge(points, edges, SAME * size)
    piece = np.abs(points[edges.end] - points[edges.start])
    spacing = np.full(len(points), np.inf)
    for end in (edges.start, edges.end):
        np.minimum.at(spacing, end, piece)
    points = np.concatenate([points, fill_points(points, spacing, view)])
    for turn in range(MOST_ROUNDS):
        delaunay = _find_delaunay((points - middle) / size)
        missing = ~np.isin(edges.key(len(points)), _list_edges(delaunay, len(points)))
        missing &= ~_find_unseen(points, edges, UNSEEN * view.least)
        if not missing.any():
            break
        points, edges = _halve(points, edges, missing, elements, turn >= 2)
    return _cut(points, delaunay, edges)


def _divide_elements(elements: Elements, own: Integer, view: View) -> tuple[Complex, _Edges]:
    """Pieces of the elements, as many as they need to be seen."""
    geometry = elements.geometry.select(own)
    lengths, turns = geometry.lengths, np.abs(geometry.turns)
    middle = 0.5 * (geometry.start + geometry.end)
    beyond = view.beyond(np.column_stack([middle.real, middle.imag]))
    room = np.maximum(view.least, 0.5 * beyond)
    visible = lengths > 4 * room
    pieces = np.where(visible, np.maximum(PIECES, np.ceil(lengths / np.maximum(view.spacing, room))), 1)
    bend = np.where(lengths > 2 * room, TURN, COARSE_TURN)
    pieces = np.maximum(pieces, np.ceil(turns / bend - 1e-9)).astype(int)
    count = pieces + 1
    number = np.repeat(np.arange(len(own)), count)
    within = np.arange(len(number)) - np.repeat(np.cumsum(count) - count, count)
    s = 2.0 * within / pieces[number] - 1.0
    points = geometry.select(number).place(s[:, None])[:, 0]
    points = np.where(within == 0, geometry.start[number], points)
    points = np.where(within == pieces[number], geometry.end[number], points)
    first = np.flatnonzero(within < pieces[number])
    return points, _Edges(first, first + 1, own[number[first]], s[first], s[first + 1])


def _add_frame(points: Complex, edges: _Edges, box: tuple[Real, Real], view: View) -> tuple[Complex, _Edges]:
    """A frame of no elements around everything, counter-clockwise."""
    room = MARGIN * float((box[1] - box[0]).max())
    (left, below), (right, above) = box[0] - room, box[1] + room
    ends = np.array([left + 1j * below, right + 1j * below, right + 1j * above, left + 1j * above])
    sides = [
        np.linspace(a, b, max(2, int(np.ceil(min(abs(b - a) / view.spacing, 400)))), endpoint=False)
        for a, b in zip(ends, np.roll(ends, -1), strict=True)
    ]
    frame = np.concatenate(sides)
    number = len(points) + np.arange(len(frame))
    none = np.zeros(len(frame))
    added = _Edges(number, np.roll(number, -1), np.full(len(frame), -1), none, none)
    return np.concatenate([points, frame]), _Edges(
        *(np.concatenate([getattr(edges, name), getattr(added, name)]) for name in _Edges.__dataclass_fields__)
    )


def _merge(points: Complex, edges: _Edges, tolerance: float) -> tuple[Complex, _Edges]:
    """One point in place of those at the same place; pieces without length are left out."""
    tree = cKDTree(np.column_stack([points.real, points.imag]))
    pairs = tree.query_pairs(tolerance, output_type="ndarray")
    graph = sparse.coo_matrix((np.ones(len(pairs)), pairs.T.reshape(2, -1)), (len(points),) * 2)
    label = connected_components(graph, directed=False)[1]
    _, kept = np.unique(label, return_index=True)
    edges = _Edges(label[edges.start], label[edges.end], edges.face, edges.first, edges.last)
    return points[kept], edges.select(edges.start != edges.end)


def _find_delaunay(points: Complex) -> Integer:
    """Triangles (t, 3), counter-clockwise, those without area left out."""
    corners = Delaunay(np.column_stack([points.real, points.imag])).simplices.astype(np.int64)
    a, b, c = points[corners].T
    area = ((b - a).conj() * (c - a)).imag
    corners = np.where((area < 0)[:, None], corners[:, ::-1], corners)
    return np.asarray(corners[np.abs(area) > 0])


def _list_edges(corners: Integer, count: int) -> Integer:
    """Of all triangles, a number of each side, whichever way it runs."""
    start, end = corners.ravel(), np.roll(corners, -1, axis=1).ravel()
    return np.unique(np.minimum(start, end) * count + np.maximum(start, end))


def _find_unseen(points: Complex, edges: _Edges, least: float) -> Bool:
    """Edges of cracks, with both of their faces, that are shorter than can be seen: where two cracks all but meet on a
    length, halving them would not end. An outline is never left open."""
    short = np.abs(points[edges.end] - points[edges.start]) < least
    _, which, count = np.unique(edges.key(len(points)), return_inverse=True, return_counts=True)
    return np.asarray(short & (count[which.ravel()] > 1))


def _halve(
    points: Complex, edges: _Edges, missing: Bool, elements: Elements, near: bool
) -> tuple[Complex, _Edges]:
    """The edges with those that are missing in two: at their middle; `near`: at another point that lies on them."""
    old = edges.select(missing)
    key = old.key(len(points))
    _, one, which = np.unique(key, return_index=True, return_inverse=True)
    which = which.ravel()
    middle = 0.5 * (old.first + old.last)
    places = np.where(old.face >= 0, 0, 0.5 * (points[old.start] + points[old.end]))
    own = np.flatnonzero(old.face >= 0)
    if len(own):
        places[own] = elements.geometry.select(old.face[own]).place(middle[own, None])[:, 0]
    number = len(points) + which
    if near:
        touched, share = _find_touching(points, old)
        there = touched >= 0
        number = np.where(there, touched, number)
        middle = np.where(there, old.first + share * (old.last - old.first), middle)
    halves = [
        _Edges(old.start, number, old.face, old.first, middle), _Edges(number, old.end, old.face, middle, old.last)
    ]  # fmt: skip
    kept = edges.select(~missing)
    points = np.concatenate([points, places[one]])
    joined = _Edges(
        *(np.concatenate([getattr(each, name) for each in (kept, *halves)]) for name in _Edges.__dataclass_fields__)
    )
    return points, joined


def _find_touching(points: Complex, edges: _Edges) -> tuple[Integer, Real]:
    """Of each edge another point that lies on it, or -1, and at which part of its length."""
    tree = cKDTree(np.column_stack([points.real, points.imag]))
    a, b = points[edges.start], points[edges.end]
    middle, length = 0.5 * (a + b), np.abs(b - a)
    found = np.full(len(a), -1)
    share = np.full(len(a), 0.5)
    near = tree.query_ball_point(np.column_stack([middle.real, middle.imag]), 0.5 * length)
    for number, others in enumerate(near):
        for other in others:
            if other in (edges.start[number], edges.end[number]) or length[number] == 0.0:
                continue
            t = (points[other] - a[number]) / (b[number] - a[number])
            if abs(t.imag) < 1e-6 and 0 < t.real < 1:
                found[number], share[number] = other, t.real
                break
    return found, share


def _cut(points: Complex, corners: Integer, edges: _Edges) -> Triangles:
    """The triangles on the left of the edges, with vertices of their own on either side of an edge."""
    count = len(points)
    directed = edges.start * count + edges.end
    order = np.argsort(directed, kind="stable")
    directed = directed[order]
    start, end = corners, np.roll(corners, -1, axis=1)
    left, right = _look_up(directed, start * count + end), _look_up(directed, end * count + start)
    neighbour = _find_neighbours(start * count + end, end * count + start)
    free = (left < 0) & (right < 0) & (neighbour >= 0)
    # Across free sides both triangles are of the same part; a part is inside if it is on the left of an edge.
    triangle = np.arange(len(corners)).repeat(3).reshape(-1, 3)
    there = free.nonzero()
    graph = sparse.coo_matrix((np.ones(len(there[0])), (triangle[there], neighbour[there] // 3)), (len(corners),) * 2)
    parts, part = connected_components(graph, directed=False)
    votes = np.bincount(part, (left >= 0).sum(axis=1) - ((left < 0) & (right >= 0)).sum(axis=1), parts)
    inside = votes[part] > 0
    corners, left, neighbour, free = corners[inside], left[inside], neighbour[inside], free[inside]
    place = np.full(len(inside), -1)
    place[inside] = np.arange(inside.sum())
    other, side = place[neighbour // 3], neighbour % 3
    # Corner c of a triangle begins its side c; across a free side the ends are met in the other order.
    number = np.arange(3 * len(corners)).reshape(-1, 3)
    t, c = np.nonzero(free & (other >= 0))
    mine = np.concatenate([number[t, c], number[t, (c + 1) % 3]])
    theirs = np.concatenate([3 * other[t, c] + (side[t, c] + 1) % 3, 3 * other[t, c] + side[t, c]])
    graph = sparse.coo_matrix((np.ones(len(mine)), (mine, theirs)), (3 * len(corners),) * 2)
    vertices, label = connected_components(graph, directed=False)
    position = np.zeros(vertices, dtype=complex)
    position[label] = points[corners.ravel()]
    face, s = np.full((vertices, 2), -1), np.zeros((vertices, 2))
    t, c = np.nonzero(left >= 0)
    edge = order[left[t, c]]
    real = edges.face[edge] >= 0
    t, c, edge = t[real], c[real], edge[real]
    outgoing, arriving = label[number[t, c]], label[number[t, (c + 1) % 3]]
    face[outgoing, 0], s[outgoing, 0] = edges.face[edge], edges.first[edge]
    face[arriving, 1], s[arriving, 1] = edges.face[edge], edges.last[edge]
    for here, there_too in ((0, 1), (1, 0)):
        lacking = (face[:, here] < 0) & (face[:, there_too] >= 0)
        face[lacking, here], s[lacking, here] = face[lacking, there_too], s[lacking, there_too]
    return Triangles(position, np.zeros(vertices, dtype=np.int64), face, s, label.reshape(-1, 3))


def _look_up(known: Integer, wanted: Integer) -> Integer:
    """Where each wanted number stands among known ones, which rise; -1 if it does not."""
    if not len(known):
        return np.full(wanted.shape, -1)
    at = np.minimum(np.searchsorted(known, wanted), len(known) - 1)
    return np.where(known[at] == wanted, at, -1)


def _find_neighbours(sides: Integer, opposite: Integer) -> Integer:
    """Of each side (t, 3) the number 3 t + c of the same side of the triangle across it, -1 if there is none."""
    order = np.argsort(sides.ravel(), kind="stable")
    at = _look_up(sides.ravel()[order], opposite)
    return np.where(at >= 0, order[at], -1)


def _join(parts: list[tuple[int, Triangles]]) -> Triangles:
    """Those of all regions; empty if there are none."""
    counts = np.cumsum([0, *(len(each.position) for _, each in parts)])
    none = np.zeros((0, 3), dtype=np.int64)
    return Triangles(
        np.concatenate([np.zeros(0, dtype=complex), *(each.position for _, each in parts)]),
        np.concatenate([np.zeros(0, dtype=np.int64), *(np.full(len(each.position), region) for region, each in parts)]),
        np.concatenate([np.zeros((0, 2), dtype=np.int64), *(each.face for _, each in parts)]),
        np.concatenate([np.zeros((0, 2)), *(each.s for _, each in parts)]),
        np.concatenate([none, *(each.corners + before for before, (_, each) in zip(counts[:-1], parts, strict=True))]),
    )
