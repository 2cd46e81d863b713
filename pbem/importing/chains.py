"""Edges of a mesh as chains from corner to corner, and chains as straight and circular legs where they are such."""

from __future__ import annotations

import itertools
import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pbem.arrays import Complex, Integer, Real
from pbem.geometry.curve import Leg
from pbem.geometry.shape import WIDEST_ARC

Edge = tuple[int, int]
# Part of the mesh's extent by which nodes may be off the line or the circle that they are said to lie on.
OFF = 1e-6
# Largest angle (degrees) between the edges of a circle, if the mesh says that they are of one entity, and if not: a
# polygon stays one whose edges all turn by more. Between the parts of edges of higher order, which are known.
WIDEST, WIDEST_UNTOLD, WIDEST_BENT = 46.0, 31.0, 91.0
# Lengths of edges are equal up to this part of them.
EQUAL = 1e-3
# An edge of higher order is an arc if its nodes are off it by no more than this part of its rise.
ROUND = 0.15
# Of edges without nodes between their ends it is not known whether they are curved.
UNKNOWN = -1


@dataclass(frozen=True)
class Chain:
    """Nodes one after the other, the last one the first one if it is closed, and the entity of each edge or 0."""

    nodes: tuple[int, ...]
    entities: tuple[int, ...]

    def place(self, nodes: Mapping[int, complex], between: Mapping[Edge, tuple[int, ...]], off: float) -> _Path:
        """The chain by the places of its nodes, among them those between the ends of edges; off: how far from its chord
        the nodes of a straight edge may be."""
        fine, at, bent = [nodes[self.nodes[0]]], [0], []
        for a, b in itertools.pairwise(self.nodes):
            own = between.get((min(a, b), max(a, b)), ())
            fine += [nodes[each] for each in (*(own if a < b else own[::-1]), b)]
            at.append(len(fine) - 1)
            bent.append(not _is_straight(np.array(fine[at[-2]:]), off) if own else UNKNOWN)
        return _Path(np.array(fine), np.array(at), np.array(self.entities), np.array(bent))

    @property
    def closed(self) -> bool:
        return self.nodes[0] == self.nodes[-1]


@dataclass(frozen=True)
class _Path:
    """fine: all points, those between the ends of edges among them; at (n,): where the ends are among them. entities
    (n - 1,): of each edge; bent (n - 1,): 1 if its nodes say that it is curved, 0 if straight, else UNKNOWN.

    Parts of it are slices: a run grows edge by edge.
    """

    fine: Complex
    at: Integer
    entities: Integer
    bent: Integer

    def part(self, first: int, last: int) -> _Path:
        """The edges between two points."""
        begin, end = self.at[first], self.at[last]
        return _Path(self.fine[begin:end + 1], self.at[first:last + 1] - begin, self.entities[first:last],
                     self.bent[first:last])

    def turn_to(self, first: int) -> _Path:
        """The same closed path from another point on."""
        cut = self.at[first]
        fine = np.concatenate([self.fine[cut:-1], self.fine[:cut + 1]])
        at = np.concatenate([[0], np.cumsum(np.roll(np.diff(self.at), -first))])
        return _Path(fine, at, np.roll(self.entities, -first), np.roll(self.bent, -first))

    @property
    def points(self) -> Complex:
        """Ends of edges (n,)."""
        return self.fine[self.at]

    @property
    def edges(self) -> int:
        """Number of edges."""
        return len(self.entities)

    @property
    def is_bent(self) -> bool | None:
        """Whether all edges are known to be curved; None if nothing is known of any."""
        return None if (self.bent == UNKNOWN).all() else bool((self.bent == 1).all())


def link(edges: Sequence[Edge], entities: Mapping[Edge, int], corners: set[int]) -> list[Chain]:
    """The chains of some edges, which end at the corners, and where not two of the edges meet."""
    beside: dict[int, list[int]] = defaultdict(list)
    for a, b in edges:
        beside[a].append(b)
        beside[b].append(a)
    ends = [node for node in beside if node in corners or len(beside[node]) != 2]
    left = {(min(edge), max(edge)): None for edge in edges}
    chains = []
    for start in [*ends, *beside]:
        for following in beside[start]:
            if (min(start, following), max(start, following)) not in left:
                continue
            nodes = [start]
            node = following
            while True:
                last = nodes[-1]
                left.pop((min(last, node), max(last, node)))
                nodes.append(node)
                if node in corners or len(beside[node]) != 2 or node == start:
                    break
                node = next(each for each in beside[node] if each != last)
            own = [entities.get((min(a, b), max(a, b)), 0) for a, b in itertools.pairwise(nodes)]
            chains.append(Chain(tuple(nodes), tuple(own)))
    return chains


def fit_legs(
    chain: Chain, nodes: Mapping[int, complex], between: Mapping[Edge, tuple[int, ...]], corners: set[int],
    extent: float,
) -> list[Leg]:
    """The legs of a chain, as long as can be, with an element for each edge, or more of those that turn by too much.

    nodes: places by tag; between: tags of the nodes of edges of higher order, by the edges' ends. A circle is four
    legs, from the angle 0 on.
    """
    off = OFF * extent
    path = chain.place(nodes, between, off)
    if chain.closed:
        if chain.nodes[0] not in corners:
            first = _run(path, 0, off)
            if 0 < first < path.edges:
                # Where the first run ends another one begins, whatever the node where the chain was begun.
                path = path.turn_to(first)
        circle = _fit_circle(path.fine[:-1], off)
        if circle is not None and _is_round(path):
            return _draw_circle(*circle, path.edges, extent)
    legs = []
    first = 0
    while first < path.edges:
        last = _run(path, first, off)
        legs += _make_legs(path.part(first, last), off)
        first = last
    return legs


def may_be_circle(points: Sequence[complex]) -> bool:
    """Whether the corners of a closed polygon, the last one the first, lie on a circle and are so many that it could be
    meant."""
    corners = np.array(points)
    if len(corners) < 4 or corners[0] != corners[-1]:
        return False
    off = OFF * float(np.ptp(corners.real) + np.ptp(corners.imag))
    nothing = np.full(len(corners), UNKNOWN)
    path = _Path(np.append(corners, corners[1]), np.arange(len(corners) + 1), nothing, nothing)
    return _may_be_round(path) and _fit_circle(corners[:-1], off) is not None


def _run(path: _Path, first: int, off: float) -> int:
    """The last point of the longest straight or circular run that begins at a point."""
    straight = first
    while straight < path.edges and _is_straight(path.part(first, straight + 1).fine, off):
        straight += 1
    bent = path.part(first, first + 1).is_bent
    if straight > first + 1 or straight == path.edges or bent is False:
        return max(straight, first + 1)
    last = first + 1
    for end in range(first + 2 if bent is None else first + 1, path.edges + 1):
        part = path.part(first, end)
        if abs(part.points[0] - part.points[-1]) <= off or part.is_bent is False or not _may_be_round(part):
            break
        if len(part.fine) > 3 and _fit_circle(part.fine, off) is None:
            break
        if _is_round(part):
            last = end
    return last if bent or _is_arc(path.part(first, last)) else first + 1


def _is_arc(path: _Path) -> bool:
    """Whether edges whose ends lie on a circle are meant to be an arc: any three edges do that are alike on both sides,
    such as those of a gable."""
    entities = path.entities
    if (entities[0] != 0) and (entities == entities[0]).all() and path.edges == 2:
        return _are_equal(path.points)
    if path.edges < 3:
        return False
    if ((entities[1:] == entities[:-1]) & (entities[1:] != 0)).any():
        return True
    # Lines that are one edge each stay straight; of others nothing is known.
    return not (entities != 0).all() and (path.edges > 3 or _are_equal(path.points))


def _are_equal(points: Complex) -> bool:
    lengths = np.abs(np.diff(points))
    return bool(np.ptp(lengths) <= EQUAL * lengths[0])


def _is_straight(points: Complex, off: float) -> bool:
    along = points[-1] - points[0]
    if abs(along) <= off:
        return False
    local = (points - points[0]) / along
    return bool((np.abs(local.imag) * abs(along) <= off).all() and (np.diff(local.real) > 0).all())


def _is_round(path: _Path) -> bool:
    """Whether the edges turn by the same sign everywhere, and some by less than a polygon's would: of a circle that
    something ends on, those on both sides of the place are of different lengths."""
    bent = path.is_bent
    if bent is False:
        return False
    turns = np.abs(_measure_turns(path))
    told = bool(((path.entities[1:] == path.entities[:-1]) & (path.entities[1:] != 0)).any())
    least = WIDEST_BENT if bent else WIDEST if told else WIDEST_UNTOLD
    return _may_be_round(path) and bool((turns <= least).any())


def _may_be_round(path: _Path) -> bool:
    """Whether the edges turn by the same sign everywhere, and by no more than those of any circle."""
    turns = _measure_turns(path)
    widest = WIDEST_BENT if path.is_bent else WIDEST
    return bool((np.abs(turns) <= widest).all() and ((turns > 0).all() or (turns < 0).all()))


def _measure_turns(path: _Path) -> Real:
    """By how much (degrees) the path turns at the points between its ends."""
    steps = np.diff(path.fine)
    return np.asarray(np.degrees(np.angle(steps[1:] / steps[:-1])))


def _fit_circle(points: Complex, off: float) -> tuple[complex, float] | None:
    """Centre and radius of the circle that all points lie on, if there is one."""
    middle = points.mean()
    local = points - middle
    scale = np.abs(local).max()
    local = local / scale
    matrix = np.stack([2 * local.real, 2 * local.imag, np.ones(len(local))], axis=1)
    (x, y, rest), _, rank, _ = np.linalg.lstsq(matrix, np.abs(local) ** 2, rcond=None)
    if rank < 3 or rest + x**2 + y**2 <= 0:
        return None
    radius = math.sqrt(rest + x**2 + y**2)
    if (np.abs(np.abs(local - complex(x, y)) - radius) * scale > off).any():
        return None
    return complex(middle + scale * complex(x, y)), float(radius * scale)


def _draw_circle(center: complex, radius: float, edges: int, extent: float) -> list[Leg]:
    """Four legs of a full circle; the digits that rounding has made are left out."""
    digits = 12 - math.ceil(math.log10(max(extent, abs(center))))
    center = complex(round(center.real, digits) + 0.0, round(center.imag, digits) + 0.0)
    radius = round(radius, digits)
    edges = max(edges, math.ceil(360 / WIDEST_ARC))
    counts = [edges // 4 + (quarter < edges % 4) for quarter in range(4)]
    points = [center + radius * direction for direction in (1, 1j, -1, -1j, 1)]
    return [
        Leg(points[k], points[k + 1], max(1, counts[k]), center=center, sweep=0.5 * math.pi) for k in range(4)
    ]


def _make_legs(path: _Path, off: float) -> list[Leg]:
    """The legs of a run: one, or several of an edge of higher order that is no arc."""
    start, end, fine = complex(path.points[0]), complex(path.points[-1]), path.fine
    if len(fine) == 2 or _is_straight(fine, off):
        return [Leg(start, end, path.edges)]
    # The middle of an edge of higher order is on it whether it has a node there or not.
    points = fine if path.edges > 1 else np.array([start, _find_middle(fine), end])
    fitted = _fit_circle(points, math.inf)
    if fitted is None or not _are_near(fine, *fitted):
        return [Leg(complex(a), complex(b), 1) for a, b in itertools.pairwise(fine)]
    rays = points - fitted[0]
    turn = float(np.angle(rays[1:] / rays[:-1]).sum())
    elements = max(path.edges, math.ceil(abs(math.degrees(turn)) / WIDEST_ARC - 1e-6))
    return [Leg(0j, 0j, elements, center=0j, sweep=turn).tie(start, end)]


def _find_middle(fine: Complex) -> complex:
    """The middle of an edge of higher order, by the polynomial through its nodes."""
    t = np.linspace(-1, 1, len(fine))
    return complex(np.linalg.solve(np.vander(t), fine)[-1])


def _are_near(points: Complex, center: complex, radius: float) -> bool:
    """Whether points are on an arc, but for a part of its rise above its chord."""
    chord = points[-1] - points[0]
    rise = np.abs(((points - points[0]) / chord).imag).max() * abs(chord)
    return bool((np.abs(np.abs(points - center) - radius) <= ROUND * rise).all())
