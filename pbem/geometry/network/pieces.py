"""From strands that meet at nodes only to named pieces, each from junction to junction, and what meets there."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pbem.geometry.curve import Leg
from pbem.geometry.network.strands import Log, Strand


@dataclass(frozen=True)
class Run:
    """Successive legs of a trace between two nodes, which may be the same one. whole: it is all of the trace as it was
    given."""

    name: str
    trace: str
    legs: tuple[Leg, ...]
    nodes: tuple[int, ...]
    whole: bool


def merge(strands: Sequence[Strand], snap: float, log: Log) -> list[list[bool]]:
    """Which legs remain: of those that lie on each other, between the same nodes, the one of the longest trace."""
    kept = [[True] * len(strand.legs) for strand in strands]
    between: dict[tuple[int, int], list[tuple[int, int]]] = defaultdict(list)
    for owner, strand in enumerate(strands):
        for number, (_, first, second) in enumerate(strand.edges()):
            between[min(first, second), max(first, second)].append((owner, number))
    lengths = [strand.length for strand in strands]
    under: dict[tuple[int, int], int] = {}
    for places in between.values():
        if len(places) == 1:
            continue
        winners: list[tuple[int, int, complex]] = []
        for owner, number in sorted(places, key=lambda place: (-lengths[place[0]], place)):
            middle = complex(strands[owner].legs[number].point(np.array(0.5)))
            onto = next((winner for winner, _, point in winners if abs(point - middle) <= snap), None)
            if onto is None:
                winners.append((owner, number, middle))
            else:
                kept[owner][number] = False
                under[owner, number] = onto
    _log_merged(strands, under, log)
    return kept


def _log_merged(strands: Sequence[Strand], under: Mapping[tuple[int, int], int], log: Log) -> None:
    """Successive legs that lie on the same trace are one stretch."""
    begun: dict[int, tuple[int, int, complex, float]] = {}
    for owner, number in sorted(under):
        onto, leg = under[owner, number], strands[owner].legs[number]
        last = begun.get(owner)
        if last is not None and last[:2] == (number - 1, onto):
            begun[owner] = (number, onto, last[2], last[3] + leg.length)
            continue
        if last is not None:
            log.add("merged", strands[owner].name, last[2], last[3], strands[last[1]].name)
        begun[owner] = (number, onto, leg.start, leg.length)
    for owner, (_, onto, place, length) in begun.items():
        log.add("merged", strands[owner].name, place, length, strands[onto].name)


def find_runs(strands: Sequence[Strand], kept: Sequence[Sequence[bool]], log: Log) -> list[Run]:
    """The pieces of all traces, in their order. A trace without cuts keeps its name."""
    counts: Counter[int] = Counter()
    for strand, flags in zip(strands, kept, strict=True):
        for (_, first, second), flag in zip(strand.edges(), flags, strict=True):
            counts.update((first, second) if flag else ())
    taken = {strand.name for strand in strands}
    runs = []
    for strand, flags in zip(strands, kept, strict=True):
        groups = _group(strand, flags, counts)
        whole = len(groups) == 1 and all(flags) and not strand.touched
        numbers = iter(range(1, 10**9))
        for group in groups:
            name = strand.name
            while len(groups) > 1 and name in taken:
                name = f"{strand.name}.{next(numbers)}"
            legs = tuple(strand.legs[number] for number in group)
            nodes = (strand.nodes[group[0]], *(strand.nodes[number + 1] for number in group))
            runs.append(Run(name, strand.name, legs, nodes, whole))
            taken.add(name)
    _log_cuts(runs, log)
    return runs


def _group(strand: Strand, flags: Sequence[bool], counts: Mapping[int, int]) -> list[list[int]]:
    """Numbers of the legs of every piece: it ends where a leg is missing, and where others reach its node."""
    count = len(flags)
    ring = count > 1 and strand.nodes[0] == strand.nodes[-1]
    order = list(range(count))

    def ends_before(number: int) -> bool:
        passed = flags[number - 1] and flags[number] and counts[strand.nodes[number]] == 2
        return (not passed and (number > 0 or ring)) or (number == 0 and not ring)

    if ring:
        first = next((number for number in order if ends_before(number)), 0)
        order = order[first:] + order[:first]
    groups: list[list[int]] = []
    for position, number in enumerate(order):
        if position == 0 or ends_before(number):
            groups.append([])
        if flags[number]:
            groups[-1].append(number)
    return [group for group in groups if group]


def _log_cuts(runs: Sequence[Run], log: Log) -> None:
    """The places where one piece of a trace follows another one."""
    logged: set[tuple[str, int]] = set()
    ends: Counter[tuple[str, int]] = Counter()
    for run in runs:
        for node in (run.nodes[0], run.nodes[-1]):
            ends[run.trace, node] += 1
    for run in runs:
        for node, place in ((run.nodes[0], run.legs[0].start), (run.nodes[-1], run.legs[-1].end)):
            alone = len(run.nodes) > 2 and run.nodes[0] == run.nodes[-1] and ends[run.trace, node] == 2
            if ends[run.trace, node] > 1 and not alone and (run.trace, node) not in logged:
                logged.add((run.trace, node))
                log.add("cut", run.trace, place, 0.0, node)
