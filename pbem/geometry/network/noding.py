"""Legs cut wherever they cross, and wherever a node of another one lies on them, until they meet at nodes only."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from pbem.arrays import Bool, Complex, Integer
from pbem.geometry.boxes import Boxes
from pbem.geometry.curve import Leg
from pbem.geometry.elements import Elements
from pbem.geometry.intersection import meeting_points
from pbem.geometry.network.strands import Log, Strand, collect_legs, gather, sort_places
from pbem.geometry.shape import share

# Each round adds nodes, which keep their distance from each other; few are needed.
MOST_ROUNDS = 60
# Rounds that ask for so many times as many cuts as there were legs, and cuts in the first round, only bring ever more.
MOST_TIMES = 10


class UnsettledError(ValueError):
    """Cuts bring ever more cuts; places: of the last ones."""

    def __init__(self, places: list[complex]) -> None:
        self.places = places
        super().__init__("the network does not settle")


@dataclass(frozen=True)
class _Edges:
    """All legs: their shapes, nodes at both ends, strand and number on it, and which of them are new (m,)."""

    shapes: Elements
    first: Integer
    second: Integer
    owner: Integer
    number: Integer
    fresh: Bool


# Legs whose ends come to lie in one place have no direction: nothing is near to them.
@np.errstate(divide="ignore", invalid="ignore")
def cut_at_nodes(
    strands: list[Strand], points: Complex, snap: float, rounding: float, log: Log
) -> Complex:
    """Cut the strands' legs at all crossings, and at the nodes that are no further from them than `snap`, through which
    they are bent. Returns the places of the nodes, those of crossings added."""
    fresh = [[True] * len(strand.legs) for strand in strands]
    for strand in strands:
        strand.barred = [frozenset()] * len(strand.legs)
    known, most = 0, 0
    for _ in range(MOST_ROUNDS):
        edges = _collect(strands, fresh)
        used = np.unique(np.concatenate([edges.first, edges.second]))
        passed = _find_passed(edges, points, used, used[used >= known], snap)
        known = len(points)
        edge, places = _find_crossings(edges, rounding)
        points, crossed = _number_crossings(points, used, places, snap)
        points, crossed = _keep_off_barred(strands, edges, edge, points, crossed, places, rounding)
        all_edges = np.concatenate([passed[0], edge[:, 0], edge[:, 1]])
        all_nodes = np.concatenate([passed[1], crossed, crossed])
        inner = (edges.first[all_edges] != all_nodes) & (edges.second[all_edges] != all_nodes)
        inner &= ~_find_barred(strands, edges, all_edges, all_nodes)
        cuts = np.unique(np.stack([all_edges[inner], all_nodes[inner]], axis=1), axis=0)
        most = most or MOST_TIMES * (len(edges.first) + len(cuts))
        if len(cuts) > most:
            break
        fresh = [[False] * len(strand.legs) for strand in strands]
        if not _apply(strands, edges, points, cuts, fresh, rounding, log):
            _refuse_nothing(strands)
            return points
    raise UnsettledError([complex(points[node]) for node in cuts[:, 1]])


def _refuse_nothing(strands: list[Strand]) -> None:
    """Raise UnsettledError for legs without a length: crossings that were kept apart are in one place."""
    places = [leg.start for strand in strands for leg in strand.legs if leg.length == 0]
    if places:
        raise UnsettledError(places)


def _collect(strands: list[Strand], fresh: list[list[bool]]) -> _Edges:
    shapes, owner, number = collect_legs(strands)
    first = np.array([node for strand in strands for node in strand.nodes[:-1]], dtype=np.int64)
    second = np.array([node for strand in strands for node in strand.nodes[1:]], dtype=np.int64)
    flags = np.array([flag for each in fresh for flag in each], dtype=bool)
    return _Edges(shapes, first, second, owner, number, flags)


def _find_passed(
    edges: _Edges, points: Complex, used: Integer, new: Integer, snap: float
) -> tuple[Integer, Integer]:
    """Edges and the nodes that they pass within the distance, of which one is new."""
    low, high = edges.shapes.bounds()
    low, high = low - snap, high + snap
    found = []
    fresh = np.flatnonzero(edges.fresh)
    if len(fresh):
        at, which = Boxes(low[fresh], high[fresh]).find_around(points[used])
        found.append(np.stack([fresh[which], used[at]], axis=1))
    if len(new):
        at, which = Boxes(low, high).find_around(points[new])
        found.append(np.stack([which, new[at]], axis=1))
    pairs = np.unique(np.concatenate([np.zeros((0, 2), dtype=np.int64), *found]), axis=0)
    edge, node = pairs[:, 0], pairs[:, 1]
    inner = (edges.first[edge] != node) & (edges.second[edge] != node)
    edge, node = edge[inner], node[inner]
    if not len(edge):
        return edge, node
    near = edges.shapes.select(edge).distances(points[node][:, None])[:, 0] <= snap
    return edge[near], node[near]


def _find_crossings(edges: _Edges, rounding: float) -> tuple[Integer, Complex]:
    """Pairs of edges (k, 2), of which one is new, and the points (k,) where they cross away from their ends."""
    low, high = edges.shapes.bounds()
    fresh = np.flatnonzero(edges.fresh)
    if not len(fresh):
        return np.zeros((0, 2), dtype=np.int64), np.zeros(0, dtype=complex)
    which, other = Boxes(low, high).find_meeting(Boxes(low[fresh], high[fresh]))
    one = fresh[which]
    keep = (one != other) & (~edges.fresh[other] | (one < other))
    one, other = one[keep], other[keep]
    curved = edges.shapes.rises() > 0
    thick = curved[one] | curved[other]
    pairs, places = _cross_straight(edges, one[~thick], other[~thick], rounding)
    more_pairs, more_places = [], []
    for i, j in zip(one[thick].tolist(), other[thick].tolist(), strict=True):
        both = _pick(edges.shapes, i), _pick(edges.shapes, j)
        for point in meeting_points(*both, rounding):
            if _is_at_end(*both, point, rounding) or _is_at_end(*both[::-1], point, rounding):
                continue
            more_pairs.append((i, j))
            more_places.append(point)
    return (
        np.concatenate([pairs, np.array(more_pairs, dtype=np.int64).reshape(-1, 2)]),
        np.concatenate([places, np.array(more_places, dtype=complex)]),
    )


def _is_at_end(leg: Leg, other: Leg, point: complex, rounding: float) -> bool:
    """Whether a leg ends on another one, from which it is not apart up to a point that both have: it is cut there."""
    place = float(leg.project(point))
    for t in (0.0, 1.0):
        end, between = (complex(leg.point(np.array(at))) for at in (t, 0.5 * (t + place)))
        apart = [abs(complex(other.point(np.clip(other.project(each), 0.0, 1.0))) - each) for each in (end, between)]
        if apart[0] <= 0.5 * rounding and apart[1] <= rounding:
            return True
    return False


def _pick(shapes: Elements, number: int) -> Leg:
    return Leg(**{name: each.item() for name, each in vars(shapes.select(number)).items()}, elements=1)


def _cross_straight(
    edges: _Edges, one: Integer, other: Integer, rounding: float
) -> tuple[Integer, Complex]:
    """Of pairs of straight edges those that cross, and where; those that share a node do not, nor do those of which one
    ends on the other within the rounding: they are cut there, and the place would be that of the rounding."""
    nodes = [(edges.first, edges.first), (edges.first, edges.second), (edges.second, edges.first),
             (edges.second, edges.second)]  # fmt: skip
    apart = np.ones(len(one), dtype=bool)
    for mine, yours in nodes:
        apart &= mine[one] != yours[other]
    one, other = one[apart], other[apart]
    a, b, c, d = edges.shapes.start[one], edges.shapes.end[one], edges.shapes.start[other], edges.shapes.end[other]

    def side(start: Complex, end: Complex, point: Complex) -> Complex:
        """How far along an edge a point is, and (imaginary) to its left, both times its length."""
        return np.asarray(np.conj(end - start) * (point - start))

    before, after, left, right = side(c, d, a), side(c, d, b), side(a, b, c), side(a, b, d)
    crossing = (before.imag * after.imag < 0) & (left.imag * right.imag < 0)
    for place, length in ((before, np.abs(d - c)), (after, np.abs(d - c)), (left, np.abs(b - a)),
                          (right, np.abs(b - a))):  # fmt: skip
        # Half of it: such ends are among the nodes that edges pass for sure.
        crossing &= (np.abs(place.imag) > 0.5 * rounding * length) | (place.real < 0) | (place.real > length**2)
    one, other, a, b = one[crossing], other[crossing], a[crossing], b[crossing]
    t = before.imag[crossing] / (before.imag[crossing] - after.imag[crossing])
    return np.stack([one, other], axis=1), a + (b - a) * t


def _number_crossings(points: Complex, used: Integer, places: Complex, snap: float) -> tuple[Complex, Integer]:
    """The places of all nodes, and the node (k,) of each crossing: one that is there within the distance, or new."""
    if not len(places):
        return points, np.zeros(0, dtype=np.int64)
    tree = cKDTree(np.stack([points[used].real, points[used].imag], axis=1))
    far, nearest = tree.query(np.stack([places.real, places.imag], axis=1))
    nodes = used[nearest]
    new = np.flatnonzero(far > snap)
    if len(new):
        joined = gather(places[new], sort_places(places[new]), snap)
        alone, which = np.unique(joined, return_inverse=True)
        nodes[new] = len(points) + which.reshape(-1)
        points = np.concatenate([points, places[new][alone]])
    return points, nodes


def _find_barred(strands: list[Strand], edges: _Edges, edge: Integer, node: Integer) -> Bool:
    """Which edges must not be bent through these nodes."""
    owner, number = edges.owner[edge].tolist(), edges.number[edge].tolist()
    return np.array([
        each in strands[i].barred[j] for i, j, each in zip(owner, number, node.tolist(), strict=True)
    ], dtype=bool)


def _keep_off_barred(
    strands: list[Strand], edges: _Edges, pairs: Integer, points: Complex, nodes: Integer, places: Complex,
    rounding: float,
) -> tuple[Complex, Integer]:
    """Crossings next to a node that one of the edges must not be bent through get one of their own, one for all that
    are in the same place."""
    both = _find_barred(strands, edges, pairs[:, 0], nodes) | _find_barred(strands, edges, pairs[:, 1], nodes)
    alone = np.flatnonzero(both)
    if not len(alone):
        return points, nodes
    own = places[alone]
    first, which = np.unique(gather(own, sort_places(own), rounding), return_inverse=True)
    nodes[alone] = len(points) + which.reshape(-1)
    return np.concatenate([points, own[first]]), nodes


def _apply(
    strands: list[Strand], edges: _Edges, points: Complex, cuts: Integer, fresh: list[list[bool]], rounding: float,
    log: Log,
) -> bool:
    """Cut edges at nodes (k, 2), and mark the parts as new; whether there were any."""
    if not len(cuts):
        return False
    begins = np.flatnonzero(np.diff(cuts[:, 0], prepend=-1))
    done = False
    inserted: dict[int, dict[int, tuple[list[Leg], list[int]]]] = {}
    for group in np.split(cuts, begins[1:]):
        edge = int(group[0, 0])
        owner, number = int(edges.owner[edge]), int(edges.number[edge])
        strand = strands[owner]
        leg = strand.legs[number]
        at = [(float(leg.project(complex(points[node]))), node) for node in group[:, 1].tolist()]
        inside = sorted((t, node) for t, node in at if 0 < t < 1)
        if not inside:
            continue
        inserted.setdefault(owner, {})[number] = _cut(strand, number, inside, points, rounding, log)
        done = True
    for owner, parts in inserted.items():
        _insert(strands[owner], parts, fresh, owner)
    return done


def _cut(
    strand: Strand, number: int, inside: list[tuple[float, int]], points: Complex, rounding: float, log: Log
) -> tuple[list[Leg], list[int]]:
    """A leg's parts between nodes at fractions of it, and those nodes."""
    leg = strand.legs[number]
    fractions = [0.0, *(t for t, _ in inside), 1.0]
    counts = share(leg.elements, list(np.diff(fractions)))
    ends = [leg.start, *(complex(points[node]) for _, node in inside), leg.end]
    parts = []
    for i, count in enumerate(counts):
        first, last = (complex(point) for point in leg.point(np.array(fractions[i:i + 2])))
        parts.append(leg.cut(fractions[i], fractions[i + 1], first, last, count).tie(ends[i], ends[i + 1]))
    for t, node in inside:
        off = abs(complex(leg.point(np.array(t))) - complex(points[node]))
        if off > rounding:
            log.add("bent", strand.name, complex(points[node]), off, node)
    return parts, [node for _, node in inside]


def _insert(
    strand: Strand, parts: dict[int, tuple[list[Leg], list[int]]], fresh: list[list[bool]], owner: int
) -> None:
    legs: list[Leg] = []
    nodes: list[int] = [strand.nodes[0]]
    flags: list[bool] = []
    barred: list[frozenset[int]] = []
    for number, leg in enumerate(strand.legs):
        new_legs, new_nodes = parts.get(number, ([leg], []))
        legs += new_legs
        nodes += [*new_nodes, strand.nodes[number + 1]]
        flags += [number in parts] * len(new_legs)
        behind = frozenset(() if number not in parts else (strand.nodes[number], *new_nodes, strand.nodes[number + 1]))
        barred += [strand.barred[number] | behind] * len(new_legs)
    strand.legs, strand.nodes, strand.barred, fresh[owner] = legs, nodes, barred, flags
    strand.touched = True
