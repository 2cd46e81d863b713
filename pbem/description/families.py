"""Pieces of one trace, t12.1, t12.2, ..., or of one line of a mesh, and what is said of them all by its name."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TypeVar

from pbem.description.effects import combine_laws
from pbem.description.schema import LawTable, StageTable

Condition = TypeVar("Condition")


def find_families(names: Iterable[str], curves: Iterable[str]) -> dict[str, tuple[str, ...]]:
    """Of the names that are no curves, those that have pieces among the curves, with these in their order."""
    known = dict.fromkeys(curves)
    wanted = {name for name in names if name not in known}
    members: dict[str, list[tuple[int, str]]] = {}
    for curve in known if wanted else ():
        stem, _, number = curve.rpartition(".")
        if stem in wanted and number.isascii() and number.isdecimal() and str(int(number)) == number:
            members.setdefault(stem, []).append((int(number), curve))
    return {name: tuple(curve for _, curve in sorted(pieces)) for name, pieces in members.items()}


def spread_laws(laws: Mapping[str, LawTable], families: Mapping[str, Sequence[str]]) -> dict[str, LawTable]:
    """The laws of single curves: what is said of a family holds for its members, but for the keys that they name."""
    spread = {member: laws[name] for name, members in families.items() if name in laws for member in members}
    for name, own in laws.items():
        if name not in families or name in families[name]:
            spread[name] = combine_laws(spread[name], own) if name in spread else own
    return spread


def spread_conditions(
    conditions: Mapping[str, Condition], families: Mapping[str, Sequence[str]]
) -> dict[str, Condition]:
    """The conditions, or changes, of single curves: what is said of a single one holds instead."""
    spread = {member: conditions[name] for name in conditions if name in families for member in families[name]}
    return {**spread, **{name: table for name, table in conditions.items() if name not in families}}


def spread_stage(stage: StageTable, families: Mapping[str, Sequence[str]]) -> StageTable:
    """The stage with what it says of families said of their members, and what it says of a single one instead."""
    if not families.keys() & {*stage.interfaces, *stage.boundary}:
        return stage
    return stage.model_copy(update={
        "interfaces": spread_conditions(stage.interfaces, families),
        "boundary": spread_conditions(stage.boundary, families),
    })
