"""Pieces of one trace, t12.1, t12.2, ..., and what is said of them all by its name."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from pbem.description.effects import combine_laws
from pbem.description.schema import LawTable, StageTable


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


def spread_stage(stage: StageTable, families: Mapping[str, Sequence[str]]) -> StageTable:
    """The stage with what it says of families said of their members, and what it says of a single one instead."""
    told = [name for name in stage.interfaces if name in families]
    if not told:
        return stage
    spread = {member: stage.interfaces[name] for name in told for member in families[name]}
    spread |= {name: table for name, table in stage.interfaces.items() if name not in told}
    return stage.model_copy(update={"interfaces": spread})
