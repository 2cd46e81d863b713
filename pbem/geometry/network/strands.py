"""Traces as strands of legs between numbered nodes, about an origin of their own."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

from pbem.arrays import Bool, Complex, Integer
from pbem.geometry.curve import Curve, Leg
from pbem.geometry.elements import Elements
from pbem.geometry.network.parts import Change, Kind
from pbem.geometry.shape import share

# A leg that turns by more is taken in parts (radians), whose ends tell what they are.
WIDEST = math.radians(120.0)
# Traces further from 0 than so many times their extent get an origin of their own.
FAR = 4.0


@dataclass
class Strand:
    """A trace on its way: its legs, each between two nodes (numbers).

    touched: whether anything was done to it, so that its curve is not the given one any more. barred: nodes that its
    legs, of which there are as many, must not be bent through, as what they are parts of has been there.
    """

    name: str
    legs: list[Leg]
    nodes: list[int] = field(default_factory=list)
    touched: bool = False
    barred: list[frozenset[int]] = field(default_factory=list)

    @property
    def closed(self) -> bool:
        return self.legs[0].start == self.legs[-1].end

    @property
    def length(self) -> float:
        return sum(leg.length for leg in self.legs)

    def edges(self) -> list[tuple[Leg, int, int]]:
        """Its legs with their nodes."""
        return [(leg, *pair) for leg, pair in zip(self.legs, pairwise(self.nodes), strict=True)]


@dataclass
class Log:
    """Changes as they happen, about the origin; `other` is a name, or the number of a node that tells it later."""

    entries: list[tuple[Kind, str, complex, float, str | int]] = field(default_factory=list)

    def add(self, kind: Kind, trace: str, place: complex, distance: float, other: str | int = "") -> None:
        self.entries.append((kind, trace, place, float(distance), other))

    def resolve(
        self, origin: complex, traces_at: Mapping[int, Iterable[str]], left_at: Mapping[int, Iterable[str]]
    ) -> tuple[Change, ...]:
        """traces_at: names of the traces at every node; left_at: of those that have a piece there, which cut others."""
        changes = []
        for kind, trace, place, distance, other in self.entries:
            if isinstance(other, int):
                here = (left_at if kind == "cut" else traces_at).get(other, ())
                other = next((name for name in here if name != trace), trace)
            changes.append(Change(kind, trace, place + origin, distance, other))
        return tuple(dict.fromkeys(changes))


def choose_origin(points: Complex) -> complex:
    """0, or a point with few digits near the middle of points that are far away: no coordinate is rounded."""
    low, high = complex(points.real.min(), points.imag.min()), complex(points.real.max(), points.imag.max())
    size = max((high - low).real, (high - low).imag)
    middle = low + 0.5 * (high - low)
    if size == 0 or abs(middle) <= FAR * size:
        return 0j
    unit = 2.0 ** math.floor(math.log2(size))
    return complex(unit * round(middle.real / unit), unit * round(middle.imag / unit))


def move_leg(leg: Leg, by: complex) -> Leg:
    """The leg at another place."""
    if not by:
        return leg
    return replace(leg, **leg.kind.move(leg, -by, 1.0)._asdict())


def split_wide(leg: Leg) -> list[Leg]:
    """The leg, or its parts if it turns too far to be known by its ends."""
    count = max(1, math.ceil(abs(leg.turn) / WIDEST - 1e-9))
    if count == 1:
        return [leg]
    fractions = np.arange(count + 1) / count
    points = [complex(point) for point in leg.point(fractions)]
    counts = share(leg.elements, [1.0] * count)
    return [
        leg.cut(fractions[i], fractions[i + 1], points[i], points[i + 1], counts[i]) for i in range(count)
    ]


def thin(strand: Strand, snap: float, log: Log) -> Strand | None:
    """Leave out the vertices that are no further than the distance from the one before; None if nothing remains."""
    kept: list[Leg] = []
    here, left_out = strand.legs[0].start, []
    for leg in strand.legs:
        tied = leg.tie(here, leg.end)
        if tied.length <= snap:
            left_out.append((leg.end, abs(leg.end - here)))
            continue
        kept.append(tied)
        here = leg.end
    last = strand.legs[-1].end
    while kept and here != last:
        # The end stays, and the vertices before it go.
        left_out = [each for each in left_out if each[0] != last] + [(here, abs(here - last))]
        leg = kept.pop()
        here = leg.start
        if abs(last - here) > snap:
            kept.append(leg.tie(here, last))
            break
    if not kept:
        log.add("dropped", strand.name, strand.legs[0].start, strand.length)
        return None
    for place, distance in left_out:
        log.add("thinned", strand.name, place, distance)
    return Strand(strand.name, kept, touched=strand.touched or bool(left_out))


def read_strands(traces: Mapping[str, Curve], origin: complex, snap: float, log: Log) -> list[Strand]:
    """The traces about an origin, without vertices that repeat the one before, and without those that are points."""
    strands = []
    for name, curve in traces.items():
        legs = [part for leg in curve.legs for part in split_wide(leg)]
        strand = thin(Strand(name, [move_leg(leg, -origin) for leg in legs]), snap, log)
        if strand is not None:
            strands.append(strand)
    return strands


def gather(points: Complex, order: Sequence[int] | Integer, distance: float) -> Integer:
    """For each point (n,) the number of the one that it is joined to: in the given order, the nearest of those before
    it that stand for themselves, if it is no further than the distance, else itself."""
    result = np.arange(len(points))
    tree = cKDTree(np.stack([points.real, points.imag], axis=1))
    pairs = tree.query_pairs(distance, output_type="ndarray")
    if not len(pairs):
        return result
    both = np.concatenate([pairs, pairs[:, ::-1]])
    near = sparse.csr_matrix((np.ones(len(both)), (both[:, 0], both[:, 1])), shape=(len(points), len(points)))
    alone = np.zeros(len(points), dtype=bool)
    concerned = np.diff(near.indptr) > 0
    for point in np.asarray(order)[concerned[order]].tolist():
        others = near.indices[near.indptr[point]:near.indptr[point + 1]]
        others = others[alone[others]]
        if len(others):
            result[point] = others[np.argmin(np.abs(points[others] - points[point]))]
        else:
            alone[point] = True
    return result


def sort_places(points: Complex, *ranks: Bool | Integer) -> Integer:
    """Numbers of points by the ranks, the first one first, then from left to right: the same for any order of them."""
    return np.lexsort((points.imag, points.real, *reversed(ranks)))


def collect_legs(strands: Sequence[Strand]) -> tuple[Elements, Integer, Integer]:
    """The legs of all strands, and the number of the strand and of the leg on it (m,)."""
    counts = np.array([len(strand.legs) for strand in strands], dtype=np.int64)
    owner = np.repeat(np.arange(len(strands)), counts)
    number = np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)
    return Elements.collect([leg for strand in strands for leg in strand.legs]), owner, number
