"""Faces that move on so few pairs that a second solution says nothing of how far: it may move alike by chance."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from pbem.arrays import Integer, Real
from pbem.model.model import Model

# Of jumps on up to so many pairs between pairs that stay together, an error of this part of the largest over their
# number. Measured over 27 blocks on slopes and punches, and cracks that meet joints, orders 1 to 3, against four times
# the elements: 0.02 to 1.3 of the largest with one pair, 0.04 to 0.3 with four, where estimates were 0 to 0.3.
MOST, PART = 4, 0.5
# Of the largest jump on an interface: less is rounding.
LEAST = 1e-6


@dataclass(frozen=True)
class _Zone:
    """Pairs (k,) of an interface that have moved, one after the other; ends: the ends of the interface that it reaches,
    0 its start, 1 its end."""

    interface: str
    pairs: Integer
    ends: tuple[int, ...]


def bound_short_zones(model: Model, interfaces: Mapping[str, Integer], opening: Real, slip: Real) -> Real:
    """The least errors (m, 2) of opening and slip on zones of few pairs; 0 at other pairs.

    interfaces: pairs of each, by arc length; opening (m,): since the start, slip (m,), lengths. A zone goes on around
    the end of its interface on the only other interface there, or on the other end of the same. One that nothing
    bounds is none.
    """
    jumps = np.abs(np.stack([opening, slip], axis=1))
    least = np.zeros_like(jumps)
    zones = [zone for name, own in interfaces.items() for zone in _list_zones(name, own, jumps[own].max(axis=1))]
    meeting = _find_meeting(model, interfaces)
    at = {(zone.interface, end): number for number, zone in enumerate(zones) for end in zone.ends}
    stay = {end for end, other in meeting.items() if other not in at}
    links = [(number, at[meeting[end]]) for end, number in at.items() if end in meeting and end not in stay]
    for group in _join(len(zones), links):
        own = [zones[number] for number in group]
        bounded = any(len(zone.ends) < 2 or any((zone.interface, end) in stay for end in zone.ends) for zone in own)
        if bounded and sum(len(zone.pairs) for zone in own) <= MOST:
            pairs = np.concatenate([zone.pairs for zone in own])
            least[pairs] = PART / len(pairs) * jumps[pairs].max(axis=0)
    return least


def _list_zones(name: str, own: Integer, size: Real) -> list[_Zone]:
    """The zones of an interface with pairs (k,) whose jumps have a size (k,)."""
    moved = size > LEAST * size.max(initial=0.0)
    changes = np.flatnonzero(np.diff(np.concatenate([[0], moved.astype(np.int8), [0]])))
    return [_Zone(name, own[first:last], (0,) * (first == 0) + (1,) * (last == len(own)))
            for first, last in changes.reshape(-1, 2).tolist()]


def _join(count: int, links: Sequence[tuple[int, int]]) -> list[list[int]]:
    """The sets of numbers below `count` that are linked."""
    ends = np.array(links, dtype=np.int64).reshape(-1, 2).T
    graph = sparse.coo_matrix((np.ones(len(links)), (ends[0], ends[1])), shape=(count, count))
    _, label = csgraph.connected_components(graph, directed=False)
    order = np.argsort(label, kind="stable")
    return [each.tolist() for each in np.split(order, np.flatnonzero(np.diff(label[order])) + 1) if len(each)]


def _find_meeting(model: Model, interfaces: Mapping[str, Integer]) -> dict[tuple[str, int], tuple[str, int]]:
    """For ends (0 start, 1 end) of interfaces the only other end there; those of contacts are ends of bodies."""
    # Ends that meet are one number: pbem.geometry.shape.join_ends.
    places: dict[complex, list[tuple[str, int]]] = {}
    for name in interfaces:
        if name in model.interfaces:
            curve = model.curves[name]
            places.setdefault(curve.start, []).append((name, 0))
            places.setdefault(curve.end, []).append((name, 1))
    pairs = [ends for ends in places.values() if len(ends) == 2]
    return {one: other for ends in pairs for one, other in (ends, ends[::-1])}
