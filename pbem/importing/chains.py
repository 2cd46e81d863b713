"""Edges of a mesh as chains from corner to corner, and chains as straight and circular legs where they are such."""

from __future__ import annotations

import itertools
import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pbem.arrays import Complex
from pbem.geometry.curve import Leg

Edge = tuple[int, int]
# Part of the mesh's extent by which nodes may be off the line or the circle that they are said to lie on.
OFF = 1e-6
# Largest angle (degrees) between the edges of a circle, if the mesh says that they are of one entity, and if not: a
# regular polygon with fewer corners stays one.
WIDEST, WIDEST_UNTOLD = 46.0, 31.0


@dataclass(frozen=True)
class Chain:
    """Nodes one after the other, the last one the first one if it is closed, and the entity of each edge or 0."""

    nodes: tuple[int, ...]
    entities: tuple[int, ...]

    @property
    def closed(self) -> bool:
        return self.nodes[0] == self.nodes[-1]


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


def fit_legs(chain: Chain, nodes: Mapping[int, complex], corners: set[int], extent: float) -> list[Leg]:
    """The legs of a chain, as long as can be, with an element for each edge.

    A circle is four legs, from the angle 0 on.
    """
    points = np.array([nodes[node] for node in chain.nodes])
    entities = np.array(chain.entities)
    off = OFF * extent
    if chain.closed:
        if chain.nodes[0] not in corners:
            first = _run(points, entities, 0, off)
            if 0 < first < len(points) - 1:
                # Where the first run ends another one begins, whatever the node where the chain was begun.
                points = np.concatenate([points[first:-1], points[:first + 1]])
                entities = np.roll(entities, -first)
        circle = _fit_circle(points[:-1], off)
        if circle is not None and _is_round(points, entities):
            return _draw_circle(*circle, len(points) - 1, extent)
    legs = []
    first = 0
    while first < len(points) - 1:
        last = _run(points, entities, first, off)
        legs.append(_make_leg(points[first:last + 1], off))
        first = last
    return legs


def _run(points: Complex, entities: np.ndarray, first: int, off: float) -> int:
    """The last point of the longest straight or circular run that begins at a point."""
    straight = first + 1
    while straight + 1 < len(points) and _is_straight(points[first:straight + 2], off):
        straight += 1
    if straight > first + 1 or straight == len(points) - 1:
        return straight
    last = first + 1
    for end in range(first + 2, len(points)):
        part, own = points[first:end + 1], entities[first:end]
        if abs(part[0] - part[-1]) <= off or not _is_round(part, own):
            break
        if len(part) > 3 and _fit_circle(part, off) is None:
            break
        last = end
    edges = last - first
    lengths = np.abs(np.diff(points[first:last + 1]))
    told = entities[first] != 0 and (entities[first:last] == entities[first]).all()
    if edges > 2 or (edges == 2 and told and abs(lengths[0] - lengths[1]) <= 1e-3 * lengths[0]):
        return last
    return first + 1


def _is_straight(points: Complex, off: float) -> bool:
    along = points[-1] - points[0]
    if abs(along) <= off:
        return False
    local = (points - points[0]) / along
    return bool((np.abs(local.imag) * abs(along) <= off).all() and (np.diff(local.real) > 0).all())


def _is_round(points: Complex, entities: np.ndarray) -> bool:
    """Whether the edges turn by the same sign everywhere, and by less than a polygon's would."""
    steps = np.diff(points)
    turns = np.degrees(np.angle(steps[1:] / steps[:-1]))
    told = bool(((entities[1:] == entities[:-1]) & (entities[1:] != 0)).any())
    widest = WIDEST if told else WIDEST_UNTOLD
    return bool((np.abs(turns) <= widest).all() and ((turns > 0).all() or (turns < 0).all()))


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
    counts = [edges // 4 + (quarter < edges % 4) for quarter in range(4)]
    points = [center + radius * direction for direction in (1, 1j, -1, -1j, 1)]
    return [
        Leg(points[k], points[k + 1], max(1, counts[k]), center=center, sweep=0.5 * math.pi) for k in range(4)
    ]


def _make_leg(points: Complex, off: float) -> Leg:
    start, end, edges = complex(points[0]), complex(points[-1]), len(points) - 1
    if edges == 1 or _is_straight(points, off):
        return Leg(start, end, edges)
    fitted = _fit_circle(points, math.inf)
    assert fitted is not None
    rays = points - fitted[0]
    turn = float(np.angle(rays[1:] / rays[:-1]).sum())
    return Leg(0j, 0j, edges, center=0j, sweep=turn).tie(start, end)
