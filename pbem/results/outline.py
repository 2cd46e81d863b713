"""Outlines of regions and faces of cracks, as they were and displaced, from the nodes of a result file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pbem.arrays import Complex, Integer, Real
from pbem.mesh.interpolation import interpolate, interpolate_tips
from pbem.results.contents import Elements, Nodes, Tips

POINTS_PER_ELEMENT = 9
# In pictures of more elements than this their shapes cannot be seen: they are drawn with fewer points, without ticks.
MANY_ELEMENTS = 4000


@dataclass(frozen=True)
class Outline:
    """A loop of a region (closed: last point = first point) or one face of a crack: points (p, 2) in order of travel.

    position: as it was; displacement: at the same points.
    """

    region: int
    crack: bool
    position: Real
    displacement: Real


def trace_outlines(nodes: Nodes, elements: Elements, displacement: Real) -> list[Outline]:
    """The loops of all regions, then the first, then the second faces of cracks; displacement (n, 2) at the nodes.

    The displacement is continuous along a loop, while each element has its own polynomial: where two elements meet,
    and where the faces of a crack meet at its tip, the outline goes through the mean. Regions that are gone, whose
    displacement is not a number, have none.
    """
    t = choose_points(len(elements.vertices))
    values = interpolate_elements(nodes, elements, displacement, t)
    start, end = elements.vertices[:, 0], elements.vertices[:, 1]
    places = to_columns(elements.geometry.sample(t))
    places[:, 0], places[:, -1] = start, end
    chains = find_chains(elements)
    join_tips(elements, chains, values)
    outlines = []
    there = np.isfinite(values).all(axis=(1, 2))
    for chain in (each for each in chains if there[each].all()):
        closed = not elements.crack[chain[0]] and bool((end[chain[-1]] == start[chain[0]]).all())
        outlines.append(Outline(
            region=int(elements.region[chain[0]]), crack=bool(elements.crack[chain[0]]),
            position=_join(places[chain], closed), displacement=_join(values[chain], closed),
        ))
    return outlines


def choose_points(elements: int) -> Real:
    """Coordinates in [-1, 1] of the points by which each of so many elements is drawn."""
    return np.linspace(-1.0, 1.0, POINTS_PER_ELEMENT if elements <= MANY_ELEMENTS else 3)


def interpolate_elements(nodes: Nodes, elements: Elements, displacement: Real, t: Real) -> Real:
    """(e, len(t), 2): displacement at local coordinates t in [-1, 1] of every element.

    At crack tips the mean of the two faces is a polynomial, and their jump has the square-root shape.
    """
    count = len(elements.vertices)
    local = elements.geometry.preimage(to_complex(nodes.position).reshape(count, -1)).real
    at_nodes = displacement.reshape(count, -1, 2)
    values = interpolate(local, np.broadcast_to(t, (count, len(t)))) @ at_nodes
    # Second faces are stored in the order of the first ones, each travelled backwards.
    first, second = np.flatnonzero(elements.crack).reshape(2, -1)
    tips = elements.tip[first] > 0
    for here, there in ((first[tips], second[tips]), (second[tips], first[tips])):
        half_jump = 0.5 * (at_nodes[here] - at_nodes[there][:, ::-1])
        along = np.broadcast_to(t, (len(here), len(t)))
        shapes = interpolate_tips(elements.tip[here], local[here], along) - interpolate(local[here], along)
        values[here] += shapes @ half_jump
    return np.asarray(values)


def to_complex(columns: Real) -> Complex:
    """Complex points (...) from their x and y (..., 2)."""
    return np.asarray(columns[..., 0] + 1j * columns[..., 1])


def to_columns(points: Complex) -> Real:
    """x and y (..., 2) of complex points or vectors (...)."""
    return np.stack([points.real, points.imag], axis=-1)


def find_tips(elements: Elements, curve_names: Sequence[str], tips: Mapping[str, Tips]) -> set[tuple[float, ...]]:
    """The points (x, y) of all ends of cracks that are tips: those that have stress-intensity factors at any stored
    step. Of cracks that a stage removes with their region these are known until then."""
    count = int(elements.crack.sum()) // 2
    first = np.flatnonzero(elements.crack)[:count]
    # The elements of a crack follow each other.
    begins = np.flatnonzero(np.diff(elements.curve[first], prepend=-1))
    ends = np.append(begins[1:], count) - 1
    points = set()
    for begin, last in zip(first[begins], first[ends], strict=True) if count else ():
        factors = tips[curve_names[elements.curve[begin]]]
        for end, vertex in ((0, elements.vertices[begin, 0]), (1, elements.vertices[last, 1])):
            if not np.isnan(factors.KI[:, end]).all():
                points.add(tuple(vertex))
    return points


def find_chains(elements: Elements) -> list[Integer]:
    """Elements that follow each other along a loop or one face of a crack, in the order of travel; cracks come last."""
    start, end = elements.vertices[:, 0], elements.vertices[:, 1]
    # Second faces are stored in the order of the first ones; their travel goes the other way.
    second = len(start) - int(elements.crack.sum()) // 2
    order = np.concatenate([np.arange(second), np.arange(len(start) - 1, second - 1, -1)])
    before, after = order[:-1], order[1:]
    follows = (start[after] == end[before]).all(axis=1)
    follows &= elements.region[after] == elements.region[before]
    follows &= elements.crack[after] == elements.crack[before]
    follows &= ~elements.crack[after] | (elements.curve[after] == elements.curve[before])
    follows &= (after < second) == (before < second)
    chains = [chain for run in np.split(order, np.flatnonzero(~follows) + 1) for chain in _part_loops(elements, run)]
    chains.sort(key=lambda chain: bool(elements.crack[chain[0]]))
    return chains


def _part_loops(elements: Elements, run: Integer) -> list[Integer]:
    """Loops that touch where one ends and the next begins; a crack is left as it is."""
    start, end = elements.vertices[:, 0], elements.vertices[:, 1]
    parts = []
    while len(run) and not elements.crack[run[0]]:
        closes = np.flatnonzero((end[run] == start[run[0]]).all(axis=1))
        length = closes[0] + 1 if len(closes) else len(run)
        parts.append(run[:length])
        run = run[length:]
    return [*parts, *([run] if len(run) else [])]


def join_tips(elements: Elements, chains: list[Integer], values: Real) -> None:
    """Let both faces of a crack have their mean displacement at the ends where nothing else meets it; in place."""
    vertices = elements.vertices.reshape(-1, 2)
    _, which, counts = np.unique(to_complex(vertices), return_inverse=True, return_counts=True)
    meeting = counts[which.ravel()].reshape(-1, 2)
    faces: dict[tuple[float, ...], list[tuple[int, int]]] = {}
    for chain in chains:
        if elements.crack[chain[0]]:
            for element, side in ((int(chain[0]), 0), (int(chain[-1]), 1)):
                if meeting[element, side] == 2:
                    faces.setdefault(tuple(elements.vertices[element, side]), []).append((element, -side))
    for ends in faces.values():
        mean = np.mean([values[end] for end in ends], axis=0)
        for end in ends:
            values[end] = mean


def _join(pieces: Real, closed: bool) -> Real:
    """(elements, points, 2) to one line, with the mean where two elements meet."""
    inner = 0.5 * (pieces[:-1, -1] + pieces[1:, 0])
    first, last = pieces[0, 0], pieces[-1, -1]
    if closed:
        first = last = 0.5 * (first + last)
    joints = np.concatenate([first[None], inner])
    body = np.concatenate([joints[:, None], pieces[:, 1:-1]], axis=1).reshape(-1, 2)
    return np.concatenate([body, last[None]])
