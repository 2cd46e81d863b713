"""Cells of VTK's grids: lines along faces and interfaces, the quadrangles of a grid of points, single points."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from pbem.arrays import Integer
from pbem.results.contents import Elements, Nodes, Tips
from pbem.results.lazy import AllPairs
from pbem.results.outline import find_chains, find_tips

VERTEX, POLYLINE, QUADRANGLE = 1, 4, 9
# Places that differ by less, relative to the size of the model, are one.
SAME_PLACE = 1e-6


@dataclass(frozen=True)
class Cells:
    """types (c,); connectivity: numbers of the points of one cell after the other, those of cell i from offsets[i]."""

    types: Integer
    connectivity: Integer
    offsets: Integer

    @classmethod
    def collect(cls, points: Sequence[Integer], kind: int | None = None) -> Cells:
        """Of the lists of their points; lines of single points are vertices."""
        counts = np.array([len(each) for each in points], dtype=np.int64)
        types = np.where(counts == 1, VERTEX, POLYLINE) if kind is None else np.full(len(points), kind)
        flat = np.concatenate([np.zeros(0, dtype=np.int64), *points])
        return cls(types, flat, np.concatenate([[0], np.cumsum(counts)]))

    @classmethod
    def vertices(cls, count: int) -> Cells:
        """Every point by itself."""
        return cls(np.full(count, VERTEX), np.arange(count), np.arange(count + 1))


def join_faces(elements: Elements, nodes: Nodes, tips: Mapping[str, Tips]) -> Cells:
    """A line for every element: through its nodes, and to the first of the element that follows it.

    Boundaries are closed, and so are cracks around their tips.
    """
    per_element = nodes.order + 1
    following = _find_following(elements, nodes, tips)
    own = np.arange(len(following))[:, None] * per_element + np.arange(per_element)
    return Cells.collect([
        np.append(line, after * per_element) if after >= 0 else line
        for line, after in zip(own, following, strict=True)
    ])  # fmt: skip


def _find_following(elements: Elements, nodes: Nodes, tips: Mapping[str, Tips]) -> Integer:
    """The element (e,) in which the face goes on, or -1."""
    start, end = elements.vertices[:, 0], elements.vertices[:, 1]
    following = np.full(len(start), -1)
    at_tips = find_tips(elements, nodes.curve_names, tips)
    begins: dict[tuple[float, ...], int] = {}
    chains = find_chains(elements)
    for chain in chains:
        following[chain[:-1]] = chain[1:]
        if elements.crack[chain[0]]:
            begins[int(elements.curve[chain[0]]), *start[chain[0]]] = int(chain[0])
    for chain in chains:
        last = int(chain[-1])
        if (start[chain[0]] == end[last]).all():
            following[last] = chain[0]
        elif elements.crack[last] and tuple(end[last]) in at_tips:
            following[last] = begins.get((int(elements.curve[last]), *end[last]), -1)
    return following


def join_pairs(interface: Integer) -> Cells:
    """A line through the pairs of each interface; interface (m,), rising."""
    return Cells.collect(np.split(np.arange(len(interface)), np.flatnonzero(np.diff(interface)) + 1))


def join_grid(configuration: str, region: Integer) -> Cells:
    """Quadrangles of the grid with which the points begin, where all corners are in regions; the rest by themselves."""
    across, up = (json.loads(configuration).get("interior_grid") if configuration else None) or (0, 0)
    number = np.arange(across * up).reshape(up, across)
    corners = np.stack([number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]], axis=-1).reshape(-1, 4)
    corners = corners[(region[corners] >= 0).all(axis=1)]
    alone = np.setdiff1d(np.arange(len(region)), corners)
    types = np.concatenate([np.full(len(corners), QUADRANGLE), np.full(len(alone), VERTEX)])
    counts = np.concatenate([np.full(len(corners), 4), np.ones(len(alone), dtype=np.int64)])
    return Cells(types, np.concatenate([corners.ravel(), alone]), np.concatenate([[0], np.cumsum(counts)]))


def match_pairs(nodes: Nodes, pairs: AllPairs) -> Integer:
    """The pair (n,) whose values hold at each node, on both sides of cracks and interfaces; -1 where there is none."""
    size = float(np.ptp(nodes.position, axis=0).max()) or 1.0
    tree = cKDTree(np.hstack([nodes.position, size * nodes.normal]))
    found = np.full(len(nodes.position), -1)
    for side in (-1.0, 1.0):
        distance, node = tree.query(np.hstack([pairs.position, side * size * pairs.normal]))
        near = distance < SAME_PLACE * size
        found[node[near]] = np.flatnonzero(near)
    return found
