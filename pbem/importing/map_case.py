"""From the traces of a map to a case: cracks of the whole plane, with friction, under a stress far away."""

from __future__ import annotations

import itertools
import math
import statistics
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from pbem.errors import Fault
from pbem.geometry.boxes import Boxes
from pbem.geometry.curve import Curve, Leg
from pbem.geometry.elements import Elements
from pbem.geometry.network import Change, Network, cut_network
from pbem.geometry.network.noding import UnsettledError
from pbem.geometry.shape import Outline, outline
from pbem.geometry.simplification import choose_vertices
from pbem.geometry.tolerance import ROUNDINGS, SAME_POINT
from pbem.importing.listing import format_place, list_changes, write_case
from pbem.importing.options import FRICTION, POISSON, YOUNG, Imported, Options
from pbem.importing.reading import Reading, Trace, fail, set_apart

# Of the median length of the traces.
SNAP, SIZE = 1e-3, 1 / 6
# Faces nearer to each other than half of this part of their legs are refused by `pbem check` as meant to be one,
# whatever the snap distance (`COINCIDENT` of pbem.model.coincidence; ends that miss a leg by a tenth of that as well).
LEAST_SNAP = 2e-5
# Traces shorter than so many roundings of the map's coordinates say nothing.
COARSEST = 1e3
# More elements than this are nothing that can be computed.
MOST_ELEMENTS = 200_000
# Radians that an element of an arc turns by at most, before its curve is refined.
WIDEST = 0.2


@dataclass(frozen=True)
class _Scale:
    """Lengths of a map: median length of the traces, snap distance, element size, and rounding of coordinates."""

    median: float
    snap: float
    size: float
    rounding: float


def make_map_case(path: Path, reading: Reading, options: Options, command: str) -> Imported:
    """The case of the traces that were read. Raises CaseError if there are none, or if their numbers make no map."""
    scale = _measure(path, reading, options)
    renamed = set_apart([trace.name for trace in reading.traces], of_known=False)
    reading.traces = [replace(trace, name=renamed.get(trace.name, trace.name)) for trace in reading.traces]
    traces: Sequence[Trace] = reading.traces
    notes: list[str] = []
    if options.simplify and not options.keep_junctions:
        traces, notes = _simplify_singly(traces, options.simplify, scale)
    network, owners, changes = _cut(path, traces, scale)
    if options.simplify and options.keep_junctions:
        traces, notes = _simplify_between(network, owners, options.simplify)
        earlier = [change for change in changes if change.kind != "cut"]
        network, owners, changes = _cut(path, traces, scale)
        changes = [*earlier, *changes]
    names = _name_curves(network, owners, scale)
    tables = _make_tables(path, network, names, options, scale)
    summary = _summarise(reading, network, owners, names)
    notes = [*reading.notes, *notes, *_tell_defaults(options, scale)]
    groups = [*_list_left_out(reading), *_list_renamed(renamed), *list_changes(changes)]
    text = write_case(path.name, tables, summary, notes, groups, command)
    return Imported(text, tuple(summary), tuple(notes), tuple(groups))


def _name_part(trace: Trace, number: int) -> str:
    """Parts of one trace, told apart by what no name of a file can hold."""
    return f"{trace.name}\n{number}" if number else trace.name


def _measure(path: Path, reading: Reading, options: Options) -> _Scale:
    if not reading.traces:
        found = "no line" + (f" ({reading.left_out[0]})" if reading.left_out else "")
        raise fail(path, [Fault("the file", found, "one trace at least")])
    lengths = [sum(leg.length for leg in part) for trace in reading.traces for part in trace.parts]
    longer = [length for length in lengths if length > 0]
    shapes = Elements.collect([leg for trace in reading.traces for part in trace.parts for leg in part])
    largest = float(np.abs(shapes.extremes()).max())
    rounding = ROUNDINGS * float(np.finfo(float).eps) * largest
    median = statistics.median(longer) if longer else 0.0
    if median <= COARSEST * rounding:
        found = f"traces of a median length of {median:.3g} at coordinates of up to {largest:.3g}"
        expected = "lengths that are known to some digits: coordinates from a nearer origin"
        if not longer:
            found, expected = f"{len(lengths)} traces of length 0", "one trace with a length at least"
        raise fail(path, [Fault("the map", found, expected)])
    snap = SNAP * median if options.snap is None else options.snap
    snap = max(snap, rounding, LEAST_SNAP * float(shapes.lengths.max()))
    size = SIZE * median if options.size is None else options.size
    count = math.fsum(lengths) / size
    if count > MOST_ELEMENTS:
        found = f"traces of {math.fsum(lengths):.3g} in all, {count:.3g} times the elements' length of {size:.3g}"
        raise fail(path, [Fault("the map", found, f"longer elements, {MOST_ELEMENTS} at most: --size")])
    return _Scale(median, snap, size, rounding)


def _cut(
    path: Path, traces: Sequence[Trace], scale: _Scale
) -> tuple[Network, dict[str, str], list[Change]]:
    """The network of traces, the trace of every part by the name that it has there, and what was done to the traces."""
    owners = {_name_part(trace, number): trace.name for trace in traces for number in range(len(trace.parts))}
    curves = {
        _name_part(trace, number): Curve(_name_part(trace, number), part)
        for trace in traces for number, part in enumerate(trace.parts)
    }
    try:
        network = cut_network(curves, scale.snap)
    except UnsettledError as error:
        where = ", ".join(dict.fromkeys(map(format_place, error.places[:5])))
        found = f"traces too near to each other for a snap distance of {scale.snap:.3g}, at {where}"
        raise fail(path, [Fault("the map", found, "a smaller distance: --snap")]) from None
    if not network.pieces:
        found = f"{len(traces)} traces, none longer than the snap distance of {scale.snap:.3g}"
        raise fail(path, [Fault("the map", found, "longer traces, or a smaller distance: --snap")])
    changes = [
        replace(each, trace=owners[each.trace], other=owners.get(each.other, each.other)) for each in network.changes
    ]
    return network, owners, changes


def _simplify_between(network: Network, owners: Mapping[str, str], distance: float) -> tuple[list[Trace], list[str]]:
    """Traces of pieces without the vertices that are no further than the distance from the lines that remain.

    What meets stays together: the ends of pieces are kept.
    """
    parts: dict[str, list[list[Leg]]] = {}
    before = after = 0
    last: tuple[str, complex] | None = None
    for piece, curve in network.pieces.items():
        legs = _simplify_legs(curve.legs, distance)
        before, after = before + len(curve.legs), after + len(legs)
        part, own = network.traces[piece], parts.setdefault(owners[network.traces[piece]], [])
        if last == (part, curve.start):
            own[-1] += legs
        else:
            own.append(list(legs))
        last = (part, curve.end)
    traces = [Trace(name, "", tuple(map(tuple, each))) for name, each in parts.items()]
    note = f"Simplified by {distance:g} between junctions: of {before} straight or circular parts {after} remain."
    return traces, [note]


def _simplify_singly(traces: Sequence[Trace], distance: float, scale: _Scale) -> tuple[list[Trace], list[str]]:
    """Traces without the vertices that are no further than the distance from the lines that remain."""
    simpler = []
    for trace in traces:
        simpler.append(replace(trace, parts=tuple(_simplify_legs(part, distance) for part in trace.parts)))
    before, after = (sum(len(part) for trace in each for part in trace.parts) for each in (traces, simpler))
    notes = [f"Simplified by {distance:g}: of {before} straight or circular parts {after} remain."]
    touching = _find_touching(traces, scale.snap) - _find_touching(simpler, max(scale.snap, scale.rounding))
    if touching:
        lay = "1 end that lay on another trace now misses it or pokes through it"
        if len(touching) > 1:
            lay = f"{len(touching)} ends that lay on another trace now miss it or poke through it"
        notes.append(
            f"{lay}, by up to {distance:g}, as that one was simplified: --keep-junctions keeps them there."
        )
    return simpler, notes


def _simplify_legs(legs: Sequence[Leg], distance: float) -> tuple[Leg, ...]:
    result: list[Leg] = []
    done = 0
    for each in outline(legs, 0.0):
        own = legs[done:done + each.legs]
        done += each.legs
        if each.straight:
            points = np.array(each.points)
            kept = points[choose_vertices(points, distance)].tolist()
            own = [Leg(a, b, 1) for a, b in itertools.pairwise(kept)]
        result += own
    return tuple(result)


def _find_touching(traces: Sequence[Trace], snap: float) -> set[tuple[str, int, bool]]:
    """The ends of parts that lie on a trace other than their own."""
    legs = [leg for trace in traces for part in trace.parts for leg in part]
    owner = np.repeat(np.arange(len(traces)), [sum(map(len, trace.parts)) for trace in traces])
    ends = [
        (number, trace.name, index, at_end, part[-1].end if at_end else part[0].start)
        for number, trace in enumerate(traces) for index, part in enumerate(trace.parts) for at_end in (False, True)
    ]
    shapes = Elements.collect(legs)
    low, high = shapes.bounds()
    points = np.array([end[-1] for end in ends])
    at, leg = Boxes(low - snap, high + snap).find_around(points)
    other = (np.array([end[0] for end in ends])[at] != owner[leg]) & (shapes.lengths[leg] > 0)
    at, leg = at[other], leg[other]
    near = shapes.select(leg).distances(points[at][:, None])[:, 0] <= snap if len(at) else np.zeros(0, dtype=bool)
    return {ends[number][1:4] for number in at[near].tolist()}


def _name_curves(network: Network, owners: Mapping[str, str], scale: _Scale) -> list[tuple[str, str, Outline]]:
    """Name, trace and shape of every curve of the case: pieces, in parts where they are both straight and circular."""
    shapes: dict[str, list[Outline]] = {}
    same = max(scale.rounding, SAME_POINT * scale.median)
    for piece, curve in network.pieces.items():
        shapes.setdefault(owners[network.traces[piece]], []).extend(outline(curve.legs, same))
    taken = set(shapes)
    named = []
    for trace, parts in shapes.items():
        number = 0
        for part in parts:
            name = trace
            while len(parts) > 1 and name in taken:
                number += 1
                name = f"{trace}.{number}"
            taken.add(name)
            named.append((name, trace, part))
    return named


def _make_tables(
    path: Path, network: Network, names: Sequence[tuple[str, str, Outline]], options: Options, scale: _Scale
) -> dict[str, Any]:
    reached: dict[complex, int] = {}
    for _, _, part in names:
        for end in (part.points[0], part.points[-1]):
            reached[end] = reached.get(end, 0) + 1
    inner = {point for _, _, part in names for point in part.points[1:-1]}
    curves = {}
    for name, _, part in names:
        tips = all(reached[end] == 1 and end not in inner for end in (part.points[0], part.points[-1]))
        length = sum(abs(b - a) for a, b in zip(part.points, part.points[1:], strict=False))
        # A crack with two tips needs an element for each of them.
        single = tips and len(part.points) == 2 and part.straight and length <= scale.size
        # Elements of an arc, refined towards its ends, must not turn too far.
        size = scale.size if part.straight else min(scale.size, WIDEST * part.radius)
        division = {"elements": 2} if single else {"size": size}
        curves[name] = {**write_shape(part), **division}
    friction = FRICTION if options.friction is None else options.friction
    stress = {"sxx": options.sxx, "syy": options.syy, "sxy": options.sxy}
    if all(value is None for value in stress.values()):
        stress["syy"] = -1.0
    return {
        "title": f"Traces of {path.name}",
        "materials": {"rock": {
            "young": YOUNG if options.young is None else options.young,
            "poisson": POISSON if options.poisson is None else options.poisson,
        }},
        "curves": curves,
        "regions": {"plane": {"material": "rock", "infinite": True, "cracks": [name for name, _, _ in names]}},
        "interfaces": {trace: {"friction": friction} for trace in dict.fromkeys(trace for _, trace, _ in names)},
        "remote": {key: 0.0 if value is None else value for key, value in stress.items()},
        "analysis": {"steps": 1},
    }


def write_shape(part: Outline) -> dict[str, Any]:
    """The keys of a curve that say its shape."""
    if part.straight:
        return {"points": [[point.real, point.imag] for point in part.points]}
    circle: dict[str, Any] = {"center": [part.center.real, part.center.imag], "radius": part.radius}
    return circle if part.angles is None else {**circle, "angles": list(part.angles)}


def _summarise(
    reading: Reading, network: Network, owners: Mapping[str, str], names: Sequence[tuple[str, str, Outline]]
) -> list[str]:
    kinds: dict[str, int] = {}
    for junction in network.junctions:
        kinds[junction.kind] = kinds.get(junction.kind, 0) + 1
    listed = ", ".join(f"{kinds[kind]} {kind}" for kind in ("X", "T", "Y", "star", "end to end") if kind in kinds)
    length = sum(curve.length for curve in network.pieces.values())
    lines = [
        f"traces: {len(reading.traces)}, in all {length:.6g} long",
        f"pieces: {len(network.pieces)}",
        f"crossings: {network.crossings}",
        f"junctions: {len(network.junctions)}" + (f" ({listed})" if listed else ""),
        f"blocks: {len(network.blocks)}",
    ]
    if len(names) != len(network.pieces):
        lines[1] += f", as {len(names)} curves, each straight or circular"
    lost = len({trace.name for trace in reading.traces} - {owners[trace] for trace in network.traces.values()})
    if lost:
        lines[0] += f"; of {lost} nothing is left"
    return lines


def _tell_defaults(options: Options, scale: _Scale) -> list[str]:
    told = []
    if options.size is None:
        told.append(f"--size {scale.size:.4g} (a sixth of the traces' median length, {scale.median:.4g})")
    if options.snap is None and scale.snap <= SNAP * scale.median:
        told.append(f"--snap {scale.snap:.4g} (a thousandth of it)")
    told += [
        f"--{key} {value:g}" for key, value in (("friction", FRICTION), ("young", YOUNG), ("poisson", POISSON))
        if getattr(options, key) is None
    ]
    if options.sxx is options.syy is options.sxy is None:
        told.append("--syy -1")
    notes = ["Default values used: " + ", ".join(told) + "."] if told else []
    if scale.snap > (SNAP * scale.median if options.snap is None else options.snap):
        notes.append(f"--snap {scale.snap:.4g} is the least for these lengths and coordinates.")
    return notes


def _list_left_out(reading: Reading) -> list[tuple[str, tuple[str, ...]]]:
    if not reading.left_out:
        return []
    return [(f"{len(reading.left_out)} of the file's entries left out", tuple(reading.left_out))]


def _list_renamed(renamed: Mapping[str, str]) -> list[tuple[str, tuple[str, ...]]]:
    if not renamed:
        return []
    lines = tuple(f"{name}: {new}" for name, new in renamed.items())
    return [(f"{len(renamed)} of the traces called otherwise, whose names would be those of pieces of others", lines)]
