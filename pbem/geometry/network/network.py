"""Networks: traces cut into pieces wherever they meet."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from pbem.arrays import Complex
from pbem.geometry.curve import Curve
from pbem.geometry.elements import Elements
from pbem.geometry.network.ends import number_nodes, pull_ends
from pbem.geometry.network.faces import find_blocks, sort_ends
from pbem.geometry.network.noding import cut_at_nodes
from pbem.geometry.network.parts import Block, Change, Junction
from pbem.geometry.network.pieces import Run, find_runs, merge
from pbem.geometry.network.strands import Log, Strand, choose_origin, move_leg, read_strands
from pbem.geometry.tolerance import ROUNDINGS


@dataclass(frozen=True)
class Network:
    """Traces as pieces that meet at their ends only.

    pieces: by name; those of a trace t12 that is cut are t12.1, t12.2, ... along it, a trace that is not cut keeps its
    name, and one to which nothing was done its curve; traces: the name of the trace of every piece; junctions: where
    pieces meet; blocks: what they enclose; changes: all that was done.
    """

    pieces: Mapping[str, Curve]
    traces: Mapping[str, str]
    junctions: tuple[Junction, ...]
    blocks: tuple[Block, ...]
    changes: tuple[Change, ...]

    @cached_property
    def members(self) -> Mapping[str, tuple[str, ...]]:
        """The pieces of every trace that has any."""
        members: dict[str, list[str]] = defaultdict(list)
        for piece, trace in self.traces.items():
            members[trace].append(piece)
        return {trace: tuple(pieces) for trace, pieces in members.items()}

    @property
    def crossings(self) -> int:
        """Number of junctions that two traces pass or more."""
        return sum(junction.through > 1 for junction in self.junctions)


def cut_network(traces: Mapping[str, Curve], snap: float = 0.0) -> Network:
    """Cut traces, open or closed, of straight and circular legs, wherever they cross or meet.

    snap: points no further from each other than this length are one, and what is no further from a trace is on it; at
    least the rounding of the coordinates. Raises UnsettledError if it is so large that cuts bring ever more cuts,
    or parts without a length.
    """
    if not traces:
        return Network({}, {}, (), (), ())
    extremes = Elements.collect([leg for curve in traces.values() for leg in curve.legs]).extremes()
    origin = choose_origin(extremes)
    rounding = ROUNDINGS * float(np.finfo(float).eps) * float(np.abs(extremes).max())
    snap = max(snap, rounding)
    log = Log()
    strands = read_strands(traces, origin, snap, log)
    if not strands:
        return Network({}, {}, (), (), log.resolve(origin, {}, {}))
    points = number_nodes(strands, snap, rounding, log)
    points = pull_ends(strands, points, snap, rounding, log)
    strands = _drop_empty(traces, strands, origin, log)
    points = cut_at_nodes(strands, points, snap, rounding, log)
    runs = find_runs(strands, merge(strands, snap, log), log)
    return _compose(traces, runs, strands, points, origin, log)


def _drop_empty(traces: Mapping[str, Curve], strands: Sequence[Strand], origin: complex, log: Log) -> list[Strand]:
    """Without the traces of which nothing is left but a node."""
    for strand in strands:
        if not strand.legs:
            given = traces[strand.name]
            log.add("dropped", strand.name, given.start - origin, given.length, strand.nodes[0])
    return [strand for strand in strands if strand.legs]


def _compose(
    traces: Mapping[str, Curve], runs: Sequence[Run], strands: Sequence[Strand], points: Complex, origin: complex,
    log: Log,
) -> Network:
    names: dict[int, dict[str, None]] = defaultdict(dict)
    for strand in strands:
        for node in strand.nodes:
            names[node][strand.name] = None
    places = _restore(traces, points, origin)
    pieces = {}
    for run in runs:
        pieces[run.name] = traces[run.trace] if run.whole else Curve(run.name, tuple(
            replace(move_leg(leg, origin), start=places[first], end=places[second])
            for leg, first, second in zip(run.legs, run.nodes, run.nodes[1:], strict=False)
        ))
    around = sort_ends(runs)
    junctions = []
    for node, steps in around.items():
        if len(steps) > 1 and not (len(steps) == 2 and steps[0][0] == steps[1][0]):
            ends = tuple((runs[number].name, not forwards) for number, forwards in steps)
            junctions.append(Junction(places[node], ends, _count_passing([runs[number].trace for number, _ in steps])))
    blocks = tuple(Block(each.rings, each.area, each.center + origin) for each in find_blocks(runs, around))
    left: dict[int, dict[str, None]] = defaultdict(dict)
    for run in runs:
        for node in run.nodes:
            left[node][run.trace] = None
    changes = log.resolve(origin, names, left)
    return Network(pieces, {run.name: run.trace for run in runs}, tuple(junctions), blocks, changes)


def _count_passing(traces: Sequence[str]) -> int:
    """How often traces pass a node: their pieces that end here, two by two."""
    return sum(count // 2 for count in Counter(traces).values())


def _restore(traces: Mapping[str, Curve], points: Complex, origin: complex) -> dict[int, complex]:
    """The places of the nodes in the coordinates of the traces: exactly those of vertices where they were not moved."""
    given = {
        vertex - origin: vertex
        for curve in traces.values() for leg in curve.legs for vertex in (leg.start, leg.end)
    }
    return {node: given.get(point, point + origin) for node, point in enumerate(points.tolist())}


