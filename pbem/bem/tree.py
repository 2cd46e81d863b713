"""Cluster trees over elements or points of all regions, and which of their clusters see each other from far."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Protocol

import numpy as np

from pbem.arrays import Bool, Complex, Integer, Real

# Places and circles that differ by less than this part of their cluster, or of their size, are alike: trees of regular
# models are the same in all units.
ROUNDED = 2.0**-30
# By this factor at least the errors of expansions fall from term to term.
RATIO = 0.55


class Circles(Protocol):
    """Circles around clusters: center (k,) complex, radius (k,)."""

    @property
    def center(self) -> Complex: ...

    @property
    def radius(self) -> Real: ...


class Branches(Circles, Protocol):
    """Circles with the places (k,) of the clusters' parents, which come before them; -1: none."""

    @property
    def parent(self) -> Integer: ...


@dataclass(frozen=True)
class Clusters:
    """Some of the clusters of a forest: their numbers there (k,); parent (k,): place among them, -1 if it is not there.
    """

    number: Integer
    parent: Integer
    center: Complex
    radius: Real

    @property
    def count(self) -> int:
        return len(self.number)


@dataclass(frozen=True)
class Forest:
    """One cluster tree for each region; clusters (k,) of all trees, level after level, parents before children.

    order (n,): the items, sorted so that those of a cluster are order[first:last]; first, last (k,). center (k,)
    complex, radius (k,): a circle around a cluster's items. region, level, parent (k,): parent is -1 at a root.
    child, children (k,): a cluster's children are child .. child + children - 1; a leaf has none.
    """

    order: Integer
    first: Integer
    last: Integer
    center: Complex
    radius: Real
    region: Integer
    level: Integer
    parent: Integer
    child: Integer
    children: Integer

    @property
    def clusters(self) -> int:
        return len(self.first)

    @cached_property
    def levels(self) -> tuple[Integer, ...]:
        """Clusters of each level below the roots."""
        deepest = int(self.level.max(initial=0))
        return tuple(np.flatnonzero(self.level == depth) for depth in range(1, deepest + 1))

    @cached_property
    def leaves(self) -> Integer:
        """Numbers of the clusters without children, in the order of their items."""
        leaves = np.flatnonzero(self.children == 0)
        return leaves[np.argsort(self.first[leaves], kind="stable")]

    def take(self, number: Integer) -> Clusters:
        """Some clusters (k,), in that order; parents that come after their children are left out."""
        place = np.full(self.clusters + 1, -1)
        place[number] = np.arange(len(number))
        parent = place[self.parent[number]]
        parent[parent >= np.arange(len(number))] = -1
        return Clusters(number, parent, self.center[number], self.radius[number])

    def widen(self, least: float) -> Forest:
        """The same with no circle smaller than a least radius."""
        return replace(self, radius=np.maximum(self.radius, least))

    def items(self, cluster: int) -> Integer:
        """The items of a cluster."""
        return self.order[self.first[cluster] : self.last[cluster]]


def build_forest(start: Complex, end: Complex, bulge: Real, region: Integer, most: Integer) -> Forest:
    """Cluster trees of the items from start to end (n,), those of each region apart.

    most (regions,): items of a region's leaf at most.

    bulge (n,): distance from the middle within which an item lies if that is more than its ends tell (arcs), else 0.
    A cluster is cut into halves of equal count along the longer side of the box around its items' middles, twice over
    if it has more than twice as many items as a leaf.
    """
    middle = 0.5 * (start + end)
    order = np.argsort(region, kind="stable")
    names, begin = np.unique(region[order], return_index=True)
    bounds = np.append(begin, len(order))
    level = [(int(name), -1, int(bounds[k]), int(bounds[k + 1])) for k, name in enumerate(names)]
    made: list[tuple[int, int, int, int, int]] = []  # region, level, parent, first, last
    depth, count = 0, 0
    while level:
        following = []
        for name, parent, first, last in level:
            made.append((name, depth, parent, first, last))
            if last - first > most[name]:
                cuts = _cut(order, middle, first, last, twice=last - first > 2 * most[name])
                following += [(name, count, low, high) for low, high in pairwise(cuts)]
            count += 1
        level, depth = following, depth + 1
    table = np.array(made, dtype=np.int64).reshape(-1, 5)
    owner, depths, above, first, last = np.ascontiguousarray(table.T)
    center, radius = np.zeros(count, dtype=complex), np.zeros(count)
    for depth in range(int(depths.max(initial=-1)) + 1):
        own = np.flatnonzero(depths == depth)
        center[own], radius[own] = _enclose(order, first[own], last[own], start, end, middle, bulge)
    children = np.bincount(above[above >= 0], minlength=count)
    child = np.full(count, -1)
    below = np.flatnonzero(above >= 0)[::-1]
    child[above[below]] = below  # the first child is written last
    return Forest(
        order=order, first=first, last=last, center=center, radius=radius, region=owner, level=depths, parent=above,
        child=child, children=children,
    )  # fmt: skip


def _cut(order: Integer, middle: Complex, first: int, last: int, twice: bool) -> list[int]:
    """Sort the items first .. last - 1 of `order` in place into two or four parts; returns the parts' bounds."""
    own = order[first:last]
    places = middle[own]
    x, y = places.real, places.imag
    wide, tall = float(np.ptp(x)), float(np.ptp(y))
    along, extent = (x, wide) if wide >= tall * (1 - ROUNDED) else (y, tall)
    if extent > 0:  # what differs by rounding keeps its order, in all units
        along = np.rint((along - along.min()) / extent / ROUNDED)
    order[first:last] = own[np.argsort(along, kind="stable")]
    half = (first + last) // 2
    if not twice:
        return [first, half, last]
    cuts = _cut(order, middle, first, half, twice=False) + _cut(order, middle, half, last, twice=False)
    return sorted(set(cuts))  # no part is empty


def _enclose(
    order: Integer, first: Integer, last: Integer, start: Complex, end: Complex, middle: Complex, bulge: Real
) -> tuple[Complex, Real]:
    """Centres and radii of circles around some clusters (k,), none of them empty: about the middle of the box around
    the items' ends. All of a level at once: there are thousands of few items each."""
    counts = last - first
    begins = np.cumsum(counts) - counts
    own = order[np.repeat(first - begins, counts) + np.arange(counts.sum())]
    one, other = start[own], end[own]
    middles = [0.5 * (np.minimum(*(np.minimum.reduceat(each, begins) for each in ends))
                      + np.maximum(*(np.maximum.reduceat(each, begins) for each in ends)))
               for ends in ((one.real, other.real), (one.imag, other.imag))]
    center = middles[0] + 1j * middles[1]
    around = np.repeat(center, counts)
    reach = np.maximum(np.abs(one - around), np.abs(other - around))
    curved = np.flatnonzero(bulge[own])
    reach[curved] = np.maximum(reach[curved], np.abs(middle[own[curved]] - around[curved]) + bulge[own[curved]])
    return center, np.maximum.reduceat(reach, begins)


@dataclass(frozen=True)
class Interactions:
    """Pairs of clusters, target and source, that together cover every pair of items of a region once.

    far_target, far_source: well apart. near_target, near_source: leaves too near to each other. Sorted by target.
    """

    far_target: Integer
    far_source: Integer
    near_target: Integer
    near_source: Integer


def find_interactions(targets: Forest, sources: Forest, ratio: float, wanted: Bool | None = None) -> Interactions:
    """Descend both forests together until clusters are well apart or leaves (theory, 42).

    Well apart: with x, y the radii of source and target over the distance of their centres, x/(1 - y) and y/(1 - x) are
    at most `ratio`, by which the errors of the expansions fall from term to term.
    wanted (target clusters,): leave out the targets that are not (they have no wanted descendant).
    """
    far: list[tuple[Integer, Integer]] = []
    near: list[tuple[Integer, Integer]] = []
    target, source = _pair_roots(targets, sources)
    while len(target):
        if wanted is not None:
            target, source = target[wanted[target]], source[wanted[target]]
        distance = np.abs(targets.center[target] - sources.center[source])
        distance *= 1 + ROUNDED  # regular models have clusters that are just apart, in some units
        own, other = targets.radius[target], sources.radius[source]
        apart = (other <= ratio * (distance - own)) & (own <= ratio * (distance - other)) & (distance > own + other)
        far.append((target[apart], source[apart]))
        target, source = target[~apart], source[~apart]
        inner_target, inner_source = targets.children[target] > 0, sources.children[source] > 0
        ended = ~inner_target & ~inner_source
        near.append((target[ended], source[ended]))
        larger = targets.radius[target] >= (1 - ROUNDED) * sources.radius[source]
        split_target = inner_target & (~inner_source | larger)
        split_source = ~ended & ~split_target
        one = _replace_by_children(targets, target[split_target], source[split_target])
        other_source, other_target = _replace_by_children(sources, source[split_source], target[split_source])
        target = np.concatenate([one[0], other_target])
        source = np.concatenate([one[1], other_source])
    far_target, far_source = _sort_pairs(far)
    near_target, near_source = _sort_pairs(near)
    return Interactions(far_target, far_source, near_target, near_source)


def _pair_roots(targets: Forest, sources: Forest) -> tuple[Integer, Integer]:
    own, other = np.flatnonzero(targets.parent < 0), np.flatnonzero(sources.parent < 0)
    root_of_region = dict(zip(sources.region[other].tolist(), other.tolist(), strict=True))
    pairs = [(root, root_of_region[name]) for root, name in zip(own.tolist(), targets.region[own].tolist(), strict=True)
             if name in root_of_region]
    both = np.array(pairs, dtype=np.int64).reshape(-1, 2)
    return both[:, 0], both[:, 1]


def _replace_by_children(forest: Forest, cluster: Integer, partner: Integer) -> tuple[Integer, Integer]:
    counts = forest.children[cluster]
    offsets = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    return np.repeat(forest.child[cluster], counts) + offsets, np.repeat(partner, counts)


def _sort_pairs(parts: list[tuple[Integer, Integer]]) -> tuple[Integer, Integer]:
    target = np.concatenate([np.zeros(0, dtype=np.int64), *(part[0] for part in parts)])
    source = np.concatenate([np.zeros(0, dtype=np.int64), *(part[1] for part in parts)])
    order = np.lexsort((source, target))
    return target[order], source[order]
