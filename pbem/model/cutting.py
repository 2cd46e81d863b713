"""Cracks that cross: cut into pieces that meet with their ends, and have the name, law and elements of their crack."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

from pbem.description.case import Case
from pbem.description.schema import CurveTable, LawTable, StageInterfaceTable
from pbem.description.varying import VaryingTable
from pbem.errors import Fault, KeyPath
from pbem.geometry.curve import Curve
from pbem.geometry.cusp import EXPECTED, touch_only
from pbem.geometry.expression import list_names
from pbem.geometry.junction import find_crossing_cracks, format_point
from pbem.geometry.network import Change, Network, cut_network
from pbem.geometry.network.noding import UnsettledError
from pbem.model.roles import Roles
from pbem.model.shaping import Shapes

T = TypeVar("T")

# Cracks that are cut, and are listed one by one.
MOST_NOTES = 6
# Degrees that the elements of an arc turn by on average, so that none turns too far when they are refined at both ends.
WIDEST = 15.0
# Numbers of elements are known to this.
ROUNDING = 1e-9


@dataclass(frozen=True)
class Cut:
    """The case, its roles and its curves with the pieces of every crack that was cut in place of it."""

    case: Case
    roles: Roles
    shapes: Shapes
    notes: tuple[str, ...] = ()
    faults: tuple[Fault, ...] = ()


def cut_cracks(case: Case, roles: Roles, shapes: Shapes) -> Cut:
    """Cut the cracks that cross others, or themselves, wherever they meet each other.

    An end on another crack needs no cut: that has a junction there. What [[generate]] made is not cut.
    """
    own = {
        name: curve for name, curve in shapes.curves.items() if name in roles.cracks and name not in case.origin
    }
    crossing = find_crossing_cracks(own, shapes.tolerance)
    crossed = [{name: own[name] for name in own if name in crossing and roles.cracks[name] == region}
               for region in dict.fromkeys(roles.cracks[name] for name in crossing)]  # fmt: skip
    try:
        networks = [cut_network(cracks, shapes.tolerance.largest) for cracks in crossed]
    except UnsettledError as error:
        return Cut(case, roles, shapes, faults=_refuse_unsettled(error, shapes.tolerance.largest))
    if not networks:
        return Cut(case, roles, shapes)
    members = {trace: pieces for net in networks for trace, pieces in net.members.items()}
    faults = tuple(fault for net in networks for fault in _find_overlaps(net, own))
    taken = {piece for pieces in members.values() for piece in pieces if piece in case.curves and piece not in members}
    faults += tuple(
        Fault.at(("curves", name), f"curve '{name}', the name of a piece of a crack that is cut", "another name")
        for name in sorted(taken)
    )
    faults += tuple(_find_lengths(case, [trace for trace, names in members.items() if len(names) > 1]))
    if faults or any(trace not in members for trace in crossing):
        return Cut(case, roles, shapes, faults=faults)
    pieces = {name: _count_elements(case.curves[net.traces[name]], curve)
              for net in networks for name, curve in net.pieces.items()}  # fmt: skip
    own_of = {name: trace for trace, names in members.items() for name in names}
    tables = {name: _write_table(case.curves[trace], pieces[name]) for name, trace in own_of.items()}
    curves = _put_in_place(shapes.curves, members, pieces)
    cracks = _put_in_place(roles.cracks, members, {name: roles.cracks[trace] for name, trace in own_of.items()})
    tolerance = shapes.tolerance
    tolerance = replace(
        tolerance, lengths={**tolerance.lengths, **{name: tolerance.lengths[own_of[name]] for name in own_of}},
        regions={**tolerance.regions, **{name: tolerance.regions[own_of[name]] for name in own_of}},
    )
    notes = tuple(_describe([change for net in networks for change in net.changes], members))
    return Cut(
        case.put_pieces(members, tables), replace(roles, cracks=cracks),
        replace(shapes, curves=curves, tolerance=tolerance), notes,
    )


def _refuse_unsettled(error: UnsettledError, tolerance: float) -> tuple[Fault, ...]:
    places = dict.fromkeys(map(format_point, error.places[:MOST_NOTES]))
    found = f"cracks too near to each other to be cut within a tolerance of {tolerance:.3g}, at {', '.join(places)}"
    return (Fault.at(("curves",), found, "crossings and ends that are further from each other, or in one point"),)


def _find_overlaps(network: Network, cracks: Mapping[str, Curve]) -> list[Fault]:
    faults = []
    for change in network.changes:
        if change.kind != "merged":
            continue
        where, what = format_point(change.place), f"curve '{change.trace}'"
        if touch_only(cracks[change.trace].legs, cracks[change.other].legs, change.place):
            found = f"{what} touching curve '{change.other}' near {where} without an angle between them"
            faults.append(Fault.at(("curves", change.trace), found, EXPECTED))
        else:
            found = f"{what} running over curve '{change.other}' from {where} on"
            faults.append(Fault.at(("curves", change.trace), found, "each piece once"))
    return faults


def _find_lengths(case: Case, cut: Sequence[str]) -> Iterator[Fault]:
    """Values over the length s along cracks that are cut, of whose pieces each has an s of its own."""
    for name in cut:
        tables: list[tuple[KeyPath, LawTable | StageInterfaceTable | None]] = [
            (("interfaces", name), case.interfaces.get(name)),
            *((("stages", number, "interfaces", name), stage.interfaces.get(name))
              for number, stage in enumerate(case.stages)),
        ]
        for loc, table in tables:
            for key in table.model_fields_set if table is not None else ():
                given = getattr(table, key)
                if isinstance(given, VaryingTable) and (given.table or "s" in list_names(given.expression or "")):
                    found = f"a value over the length s of crack '{name}', which others cut into pieces"
                    yield Fault.at((*loc, key), found, "an expression of x and y, which the pieces have in common")


def _count_elements(table: CurveTable, curve: Curve) -> Curve:
    """The piece, with the elements that a size asks for on each leg; a number is divided where the crack is cut.

    Arcs have as many as they need when they are refined towards the cuts.
    """
    legs = []
    for leg in curve.legs:
        count = leg.elements if table.size is None else math.ceil(leg.length / table.size - ROUNDING)
        least = math.ceil(math.degrees(abs(leg.turn)) / WIDEST - ROUNDING)
        legs.append(replace(leg, elements=max(1, count, least)))
    return replace(curve, legs=tuple(legs))


def _write_table(table: CurveTable, piece: Curve) -> CurveTable:
    """What the case says of the piece; its shape is that of the whole crack."""
    if table.elements is None:
        return table
    return table.model_copy(update={"elements": sum(leg.elements for leg in piece.legs)})


def _put_in_place(
    values: Mapping[str, T], members: Mapping[str, tuple[str, ...]], pieces: Mapping[str, T]
) -> dict[str, T]:
    result: dict[str, T] = {}
    for name, value in values.items():
        result |= {piece: pieces[piece] for piece in members[name]} if name in members else {name: value}
    return result


def _describe(changes: list[Change], members: Mapping[str, tuple[str, ...]]) -> list[str]:
    places: dict[str, list[str]] = {}
    for change in changes:
        if change.kind == "cut":
            places.setdefault(change.trace, []).append(f"{format_point(change.place)} by '{change.other}'")
    cut = {trace: names for trace, names in members.items() if len(names) > 1}
    if len(cut) > MOST_NOTES:
        count = sum(len(names) for names in cut.values())
        return [f"{len(cut)} cracks are cut into {count} pieces where they meet each other: '{next(iter(cut))}' into "
                f"'{cut[next(iter(cut))][0]}' to '{cut[next(iter(cut))][-1]}', and so on."]  # fmt: skip
    return [
        f"Crack '{trace}' is cut into '{names[0]}' to '{names[-1]}': at {', '.join(places.get(trace, []))}."
        for trace, names in cut.items()
    ]
