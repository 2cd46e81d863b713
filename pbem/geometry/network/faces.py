"""The parts of the plane that pieces enclose: walks along them that always turn as far left as they can."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from pbem.geometry.curve import Leg
from pbem.geometry.elements import Elements
from pbem.geometry.network.parts import Block
from pbem.geometry.network.pieces import Run

# A piece, by number, and whether it is travelled forwards.
Step = tuple[int, bool]
# Directions at a node are taken at this part of the shortest leg there.
NEAR = 0.25


def sort_ends(runs: Sequence[Run]) -> dict[int, list[Step]]:
    """At every node the steps that leave it, counter-clockwise."""
    leaving: dict[int, list[tuple[Step, Leg]]] = {}
    for number, run in enumerate(runs):
        leaving.setdefault(run.nodes[0], []).append(((number, True), run.legs[0]))
        leaving.setdefault(run.nodes[-1], []).append(((number, False), run.legs[-1].reverse()))
    result = {}
    for node, steps in leaving.items():
        if len(steps) > 2:
            near = NEAR * min(leg.length for _, leg in steps)
            steps.sort(key=lambda each: _find_direction(each[1], near))
        result[node] = [step for step, _ in steps]
    return result


def _find_direction(leg: Leg, near: float) -> float:
    return float(np.angle(complex(leg.point(np.array(near / leg.length))) - leg.start))


def find_blocks(runs: Sequence[Run], around: Mapping[int, Sequence[Step]]) -> list[Block]:
    """The blocks, those whose outer rings begin with the first pieces first; about the network's origin."""
    follows: dict[Step, Step] = {}
    for steps in around.values():
        for position, (number, forwards) in enumerate(steps):
            # Who arrives here against this step goes on along its right-hand neighbour: the face is on the left.
            follows[number, not forwards] = steps[position - 1]
    blocks = []
    for walk in _walk(follows):
        both = {number for number, forwards in walk if forwards and (number, False) in walk}
        rings = list(_cut_bridges(list(walk), both))
        shapes = [Elements.collect(_list_legs(runs, ring)) for ring in rings]
        areas = [_measure(each)[0] for each in shapes]
        if not rings or sum(areas) <= 0:
            continue
        first = int(np.argmax(areas))
        order = [first, *(number for number in range(len(rings)) if number != first)]
        moments = [_measure(each) for each in shapes]
        area = float(sum(each for each, _ in moments))
        center = sum(each * place for each, place in moments) / area
        named = tuple(tuple((runs[number].name, ahead) for number, ahead in rings[which]) for which in order)
        blocks.append(Block(named, area, complex(center)))
    return blocks


def _walk(follows: Mapping[Step, Step]) -> Iterator[dict[Step, None]]:
    """The closed walks, each as its steps in order."""
    seen: set[Step] = set()
    for start in follows:
        walk: dict[Step, None] = {}
        step = start
        while step not in seen:
            seen.add(step)
            walk[step] = None
            step = follows[step]
        if walk:
            yield walk


def _cut_bridges(walk: list[Step], both: set[int]) -> Iterator[list[Step]]:
    """The closed parts of a walk between pieces that are travelled there and back."""
    stack: list[list[Step]] = [[]]
    opened: list[int] = []
    for step in walk:
        if step[0] not in both:
            stack[-1].append(step)
        elif opened and opened[-1] == step[0]:
            opened.pop()
            part = stack.pop()
            if part:
                yield part
        else:
            opened.append(step[0])
            stack.append([])
    if stack[0]:
        yield stack[0]


def _list_legs(runs: Sequence[Run], ring: Sequence[Step]) -> list[Leg]:
    legs: list[Leg] = []
    for number, forwards in ring:
        own = runs[number].legs
        legs += own if forwards else [leg.reverse() for leg in reversed(own)]
    return legs


def _measure(shapes: Elements) -> tuple[float, complex]:
    """Area inside of a closed chain of legs, positive if it is counter-clockwise, and its centroid (of the chords)."""
    reference = shapes.start[0]
    start, end = shapes.start - reference, shapes.end - reference
    triangles = 0.5 * (np.conj(start) * end).imag
    chords = float(triangles.sum())
    area = chords + float(shapes.areas.sum())
    if chords == 0:
        return area, complex(reference + start.mean())
    return area, complex(reference + (triangles * (start + end) / 3).sum() / chords)
