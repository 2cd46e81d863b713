"""Faults of the laws of interfaces and cracks, those of pieces of a trace at their own keys where these cause them."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Literal

from pydantic import ValidationError

from pbem.description.case import Case
from pbem.description.schema import LawTable
from pbem.errors import Fault
from pbem.geometry.curve import Curve
from pbem.model.law import check_along, read_law
from pbem.model.model import Interface, Law


def read_interface_law(
    case: Case, name: str, table: LawTable, default: Literal["bonded", "coulomb"]
) -> tuple[Law, list[Fault]]:
    """As `read_law`, of an interface or crack."""
    loc = ("interfaces", name)
    law, faults = read_law(case, loc, table, default)
    return law, _blame_own_keys(case, name, faults, lambda other: read_law(case, loc, other, default)[1])


def check_interface_along(case: Case, name: str, interface: Interface, curve: Curve) -> list[Fault]:
    """As `check_along`, of an interface or crack."""
    loc, default = ("interfaces", name), "coulomb" if interface.second is None else "bonded"

    def judge(other: LawTable) -> list[Fault]:
        return check_along(loc, read_law(case, loc, other, default)[0], curve)  # type: ignore[arg-type]

    return _blame_own_keys(case, name, check_along(loc, interface.law, curve), judge)


def _blame_own_keys(
    case: Case, name: str, faults: list[Fault], judge: Callable[[LawTable], Iterable[Fault]]
) -> list[Fault]:
    """The faults of a law; of a piece those that the law of its trace alone would not have at its own keys, which cause
    them. judge: the faults of the table of the trace in its place."""
    if not faults:
        return faults
    given = case.given.get("interfaces", {})
    family = next((each for each, members in case.families.items() if name in members and each in given), None)
    if family is None or name not in given:
        return faults
    try:
        alone = set(judge(LawTable.model_validate(given[family])))
    except ValidationError:  # is told by itself
        return faults
    own = tuple(given[name])
    place = ("interfaces", name, *(own if len(own) == 1 else ()))

    def is_told_right(fault: Fault) -> bool:
        return fault in alone or fault.path[:2] != place[:2] or len(fault.path) < 3 or fault.path[2] in own

    return [fault if is_told_right(fault) else
            Fault.at(place, f"{fault.found}, with what is said of '{family}'", fault.expected) for fault in faults]
