"""Vertices that are the same point, and ends of traces that all but reach another trace, or poke through it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pbem.arrays import Complex, Integer
from pbem.geometry.boxes import Boxes
from pbem.geometry.intersection import meeting_points
from pbem.geometry.network.parts import Kind
from pbem.geometry.network.strands import Log, Strand, collect_legs, gather, sort_places


def number_nodes(strands: Sequence[Strand], snap: float, rounding: float, log: Log) -> Complex:
    """Give every strand its nodes: vertices no further from each other than `snap` are one. Returns their places.

    Ends move rather than vertices. No two nodes are nearer to each other than `snap`.
    """
    places = [[strand.legs[0].start, *(leg.end for leg in strand.legs)] for strand in strands]
    points = np.array([point for each in places for point in each], dtype=complex)
    is_end = np.zeros(len(points), dtype=bool)
    counts = np.array([len(each) for each in places])
    last = np.cumsum(counts) - 1
    opened = np.array([not strand.closed for strand in strands], dtype=bool)
    is_end[last[opened]] = is_end[(last - counts + 1)[opened]] = True
    owner = np.repeat(np.arange(len(strands)), counts)
    joined = gather(points, sort_places(points, is_end), snap)
    for vertex in np.flatnonzero(np.abs(points[joined] - points) > rounding).tolist():
        other = strands[owner[joined[vertex]]].name
        log.add("joined", strands[owner[vertex]].name, complex(points[vertex]),
                abs(points[vertex] - points[joined[vertex]]), other)
    for strand, nodes in zip(strands, np.split(joined, last[:-1] + 1), strict=True):
        _tie(strand, nodes.tolist(), points, snap)
    return points


def _tie(strand: Strand, nodes: list[int], points: Complex, snap: float) -> None:
    """Let a strand run through its nodes; legs that have none left between their ends go."""
    legs, kept = [], [nodes[0]]
    for leg, end in zip(strand.legs, nodes[1:], strict=True):
        if end == kept[-1]:
            strand.touched = True
            continue
        tied = leg.tie(complex(points[kept[-1]]), complex(points[end]))
        strand.touched |= abs(tied.start - leg.start) > 0 or abs(tied.end - leg.end) > 0
        legs.append(tied)
        kept.append(end)
    strand.legs, strand.nodes = legs, kept


def pull_ends(strands: list[Strand], points: Complex, snap: float, rounding: float, log: Log) -> Complex:
    """Move every end that no other leg reaches onto the leg that it all but reaches, or pokes through, by less than
    `snap`. Returns the places of the nodes."""
    legs, owner, number = collect_legs(strands)
    if not legs.count:
        return points
    first = np.array([node for strand in strands for node in strand.nodes[:-1]])
    second = np.array([node for strand in strands for node in strand.nodes[1:]])
    counts = np.bincount(np.concatenate([first, second]), minlength=len(points))
    tips = np.flatnonzero(counts == 1)
    low, high = legs.bounds()
    at, near = Boxes(low - snap, high + snap).find_around(points[tips])
    tip = tips[at]
    foreign = (first[near] != tip) & (second[near] != tip)
    tip, near = tip[foreign], near[foreign]
    distance = legs.select(near).distances(points[tip][:, None])[:, 0]
    close = distance <= snap
    tip, near, distance = tip[close], near[close], distance[close]
    order = np.lexsort((near, distance, tip))
    own = {node: edge for edge, pair in enumerate(zip(first.tolist(), second.tolist(), strict=True)) for node in pair}
    moved = points.copy()
    targets: dict[int, list[tuple[int, float]]] = {}
    for index in order.tolist():
        targets.setdefault(int(tip[index]), []).append((int(near[index]), float(distance[index])))
    told: list[tuple[Kind, str, int, complex, float, str]] = []
    for node, others in targets.items():
        leg = strands[owner[own[node]]].legs[number[own[node]]]
        name = strands[owner[own[node]]].name
        place = complex(points[node])
        crossings = [
            (abs(point - place), point, edge) for edge, _ in others
            for point in meeting_points(leg, strands[owner[edge]].legs[number[edge]], rounding)
            if rounding < abs(point - place) <= snap
        ]
        if crossings:
            far, point, edge = max(crossings, key=lambda each: each[0])
            told.append(("cut off", name, node, place, far, strands[owner[edge]].name))
            moved[node] = point
        elif others[0][1] > rounding:
            edge, far = others[0]
            other = strands[owner[edge]].legs[number[edge]]
            told.append(("joined", name, node, place, far, strands[owner[edge]].name))
            moved[node] = complex(other.point(np.array(min(1.0, max(0.0, other.project(place))))))
    target = _settle(strands, points, moved, snap)
    for kind, name, node, place, far, onto in told:
        # What lies next to a node of the other trace goes on to it.
        reached = complex(moved[target[node]])
        if kind == "joined":
            log.add(kind, name, place, abs(reached - place), onto)
            continue
        log.add(kind, name, place, far, onto)
        cut = complex(moved[node])
        if abs(reached - cut) > rounding:
            log.add("joined", name, cut, abs(reached - cut), onto)
    return moved


def _settle(strands: list[Strand], points: Complex, moved: Complex, snap: float) -> Integer:
    """Ends that were moved next to another node become that node: the numbers of the nodes that all become."""
    which = np.flatnonzero(moved != points)
    if not len(which):
        return np.arange(len(points))
    used = np.unique(np.concatenate([strand.nodes for strand in strands if strand.nodes]))
    shifted = np.isin(used, which)
    joined = gather(moved[used], sort_places(moved[used], shifted), snap)
    target = np.arange(len(points))
    target[used] = used[joined]
    for strand in strands:
        if strand.legs:
            _tie(strand, target[strand.nodes].tolist(), moved, snap)
    return target


def list_nodes(strands: Sequence[Strand]) -> Integer:
    """Numbers of the nodes that strands have."""
    return np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *(np.array(strand.nodes) for strand in strands)]))
